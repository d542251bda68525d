"""Viscoelastic restitution against its equation of motion."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import gamma

from ifrfit.physics.effects import EFFECTS, compose
from ifrfit.physics.effects.viscoelastic import _FIRST, restitution


def integrated(x: float) -> float:
    """n'' = -n^1.5 - x n^0.5 n', n'(0) = 1, until the force vanishes; all else is scaled out."""

    def motion(t: float, y: np.ndarray) -> list[float]:
        root = math.sqrt(max(y[0], 0.0))
        return [y[1], -root * (y[0] + x * y[1])]

    def force(t: float, y: np.ndarray) -> float:
        return float(y[0] + x * y[1]) if t > 1e-3 else 1.0

    force.terminal = True  # type: ignore[attr-defined]
    found = solve_ivp(motion, (0.0, 50.0), [1e-14, 1.0], events=force, rtol=1e-11, atol=1e-13)
    return float(-found.y[1, -1])


@pytest.mark.parametrize(
    ("x", "error"), [(0.01, 5e-5), (0.1, 5e-5), (0.2, 3e-4), (0.5, 2e-3), (1.0, 5e-3), (2.0, 8.5e-3)]
)
def test_approximant_against_the_equation_of_motion(x, error):
    assert abs(float(restitution(np.array(x))) - integrated(x)) <= error


def test_first_coefficient_is_the_known_one():
    """Ramirez et al. (1999), PRE 60, 4465: sqrt(pi) Gamma(3/5)/(2^(1/5) 5^(2/5) Gamma(21/10))."""
    exact = math.sqrt(math.pi) * gamma(0.6) / (2**0.2 * 5**0.4 * gamma(2.1))
    assert exact == pytest.approx(_FIRST, abs=1e-6)
    assert (1.0 - integrated(1e-3)) / 1e-3 == pytest.approx(exact, rel=2e-3)


def test_falls_from_one_to_zero_at_any_speed():
    e = restitution(np.concatenate([[0.0], np.logspace(-12, 300, 2000), [np.inf]]))
    assert e[0] == 1.0
    assert (np.diff(e) <= 0.0).all()
    assert np.isfinite(e).all()
    assert e[-1] < 1e-20


def test_number_is_that_of_the_dimensional_law(impacts, glass):
    """The same x from the force law in SI units: 1.5 A (rho_H/m)^0.4 V^0.2, rho_H = 4/3 E* sqrt(R)."""
    some = impacts([0.0, 60.0], speed=2.0, radius=1e-3)
    mass = 2563.0 * 4.0 / 3.0 * math.pi * 1e-9
    rho = 4.0 / 3.0 * 38.3e9 * math.sqrt(1e-3)
    x = [1.5e-9 * (rho / mass) ** 0.4 * v**0.2 for v in (2.0, 1.0)]
    effect = EFFECTS["viscoelastic"]
    found = effect.criterion(glass, some, compose(glass, some, []), 1e-3)
    assert found.value == pytest.approx(max(x), rel=1e-12)
    np.testing.assert_allclose(
        compose(glass, some, ["viscoelastic"]).e_n, restitution(np.array(x)), rtol=1e-12
    )


def test_remark_only_beyond_the_checked_range(impacts, glass):
    effect = EFFECTS["viscoelastic"]
    assert effect.validity(glass, impacts()).words == ""
    far = effect.validity(glass.with_numbers(dissipation_time=1.0), impacts())
    assert far.holds
    assert "lies beyond 2, up to which" in far.words


def test_at_rest_it_is_elastic(impacts, glass):
    assert compose(glass, impacts([90.0]), ["viscoelastic"]).e_n[0] == 1.0
