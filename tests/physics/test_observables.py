"""The registry of observables, angles without lost digits, shapes, read-only results and undefined values."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import mpmath  # type: ignore[import-untyped]
import numpy as np
import pytest
from factories import SCHEMA, own_constant
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from ifrfit.physics import CLOSURES, OBSERVABLES, rebound
from ifrfit.physics.angles import sincos
from ifrfit.physics.observable import check_observable

CONSTANTS = {name: own_constant(name) for name in CLOSURES}


def test_the_names_of_the_schema_are_there() -> None:
    assert set(SCHEMA) <= set(OBSERVABLES)
    assert all(key == observable.name for key, observable in OBSERVABLES.items())


@pytest.mark.parametrize("name", OBSERVABLES)
def test_an_entry_does_not_contradict_itself(name: str) -> None:
    check_observable(OBSERVABLES[name])


def test_values_against_their_definitions() -> None:
    """Registry against ratios of velocities, one by one, at an ordinary impact with lateral spin."""
    gamma, e_n, mu = 40.0, 0.8, 0.12
    r = rebound(gamma, 0.2, -0.1, e_n=e_n, e_t=-0.9, mu=mu, degrees=True)
    sine, cosine = math.sin(math.radians(gamma)), math.cos(math.radians(gamma))
    v_x, v_y, v_n = float(r.v_x), float(r.v_y), float(r.v_n)
    c_x, c_y = float(r.contact_x), float(r.contact_y)
    expected = {
        "e_n": e_n,
        "mu": mu,
        "beta": -(c_x * (sine - 0.1) + c_y * 0.2) / ((sine - 0.1) ** 2 + 0.2**2),
        "beta_cm": -v_x / sine,
        "beta_tot": math.sqrt(v_x**2 + v_y**2 + v_n**2),
        "mu_app": (sine - v_x) / (v_n + cosine),
        "delta_deg": math.degrees(math.atan(v_x / v_n)),
        "lambda_deg": math.degrees(math.atan(v_y / v_x)),
        "tan_psi_after": c_x / cosine,
        "tan_psi_out": c_x / v_n,
        "psi_after_deg": math.degrees(math.atan(c_x / cosine)),
        "psi_out_deg": math.degrees(math.atan(c_x / v_n)),
        "spin_x_after": c_y - v_y,
        "spin_y_after": c_x - v_x,
        "v_x": v_x,
        "v_y": v_y,
        "v_n": e_n * cosine,
    }
    assert expected.keys() == set(SCHEMA)
    for name, value in expected.items():
        got = OBSERVABLES[name].value(r, np.asarray(mu))
        assert float(got) == pytest.approx(value, abs=2e-14), name
    assert float(r.mu_app_magnitude) == pytest.approx(math.hypot(sine - v_x, v_y) / (v_n + cosine), abs=1e-15)


@pytest.mark.parametrize(
    ("degrees", "sine", "cosine"),
    [
        (0.0, 0.0, 1.0),
        (30.0, 0.5, math.sqrt(3.0) / 2.0),
        (45.0, math.sqrt(0.5), math.sqrt(0.5)),
        (60.0, math.sqrt(3.0) / 2.0, 0.5),
        (90.0, 1.0, 0.0),
    ],
)
def test_sine_and_cosine_are_exact_at_round_angles(degrees: float, sine: float, cosine: float) -> None:
    got = [float(part) for part in sincos(degrees, degrees=True)]
    assert got == pytest.approx([sine, cosine], rel=3e-16, abs=0.0)
    rational = {0.0, 0.5, 1.0}
    assert all(one == two for one, two in zip(got, (sine, cosine), strict=True) if two in rational)
    assert (got[0] == got[1]) == (degrees == 45.0)


def relative_errors(degrees: float) -> tuple[float, float]:
    got = sincos(degrees, degrees=True)
    with mpmath.workdps(50):
        exact = mpmath.mpf(degrees) * mpmath.pi / 180
        pair = zip(got, (mpmath.sin(exact), mpmath.cos(exact)), strict=True)
        errors = [abs(mpmath.mpf(float(g)) / e - 1) if e else mpmath.mpf(abs(float(g))) for g, e in pair]
    return float(errors[0]), float(errors[1])


@pytest.mark.parametrize("off", [1e-13, 1e-10, 2e-8, 1e-6, 1e-3, 0.1, 10.0])
def test_no_digits_are_lost_near_ninety(off: float) -> None:
    assert max(relative_errors(90.0 - off)) <= 5e-16


@given(st.floats(0.0, 90.0, allow_subnormal=False).filter(lambda degrees: degrees == 0.0 or degrees > 1e-300))
@settings(max_examples=300, deadline=None)
def test_sine_and_cosine_to_the_last_bits(degrees: float) -> None:
    # 90 has no exact cosine but zero, which is what is wanted
    if degrees < 90.0:
        assert max(relative_errors(degrees)) <= 5e-16


def test_radians_are_numpys() -> None:
    gamma = np.array([0.1, 0.8, 1.5])
    sine, cosine = sincos(gamma)
    assert (sine == np.sin(gamma)).all()
    assert (cosine == np.cos(gamma)).all()
    one = rebound(np.radians(35.0), 0.1, 0.2, e_n=0.9, e_t=-0.9, mu=0.1)
    two = rebound(35.0, 0.1, 0.2, e_n=0.9, e_t=-0.9, mu=0.1, degrees=True)
    assert float(one.v_x) == pytest.approx(float(two.v_x), rel=1e-14)


FIELDS = ("v_x", "v_y", "v_n", "spin_x", "spin_y", "sticking", "impulse_factor")
PROPERTIES = [
    *("contact_x", "contact_y"),
    *("beta", "beta_cm", "beta_tot", "mu_app", "mu_app_magnitude", "delta", "lambda_"),
    *("tan_psi_after", "tan_psi_out", "psi_after", "psi_out", "energy_change"),
]


def test_scalars_in_scalars_out() -> None:
    r = rebound(10.0, e_n=0.9, e_t=-0.9, mu=0.1, degrees=True)
    for name in (*FIELDS, *PROPERTIES):
        assert np.ndim(getattr(r, name)) == 0, name
    assert f"{r.beta:.3f}" == "0.500"
    assert bool(r.sticking)


@pytest.mark.parametrize(
    ("gamma", "spin_y", "mu", "shape"),
    [
        (np.zeros(3), 0.1, 0.1, (3,)),
        (np.full((3, 1), 20.0), np.zeros(4), 0.1, (3, 4)),
        (20.0, 0.1, np.full((2, 5), 0.1), (2, 5)),
        (np.full((2, 1, 1), 20.0), np.zeros((3, 1)), np.full(4, 0.1), (2, 3, 4)),
        (np.zeros(0), 0.1, 0.1, (0,)),
        ([10.0, 20.0], (0.1, 0.2), [0.1, 0.2], (2,)),
    ],
)
def test_shapes_broadcast(gamma: Any, spin_y: Any, mu: Any, shape: tuple[int, ...]) -> None:
    r = rebound(gamma, 0.1, spin_y, e_n=0.9, e_t=-0.9, mu=mu, degrees=True)
    for name in (*FIELDS, *PROPERTIES):
        assert np.shape(getattr(r, name)) == shape, name
    for observable in OBSERVABLES.values():
        assert np.shape(observable.value(r, np.asarray(mu, dtype=float))) == shape, observable.name


def test_broadcasting_gives_what_single_calls_give() -> None:
    gamma, spin = np.array([5.0, 40.0, 90.0]), np.array([-0.9, 0.0, 0.4, 1e6])
    e_t = np.array([-1.0, -0.8, -0.6, -0.4])
    many = rebound(gamma[:, None], 0.1, spin, e_n=0.9, e_t=e_t, mu=0.2, degrees=True)
    for i, j in np.ndindex(3, 4):
        one = rebound(gamma[i], 0.1, spin[j], e_n=0.9, e_t=e_t[j], mu=0.2, degrees=True)
        for name in FIELDS:
            assert getattr(many, name)[i, j] == getattr(one, name)


def test_shapes_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ValueError, match="shape"):
        rebound(np.zeros(3), np.zeros(4), e_n=0.9, e_t=-0.9, mu=0.1)


def arrays_of(part: Any) -> dict[str, NDArray[Any]]:
    values = {field.name: getattr(part, field.name) for field in dataclasses.fields(part)}
    return {name: value for name, value in values.items() if isinstance(value, np.ndarray)}


def test_results_are_read_only_copies_and_inputs_are_left_alone() -> None:
    gamma, spin = np.array([10.0, 60.0]), np.array([0.1, 0.2])
    r = rebound(gamma, spin, 0.2, e_n=0.9, e_t=-0.9, mu=0.1, degrees=True)
    held, before = arrays_of(r) | arrays_of(r.incidence), r.mu_app_magnitude.copy()
    assert set(FIELDS) < set(held)
    assert not any(value.flags.writeable for value in held.values())
    gamma[0], spin[:] = 11.0, 5.0  # the caller's own can still be written to
    assert (r.mu_app_magnitude == before).all()
    with pytest.raises(dataclasses.FrozenInstanceError):
        r.v_x = r.v_y  # type: ignore[misc]


@pytest.mark.parametrize(
    ("gamma", "spin_x", "spin_y", "e_n", "undefined"),
    [
        (0.0, 0.0, 0.0, 0.9, {"beta", "beta_cm", "lambda_"}),
        (0.0, 0.0, 0.3, 0.9, {"beta_cm"}),
        (30.0, 0.0, -0.5, 0.9, {"beta"}),
        (90.0, 0.0, 0.0, 0.9, {"mu_app", "mu_app_magnitude", "tan_psi_after", "tan_psi_out"}),
        (90.0, 0.0, -1.0, 0.9, {"beta", "mu_app", "mu_app_magnitude", "tan_psi_after", "tan_psi_out"}),
        (30.0, 0.1, 0.2, 0.0, {"tan_psi_out"}),
        (30.0, 0.1, 0.2, 0.9, set()),
    ],
)
def test_undefined_values_are_nan_and_nothing_else_is(
    gamma: float, spin_x: float, spin_y: float, e_n: float, undefined: set[str]
) -> None:
    r = rebound(gamma, spin_x, spin_y, e_n=e_n, e_t=-0.9, mu=0.1, degrees=True)
    found = {name for name in (*FIELDS, *PROPERTIES) if not math.isfinite(float(getattr(r, name)))}
    if gamma == 90.0 and spin_y == -1.0:
        # nothing moves at the contact and nothing leaves the wall: its angle has no direction
        undefined = undefined | {"psi_after", "psi_out"}
    assert found == undefined
    assert all(math.isnan(float(getattr(r, name))) for name in found)


def test_slip_ratio_is_zero_without_slip_and_infinite_at_grazing_incidence() -> None:
    r = rebound([90.0, 90.0, 30.0], 0.0, [-1.0, 0.0, -0.5], e_n=0.9, e_t=-0.9, mu=0.1, degrees=True)
    assert r.incidence.tau.tolist() == [0.0, math.inf, 0.0]
    assert r.sticking.tolist() == [True, False, True]


def test_angles_stay_defined_where_their_tangents_are_not() -> None:
    dead = rebound(30.0, 0.1, 0.2, e_n=0.0, e_t=-0.9, mu=0.1, degrees=True)
    assert math.degrees(dead.delta) == 90.0
    sideways = rebound(0.0, 0.3, 0.0, e_n=0.9, e_t=-0.9, mu=0.1, degrees=True)
    assert math.degrees(sideways.lambda_) == -90.0
    assert math.degrees(rebound(90.0, e_n=0.9, e_t=-0.9, mu=0.1, degrees=True).psi_after) == 90.0


@pytest.mark.parametrize("law", CONSTANTS)
def test_no_warnings_at_the_edges(law: str) -> None:
    """Warnings are errors in this suite; every combination of extreme values passes without one."""
    gamma = np.array([0.0, 1e-300, 30.0, 90.0 - 1e-13, 90.0])[:, None, None, None]
    spin = np.array([0.0, -0.5, -1.0, 1e-320, 1e15])
    mu = np.array([0.0, 1e-300, 0.1, 1e6, 1e300])[:, None]
    e_n = np.array([0.0, 1e-300, 1.0])[:, None, None]
    r = rebound(gamma, -spin, spin, e_n=e_n, mu=mu, closure=law, degrees=True, **CONSTANTS[law])
    for name in FIELDS:
        assert np.isfinite(getattr(r, name)).all(), name
    for observable in OBSERVABLES.values():
        value = observable.value(r, np.broadcast_to(mu, r.v_x.shape))
        assert value.shape == r.v_x.shape, observable.name
    for name in PROPERTIES:
        assert getattr(r, name).shape == r.v_x.shape
