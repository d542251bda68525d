from __future__ import annotations

import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
from hard_cases.case import GROUPS, METHODS, SLOW, HardCase
from hard_cases.cases import CASES

ROOT = Path(__file__).parents[2]


RUNS = [
    pytest.param(
        case,
        method,
        # one worker, so that what all methods are compared with is computed once
        marks=[
            pytest.mark.xdist_group(f"hard case {case.name}"),
            *([pytest.mark.long] if method in SLOW else []),
        ],
        id=f"{case.name}{f' by {method}' if method else ''}",
    )
    for case in CASES
    for method in case.methods or ("",)
]


@pytest.mark.parametrize(("case", "method"), RUNS)
def test_hard_case(case: HardCase, method: str, tmp_path: Path) -> None:
    with warnings.catch_warnings(), np.errstate(all="warn", under="ignore"):
        warnings.simplefilter("error")
        case.check(case.run(tmp_path, method) if method else case.run(tmp_path))


def test_whatever_is_fitted_is_fitted_by_every_method() -> None:
    fitted = [case for case in CASES if case.group in ("identifiability", "numerics")]
    assert len(fitted) > 30
    assert all(case.methods == METHODS for case in fitted)


def test_every_case_is_told_in_a_sentence() -> None:
    assert len({case.name for case in CASES}) == len(CASES)
    for case in CASES:
        assert case.group in GROUPS
        for sentence in (case.what, case.answer):
            assert sentence.endswith(".")
            assert "|" not in sentence.replace("|U_t|", "")
            assert "\n" not in sentence


def test_the_page_of_hard_cases_is_up_to_date() -> None:
    script = ROOT / "scripts" / "write_hard_cases.py"
    done = subprocess.run([sys.executable, script, "--check"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
