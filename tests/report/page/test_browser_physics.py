"""The script of the panel against the package, number by number, in a real browser."""

from __future__ import annotations

import numpy as np
import pytest

from ifrfit.physics import CLOSURES, OBSERVABLES, get_closure, rebound, transition_angles, transition_tau
from ifrfit.report.page.html import physics_script

BILINEAR = [name for name, closure in CLOSURES.items() if closure.bilinear]  # what the panel knows
PANEL = [name for name, observable in OBSERVABLES.items() if observable.panel is not None]
GAMMA = (0.0, 1e-6, 12.5, 30.0, 45.0, 60.0, 77.7, 89.999999, 90.0)
SPINS = ((0.0, 0.0), (0.3, 0.0), (0.0, 0.833), (-0.2, -0.5), (0.0, -0.5))
SCALARS = ((0.94, 0.12), (0.0, 0.4), (1.0, 0.0))

# ratios over a slip or a velocity that all but cancels carry its rounding; the package's own has it too
TOLERANCE = 1e-12


@pytest.fixture(scope="module")
def script(browser):
    tab = browser.new_page()
    tab.add_script_tag(content=physics_script().replace("const ifrfit", "window.ifrfit"))
    yield tab
    tab.close()


def constants(name, inertia):
    low, high = CLOSURES[name].domain(inertia)
    return (low, 0.7 * low + 0.3 * high, high)


def lines(name, inertia):
    linear = get_closure(name).coefficients(inertia)
    return {"a": [linear.a0, linear.a1], "b": [linear.b0, linear.b1]}


@pytest.mark.parametrize("inertia", [0.4, 2.0 / 3.0])
@pytest.mark.parametrize("name", BILINEAR)
def test_every_observable_is_the_same_to_1e_12(script, name, inertia):
    constant = CLOSURES[name].constant
    cases = [
        (gamma, *spins, e_n, c, mu)
        for gamma in GAMMA
        for spins in SPINS
        for e_n, mu in SCALARS
        for c in constants(name, inertia)
    ]
    found = script.evaluate(
        """([cases, names, closure, inertia]) => cases.map(([gamma, sx, sy, en, c, mu]) =>
             names.map((name) => {
               const v = ifrfit.value(name, gamma, sx, sy, closure, en, c, mu, inertia);
               return Number.isFinite(v) ? v : null;
             }))""",
        [cases, PANEL, lines(name, inertia), inertia],
    )
    gamma, spin_x, spin_y, e_n, c, mu = (np.array(column) for column in zip(*cases, strict=True))
    extra = {constant: c} if constant else {}
    state = rebound(
        gamma, spin_x, spin_y, e_n=e_n, mu=mu, closure=name, inertia_factor=inertia, degrees=True, **extra
    )
    theirs = np.array(found, dtype=float)
    for column, observable in enumerate(PANEL):
        ours = OBSERVABLES[observable].value(state, mu)
        mine = np.where(np.isfinite(ours), ours, np.nan)
        assert np.array_equal(np.isnan(mine), np.isnan(theirs[:, column])), observable
        scale = 1.0 + np.abs(mine)
        np.testing.assert_array_less(
            np.nan_to_num(np.abs(mine - theirs[:, column]) / scale), TOLERANCE, err_msg=observable
        )


def test_transition_angles_are_the_same(script):
    cases = [
        (name, c, kappa, *spins)
        for name in BILINEAR
        for c in constants(name, 0.4)
        for kappa in (0.0, 0.02, 0.23, 0.8, 3.0)
        for spins in SPINS
    ]
    found = script.evaluate(
        """([cases, closures]) => cases.map(([name, c, kappa, sx, sy]) =>
             ifrfit.transitions(closures[name], 0, c, kappa, sx, sy))""",
        [cases, {name: lines(name, 0.4) for name in BILINEAR}],
    )
    for (name, c, kappa, spin_x, spin_y), theirs in zip(cases, found, strict=True):
        ours = transition_angles(transition_tau(get_closure(name), c, kappa), spin_x, spin_y)
        assert len(ours) == len(theirs), (name, c, kappa, spin_x, spin_y)
        np.testing.assert_allclose(theirs, ours, rtol=1e-12, atol=1e-12)


def test_a_wrong_formula_would_be_seen(script):
    """The comparison has teeth: beta of another inertia factor is off by far more than the tolerance."""
    closure = lines("ifr", 0.4)
    right, wrong = (
        script.evaluate("([c, j]) => ifrfit.value('beta', 40, 0, 0, c, 0.94, -0.9, 0.12, j)", [closure, j])
        for j in (0.4, 0.41)
    )
    assert abs(right - wrong) > 1e-3
