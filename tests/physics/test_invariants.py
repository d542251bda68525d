"""What holds for every impact, whatever the closure: properties over the whole domain."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from factories import own_constant
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from impulses import impulse_of

from ifrfit.cost.impulse_balance import impact
from ifrfit.physics import CLOSURES, rebound, transition_tau
from ifrfit.physics.closure import check_closure, rotational_share

gammas = st.one_of(st.floats(0.0, 90.0), st.sampled_from([0.0, 30.0, 60.0, 90.0 - 1e-9, 90.0]))
spins = st.one_of(st.floats(-2.0, 2.0), st.floats(-1e6, 1e6), st.sampled_from([0.0, -0.5, -1.0]))
SPEEDS = ("v_x", "v_y", "v_n", "spin_x", "spin_y", "contact_x", "contact_y")


@st.composite
def laws(draw: st.DrawFn) -> dict[str, Any]:
    """Closure, its constants within the passive domain, and the inertia, as keywords of `rebound`."""
    closure = CLOSURES[draw(st.sampled_from(sorted(CLOSURES)))]
    # a law from a table has its constants for some bodies only
    j = draw(st.floats(0.05 if closure.bilinear else 0.4, 1.0))
    call: dict[str, Any] = {
        "closure": closure.name,
        "inertia_factor": j,
        "e_n": draw(st.floats(0.0, 1.0)),
        "mu": draw(st.one_of(st.floats(0.0, 2.0), st.floats(0.0, 1e6), st.just(0.0))),
        "degrees": True,
    }
    if closure.constant:
        low, high = closure.domain(j)
        call[closure.constant] = min(max(low + draw(st.floats(0.0, 1.0)) * (high - low), low), high)
    return call


def scale_of(spin_x: float, spin_y: float) -> float:
    return 1.0 + abs(spin_x) + abs(spin_y)


def bound_of(call: dict[str, Any]) -> float:
    """Kappa/tau at which sticking ends."""
    closure = CLOSURES[call["closure"]]
    return float(closure.law(call["inertia_factor"]).bound(call.get(closure.constant or "", 0.0)))


def impulse_bounds(call: dict[str, Any]) -> tuple[float, float]:
    """Least and largest k: of a + min(b, ...) for these constants; of another law where energy is kept."""
    closure, j = CLOSURES[call["closure"]], call["inertia_factor"]
    if not closure.bilinear:
        return 0.0, 2.0 * rotational_share(j)
    linear, c = closure.coefficients(j), call.get(closure.constant or "", 0.0)
    a = linear.a0 + linear.a1 * c
    return a, a + bound_of(call)


@given(gammas, spins, spins, laws())
@settings(max_examples=200, deadline=None)
def test_balances_of_an_impact(gamma: float, spin_x: float, spin_y: float, call: dict[str, Any]) -> None:
    r = rebound(gamma, spin_x, spin_y, **call)
    j, slip, tolerance = r.inertia_factor, float(r.incidence.slip), 1e-13 * scale_of(spin_x, spin_y)
    # angular momentum about the point of contact is kept
    assert abs((r.v_x - j * r.spin_y) - (r.incidence.sine - j * spin_y)) <= tolerance
    assert abs((r.v_y - j * r.spin_x) + j * spin_x) <= tolerance
    # the contact point moves with centre and spin, and along the slip
    assert abs(r.contact_x - (r.v_x + r.spin_y)) <= tolerance
    assert abs(r.contact_y - (r.v_y + r.spin_x)) <= tolerance
    assert abs(r.contact_x * r.incidence.slip_y - r.contact_y * r.incidence.slip_x) <= tolerance * slip
    # the impulse lies within its bounds
    low, high = impulse_bounds(call)
    assert all(math.isfinite(float(getattr(r, name))) for name in (*SPEEDS, "impulse_factor"))
    assert low - 1e-15 <= r.impulse_factor <= high + 1e-15
    assert float(r.v_n) == call["e_n"] * float(r.incidence.cosine)
    # energy, over m u^2/2, is that of velocities and spins, and never grows
    change = float(r.energy_change)
    after = r.v_x**2 + r.v_y**2 + r.v_n**2 + j * (r.spin_x**2 + r.spin_y**2)
    expected = float(after - 1.0 - j * (spin_x**2 + spin_y**2))
    assert abs(change - expected) <= 1e-13 * scale_of(spin_x, spin_y) ** 2
    assert change <= 1e-14 * (1.0 + slip**2)
    # its tangential part follows from beta
    if slip > 0.0:
        normal = (call["e_n"] ** 2 - 1.0) * float(r.incidence.cosine) ** 2
        tangential = rotational_share(j) * slip**2 * (float(r.beta) ** 2 - 1.0)
        assert abs(change - normal - tangential) <= 1e-13 * (1.0 + slip**2)


@given(spins, spins, st.floats(-math.pi, math.pi), laws())
@settings(max_examples=200, deadline=None)
def test_turning_the_spin_about_the_normal_turns_the_rebound(
    spin_x: float, spin_y: float, turn: float, call: dict[str, Any]
) -> None:
    """At normal incidence only the spin has a direction; (spin_y, spin_x) is the vector along (x, y)."""
    cosine, sine = math.cos(turn), math.sin(turn)

    def turned(x: Any, y: Any) -> tuple[Any, Any]:
        return cosine * x - sine * y, sine * x + cosine * y

    one = rebound(0.0, spin_x, spin_y, **call)
    new_y, new_x = turned(spin_y, spin_x)
    two = rebound(0.0, new_x, new_y, **call)
    tolerance = 1e-12 * scale_of(spin_x, spin_y)
    for x, y in (("v_x", "v_y"), ("spin_y", "spin_x"), ("contact_x", "contact_y")):
        expected = turned(getattr(one, x), getattr(one, y))
        assert abs(getattr(two, x) - expected[0]) <= tolerance
        assert abs(getattr(two, y) - expected[1]) <= tolerance


@given(
    gammas,
    spins,
    spins,
    laws(),
    st.floats(1e-3, 1e3),
    st.floats(1e-3, 1e3),
    st.floats(1e-3, 1e3),
    st.integers(0, 2**32 - 1),
)
@settings(max_examples=200, deadline=None)
def test_agrees_with_the_impulse_balance_at_any_speed_size_mass_and_direction_of_the_wall(
    gamma: float,
    spin_x: float,
    spin_y: float,
    call: dict[str, Any],
    speed: float,
    radius: float,
    mass: float,
    seed: int,
) -> None:
    frame, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    frame[:, 2] *= np.linalg.det(frame)
    closure = CLOSURES[call["closure"]]
    r = rebound(gamma, spin_x, spin_y, **call)
    state = impact(
        gamma,
        spin_x,
        spin_y,
        law=impulse_of(closure.name),
        constant=call.get(closure.constant or "", 0.0),
        e_n=call["e_n"],
        mu=call["mu"],
        inertia_factor=call["inertia_factor"],
        speed=speed,
        radius=radius,
        mass=mass,
        frame=frame,
    )
    # near grazing a huge mu multiplies the rounding of u.n in the turned frame
    tolerance = 1e-13 * scale_of(spin_x, spin_y) * (1.0 + 10.0 * call["mu"])
    for name in SPEEDS:
        assert abs(getattr(r, name) - state[name]) <= tolerance, name


@pytest.mark.parametrize("law", CLOSURES)
def test_no_closure_contradicts_itself(law: str) -> None:
    """As those are checked that are registered; tests/plugins has laws that are refused."""
    check_closure(CLOSURES[law])


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("law", CLOSURES)
def test_no_closure_creates_energy_at_the_ends_of_its_domain(law: str, share: float) -> None:
    gamma, spin = np.linspace(0.0, 90.0, 91)[:, None], np.array([-3.0, -0.5, 0.0, 0.4, 3.0, 100.0])
    for j in (0.4, 0.5, 2.0 / 3.0):
        for mu in (0.0, 0.05, 0.3, 2.0):
            r = rebound(
                gamma, 0.1, spin, e_n=1.0, mu=mu, closure=law, inertia_factor=j, degrees=True,
                **own_constant(law, share, j),
            )  # fmt: skip
            assert r.energy_change.max() <= 1e-12 * (1.0 + 100.0**2)


@pytest.mark.parametrize("inertia_factor", [0.05, 0.4, 2.0 / 3.0])
@pytest.mark.parametrize("law", ["ifr", "ifr-contact", "fr"])
@pytest.mark.parametrize("beyond", ["below", "above"])
def test_just_outside_the_passive_range_energy_is_created(
    law: str, inertia_factor: float, beyond: str
) -> None:
    """Negative control: the limits are sharp, an impact outside them gains energy."""
    closure = CLOSURES[law]
    assert closure.constant is not None
    low, high = closure.domain(inertia_factor)
    constant = {closure.constant: low - 0.01 if beyond == "below" else high + 0.01}
    gamma, spin = np.linspace(0.0, 90.0, 181)[:, None], np.array([-3.0, 0.0, 3.0, 100.0])

    def gain(c: dict[str, float]) -> float:
        found = [
            rebound(
                gamma,
                0.0,
                spin,
                e_n=1.0,
                mu=mu,
                closure=law,
                inertia_factor=inertia_factor,
                degrees=True,
                **c,
            ).energy_change.max()
            for mu in (0.0, 0.1, 10.0)
        ]
        return float(max(found))

    assert gain(constant) > 1e-3
    assert gain({closure.constant: low}) <= 1e-10
    assert gain({closure.constant: high}) <= 1e-10


@given(st.floats(0.0, 89.0), spins, spins, laws())
@settings(max_examples=300, deadline=None)
def test_continuous_at_the_transition(
    gamma: float, spin_x: float, spin_y: float, call: dict[str, Any]
) -> None:
    """Mu that puts the impact on the transition: a little more sticks, a little less slides, alike."""
    b = bound_of(call)
    still = rebound(gamma, spin_x, spin_y, **call)
    assume(float(still.incidence.slip) > 1e-3)
    assume(b > 1e-3)
    mu = b * float(still.incidence.tau) / (1.0 + call["e_n"])
    h = 1e-9
    more = rebound(gamma, spin_x, spin_y, **{**call, "mu": mu * (1.0 + h)})
    less = rebound(gamma, spin_x, spin_y, **{**call, "mu": mu * (1.0 - h)})
    assert bool(more.sticking)
    assert not bool(less.sticking)
    slip = float(still.incidence.slip)
    j = call["inertia_factor"]
    # a law from a table meets that of sliding within the accuracy of the table
    exact = CLOSURES[call["closure"]].bilinear
    step = 2.0 * h * b + (0.0 if exact else 1e-3 * rotational_share(j))
    for name in SPEEDS:
        jump = abs(float(getattr(more, name) - getattr(less, name)))
        assert jump <= step * slip * (1.0 + 1.0 / j) + 1e-14 * scale_of(spin_x, spin_y)


@given(laws(), spins, spins)
@settings(max_examples=200, deadline=None)
def test_sticking_is_below_the_transition_ratio(call: dict[str, Any], spin_x: float, spin_y: float) -> None:
    closure = CLOSURES[call["closure"]]
    c = call.get(closure.constant or "", 0.0)
    tau = transition_tau(closure, c, call["mu"] * (1.0 + call["e_n"]), call["inertia_factor"])
    gamma = np.linspace(0.0, 89.99, 400)
    r = rebound(gamma, spin_x, spin_y, **call)
    clear = np.abs(r.incidence.tau - tau) > 1e-9 * (1.0 + tau)
    assert (r.sticking == (r.incidence.tau < tau))[clear].all()


@given(
    st.floats(0.0, 89.0),
    st.floats(-1e-3, 1e-3),
    st.floats(-1e-3, 1e-3),
    st.floats(-1e-3, 1e-3),
    st.floats(-1e-3, 1e-3),
    laws(),
)
@settings(max_examples=300, deadline=None)
def test_lipschitz_through_no_slip(
    gamma: float, x1: float, y1: float, x2: float, y2: float, call: dict[str, Any]
) -> None:
    """Slips around zero, in any directions: impulses differ by at most (a + b) times what the slips do."""
    sine = float(rebound(gamma, **call).incidence.sine)
    one = rebound(gamma, y1, x1 - sine, **call)
    two = rebound(gamma, y2, x2 - sine, **call)
    slips = math.hypot(
        float(one.incidence.slip_x - two.incidence.slip_x), float(one.incidence.slip_y - two.incidence.slip_y)
    )
    impulses = math.hypot(float(one.v_x - two.v_x), float(one.v_y - two.v_y))
    assert impulses <= impulse_bounds(call)[1] * slips + 1e-15


@pytest.mark.parametrize("law", CLOSURES)
@pytest.mark.parametrize("slip", [5e-324, 1e-310, 1e-200, 1e-17])
def test_vanishing_slip_is_a_vanishing_impulse(law: str, slip: float) -> None:
    closure = CLOSURES[law]
    constant = {closure.constant: closure.domain(0.4)[0]} if closure.constant else {}
    r = rebound(0.0, slip, -slip, e_n=0.9, mu=0.1, closure=law, **constant)  # type: ignore[arg-type]
    assert math.isfinite(float(r.impulse_factor))
    assert math.hypot(float(r.v_x), float(r.v_y)) <= 4.0 * slip
