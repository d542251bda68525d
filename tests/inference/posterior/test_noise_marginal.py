"""The table of a noise's law holds all of it, wherever bounds cut it off."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mpmath import mp
from scipy import special

from ifrfit.inference.posterior.discrete_law import DiscreteLaw
from ifrfit.inference.posterior.marginals import _ORDER, _compressed, _edges
from ifrfit.inference.posterior.noise_scale import NoiseScale, _log_gamma_share
from ifrfit.inference.posterior.quadrature_axis import QuadratureAxis


def table(own: NoiseScale, least: float, most: float) -> QuadratureAxis:
    return QuadratureAxis.of(_edges(own, least, most), _ORDER)


@settings(deadline=None, max_examples=150)
@given(
    st.sampled_from([1, 2, 3, 8, 40, 1000, 30_000]),
    st.floats(-8.0, 8.0),  # logarithm of the root mean square, in units of the geometric mean of the bounds
    st.floats(0.01, 7.0),  # half the logarithm of the ratio of the bounds
)
def test_density_integrates_to_one(n: int, log_rms: float, half_span: float) -> None:
    own = NoiseScale(n, math.exp(-half_span), math.exp(half_span))
    square = n * math.exp(2.0 * log_rms)
    if own.log_likelihood(np.array([square]))[0] < -1e5:
        return  # no posterior goes there
    axis = table(own, square, square)
    total = axis.weights()[0] @ own.density(axis.nodes(), np.array(square))
    assert abs(total - 1.0) < 1e-8


@pytest.mark.parametrize(
    ("a", "low", "high"),
    [
        (0.5, 1490.0, 8e4),
        (4.0, 900.0, 901.0),
        (20.0, 1e-16, 2e-16),
        (500.0, 60.0, 90.0),
        (500.0, 2600.0, 2601.0),
        (15_000.0, 9_000.0, 9_100.0),
        (15_000.0, 22_000.0, 30_000.0),
    ],
)
def test_shares_below_all_numbers_keep_their_digits(a: float, low: float, high: float) -> None:
    with mp.workdps(40):
        expected = mp.log(mp.gammainc(a, low, high, regularized=True))
    found = float(_log_gamma_share(a, np.array([low]), np.array([high]))[0])
    assert found == pytest.approx(float(expected), rel=1e-12, abs=1e-9)


@pytest.mark.parametrize("n", [2, 5, 40, 500])
def test_distribution_is_the_inverse_gamma_law(n: int) -> None:
    own, square = NoiseScale(n, 1e-6, 1e4), 0.05**2 * n
    axis = table(own, square, square)
    share = axis.weights()[0] * own.density(axis.nodes(), np.array(square))
    ends = axis.panels[:, 1]
    below = np.cumsum(share.reshape(axis.shape).sum(axis=1))
    # sigma lies below an end where square/(2 sigma^2) lies above its own
    expected = special.gammaincc(0.5 * n, 0.5 * square * np.exp(-2.0 * ends))
    np.testing.assert_allclose(below, expected, atol=1e-10)


@pytest.mark.parametrize("rms", [1e-4, 0.02, 0.05, 1.0, 3.0, 8.0, 1e3])
def test_draws_follow_the_density_where_bounds_cut_it_off(rms: float) -> None:
    own = NoiseScale(40, 0.05, 1.0)
    square = 40 * rms**2
    axis = table(own, square, square)
    share = axis.weights()[0] * own.density(axis.nodes(), np.array(square))
    mean = share @ axis.nodes()
    sd = math.sqrt(share @ (axis.nodes() - mean) ** 2)
    drawn = np.log(own.draw(np.full(20_000, square), np.random.default_rng(5)))
    assert math.log(own.lower) - 1e-12 <= drawn.min()
    assert drawn.max() <= math.log(own.upper) + 1e-12
    assert abs(drawn.mean() - mean) < max(5.3 * sd / math.sqrt(20_000), 1e-3 * sd + 1e-6)


@pytest.mark.parametrize("n", [1, 3, 40, 1000])
def test_a_few_sums_of_squares_stand_for_many(n: int) -> None:
    rng = np.random.default_rng(n)
    square = n * np.exp(rng.normal(0.0, 0.3, 4000) * math.sqrt(2.0 / n))
    weight = rng.random((2, 4000))
    weight /= weight.sum(axis=1, keepdims=True)
    few, share = _compressed(DiscreteLaw.of(square, weight), n, 0.0)
    assert few.size < 100
    own = NoiseScale(n, 1e-3, 1e3)
    at = np.linspace(-2.0, 2.0, 60)
    np.testing.assert_allclose(
        share @ own.density(at, few[:, None]), weight @ own.density(at, square[:, None]), atol=1e-9
    )
