"""Smoothed importance weights against ArviZ's."""

from __future__ import annotations

import numpy as np
import pytest

from ifrfit.inference.comparison.pareto_smoothing import smoothed


@pytest.mark.parametrize("m", [1000, 4000])
def test_it_is_what_arviz_computes(m: int) -> None:
    from arviz_stats.base.array import array_stats

    rng = np.random.default_rng(2)
    sizes = np.geomspace(1e-6, 30.0, 80)  # weights from all alike to one that has everything
    each = -0.5 * (rng.standard_normal((m, 1)) + rng.standard_normal(80)) ** 2 * sizes
    each[:, -1] = np.repeat(each[: m // 4, -1], 4)  # ties
    elpd, k = smoothed(each)
    with np.errstate(all="ignore"):
        found = [array_stats.loo(column, chain_axis=None, draw_axis=-1) for column in each.T]
    assert k == pytest.approx(np.array([float(shape) for _, shape, _ in found]), rel=1e-9, nan_ok=True)
    assert elpd == pytest.approx(np.array([float(own) for own, _, _ in found]), rel=1e-9, nan_ok=True)


def test_a_tail_of_few_values_is_not_smoothed() -> None:
    each = np.zeros((1000, 1))
    each[:970] = -np.linspace(1.0, 2.0, 970)[:, None]
    each[500:900] = -1.9
    elpd, k = smoothed(each)
    assert np.isnan(elpd).all() or np.isnan(k).all()
