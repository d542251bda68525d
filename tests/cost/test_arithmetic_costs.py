"""Digits lost in single and in double precision: small where nothing cancels, large where it does."""

from __future__ import annotations

import numpy as np
import pytest
from mpmath import workdps

from ifrfit.cost import arithmetic_costs as arithmetic
from ifrfit.cost.arithmetic_costs import (
    DOUBLE,
    EXACT,
    GIVEN,
    HARD,
    READINGS,
    SINGLE,
    VELOCITIES,
    Impact,
    arithmetic_costs,
    hard_impacts,
)
from ifrfit.errors import UsageError
from ifrfit.physics import OBSERVABLES, rebound

CONSTANTS = {"e_n": 0.94, "e_t": -0.93, "mu": 0.12}
GAMMA = np.linspace(5.0, 80.0, 16)
EASY = "5 to 80 deg, spins 0.3"


@pytest.fixture(scope="module")
def costs():
    return arithmetic_costs(gamma_deg=GAMMA, spin_y=0.1, **CONSTANTS, quick=True)


@pytest.fixture(scope="module")
def error(costs):
    found = {(cost.method, cost.setting, cost.quantity): cost.error for cost in costs}
    return lambda *key: found[key]


def test_a_unit_of_the_last_place_where_nothing_cancels(error):
    for setting in (GIVEN, EASY, "at the transition"):
        for quantity in (VELOCITIES, "beta", "beta_cm", "beta_tot", "mu_app"):
            assert 1e-9 < error(SINGLE, setting, quantity) < 1e-6, (setting, quantity)
            assert error(DOUBLE, setting, quantity) < 2e-15, (setting, quantity)
        assert error(SINGLE, setting, "delta") < 1e-6


@pytest.mark.parametrize(
    ("setting", "quantity"),
    [
        ("slip cancels to 1e-6", "beta"),
        ("grazing, from 89.999 deg", "mu_app"),
        ("spins of 1e6", "beta_cm"),
    ],
)
def test_lost_where_it_cancels(error, setting, quantity):
    """Controls: a measurement that cannot see a loss would say 1e-7 here as well."""
    assert error(SINGLE, setting, quantity) > 1e-3
    assert 1e-13 < error(DOUBLE, setting, quantity) < 1e-8
    assert error(SINGLE, setting, VELOCITIES) < 1e-6  # what is computed first is still right


def test_the_loss_grows_as_the_slip_vanishes(error):
    little, much = (error(SINGLE, f"slip cancels to {x}", "beta") for x in ("1e-3", "1e-6"))
    assert 1e-6 < little < 1e-3
    assert much > 100.0 * little


def test_fifty_digits_are_fifty(costs):
    last = costs[-1]
    assert (last.method, last.setting) == (EXACT, GIVEN)
    assert 0.0 < last.error < 1e-47


def test_every_kind_of_impact_in_both_precisions(costs):
    for name in (SINGLE, DOUBLE):
        rows = [cost for cost in costs if cost.method == name]
        assert {cost.setting for cost in rows} == {GIVEN, *HARD}
        assert {cost.quantity for cost in rows} == {VELOCITIES, *READINGS}
        lateral = {cost.setting for cost in rows if cost.quantity == "lambda"}
        assert lateral == {EASY, "spins of 1e3", "spins of 1e6"}
    assert {cost.kind for cost in costs} == {"arithmetic"}
    units = {(READINGS.get(cost.quantity), cost.error_unit) for cost in costs}
    assert units == {("angle", "rad"), ("quotient", "1"), (None, "1 + |s|")}


def test_readings_are_the_observables_of_that_name():
    """Read off the state in double precision, they are those of the registry."""
    impacts = hard_impacts(EASY, 50, 0.2)
    before, after = arithmetic.computed(impacts, CONSTANTS, np.dtype(float))
    state = rebound(impacts.gamma_deg, impacts.spin_x, impacts.spin_y, **CONSTANTS, degrees=True)
    for name, (over, under) in arithmetic.sides_of(before, after).items():
        angle = READINGS[name] == "angle"
        read = np.degrees(np.arctan2(over, under)) if angle else over / under
        expected = OBSERVABLES[f"{name}_deg" if angle else name].value(state, np.asarray(CONSTANTS["mu"]))
        np.testing.assert_allclose(read, expected, rtol=1e-11, atol=1e-12, err_msg=name)


def test_a_value_that_is_lost_is_an_infinite_error():
    """A slip of 1e-9, which single precision takes for none: there is a beta, and none is found."""
    sine = np.float64(np.sin(np.radians(30.0)))
    impacts = Impact(np.array([30.0]), np.zeros(1), np.array([-sine + 1e-9]))
    with workdps(50):
        exact = arithmetic._exact(impacts, CONSTANTS)
        single, double = (
            {q: e for q, e, _ in arithmetic.errors(impacts, CONSTANTS, np.dtype(name), exact)}
            for name in (SINGLE, DOUBLE)
        )
    assert single["beta"] == np.inf
    assert double["beta"] < 1e-6
    assert single[VELOCITIES] < 1e-6


def test_an_undefined_value_has_no_error(error):
    costs = arithmetic_costs(gamma_deg=[0.0, 90.0], spin_y=0.0, **CONSTANTS, quick=True)
    found = {cost.quantity: cost.error for cost in costs if (cost.method, cost.setting) == (DOUBLE, GIVEN)}
    assert max(found.values()) < 1e-14


def test_numpy_keeps_single_precision_too(monkeypatch, error):
    monkeypatch.setattr(arithmetic, "available", lambda: False)
    impacts = hard_impacts(EASY, 40, CONSTANTS["mu"] * 1.94)
    _, after = arithmetic.computed(impacts, CONSTANTS, np.dtype(SINGLE))
    assert {x.dtype for x in after.values()} == {np.dtype(SINGLE)}
    with workdps(50):
        exact = arithmetic._exact(impacts, CONSTANTS)
        off = {q: e for q, e, _ in arithmetic.errors(impacts, CONSTANTS, np.dtype(SINGLE), exact)}
    assert off[VELOCITIES] == pytest.approx(error(SINGLE, EASY, VELOCITIES), rel=1.0)


def test_constants_must_be_numbers():
    with pytest.raises(UsageError, match="give three numbers"):
        arithmetic_costs(gamma_deg=GAMMA, spin_y=0.0, e_n=0.9, e_t=np.nan, mu=0.1)
