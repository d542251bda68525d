"""What each effect of a scene changes and costs: what is held against what, not the seconds."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from ifrfit.cost import effect_costs as effects
from ifrfit.cost.effect_costs import effect_costs
from ifrfit.physics.effects import compose
from ifrfit.simulation.simulate import simulate

SCENES = Path(__file__).parents[2] / "docs" / "scenes"


def measured(scene, **changes):
    found = simulate(scene, **changes)
    return found, effect_costs(found.contact, found.impacts, found.plan, quick=True)


@pytest.fixture(scope="module")
def kharaz():
    return measured(SCENES / "kharaz.toml")


def test_a_cost_for_every_effect_that_can_be_computed(kharaz):
    found, costs = kharaz
    lines = {line.effect: line for line in found.plan.lines if line.criterion is not None}
    assert [cost.method for cost in costs.costs] == list(lines)
    for cost in costs.costs:
        line = lines[cost.method]
        assert (cost.kind, cost.setting, cost.quantity) == ("physics", line.state, line.observable)
        assert cost.error_unit == ("rad" if line.observable == "delta_deg" else "1")
        assert 0.0 <= cost.time.low <= cost.time.median <= cost.time.high
        if cost.method != "plasticity":
            assert cost.error == line.change
    assert costs.plain.median > 0.0
    assert costs.planned.median > 0.0


def test_a_law_that_only_stands_by_changes_nothing_to_speak_of(kharaz):
    """The sphere of this scene does not yield, so plasticity has nothing against the e_n that is given."""
    _, costs = kharaz
    plasticity = next(cost for cost in costs.costs if cost.method == "plasticity")
    assert plasticity.setting == "constant"
    assert math.isnan(plasticity.error)


def test_the_effect_is_the_only_difference(monkeypatch):
    pairs = []

    def compared(less, more, number, repeats):
        composed.clear()
        for call in (less, more):
            call()
        pairs.append(tuple(composed))
        return effects.Timing(1.0, 1.0, 1.0, repeats)

    composed = []

    def watched(contact, impacts, on):
        composed.append(set(on))
        return compose(contact, impacts, on)

    monkeypatch.setattr(effects, "_added", compared)
    monkeypatch.setattr(effects, "compose", watched)
    found, costs = measured(SCENES / "dust.toml")
    assert found.plan.on == ("plasticity",)
    assert [cost.method for cost in costs.costs] == [
        "lateral-spin",
        "plasticity",
        "adhesion",
        "compliance",
        "fluid",
    ]
    assert pairs == [
        ({"plasticity"}, {"plasticity", "lateral-spin"}),
        (set(), {"plasticity"}),
        ({"plasticity"}, {"plasticity", "adhesion"}),
        ({"plasticity"}, {"plasticity", "compliance"}),
        ({"plasticity"}, {"plasticity", "fluid"}),
        (set(),),  # the closure alone, and as planned
        ({"plasticity"},),
    ]


def test_without_the_closures_constant_compliance_has_nothing_to_compare_with(tmp_path):
    text = (SCENES / "kharaz.toml").read_text(encoding="utf-8")
    kept = [line for line in text.splitlines() if not line.startswith("e_t")]
    (tmp_path / "scene.toml").write_text("\n".join(kept), encoding="utf-8")
    found, costs = measured(tmp_path / "scene.toml")
    assert "compliance" in found.plan.on
    compliance = next(cost for cost in costs.costs if cost.method == "compliance")
    assert math.isnan(compliance.error)


@pytest.mark.parametrize(("samples", "call"), [(1, 10_000), (800, 13_600)])
def test_impacts_of_a_call(samples, call):
    _, costs = measured(SCENES / "wet-bead.toml", samples=samples)
    assert costs.impacts == call


def test_very_many_impacts_are_thinned(monkeypatch):
    monkeypatch.setattr(effects, "MOST", 12_000)
    _, costs = measured(SCENES / "wet-bead.toml", samples=800)
    assert costs.impacts == 12_000


def test_a_difference_lost_in_the_noise_is_no_gain():
    timing = effects._timing([-3.0, -1.0, 2.0])
    assert (timing.low, timing.median, timing.high) == (0.0, 0.0, 2.0)
