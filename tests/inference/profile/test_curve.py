from __future__ import annotations

import math

import numpy as np
import pytest

from ifrfit.inference.distributions.truncated_normal import half_width
from ifrfit.inference.profile.curve import ProfileCurve
from ifrfit.inference.profile.objective import limit
from ifrfit.inference.profile.types import closed, shape_of


def traced(function, lower, upper, optima, step=0.1, far=None):
    curve = ProfileCurve(np.vectorize(function, otypes=[float]), lower, upper, far)
    curve.explore(optima, step, limit(0.997))
    curve.best_place(optima[0])
    return curve


def test_limits_are_chi2_and_student() -> None:
    assert limit(0.68) == pytest.approx(0.98894, abs=1e-4)
    assert limit(0.95) == pytest.approx(3.84146, abs=1e-5)
    assert limit(0.95, one_sided=True) == pytest.approx(2.70554, abs=1e-5)
    assert limit(0.68, one_sided=True) == pytest.approx(0.21874, abs=1e-4)
    t = half_width(0.95, 7.0)
    assert limit(0.95, 7.0) == pytest.approx(7.0 * math.log(1.0 + t * t / 7.0))
    assert limit(0.95, 1e9) == pytest.approx(limit(0.95), rel=1e-6)


@pytest.mark.parametrize(("at", "sd"), [(0.5, 0.1), (3.0, 1e-6), (-2.0, 50.0)])
def test_a_parabola_closes_where_it_must(at: float, sd: float) -> None:
    curve = traced(lambda x: ((x - at) / sd) ** 2, -1e4, 1e4, [at], sd)
    ((low, high),) = curve.pieces(limit(0.95))
    z = math.sqrt(limit(0.95))
    assert (low - at) / sd == pytest.approx(-z, rel=1e-6)
    assert (high - at) / sd == pytest.approx(z, rel=1e-6)


def test_a_second_valley_that_no_optimum_announced_is_met() -> None:
    curve = traced(lambda x: min((x - 0.2) ** 2, (x - 0.8) ** 2 + 1e-4) / 0.05**2, 0.0, 1.0, [0.2], 0.05)
    assert len(curve.pieces(limit(0.95))) == 2


def test_an_announced_needle_is_not_lost() -> None:
    def needle(x: float) -> float:
        return min(((x - 0.2) / 0.05) ** 2, ((x - 0.803) / 1e-5) ** 2)

    assert len(traced(needle, 0.0, 1.0, [0.2, 0.803], 0.05).pieces(limit(0.95))) == 2
    # the control: unannounced, nothing could know of it
    assert len(traced(needle, 0.0, 1.0, [0.2], 0.05).pieces(limit(0.95))) == 1


def test_kinks_get_more_places() -> None:
    curve = traced(lambda x: 30.0 * abs(x - 0.3), 0.0, 1.0, [0.3], 0.05)
    x, _ = curve.window(limit(0.997))
    assert np.diff(x)[np.searchsorted(x, 0.3) - 1] < 0.2 * np.median(np.diff(x)) or x.size < 60


def test_level_to_infinity_stays_open() -> None:
    curve = traced(lambda x: 100.0 * max(0.2 - x, 0.0), 0.0, math.inf, [0.5], 0.1, far=2.0)
    ((low, high),) = curve.pieces(limit(0.95))
    assert low == pytest.approx(0.2 - 0.0384146, abs=1e-6)
    assert high == math.inf
    x, _ = curve.window(limit(0.997))
    assert np.isfinite(x).all()
    assert x.max() == 2.0
    assert curve.stopped == ""


def test_infinity_that_closes_is_found_by_doubling() -> None:
    curve = traced(lambda x: ((x - 1e5) / 1e4) ** 2, 0.0, math.inf, [1e5], 1.0)
    ((_, high),) = curve.pieces(limit(0.95))
    assert high == pytest.approx(1e5 + 1e4 * math.sqrt(limit(0.95)))
    assert curve.stopped == ""


def test_infinity_that_never_closes_is_told() -> None:
    curve = traced(lambda x: max(0.0, 1.0 - x), 0.0, math.inf, [2.0])
    assert curve.stopped.startswith("it does not close up to 1e+")
    curve = ProfileCurve(lambda x: (x - 0.5) ** 2 / 0.01, 0.0, 1.0, unconverged=[0.1, 0.2])
    assert curve.stopped == f"the search has not settled at 2 of its {curve.n_evaluations} places"


def test_shapes() -> None:
    inside, low, both = ((0.2, 0.8),), ((0.0, 0.8),), ((0.0, 1.0),)
    assert shape_of(inside, inside, 0.0, 1.0) == "bounded"
    assert shape_of(inside, low, 0.0, 1.0) == "one_sided"
    assert shape_of(inside, both, 0.0, 1.0) == "flat"
    assert shape_of(((0.2, 0.3), (0.4, 0.5)), inside, 0.0, 1.0) == "multimodal"
    assert closed((0.1, math.inf), 0.0, math.inf) == (True, False)
