"""The plan: what is kept, what is dropped, what is only warned of."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import pytest
from factories import BILINEAR, own_constant
from hypothesis import given, settings
from hypothesis import strategies as st

from ifrfit.errors import DataError
from ifrfit.physics.effects import EFFECTS, ORDER, Contact, Fluid, compose, make_plan
from ifrfit.physics.effects.contact import ContactNumber
from ifrfit.physics.effects.plan import differences, pilot_rows
from ifrfit.physics.effects.rolling import Rolling
from ifrfit.registry import registered

OBSERVABLES = ("e_n", "beta", "delta_deg", "lambda_deg", "beta_tot", "spin_y_after")
GIVEN = {"e_n": "constants.e_n", "tangential": "constants.e_t"}


def line(plan, name):
    return next(line for line in plan.lines if line.effect == name)


def test_the_registry_is_in_the_order_of_composition():
    stages = [ORDER.index(effect.stage) for effect in EFFECTS.values()]
    assert stages == sorted(stages)
    for name, effect in EFFECTS.items():
        assert effect.name == name
        assert effect.source
        assert effect.cost_ns > 0.0


def test_one_line_for_every_effect_with_number_threshold_and_change(impacts, glass):
    plan = make_plan(glass, impacts([10.0, 50.0]), OBSERVABLES, accuracy=1e-3, given=GIVEN)
    assert [found.effect for found in plan.lines] == list(EFFECTS)
    for found in plan.lines:
        assert (found.criterion is None) == (found.state == "unknown"), found
        assert (found.change is None) == (found.state == "unknown"), found
        assert found.reason or found.state in ("on", "off"), found


sizes = st.floats(1e-9, 1.0)
speeds = st.floats(1e-9, 1e5)


@st.composite
def scenes(draw):
    """Contacts of every kind, soft to hard, sticky to clean, in a liquid or not."""
    contact = Contact(
        density=draw(st.floats(100.0, 2e4)),
        modulus=draw(st.floats(1e6, 1e12)),
        fluid=draw(st.one_of(st.none(), st.just(Fluid("oil", 0.1)), st.just(Fluid("air", 1.81e-5, 66e-9)))),
    ).with_numbers(
        limiting_pressure=draw(st.one_of(st.none(), st.floats(1e5, 1e11))),
        interface_energy=draw(st.one_of(st.none(), st.floats(0.0, 10.0))),
        rolling_friction=draw(st.one_of(st.none(), st.floats(0.0, 0.1))),
    )
    law = draw(st.sampled_from(BILINEAR))
    numbers = {
        "speed": draw(speeds),
        "radius": draw(sizes),
        "e_n": draw(st.floats(0.0, 1.0)),
        "mu": draw(st.floats(0.0, 2.0)),
        "closure": law,
        "constant": next(iter(own_constant(law).values()), 0.0),
    }
    gammas = [0.0, *sorted(draw(st.lists(st.floats(0.0, 90.0), min_size=1, max_size=6)))]
    spins = draw(st.tuples(st.sampled_from([0.0, 0.3]), st.sampled_from([0.0, -0.5])))
    return contact, (gammas, *spins), numbers


@given(scenes(), st.sampled_from([1e-2, 1e-3, 1e-6]), st.booleans())
@settings(max_examples=80, deadline=None)
def test_everything_dropped_together_changes_less_than_the_accuracy(impacts, scene, accuracy, computes_e_n):
    contact, where, numbers = scene
    known = {"tangential": "constants.e_t"}
    if not (computes_e_n and "limiting_pressure" in contact.numbers):
        known["e_n"] = "constants.e_n"
    some = impacts(*where, **numbers)
    plan = make_plan(contact, some, OBSERVABLES, accuracy=accuracy, given=known)
    forced = [found.effect for found in plan.lines if found.state in ("on", "off")]
    change = differences(
        compose(contact, some, forced), compose(contact, some, plan.on), some.mu, OBSERVABLES
    )
    assert max(change.values()) <= accuracy
    assert max(change.values()) == plan.dropped
    for found in plan.lines:
        if found.state == "off" and found.change is not None:
            assert found.change <= accuracy or found.alarm


@given(scenes(), st.lists(st.sampled_from(list(EFFECTS)), unique=True))
@settings(max_examples=80, deadline=None)
def test_energy_never_grows_whatever_acts(impacts, scene, on):
    contact, where, numbers = scene
    some = impacts(*where, **numbers)
    on = [name for name in on if not EFFECTS[name].lacks(contact, some) and name != "compliance"]
    out = compose(contact, some, on)
    slip = float(np.max(some.incidence.slip))
    assert (out.energy_change <= 1e-14 * (1.0 + slip**2)).all()
    assert ((out.e_n >= 0.0) & (out.e_n <= 1.0)).all()
    for name in ("v_x", "v_y", "v_n", "spin_x", "spin_y"):
        assert np.isfinite(getattr(out, name)).all(), name


@pytest.mark.parametrize("name", EFFECTS)
def test_energy_does_not_grow_at_the_ends_of_an_effects_numbers(impacts, glass, name):
    numbers = EFFECTS[name].numbers
    some = impacts([0.0, 10.0, 50.0, 85.0], 0.2, -0.3, e_n=1.0)
    for ends in product(*((number.low, number.high) for number in numbers)):
        given = {number.name: end for number, end in zip(numbers, ends, strict=True)}
        contact = glass.with_numbers(**given)
        assert not EFFECTS[name].lacks(contact, some)
        gain = float(compose(contact, some, [name]).energy_change.max())
        assert gain <= 1e-14, f"{name} at {given}: the energy grows by up to {gain:.3g} of m u^2/2"


@dataclass(frozen=True)
class Twist(Rolling):
    """Made up: changes velocities along the wall and spins, and nothing that follows from them."""

    name: str = "twist"
    numbers: tuple[ContactNumber, ...] = ()

    def lacks(self, contact, impacts):
        return ""

    def apply(self, contact, impacts, bounce):
        out = bounce.done
        changed = {name: 0.9 * getattr(out, name) for name in ("v_x", "v_y", "v_n", "e_n")}
        return replace(
            bounce, outcome=replace(out, **changed, spin_x=0.5 * out.spin_x, spin_y=0.2 * out.spin_y)
        )


@pytest.mark.parametrize("name", [*EFFECTS, "twist"])
def test_contact_beta_friction_and_energy_follow_from_velocities_and_spins(impacts, glass, name):
    some = impacts([0.0, 10.0, 50.0, 85.0, 90.0], 0.2, -0.3)
    with registered(Twist()):
        own = {number.name: 0.5 * (number.low + number.high) for number in EFFECTS[name].numbers}
        contact = glass.with_numbers(**{**own, **glass.numbers})
        out = compose(contact, some, dict.fromkeys(("lateral-spin", name)))
    before, j = some.incidence, glass.inertia_factor
    exact = {"rtol": 0.0, "atol": 1e-14}
    x, y = out.v_x + out.spin_y, out.v_y + out.spin_x
    np.testing.assert_allclose(out.contact_x, x, **exact)
    np.testing.assert_allclose(out.contact_y, y, **exact)
    np.testing.assert_allclose(out.beta, -(x * before.slip_x + y * before.slip_y) / before.slip**2, **exact)
    np.testing.assert_allclose(out.v_n, out.e_n * before.cosine, **exact)
    pressed = (1.0 + out.e_n) * before.cosine
    pushed = before.sine - out.v_x, out.v_y
    np.testing.assert_allclose(out.mu_app[:-1] * pressed[:-1], pushed[0][:-1], **exact)
    np.testing.assert_allclose(out.mu_app_magnitude[:-1] * pressed[:-1], np.hypot(*pushed)[:-1], **exact)
    after = out.v_x**2 + out.v_y**2 + out.v_n**2 + j * (out.spin_x**2 + out.spin_y**2)
    change = after - 1.0 - j * (before.spin_x**2 + before.spin_y**2)
    np.testing.assert_allclose(out.energy_change, change, **exact)


def test_energy_grows_where_a_constant_is_not_passive(impacts):
    """Control: the property above can fail."""
    assert compose(Contact(), impacts([60.0], constant=0.0, mu=1.0), []).energy_change[0] > 0.0


def test_a_given_constant_is_never_replaced_but_the_plan_warns(impacts, glass):
    fast = impacts([10.0, 40.0], speed=100.0)
    plan = make_plan(glass, fast, OBSERVABLES, accuracy=1e-3, given=GIVEN)
    found = line(plan, "plasticity")
    assert found.state == "constant"
    assert found.alarm
    assert found.reason == "constants.e_n is given and stays; remove constants.e_n to compute it"
    slow = impacts([10.0, 40.0], speed=0.1)
    calm = line(make_plan(glass, slow, OBSERVABLES, accuracy=1e-3, given=GIVEN), "plasticity")
    assert calm.state == "constant"
    assert not calm.alarm


def test_without_e_n_the_law_that_can_is_computed(impacts, glass):
    elastic = glass.with_numbers(dissipation_time=None)
    known = {"tangential": "constants.e_t"}
    plan = make_plan(elastic, impacts([10.0], speed=100.0, e_n=1.0), OBSERVABLES, accuracy=1e-3, given=known)
    assert "plasticity" in plan.on
    with pytest.raises(DataError, match="viscoelastic or plasticity, and their losses"):
        make_plan(glass, impacts(), OBSERVABLES, accuracy=1e-3, given=known)
    with pytest.raises(DataError, match=r"constants\.e_n is missing, and nothing computes it"):
        make_plan(Contact(), impacts(), OBSERVABLES, accuracy=1e-3, given=known)
    chosen = make_plan(glass, impacts(), OBSERVABLES, accuracy=1e-3, given=known, requested=("viscoelastic",))
    assert chosen.on == ("viscoelastic",)
    assert line(chosen, "plasticity").reason == "not listed"


def test_a_list_is_computed_as_it_is(impacts, glass):
    some = impacts([10.0, 40.0], speed=0.5, radius=1e-5)
    plan = make_plan(glass, some, OBSERVABLES, accuracy=1e-3, given=GIVEN, requested=("rolling",))
    assert plan.on == ("rolling",)
    adhesion = line(plan, "adhesion")
    assert adhesion.state == "off"
    assert adhesion.alarm
    nothing = make_plan(glass, some, OBSERVABLES, accuracy=1e-3, given=GIVEN, requested=())
    assert nothing.on == ()


def test_lateral_spin_is_no_choice(impacts, glass):
    plan = make_plan(glass, impacts([10.0], 1e-9), OBSERVABLES, accuracy=1e-3, given=GIVEN, requested=())
    assert plan.on == ("lateral-spin",)


def test_a_list_that_cannot_be_is_refused(impacts, glass):
    """As the hard cases of scenes, which go through the command, and one more."""
    shell = replace(glass, inertia_factor=0.6667)
    with pytest.raises(DataError, match="but not a homogeneous sphere") as caught:
        make_plan(shell, impacts(), OBSERVABLES, accuracy=1e-3, given=GIVEN, requested=("adhesion",))
    assert caught.value.exit_status == 3


def test_a_gas_is_refused_where_it_matters_and_passed_over_where_not(impacts, glass):
    air = replace(glass, fluid=Fluid("air", 1.81e-5, 66e-9)).with_numbers(
        interface_energy=None, rolling_friction=None
    )
    small = make_plan(air, impacts([20.0], radius=2.5e-6), OBSERVABLES, accuracy=1e-3, given=GIVEN)
    assert line(small, "fluid").state == "refused"
    assert line(small, "fluid").alarm
    large = make_plan(air, impacts([20.0], radius=0.1, speed=2.0), OBSERVABLES, accuracy=1e-3, given=GIVEN)
    assert line(large, "fluid").state == "off"
    assert 0.0 < line(large, "fluid").change < 1e-3
    assert large.dropped == line(large, "fluid").change


def test_small_effects_are_kept_where_they_add_up(impacts, glass):
    """Two effects of 0.7 of the accuracy each: one of them has to stay."""
    quiet = replace(glass, fluid=Fluid("thin", 1e-6)).with_numbers(
        limiting_pressure=None, dissipation_time=None
    )
    some = impacts([20.0], radius=1e-4, speed=1.0, e_n=1.0)
    apart = make_plan(quiet, some, ("e_n", "spin_y_after"), accuracy=1e-9, given=GIVEN)
    changes = {name: line(apart, name).change for name in ("adhesion", "fluid")}
    largest, total = max(changes.values()), sum(changes.values())
    accuracy = 0.5 * (largest + total)
    plan = make_plan(
        quiet.with_numbers(rolling_friction=None), some, ("e_n",), accuracy=accuracy, given=GIVEN
    )
    kept = [found for found in plan.lines if found.state == "on"]
    assert len(kept) == 1
    assert kept[0].reason == "small, but with the dropped ones too much"


def test_the_pilot_holds_the_extreme_impacts(impacts):
    rng = np.random.default_rng(0)
    n = 20_000
    some = impacts(rng.uniform(0, 90, n), rng.normal(0, 1, n), speed=rng.lognormal(0, 1, n), radius=1e-3)
    rows = pilot_rows(some)
    assert rows.size < 500
    pilot = some.take(rows)
    assert pilot.normal_speed.max() == some.normal_speed.max()
    assert pilot.normal_speed.min() == some.normal_speed.min()
    assert pilot.incidence.slip.max() == some.incidence.slip.max()
    assert pilot_rows(impacts(np.arange(10.0))).size == 10
