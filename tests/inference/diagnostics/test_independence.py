"""Errors that are alike from row to row make intervals too short; a law that does not hold is no reason."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from factories import rest_long
from scipy import stats
from slips_scenes import Cause, Scene, experiment, truth

from ifrfit.data.observations import Observations
from ifrfit.inference.diagnostics.independence import neighbours_alike
from ifrfit.inference.fit import fit

E_N = {"e_n": 0.8}
BETA = Scene(("beta",), 40, 0.03, policy="unknown", fixed=E_N)


def fitted(scene, cause, seed):
    data = experiment(scene, cause, seed)
    return fit(data, method="lsq", independent=True, fix=scene.fixed, closure=scene.closure)


def test_p_values_of_independent_errors_are_uniform_in_their_tail():
    rng = np.random.default_rng(3)
    n = 30
    columns = np.column_stack((np.ones(n), np.linspace(0.0, 1.0, n), np.linspace(0.0, 1.0, n) ** 2))
    basis = np.linalg.qr(columns)[0]
    first, second = np.arange(n - 1), np.arange(1, n)
    errors = rng.standard_normal((20_000, n))
    left = errors - errors @ basis @ basis.T
    p = np.array([neighbours_alike(first, second, basis, z)[0] for z in left])
    for limit in (0.005, 0.001):
        assert stats.binomtest(int((p < limit).sum()), p.size, limit).pvalue > 1e-3
    # the control: errors that are alike are seen
    for i in range(1, n):
        errors[:, i] = 0.8 * errors[:, i - 1] + 0.6 * errors[:, i]
    left = errors[:300] - errors[:300] @ basis @ basis.T
    p = np.array([neighbours_alike(first, second, basis, z)[0] for z in left])
    assert (p < 0.001).mean() > 0.3


@pytest.mark.parametrize("known", [True, False])
def test_errors_that_drift_are_a_finding(known):
    every = [
        fitted(replace(BETA, policy="known" if known else "unknown"), Cause("correlated", 0.9), seed).facts
        for seed in range(8)
    ]
    # the rest is a misfit, or an effect that they feign
    quiet = ("at_bound", "identifiable")
    assert sum(any(not fact.ok for name, fact in facts.items() if name not in quiet) for facts in every) >= 7
    seen = [facts["independence"] for facts in every if "independence" in facts]
    assert len(seen) >= 2
    for fact in seen:
        assert not fact.ok
        assert fact.says.startswith(
            "errors of beta are not independent: residuals of neighbours along the table"
        )
        assert "intervals are too short by a factor of some" in fact.says
        assert 1.3 < fact.figures["factor"] < 5.0
        assert fact.figures["effective"] < 20.0


@pytest.mark.parametrize("seeds", rest_long((20, 60)))
def test_the_factor_is_that_of_simulated_constants(seeds):
    """The scatter of mu over experiments over its sd, where neighbours are alike by 0.8."""
    pulls = []
    factors = []
    for seed in range(seeds):
        result = fitted(BETA, Cause("correlated", 0.8), seed)
        e_t, true = result.constants["e_t"], truth(BETA, seed)["e_t"]
        if e_t.value is not None and e_t.stderr:
            pulls.append((e_t.value - true) / e_t.stderr)
        if "independence" in result.facts:
            factors.append(result.facts["independence"].figures["factor"])
    spread = 1.4826 * float(np.median(np.abs(pulls)))
    assert 0.6 < spread / float(np.median(factors)) < 1.8


@pytest.mark.parametrize("repeats", [1, 2, 6])
@pytest.mark.parametrize("seeds", rest_long((2, 4)))
def test_independent_errors_are_none(repeats, seeds):
    for seed in range(seeds):
        assert "independence" not in fitted(replace(BETA, n=60, repeats=repeats), Cause(), seed).facts


@pytest.mark.parametrize("repeats", [1, 6])
@pytest.mark.parametrize("seeds", rest_long((2, 4)))
def test_a_law_that_does_not_hold_is_no_reason(repeats, seeds):
    """Data of closure FR, fitted by IFR: the misfit is said, not errors that are alike."""
    scene = replace(BETA, n=120, noise=0.003, closure="fr", repeats=repeats)
    said = 0
    for seed in range(seeds):
        data = experiment(scene, Cause(), seed)
        facts = fit(data, method="lsq", independent=True, fix=E_N, closure="ifr").facts
        said += any(not facts[name].ok for name in ("lack_of_fit", "slips", "effects") if name in facts)
        assert "independence" not in facts
    assert said >= 1


def test_repeats_tell_errors_from_the_law():
    """Ten readings at each of six angles; the law does not hold, and errors are alike all the same."""
    rng = np.random.default_rng(5)
    scene = Scene(("beta",), 60, 0.01, policy="unknown", fixed=E_N, closure="fr", repeats=10)
    table = experiment(scene, Cause("correlated", 0.8), int(rng.integers(100))).table
    facts = fit(Observations(table), method="lsq", independent=True, fix=E_N, closure="ifr").facts
    assert not facts["lack_of_fit"].ok
    assert not facts["independence"].ok
