"""The table of a noise's law holds all of it, wherever bounds cut it off."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy import special

from ifrfit.inference.posterior.axis import Axis
from ifrfit.inference.posterior.noise import UnknownNoise
from ifrfit.inference.posterior.of_noise import _ORDER, _compressed, _edges


def table(own: UnknownNoise, least: float, most: float) -> Axis:
    return Axis.of(_edges(own, least, most), _ORDER)


@settings(deadline=None, max_examples=150)
@given(
    st.sampled_from([1, 2, 3, 8, 40, 1000, 30_000]),
    st.floats(-8.0, 8.0),  # logarithm of the root mean square, in units of the geometric mean of the bounds
    st.floats(0.01, 7.0),  # half the logarithm of the ratio of the bounds
)
@example(1, 5.0, 1.0)
def test_density_integrates_to_one(n: int, log_rms: float, half_span: float) -> None:
    own = UnknownNoise(n, math.exp(-half_span), math.exp(half_span))
    square = n * math.exp(2.0 * log_rms)
    if own.log_likelihood(np.array([square]))[0] < -1e5:
        return  # no posterior goes there
    axis = table(own, square, square)
    total = axis.weights()[0] @ own.density(axis.nodes(), np.array(square))
    assert abs(total - 1.0) < 1e-6  # narrow bounds leave few digits of the share between them


@pytest.mark.parametrize("n", [2, 5, 40, 500])
def test_distribution_is_the_inverse_gamma_law(n: int) -> None:
    own, square = UnknownNoise(n, 1e-6, 1e4), 0.05**2 * n
    axis = table(own, square, square)
    share = axis.weights()[0] * own.density(axis.nodes(), np.array(square))
    ends = axis.panels[:, 1]
    below = np.cumsum(share.reshape(axis.shape).sum(axis=1))
    # sigma lies below an end where square/(2 sigma^2) lies above its own
    expected = special.gammaincc(0.5 * n, 0.5 * square * np.exp(-2.0 * ends))
    np.testing.assert_allclose(below, expected, atol=1e-10)


@pytest.mark.parametrize("n", [1, 3, 40, 1000])
def test_a_few_sums_of_squares_stand_for_many(n: int) -> None:
    rng = np.random.default_rng(n)
    square = n * np.exp(rng.normal(0.0, 0.3, 4000) * math.sqrt(2.0 / n))
    weight = rng.random((2, 4000))
    weight /= weight.sum(axis=1, keepdims=True)
    few, share = _compressed(square, weight, n, 0.0)
    assert few.size < 100
    own = UnknownNoise(n, 1e-3, 1e3)
    at = np.linspace(-2.0, 2.0, 60)
    np.testing.assert_allclose(
        share @ own.density(at, few[:, None]), weight @ own.density(at, square[:, None]), atol=1e-9
    )
