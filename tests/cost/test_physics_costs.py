"""Work and precision of the contact laws: the order of the errors, not the seconds."""

from __future__ import annotations

import numpy as np
import pytest
from factories import BILINEAR, own_constant

from ifrfit.cost import physics_costs as physics
from ifrfit.cost.physics_costs import Scene, closest, physics_costs, scaling_doubt
from ifrfit.errors import UsageError
from ifrfit.physics import get_closure, rebound
from ifrfit.physics.angles import Incidence
from ifrfit.physics.compliance import chi_of, rebound_ratio

CHI = float(chi_of(0.3))
CALL = {"spin_y": 0.0, "e_n": 0.95, "mu": 0.12, "chi": CHI}
GAMMA = np.linspace(1.0, 85.0, 25)


@pytest.fixture(scope="module")
def costs():
    return physics_costs(gamma_deg=GAMMA, **CALL, given={"ifr": -0.93}, quick=True)


def error(costs, method, setting=""):
    return {cost.error for cost in costs if cost.method == method and cost.setting.startswith(setting)}.pop()


def test_the_finer_the_nearer(costs):
    memory = [error(costs, "memory function", f"{steps} steps") for steps in physics.QUICK.memory]
    assert memory == sorted(memory, reverse=True)
    assert memory[0] < 1e-2
    assert memory[-1] < 2e-5
    coarse, fine = (error(costs, "annuli", f"{annuli} annuli") for annuli in physics.QUICK.annuli)
    assert fine < 0.6 * coarse
    assert error(costs, "table") < 2e-3


def test_constant_coefficients_are_far_off_near_the_normal(costs):
    for title in ("F", "FR", "IFR", "IFR-contact"):
        assert error(costs, f"closure {title}") > 0.2
    oblique = physics_costs(gamma_deg=[60.0, 70.0, 80.0], **CALL, quick=True)
    assert error(oblique, "closure F") < 1e-6  # gross slip: Coulomb's friction and nothing else
    assert error(oblique, "Stronge's model") < 1e-6


def test_the_reference_states_its_own_error(costs):
    reference = costs[-1]
    assert reference.setting == "16000 steps: the reference"
    assert 0.0 < reference.error < 1e-6
    assert reference.error == min(cost.error for cost in costs)
    scene = Scene.of(GAMMA, **CALL)
    finer, _ = scene.reference(64_000)
    moved = float(np.abs(scene.solved("memory", 16_000) - finer).max())
    assert moved == pytest.approx(reference.error, rel=0.5)


def test_what_is_stated_of_each(costs):
    assert {cost.kind for cost in costs} == {"physics"}
    assert {(cost.quantity, cost.error_unit) for cost in costs} == {("beta", "1")}
    assert all(cost.time.low > 0.0 for cost in costs)
    settings = [cost.setting for cost in costs]
    assert "e_t = -0.93, mu = 0.12, given; numpy" in settings
    assert any(setting.startswith("beta0 = ") and "closest" in setting for setting in settings)
    pairs = [(cost.method, cost.setting) for cost in costs]
    assert len(set(pairs)) == len(pairs)


def test_given_constants_are_the_ones_that_are_judged(costs):
    psi1 = Scene.of(GAMMA, **CALL).psi1
    exact = -rebound_ratio(psi1, CHI, e_n=0.95, method="memory", steps=16_000) / psi1
    ours = rebound(GAMMA, e_n=0.95, e_t=-0.93, mu=0.12, degrees=True).beta
    assert error(costs, "closure IFR") == pytest.approx(np.abs(ours - exact).max(), abs=1e-9)


@pytest.mark.parametrize("name", BILINEAR)
def test_the_closest_constants_are_those_behind_a_beta(name):
    closure, own = get_closure(name), own_constant(name, 0.65)
    incidence = Incidence.of(GAMMA, 0.0, 0.1, degrees=True)
    beta = rebound(GAMMA, 0.0, 0.1, e_n=0.9, mu=0.2, closure=name, degrees=True, **own).beta
    own_found, mu_found = closest(closure, incidence, beta, 0.9)
    assert mu_found == pytest.approx(0.2, abs=1e-9)
    assert own_found == pytest.approx(next(iter(own.values()), 0.0), abs=1e-9)


def test_closest_means_closer_than_the_given_ones(costs):
    scene = Scene.of(GAMMA, **CALL)
    exact = scene.solved("memory")

    def squares(e_t, mu):
        return float(((rebound(GAMMA, e_n=0.95, e_t=e_t, mu=mu, degrees=True).beta - exact) ** 2).sum())

    e_t, mu = closest(get_closure("ifr"), scene.incidence, exact, 0.95)
    assert squares(e_t, mu) < min(squares(-0.93, 0.12), squares(e_t, 1.02 * mu))


def test_the_scaling_has_a_doubt_of_its_own():
    assert scaling_doubt(gamma_deg=GAMMA, **CALL | {"e_n": 1.0}) == 0.0
    some, more = (scaling_doubt(gamma_deg=GAMMA, **CALL | {"e_n": e_n}) for e_n in (0.95, 0.8))
    assert 0.02 < some < more


def test_impacts_are_thinned_and_those_without_beta_left_out():
    many = np.concatenate([np.linspace(0.0, 90.0, 500)] * 2)
    scene = Scene.of(many, **CALL)
    assert scene.psi1.size == physics.MOST_IMPACTS
    assert (np.diff(scene.psi1) > 0.0).all()
    assert np.isfinite(scene.psi1).all()
    tau = np.tan(np.radians(np.linspace(0.0, 90.0, 500)[[1, -2]]))
    np.testing.assert_allclose(scene.incidence.tau[[0, -1]], tau, rtol=1e-9)


@pytest.fixture
def brief(monkeypatch):
    """What is tried, and not how exact it is."""
    monkeypatch.setattr(physics, "QUICK", physics.Extent((50, 200), (10,), 2000, 1, 0.0))


@pytest.mark.usefixtures("brief")
def test_near_the_normal_alone_friction_is_not_needed():
    costs = physics_costs(gamma_deg=[1.0, 2.0], **CALL, quick=True)
    assert np.isfinite([cost.error for cost in costs]).all()


@pytest.mark.usefixtures("brief")
def test_beyond_the_table_there_is_none():
    costs = physics_costs(gamma_deg=[5.0, 30.0], **CALL | {"chi": 3.5}, quick=True)
    assert "table" not in {cost.method for cost in costs}


@pytest.mark.usefixtures("brief")
def test_without_numba(monkeypatch):
    monkeypatch.setattr(physics, "available", lambda: False)
    plain = physics_costs(gamma_deg=[5.0, 40.0], **CALL, quick=True)
    assert not any("compiled" in cost.setting for cost in plain)
    assert "200 steps; plain Python" in {cost.setting for cost in plain}


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"gamma_deg": 0.0}, "No impact has both slip and approach"),
        ({"gamma_deg": 90.0}, "No impact has both slip and approach"),
        ({"mu": 0.0}, "mu = 0, chi = "),
        ({"e_n": 1.2}, "e_n must lie in 0 to 1"),
        ({"chi": float("nan")}, "chi = nan"),
    ],
)
def test_refusals(changes, says):
    with pytest.raises(UsageError, match=says):
        physics_costs(**{"gamma_deg": 10.0} | CALL | changes, quick=True)
