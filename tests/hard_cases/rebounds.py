"""Hard cases of the rebound itself: rows of tests/reference/impacts.csv, by what they are for."""

from __future__ import annotations

from hard_cases.case import HardCase
from reference_impacts import Columns, misses, tagged


def _as_reference(rows: Columns) -> None:
    assert rows["tag"].size
    assert misses(rows) == []


def _case(name: str, tag: str, what: str, answer: str) -> HardCase:
    return HardCase(name, "rebound", what, answer, lambda folder: tagged(tag), _as_reference)


CASES = (
    _case(
        "gamma 0 and 90",
        "edge_gamma",
        "Rebound at exactly 0 and 90 degrees, with and without spin.",
        "The 50-digit reference; nan only for beta_cm at 0 degrees, mu_app and tan(delta) at 90, "
        "beta without slip, lambda at rest.",
    ),
    _case(
        "no slip",
        "Ut_zero",
        "Rebound with U_t = 0: normal incidence, pure rolling, rolling at grazing incidence.",
        "The impulse along the wall is 0, beta is nan, everything else is the reference.",
    ),
    _case(
        "e_n 0 and 1, mu 0 and 1e6",
        "extreme_en_mu",
        "Rebound with e_n of 0 and 1 and mu of 0 and a million, from 0 to 90 degrees, with spin.",
        "The 50-digit reference; at 90 degrees friction does nothing, however large mu.",
    ),
    _case(
        "mu beyond reason",
        "extreme_mu",
        "Rebound with mu of 1e12 and 1e300.",
        "Plain sticking: the 50-digit reference, and no overflow.",
    ),
    _case(
        "spins of 1e15",
        "huge_spin",
        "Rebound with R omega/u of 1e15 in either direction and both.",
        "The 50-digit reference, to 1e-13 of the spin.",
    ),
)
