"""Of many rows slips are looked for by some of them, and once an impact: what is found is the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import ifrfit
from ifrfit.inference.diagnostics.omitted_effects.effect_signatures import directions
from ifrfit.inference.diagnostics.slips.nuisances import Flaw, nuisances, readings
from ifrfit.inference.diagnostics.slips.refit import spread
from ifrfit.inference.diagnostics.slips.row_slips import _IMPACTS_OF_STARTS, _spread_impacts
from ifrfit.physics import OBSERVABLES

MANY = 4500  # impacts, of which some tell from where a search begins
TRUTH = {"e_n": 0.85, "e_t": -0.75, "mu": 0.2}


def table(n, *, names=("beta", "e_n"), spin=0.0, seed=0, noise=0.02):
    """Impacts with speeds that differ."""
    rng = np.random.default_rng(seed)
    gamma, spin_y = rng.uniform(5.0, 80.0, n), spin * rng.standard_normal(n)
    state = ifrfit.rebound(gamma, 0.0, spin_y, degrees=True, **TRUTH)
    mu = np.asarray(TRUTH["mu"])
    columns = {name: OBSERVABLES[name].value(state, mu) + noise * rng.standard_normal(n) for name in names}
    return pd.DataFrame(
        {"gamma_deg": gamma, "spin_y": spin_y, "speed_m_s": rng.uniform(1.0, 5.0, n), **columns}
    )


@pytest.mark.parametrize(
    "flaw",
    [
        Flaw(offset=1.0),
        Flaw(turn=np.array([[0.5], [-1.0]])),
        Flaw(speed=0.03),
        Flaw(spin=0.1, lost=0.02),
        Flaw(gained=0.05, along=0.01),
        Flaw(offset=np.linspace(-1.0, 1.0, 120)),  # differs within an impact
    ],
    ids=("offset", "turn", "speed", "spin", "before", "by row"),
)
def test_values_of_one_impact_are_those_of_rows_one_by_one(flaw):
    problem = ifrfit.fit(table(40, names=("v_x", "v_n", "spin_y_after"), spin=0.3), method="lsq").problem
    assert problem.rows.shared_incidence is not None
    rows = np.arange(len(problem.rows))
    alone = replace(problem, rows=replace(problem.rows, impact=rows))
    assert alone.rows.shared_incidence is None
    theta = np.array([[0.8, -0.7, 0.15], [0.9, -0.6, 0.3]])
    np.testing.assert_array_equal(readings(problem, theta, flaw), readings(alone, theta, flaw))


def test_values_of_some_rows_are_those_of_all():
    found = ifrfit.fit(table(60, names=("v_x", "v_n")), method="lsq")
    problem, optimum = found.problem, found.least_squares.optimum
    sigma = np.full(len(problem.rows), 0.02)
    jacobian = problem.jacobian(optimum.theta)
    effects = directions(problem, optimum.theta, jacobian, sigma)
    some, theta = np.array([3, 17, 40, 41, 99]), np.tile(optimum.theta, (3, 1))
    asked = [each for each in (*effects, *nuisances(problem)) if each.of_rows is not None]
    assert {each.name for each in asked} >= {"rolling", "zero-along"}
    for each in asked:
        size = np.array([0.0, 0.01, 0.05])
        np.testing.assert_allclose(
            each.of_rows(some)(theta, size), each.values(theta, size)[:, some], rtol=1e-14, atol=1e-15
        )


@pytest.mark.parametrize("n", [2 * _IMPACTS_OF_STARTS - 1, MANY])
def test_some_impacts_are_whole(n):
    problem = ifrfit.fit(table(n), method="lsq").problem
    some = _spread_impacts(problem)
    if n < MANY:
        assert some is None
        return
    impacts = problem.rows.impacts[some]
    assert np.unique(impacts).size == pytest.approx(_IMPACTS_OF_STARTS, abs=5)
    assert (np.bincount(impacts)[impacts] == 2).all()


@pytest.mark.parametrize("share", [0.02, 0.3])
def test_few_and_many_rows_of_another_sign_are_named(share):
    rows = table(MANY, names=("beta",))
    turned = np.random.default_rng(1).random(MANY) < share
    rows.loc[turned, "beta"] *= -1.0
    slips = ifrfit.fit(rows, method="lsq").facts["slips"]
    assert not slips.ok
    assert slips.figures["called"] == ["mixed-sign beta"]


def test_a_table_of_another_sign_is_named_and_a_right_one_is_not():
    rows = table(MANY)
    assert ifrfit.fit(rows, method="lsq").facts["slips"].ok
    rows["beta"] *= -1.0
    slips = ifrfit.fit(rows, method="lsq").facts["slips"]
    assert slips.figures["called"] == ["sign beta"]


def test_a_series_of_which_no_impact_is_among_some_has_its_noise():
    rows = table(MANY)
    rows["series"] = "many"
    apart = np.setdiff1d(np.arange(MANY), spread(MANY, _IMPACTS_OF_STARTS))[:8]
    rows.loc[apart, "series"] = "few"
    rows["beta"] *= -1.0
    slips = ifrfit.fit(rows, method="lsq", separate=("noise",)).facts["slips"]
    assert slips.figures["called"] == ["sign beta"]
