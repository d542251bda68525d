"""Closure maw as a closure: what an impact does under it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ifrfit.errors import UsageError
from ifrfit.physics import CLOSURES, get_closure, rebound
from ifrfit.physics.angles import Incidence
from ifrfit.physics.compliance import rebound_ratio

MAW = get_closure("maw")

gammas = st.floats(0.0, 89.9)
spins = st.floats(-2.0, 2.0)
shares = st.floats(0.0, 1.0)


@given(
    gammas,
    spins,
    st.floats(0.0, 1.0),
    st.floats(0.01, 1.0),
    st.floats(0.0, 1.0),
    st.sampled_from([0.4, 0.5, 2 / 3]),
)
@settings(max_examples=200, deadline=None)
def test_beta_is_that_of_the_scaled_velocities(
    gamma: float, spin: float, e_n: float, mu: float, share: float, j: float
) -> None:
    low, high = MAW.domain(j)
    chi = low + share * (high - low)
    r = rebound(gamma, 0.0, spin, e_n=e_n, mu=mu, chi=chi, closure="maw", inertia_factor=j, degrees=True)
    stiffness = 2.0 * chi * j / (1.0 + j)
    per_velocity = stiffness / (mu * r.incidence.cosine)
    psi1 = per_velocity * r.incidence.slip_x
    psi2 = rebound_ratio(psi1, chi, e_n=e_n)
    assert per_velocity * r.contact_x == pytest.approx(float(psi2), abs=1e-9 * (1.0 + abs(psi1)))


@given(gammas, spins, spins, shares, st.floats(0.0, 1.0), st.floats(0.0, 1.0))
@settings(max_examples=200, deadline=None)
def test_friction_is_bounded_and_planar_in_three_dimensions(
    gamma: float, spin_x: float, spin_y: float, share: float, e_n: float, mu: float
) -> None:
    chi = 7 / 6 + share * 7 / 12
    r = rebound(gamma, spin_x, spin_y, e_n=e_n, mu=mu, chi=chi, closure="maw", degrees=True)
    i = r.incidence
    # where mu is subnormal, rounding is absolute
    assert r.mu_app_magnitude <= mu * (1.0 + 1e-9) + 1e-300 or np.isnan(r.mu_app_magnitude)
    # the motion stays in the plane of the slip: a planar impact of the same slip ratio has the same beta
    if i.slip > 1e-6:
        flat = rebound(np.arctan(i.tau), e_n=e_n, mu=mu, chi=chi, closure="maw")
        assert r.beta == pytest.approx(float(flat.beta), abs=1e-8)


@pytest.mark.parametrize("j", [0.4, 2 / 3])
@pytest.mark.parametrize("place", [0.3, 0.6, 0.95])
def test_slopes_are_those_of_differences(j: float, place: float) -> None:
    law = MAW.law(j)
    chi = MAW.domain(j)[0] + place * (MAW.domain(j)[1] - MAW.domain(j)[0])
    incidence = Incidence.of(np.array([1.0, 5.0, 12.0, 20.0, 33.0, 50.0, 80.0]), 0.1, degrees=True)
    by_c, by_kappa = law.slopes(incidence, chi, 0.21)
    h = 1e-6
    expected = (law.impulse(incidence, chi + h, 0.21)[0] - law.impulse(incidence, chi - h, 0.21)[0]) / (2 * h)
    assert np.abs(by_c - expected).max() < 1e-6
    expected = (law.impulse(incidence, chi, 0.21 + h)[0] - law.impulse(incidence, chi, 0.21 - h)[0]) / (2 * h)
    assert np.abs(by_kappa - expected).max() < 1e-6
    bound = law.bound(chi)
    assert law.constant_at(bound) == pytest.approx(chi, rel=1e-12)
    assert law.bound_slope(chi) == pytest.approx(
        (law.bound(chi + h) - law.bound(chi - h)) / (2 * h), rel=1e-6
    )


def test_edges() -> None:
    gamma = np.array([0.0, 0.0, 45.0, 90.0, 90.0])
    spin = np.array([0.0, 0.3, -np.sqrt(0.5), 0.0, 1e8])
    r = rebound(gamma, 0.0, spin, e_n=0.9, mu=0.1, chi=1.4, closure="maw", degrees=True)
    assert np.isfinite(r.v_x).all()
    assert r.v_x[3] == 1.0  # no normal impulse, no friction
    none = rebound(gamma, 0.0, spin, e_n=0.9, mu=0.0, chi=1.4, closure="maw", degrees=True)
    assert (none.contact_x == none.incidence.slip_x).all()
    assert np.isnan(rebound(30.0, e_n=0.9, mu=0.1, chi=np.nan, closure="maw", degrees=True).v_x)
    assert np.isnan(rebound(30.0, e_n=0.9, mu=np.nan, chi=1.4, closure="maw", degrees=True).v_x)


def test_refusals() -> None:
    with pytest.raises(UsageError, match="Closure MAW needs chi"):
        rebound(0.3, e_n=0.9, mu=0.1, closure="maw")
    with pytest.raises(UsageError, match="Closure MAW has no constant e_t: it takes e_n, chi, mu"):
        rebound(0.3, e_n=0.9, mu=0.1, e_t=-0.9, chi=1.4, closure="maw")
    with pytest.raises(UsageError, match=r"the table of closure MAW reaches from 0\.65 to 3"):
        rebound(0.3, e_n=0.9, mu=0.1, chi=3.5, closure="maw")
    with pytest.raises(TypeError, match="not bilinear"):
        MAW.coefficients(0.4)


def test_domain_by_inertia() -> None:
    assert MAW.domain(0.4) == pytest.approx((7 / 6, 7 / 4))
    assert MAW.domain(2 / 3) == pytest.approx((5 / 6, 5 / 4))
    assert MAW.domain(0.05) == pytest.approx((7.0, 10.5))  # nothing of it is in the table
    assert not MAW.bilinear
    assert all(closure.bilinear for name, closure in CLOSURES.items() if name != "maw")
