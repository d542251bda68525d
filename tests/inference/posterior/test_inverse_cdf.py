"""Tables invert distribution functions as a search in them would."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import stats

from ifrfit.inference.distributions.protocol import LEVELS
from ifrfit.inference.posterior.marginals import Marginal
from ifrfit.inference.posterior.quadrature_axis import PanelCdf, QuadratureAxis
from ifrfit.inference.posterior.sampling import InverseCdfTable, table_points


def made(rows: int, order: int = 12) -> tuple[QuadratureAxis, PanelCdf, np.ndarray]:
    """Densities with tails, gaps and a second hump, and the points of their tables."""
    axis = QuadratureAxis.of(np.array([-40.0, -8.0, -4.0, -1.0, 0.0, 0.5, 2.0, 6.0, 30.0]), order)
    x = axis.nodes()
    width = np.linspace(0.4, 2.0, rows)[:, None]
    density = np.exp(-0.5 * (x / width) ** 2) + 0.1 * np.exp(-0.5 * ((x - 4.0) / 0.5) ** 2)
    panels = PanelCdf.of(axis, density.reshape(rows, *axis.shape))
    return axis, panels, (axis.low[:, None] + axis.width[:, None] * table_points(order)).reshape(1, -1)


@pytest.mark.parametrize("rows", [1, 7])
def test_values_are_those_of_a_search(rows: int) -> None:
    axis, panels, places = made(rows)
    rng = np.random.default_rng(rows)
    row, p = rng.integers(0, rows, 5000), rng.random(5000)
    p[:4] = 0.0, 1.0, 1e-12, 1.0 - 1e-12
    table = InverseCdfTable.of(panels)
    value, before = table.inverse(row, p, places)
    for number in range(rows):
        own = row == number
        below = table.below[number]
        right = np.clip(np.searchsorted(below, p[own]), 1, below.size - 1)
        rise = below[right] - below[right - 1]
        share = np.where(rise > 0.0, (p[own] - below[right - 1]) / np.where(rise > 0.0, rise, 1.0), 0.5)
        expected = places[0][right - 1] + share * (places[0][right] - places[0][right - 1])
        np.testing.assert_allclose(value[own], expected, rtol=0.0, atol=1e-9)
    nodes = axis.nodes()
    assert (nodes[before] <= value + 1e-9).all()
    assert (value <= nodes[before + 1] + 1e-9).all()


def test_values_have_the_share_below_that_was_asked_for() -> None:
    _, panels, places = made(3)
    row, p = np.repeat(np.arange(3), 99), np.tile(np.linspace(0.01, 0.99, 99), 3)
    value, _ = InverseCdfTable.of(panels).inverse(row, p, places)
    below = panels.below(value[:, None])[np.arange(row.size), row] / panels.total[row]
    np.testing.assert_allclose(below, p, atol=2e-3)


def test_places_may_differ_by_row() -> None:
    _, panels, places = made(2)
    table = InverseCdfTable.of(panels)
    row, p = np.array([0, 1, 1]), np.array([0.3, 0.3, 0.8])
    both = np.concatenate((places, places + 100.0))
    found, _ = table.inverse(row, p, both)
    np.testing.assert_allclose(found, table.inverse(row, p, places)[0] + 100.0 * row)


def test_an_empty_row_gives_its_end() -> None:
    axis, _, places = made(1)
    nothing = PanelCdf.of(axis, np.zeros((1, *axis.shape)))
    value, _ = InverseCdfTable.of(nothing).inverse(np.zeros(3, dtype=int), np.array([0.1, 0.5, 1.0]), places)
    assert np.isfinite(value).all()


def test_a_distribution_stays_when_its_axis_is_refined():
    axis, panels, _ = made(2)
    at = np.linspace(axis.low[0], axis.low[-1] + axis.width[-1], 41)
    before = panels.below_in_all(at, 2)
    axis.split(axis.low + 0.3 * axis.width)
    assert panels.below_in_all(at, 2) == pytest.approx(before, abs=0.0)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, 1e-6])
@pytest.mark.parametrize(
    "law", [stats.norm(2.0, 0.3), stats.gamma(4.0), stats.gamma(40.0), stats.beta(3.0, 5.0), stats.t(5.0)]
)
@pytest.mark.parametrize("p", [LEVELS, (1e-5, 0.5), (0.3, 1.0 - 1e-4)])
def test_quantiles_are_within_the_tolerance(law: Any, tolerance: float, p: tuple[float, ...]) -> None:
    mean, sd = law.mean(), law.std()
    own = Marginal(
        "x", *law.support(), lambda level: (mean, sd), lambda t, levels: np.tile(law.cdf(t), (levels, 1))
    )
    found = own.quantiles(np.array(p), tolerance)
    np.testing.assert_allclose(found, law.ppf(p), rtol=0.0, atol=tolerance * sd)


def test_few_values_of_a_nearly_normal_law_are_enough() -> None:
    """With the miss of a value the error of the next one is known: 7 places, and 5 levels twice at most."""
    law, asked = stats.gamma(40.0), []

    def cdf(t: np.ndarray, levels: int) -> np.ndarray:
        asked.append(t.size)
        return np.tile(law.cdf(t), (levels, 1))

    own = Marginal("x", 0.0, np.inf, lambda level: (law.mean(), law.std()), cdf)
    own.at_levels(1e-3)
    assert sum(asked) <= 7 + 2 * len(LEVELS)
