"""Closures against an impulse balance that shares no code with the package."""

from __future__ import annotations

import math
import pickle
from typing import Any

import numpy as np
import pytest
from factories import own_constant
from impulses import WRITTEN

from ifrfit.cost.impulse_balance import impact
from ifrfit.errors import UsageError
from ifrfit.physics import CLOSURES, get_closure, rebound

STATE = ("v_x", "v_y", "v_n", "spin_x", "spin_y", "contact_x", "contact_y")
INERTIA = {"disc": 0.5, "sphere": 0.4, "shell": 2.0 / 3.0, "dense core": 0.05, "hoop": 1.0}


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


def test_a_tie_of_the_two_frictions_sticks() -> None:
    r = rebound(0.0, 0.0, 1.0, e_n=0.0, e_t=-1.0, mu=0.5, inertia_factor=0.5, degrees=True)
    assert bool(r.sticking)


def test_registry_keys_are_the_names() -> None:
    assert all(key == closure.name for key, closure in CLOSURES.items())
    assert all(closure.source for closure in CLOSURES.values())
    assert get_closure("IFR") is CLOSURES["ifr"]


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (
            {"closure": "hertz", "e_t": -0.9},
            f"There is no closure 'hertz'. Choose one of {', '.join(CLOSURES)}. One of your own is "
            "known once it is registered.",
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
        (
            {"e_t": -0.9, "inertia_factor": "round"},
            "inertia_factor is 'round': it must be positive (2/5 for a solid sphere).",
        ),
        (
            {"e_t": -0.9, "inertia_factor": (0.4, 0.5)},
            "inertia_factor is an array: it must be one number, so call once for each body.",
        ),
    ],
)
def test_refusals_say_what_to_do(call: dict[str, Any], text: str) -> None:
    with pytest.raises(UsageError) as caught:
        rebound(30.0, e_n=0.9, mu=0.1, degrees=True, **call)
    assert str(caught.value) == text
    assert caught.value.exit_status == 2


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        ({"gamma": "a"}, "gamma: 'a' is no number, nor an array of them: give numbers."),
        ({"gamma": 1j}, "gamma: 1j is no number, nor an array of them: give numbers."),
        ({"e_n": None}, "e_n: None is no number, nor an array of them: give numbers."),
        (
            {"gamma": [0.5, 30.0]},
            "gamma 30: incidence angles lie between 0 and pi/2 from the normal; degrees need degrees=True.",
        ),
        (
            {"gamma": 90.5, "degrees": True},
            "gamma 90.5: incidence angles lie between 0 and 90 degrees from the normal.",
        ),
        ({"mu": -0.1}, "mu is -0.1: it must be 0 or more."),
        ({"e_n": [0.9, -0.1]}, "e_n is -0.1: it must be 0 or more."),
        (
            {"gamma": [0.1, 0.2], "spin_x": [1.0, 2.0, 3.0]},
            "The shapes of gamma (2,) and spin_x (3,) do not go together. "
            "Give arrays as long as one another, or single numbers.",
        ),
    ],
)
def test_there_is_no_answer_outside_the_domain(changed: dict[str, Any], text: str) -> None:
    with pytest.raises(UsageError) as caught:
        rebound(**{"gamma": 0.5, "e_n": 0.9, "e_t": -0.7, "mu": 0.1} | changed)
    assert str(caught.value) == text


def test_what_a_fit_takes_is_computed_and_what_is_missing_stays_missing() -> None:
    constants = {"e_n": 0.9, "e_t": -0.8, "mu": 0.1}
    shell = rebound([0.2, math.nan], inertia_factor="2/3", **constants)
    assert shell.beta[0] == rebound(0.2, inertia_factor=2.0 / 3.0, **constants).beta
    assert math.isnan(shell.beta[1])
    # beyond the passive domain, as a fit with wider bounds has it: an impact that gains energy
    assert rebound(0.0, e_n=1.02, e_t=0.1, mu=0.1).v_n == 1.02
    assert rebound(0.5 * math.pi, **constants).sticking.size == 1


@pytest.mark.parametrize("closure", CLOSURES.values(), ids=lambda c: c.name)
def test_a_closure_goes_to_other_processes_by_its_name(closure):
    assert pickle.loads(pickle.dumps(closure)) is closure
