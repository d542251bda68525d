"""Every hard case by the bootstrap, which takes the scatter from the data and not from sigma.

So its answers are those of the other methods where there is scatter. Without any its intervals have no width,
and with a handful of rows its replicates are too few different ones: there the optimum is still the certified
one, refusals are the same, and numbers make sense together.
"""

from __future__ import annotations

import math
import warnings
from pathlib import Path

import numpy as np
import pytest
from hard_cases import identifiable, numerics
from hard_cases.case import HardCase, Told, fits
from hard_cases.numerics import Judged

from ifrfit.inference import FitResult

CASES = (*identifiable.CASES, *numerics.CASES)
# all rows agree, or are too few to be drawn anew in different ways
WITHOUT_SCATTER = {
    "no noise at all",
    "no noise, a point on the kink",
    "one sliding point",
    "as many points as constants",
    "fewer points than constants",
    "rows that say nothing",
    "one point in its own series",
    "truth on a bound: e_t = -1, without noise",
    "truth on a bound: mu = 0, without noise",
    "truth on a bound: e_n = 1, without noise",
    "truth on a bound: e_n = 1, with noise",  # that of beta; its drop tests agree
    "truth on a bound: e_n = 1, with other noise",
    "duplicated rows",
}
# replicates of one or two rows are all flat in some direction: none of them is solved with the others
LONG = {
    "all points at one angle",
    "as many points as constants",
    "fewer points than constants",
    "one row, one angle",
    "random small problems",
    "further random small problems",
    "weights over 1e12",
    "weights over 1e12, closure FR",
    "weights over 1e16",
}


def sound(result: FitResult) -> None:
    """Intervals are ordered and inside the domain; nothing open has a value; counts add up."""
    figures = result.facts["converged"].figures
    assert figures["failed"] == sum(figures["reasons"].values()) <= figures["replicates"] == 1000
    for name, found in result.flat_constants().items():
        (low68, high68), (low95, high95) = found.interval68, found.interval95
        assert low95 <= low68 <= high68 <= high95, (name, found)
        assert (found.value is None) == (found.stderr is None) or found.status == "fixed"
        if found.value is not None:
            assert low95 - 1e-12 <= found.value <= high95 + 1e-12, (name, found)
            assert math.isfinite(found.value)
    assert result.summary()
    assert result.to_dict()


@pytest.mark.parametrize(
    "case",
    [pytest.param(c, marks=pytest.mark.long if c.name in LONG else ()) for c in CASES],
    ids=[c.name for c in CASES],
)
def test_hard_case(case: HardCase, tmp_path: Path) -> None:
    with warnings.catch_warnings(), np.errstate(all="warn", under="ignore"):
        warnings.simplefilter("error")
        outcome = case.run(tmp_path, "bootstrap")
        if isinstance(outcome, Told) or case.name not in WITHOUT_SCATTER:
            case.check(outcome)
        for found in fits(outcome):
            if isinstance(found, Judged):
                assert found.result.fit.chi2 == pytest.approx(found.chi2, rel=1e-9, abs=1e-12)
                found = found.result
            sound(found)


def test_every_case_set_apart_is_one() -> None:
    assert {case.name for case in CASES} >= WITHOUT_SCATTER | LONG
