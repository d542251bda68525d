"""How often percentile intervals hold the truth, on both regimes, noise unknown; a control that must fail."""

from __future__ import annotations

import math

import numpy as np
import pytest
from bootstrap_scenes import TRUTH, fitted, scene

from ifrfit.inference.bootstrap import bootstrap
from ifrfit.inference.bootstrap.schemes import SCHEMES, Cases

LEVELS = {0.68: (0.16, 0.84), 0.95: (0.025, 0.975)}


def held(
    n: int, experiments: int, scheme: str, *, copies: int = 1, apart: bool = False
) -> dict[float, np.ndarray]:
    """Share of experiments whose interval holds the truth: level to (e_n, e_t, mu)."""
    hits = {level: np.zeros(3) for level in LEVELS}
    for seed in range(experiments):
        problem, found = fitted(scene(n, seed=1000 + seed, noise="unknown", copies=copies))
        rows = Cases.of(problem, np.arange(problem.rows.value.size)) if apart else scheme
        draws = bootstrap(problem, found, scheme=rows, replicates=300, seed=seed).draws
        for level, tails in LEVELS.items():
            for i, (name, truth) in enumerate(TRUTH.items()):
                low, high = np.quantile(draws[name], tails)
                hits[level][i] += low <= truth <= high
    return {level: count / experiments for level, count in hits.items()}


def expected(n: int, level: float) -> tuple[float, float]:
    """Coverage of the normal law's interval with the scatter's own sd, and that level itself.

    The sd of draws of n values is that of the values over their number, not over the number less one, and it
    is estimated: a percentile interval is that much shorter than Student's.
    """
    from scipy import stats

    reach = stats.norm.ppf(0.5 + 0.5 * level) * math.sqrt((n - 2) / n)
    return float(2.0 * stats.t.cdf(reach, n - 2) - 1.0), level


def test_percentile_intervals_hold_the_truth_nearly_as_often_as_they_say() -> None:
    n, experiments = 40, 24
    for level, share in held(n, experiments, "cases").items():
        low, high = expected(n, level)
        # three constants, hardly correlated
        error = 4.0 * math.sqrt(low * (1.0 - low) / (3.0 * experiments))
        assert low - error < share.mean() < high + error


@pytest.mark.long
@pytest.mark.parametrize("n", [20, 40])
@pytest.mark.parametrize("scheme", SCHEMES)
def test_each_constant_is_held_as_often(scheme, n) -> None:
    experiments = 600
    for level, share in held(n, experiments, scheme).items():
        low, high = expected(n, level)
        error = 4.0 * math.sqrt(low * (1.0 - low) / experiments)
        assert (share > low - error).all()
        assert (share < high + error).all()


def test_rows_in_the_place_of_impacts_hold_it_far_too_seldom() -> None:
    """The control that must fail: each row four times, with one error; drawn apart they look like four."""
    share = held(20, 20, "cases", copies=4, apart=True)
    assert share[0.95].mean() < 0.82
    assert share[0.68].mean() < 0.55
