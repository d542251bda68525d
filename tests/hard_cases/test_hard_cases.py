from __future__ import annotations

import math
import warnings
from pathlib import Path

import numpy as np
import pytest
from hard_cases.case import GROUPS, METHODS, HardCase, fits
from hard_cases.cases import CASES
from write_hard_cases import page

from ifrfit.inference import FitResult

ROOT = Path(__file__).parents[2]


RUNS = [
    pytest.param(
        case,
        method,
        marks=[pytest.mark.long] if method in case.slow else [],
        id=f"{case.name}{f' by {method}' if method else ''}",
    )
    for case in CASES
    for method in case.methods or ("",)
]


@pytest.mark.parametrize(("case", "method"), RUNS)
def test_hard_case(case: HardCase, method: str, tmp_path: Path) -> None:
    with warnings.catch_warnings(), np.errstate(all="warn", under="ignore"):
        warnings.simplefilter("error")
        outcome = case.run(tmp_path, method) if method else case.run(tmp_path)
        case.check(outcome)
        if method == "exact":
            for found in fits(outcome):
                is_a_law(getattr(found, "result", found))


def is_a_law(result: FitResult) -> None:
    """The posterior is finite, in order and inside its domain, its draws too."""
    problem, post = result.problem, result.distribution
    assert math.isfinite(result.fit.log_evidence)
    # FR's transition has no end: a few of its smallest problems stop short of 1e-4, and say so
    converged = result.facts["converged"].ok
    assert converged or result.closure == "fr", result.facts["converged"].says
    bounds = dict(zip(problem.parameters.names, zip(*problem.parameters.bounds(), strict=True), strict=True))
    drawn = post.draws(50, np.random.default_rng(1))
    for name in post.names:
        low, high = bounds.get(name, (0.0, math.inf))
        mean, levels = (
            post.mean(name),
            post.quantile(name, np.array([0.0, 1e-3, 0.025, 0.5, 0.975, 0.999, 1.0])),
        )
        assert math.isfinite(mean)
        assert post.sd(name) > 0.0, name
        assert (np.diff(levels) >= 0.0).all(), (name, levels)
        assert low - 1e-12 <= levels[0]
        assert levels[-1] <= high + 1e-12
        # FR's tail can carry the mean beyond the quantiles; then the quadrature has not converged
        assert levels[1] <= mean <= levels[-2] or not converged, (name, levels, mean)
        assert np.isfinite(levels).all()
        assert np.isfinite(drawn[name]).all()


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
            assert "|" not in sentence.replace("|U_t|", "").replace("|beta|", "")
            assert "\n" not in sentence


def test_the_page_of_hard_cases_is_up_to_date() -> None:
    assert (ROOT / "docs" / "hard-cases.md").read_text(encoding="utf-8") == page()
