"""Closures against an impulse balance that shares no code with the package."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest
from factories import BILINEAR, own_constant
from hypothesis import given, settings
from hypothesis import strategies as st
from impulses import WRITTEN, impulse_of

from ifrfit.cost.impulse_balance import impact
from ifrfit.errors import UsageError
from ifrfit.physics import CLOSURES, get_closure, rebound

STATE = ("v_x", "v_y", "v_n", "spin_x", "spin_y", "contact_x", "contact_y")
INERTIA = {"disc": 0.5, "sphere": 0.4, "shell": 2.0 / 3.0, "dense core": 0.05, "hoop": 1.0}

gammas = st.floats(0.0, 90.0)
spins = st.one_of(st.floats(-2.0, 2.0), st.floats(-1e6, 1e6))
inertias = st.floats(0.05, 1.0)
shares = st.floats(0.0, 1.0)
restitutions = st.floats(0.0, 1.0)
frictions = st.one_of(st.floats(0.0, 2.0), st.floats(0.0, 1e6))


def assert_same_state(got: Any, expected: Any, scale: float) -> None:
    for name in STATE:
        value = expected[name] if isinstance(expected, dict) else getattr(expected, name)
        assert abs(getattr(got, name) - value) <= 2e-13 * scale, name


@pytest.mark.parametrize("law", BILINEAR)
@given(gammas, spins, spins, restitutions, shares, frictions, inertias)
@settings(max_examples=150, deadline=None)
def test_agrees_with_the_impulse_balance(
    law: str,
    gamma: float,
    spin_x: float,
    spin_y: float,
    e_n: float,
    share: float,
    mu: float,
    inertia_factor: float,
) -> None:
    constant = own_constant(law, share, inertia_factor)
    got = rebound(
        gamma,
        spin_x,
        spin_y,
        e_n=e_n,
        mu=mu,
        closure=law,
        inertia_factor=inertia_factor,
        degrees=True,
        **constant,
    )
    expected = impact(
        gamma,
        spin_x,
        spin_y,
        law=impulse_of(law),
        constant=next(iter(constant.values()), 0.0),
        e_n=e_n,
        mu=mu,
        inertia_factor=inertia_factor,
    )
    assert_same_state(got, expected, 1.0 + abs(spin_x) + abs(spin_y))


@pytest.mark.parametrize("law", WRITTEN)
def test_the_oracle_tells_closures_apart(law: str) -> None:
    """Negative control: no other law gives the same impact."""
    constant = own_constant(law, 0.3, 0.4)
    got = rebound(20.0, 0.1, 0.2, e_n=0.9, mu=0.5, closure=law, degrees=True, **constant)
    number = next(iter(constant.values()), -0.6)
    others = [other for other in WRITTEN if other != law]
    for other in others:
        expected = impact(20.0, 0.1, 0.2, law=WRITTEN[other], constant=number, e_n=0.9, mu=0.5)
        assert abs(float(got.v_x) - expected["v_x"]) > 1e-3


@pytest.mark.parametrize("inertia_factor", INERTIA.values(), ids=INERTIA.keys())
@pytest.mark.parametrize(
    ("law", "constant", "other", "other_constant"),
    [
        ("ifr", lambda j: {"e_t": -1.0}, "fr", lambda j: {"beta0": j}),
        ("ifr-contact", lambda j: {"e_t": -1.0}, "f", lambda j: {}),
        ("fr", lambda j: {"beta0": 0.0}, "f", lambda j: {}),
    ],
    ids=["IFR is FR", "IFR-contact is F", "FR is F"],
)
def test_identities_between_closures(
    inertia_factor: float, law: str, constant: Any, other: str, other_constant: Any
) -> None:
    gamma = np.linspace(0.0, 90.0, 91)[:, None]
    spin = np.array([-1.5, -0.4, 0.0, 0.3, 2.0])
    common: dict[str, Any] = {"e_n": 0.8, "mu": 0.2, "inertia_factor": inertia_factor, "degrees": True}
    one = rebound(gamma, 0.1, spin, closure=law, **constant(inertia_factor), **common)
    two = rebound(gamma, 0.1, spin, closure=other, **other_constant(inertia_factor), **common)
    assert one.sticking.any()
    assert not one.sticking.all()
    assert (one.sticking == two.sticking).all()
    for name in STATE:
        np.testing.assert_allclose(getattr(one, name), getattr(two, name), rtol=0.0, atol=2e-14)


@pytest.mark.parametrize("inertia_factor", INERTIA.values(), ids=INERTIA.keys())
@pytest.mark.parametrize(
    ("law", "constant", "beta"),
    [
        ("f", None, lambda c, j: 0.0),
        ("fr", 0.3, lambda c, j: c),
        ("ifr", -0.9, lambda c, j: c + 1.0 + j),
        ("ifr-contact", -0.9, lambda c, j: 1.0 + c),
    ],
)
def test_sticking_restitution(inertia_factor: float, law: str, constant: float | None, beta: Any) -> None:
    own = CLOSURES[law].constant
    given_constant = {own: constant} if own else {}
    r = rebound(
        10.0,
        e_n=0.9,
        mu=50.0,
        closure=law,
        inertia_factor=inertia_factor,
        degrees=True,
        **given_constant,  # type: ignore[arg-type]
    )
    assert bool(r.sticking)
    assert float(r.beta) == pytest.approx(beta(constant, inertia_factor), abs=1e-14)


def test_a_tie_of_the_two_frictions_sticks() -> None:
    r = rebound(0.0, 0.0, 1.0, e_n=0.0, e_t=-1.0, mu=0.5, inertia_factor=0.5, degrees=True)
    assert bool(r.sticking)


@pytest.mark.parametrize("law", ["f", "fr"])
def test_sliding_of_f_and_fr_is_coulomb(law: str) -> None:
    constant = {"beta0": 0.4} if law == "fr" else {}
    r = rebound(80.0, 0.2, e_n=0.7, mu=0.1, closure=law, degrees=True, **constant)
    assert not bool(r.sticking)
    assert float(r.mu_app_magnitude) == pytest.approx(0.1, rel=1e-13)


@pytest.mark.parametrize(("law", "limits"), [("f", (0, 0)), ("fr", (-1, 1)), ("ifr-contact", (-1, 0))])
def test_passive_ranges(law: str, limits: tuple[float, float]) -> None:
    assert CLOSURES[law].domain(0.4) == limits


def test_passive_range_of_ifr_follows_the_inertia() -> None:
    assert CLOSURES["ifr"].domain(0.4) == (-1.0, -0.4)
    assert CLOSURES["ifr"].domain(2.0 / 3.0) == (-1.0, -2.0 / 3.0)


@pytest.mark.parametrize(
    ("law", "names"),
    [
        ("f", ("e_n", "mu")),
        ("fr", ("e_n", "beta0", "mu")),
        ("ifr", ("e_n", "e_t", "mu")),
        ("ifr-contact", ("e_n", "e_t", "mu")),
    ],
)
def test_names_of_constants(law: str, names: tuple[str, ...]) -> None:
    assert CLOSURES[law].constants == names


def test_registry_keys_are_the_names() -> None:
    assert all(key == closure.name for key, closure in CLOSURES.items())
    assert all(closure.source for closure in CLOSURES.values())
    assert get_closure("IFR") is CLOSURES["ifr"]


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (
            {"closure": "hertz", "e_t": -0.9},
            f"There is no closure 'hertz'. Choose one of {', '.join(CLOSURES)}.",
        ),
        ({}, "Closure IFR needs e_t: give e_t=..."),
        ({"closure": "ifr-contact"}, "Closure IFR-contact needs e_t: give e_t=..."),
        ({"closure": "fr"}, "Closure FR needs beta0: give beta0=..."),
        ({"closure": "f", "e_t": -0.9}, "Closure F has no constant e_t: it takes e_n, mu."),
        (
            {"closure": "fr", "beta0": 0.1, "e_t": -0.9},
            "Closure FR has no constant e_t: it takes e_n, beta0, mu.",
        ),
        ({"e_t": -0.9, "beta0": 0.1}, "Closure IFR has no constant beta0: it takes e_n, e_t, mu."),
        ({"e_t": -0.9, "chi": 1.4}, "Closure IFR has no constant chi: it takes e_n, e_t, mu."),
        (
            {"e_t": -0.9, "inertia_factor": 0.0},
            "inertia_factor is 0.0: it must be positive (2/5 for a solid sphere).",
        ),
        (
            {"e_t": -0.9, "inertia_factor": -0.4},
            "inertia_factor is -0.4: it must be positive (2/5 for a solid sphere).",
        ),
        (
            {"e_t": -0.9, "inertia_factor": float("nan")},
            "inertia_factor is nan: it must be positive (2/5 for a solid sphere).",
        ),
    ],
)
def test_refusals_say_what_to_do(call: dict[str, Any], text: str) -> None:
    with pytest.raises(UsageError) as caught:
        rebound(30.0, e_n=0.9, mu=0.1, degrees=True, **call)
    assert str(caught.value) == text
    assert caught.value.exit_status == 2


@pytest.mark.parametrize("closure", CLOSURES.values(), ids=lambda c: c.name)
def test_a_closure_goes_to_other_processes_by_its_name(closure):
    assert pickle.loads(pickle.dumps(closure)) is closure
