"""Readings that are left out, as their impact counts already, are held against those that are used."""

from __future__ import annotations

import numpy as np
import pytest
from factories import each_once, rest_long

from ifrfit import fit
from ifrfit.inference.diagnostics.left_out_readings import impulse_factor
from ifrfit.physics import OBSERVABLES
from ifrfit.physics.angles import Incidence
from ifrfit.physics.closures import get_closure
from ifrfit.physics.rebound import rebound_of

N = 40
SETS = {
    "spin, beta": ("beta", "e_n", "spin_y_after"),
    "velocities, beta": ("v_x", "v_n", "spin_y_after", "beta", "beta_cm"),
    "centre, beta": ("beta_cm", "e_n", "beta"),
    "spin, tan psi": ("spin_y_after", "tan_psi_after", "e_n"),
    "beta, delta": ("beta", "delta_deg", "e_n"),
    "psi, delta": ("psi_after_deg", "delta_deg", "e_n"),
    "many": ("beta_cm", "spin_y_after", "beta", "e_n", "delta_deg", "mu_app"),
}


def columns(seed, names, *, n=N, noise=0.02, of=0.4, spin=0.0, **moved):
    """A table of impacts of a body of inertia factor `of`, observables moved or as they are."""
    rng = np.random.default_rng([seed, 91])
    gamma = rng.uniform(8.0, 80.0, n)
    incidence = Incidence.of(gamma, 0.0, spin, degrees=True)
    state = rebound_of(incidence, get_closure("ifr"), 0.85, -0.75, 0.15, of)
    table = {"gamma_deg": gamma} | ({"spin_y": np.full(n, spin)} if spin else {})
    for name in names:
        unit = np.degrees(1.0) if name.endswith("_deg") else 1.0
        value = OBSERVABLES[name].value(state, np.full(n, 0.15)) + unit * noise * rng.standard_normal(n)
        table[name] = moved[name](value) if name in moved else value
    return table


def fact(table, **options):
    return fit(table, method="lsq", **options).facts.get("left_out_readings")


@pytest.mark.parametrize("seed", rest_long(range(10)))
def test_a_hollow_ball_taken_for_a_solid_one(seed):
    """Spins and e_n fit one another at any inertia factor: beta, which is left out, tells it."""
    table = columns(seed, SETS["spin, beta"], of=2 / 3)
    found = fit(table, method="lsq")
    assert not found.facts["left_out_readings"].ok
    says = found.facts["left_out_readings"].says
    assert says.startswith("beta, left out, contradicts spin_y_after of the same impacts, which is used")
    assert "(--inertia-factor 0.667, thin hollow ball)" in says
    # beta = (1 + J) dspin/slip - 1, so that spins (1 + 2/3)/(1 + 0.4) times as large close as well
    assert "spins after impact 1.1" in says or "spins after impact 1.2" in says
    assert "left_out_readings" not in fit(table, method="lsq", inertia_factor=2 / 3).facts


@pytest.mark.parametrize(
    ("kind", "moved", "words"),
    [
        ("spin, beta", {"spin_y_after": lambda x: -x}, "spins after impact of the other sign"),
        ("spin, beta", {"beta": lambda x: -x}, "beta of the other sign"),
        ("spin, beta", {"spin_y_after": lambda x: 2.0 * x}, "times as large"),
        ("spin, tan psi", {"tan_psi_after": lambda x: -x}, "tan_psi_after of the other sign"),
        ("beta, delta", {"delta_deg": lambda x: np.minimum(90.0 - x, 90.0)}, "delta_deg from the wall"),
        ("psi, delta", {"delta_deg": lambda x: -x}, "delta_deg of the other sign"),
        ("velocities, beta", {"beta": lambda x: 100.0 * x}, "beta in percent"),
        ("velocities, beta", {"beta": lambda x: -x}, "beta of the other sign"),
    ],
)
@pytest.mark.parametrize("spin", [0.0, 0.3])
@pytest.mark.parametrize("seed", rest_long(range(5)))
def test_a_slip_of_one_column_is_named(seed, spin, kind, moved, words):
    found = fact(columns(seed, SETS[kind], spin=spin, **moved))
    assert found is not None
    assert words in found.says


@pytest.mark.parametrize(("kind", "of"), each_once(SETS, [0.4, 2 / 3]))
@pytest.mark.parametrize(("noise", "n"), each_once([0.005, 0.05], [8, N]))
@pytest.mark.parametrize("seed", rest_long(range(10)))
def test_columns_that_agree_are_not_named(seed, n, noise, of, kind):
    """Control, with spin before in every second table."""
    spin = 0.3 * (seed % 2)
    assert fact(columns(seed, SETS[kind], n=n, noise=noise, of=of, spin=spin), inertia_factor=of) is None


@pytest.mark.parametrize("name", [o for o in OBSERVABLES if "Ty" not in OBSERVABLES[o].takes])
def test_the_impulse_factor_of_a_value_is_that_of_the_impact(name):
    """Known answer: the law's own k, for every observable that tells one."""
    observable = OBSERVABLES[name]
    incidence = Incidence.of(np.linspace(5.0, 80.0, 16), 0.0, 0.2, degrees=True)
    state = rebound_of(incidence, get_closure("fr"), 0.9, 0.4, 0.1, 0.4)
    value = np.asarray(observable.value(state, np.full(16, 0.1)))
    k = impulse_factor(observable, incidence, value, np.full(16, 0.9), 0.4)
    if observable.kind not in ("tangential", "curved") or name == "spin_x_after":
        assert np.isnan(k).all()
    else:
        assert k == pytest.approx(state.impulse_factor, abs=1e-9)
