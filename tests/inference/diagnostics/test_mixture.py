"""Two balls in one table, which no column tells apart: where enough of them slide, never all well."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from factories import rest_long
from slips_scenes import Cause, Scene, experiment

from ifrfit.data.observations import Observations
from ifrfit.inference.fit import fit

E_N = {"e_n": 0.8}
BETA, RAW = Scene(("beta",), 34, 0.03, policy="unknown", fixed=E_N), Scene(n=34, policy="unknown", spins=True)


def facts_of(scene, cause, seed):
    data = experiment(scene, cause, seed)
    return fit(data, method="lsq", independent=True, fix=scene.fixed).facts


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("scene", [BETA, RAW], ids=["beta", "raw"])
@pytest.mark.parametrize("seeds", rest_long(((0, 1), (0, 1, 3, 4))), ids=len)
def test_two_kinds_are_never_all_well(scene, known, seeds):
    every = [
        facts_of(replace(scene, policy="known" if known else "unknown"), Cause("two-kinds", 0.8), seed)
        for seed in seeds
    ]
    for facts in every:
        assert any(not fact.ok for name, fact in facts.items() if name not in ("at_bound", "identifiable"))
    assert sum("mixture" in facts for facts in every) >= (0 if known else 0.75 * len(seeds))


def test_both_values_are_said():
    fact = facts_of(RAW, Cause("two-kinds", 0.8), 1)["mixture"]
    low, high = sorted(fact.figures["values"])
    assert fact.figures["constant"] == "mu"
    assert high / low == pytest.approx(1.8, rel=0.1)
    assert 8 <= fact.figures["of_second"] <= 26
    assert "--separate mu" in fact.says


@pytest.mark.parametrize("scene", [BETA, RAW], ids=["beta", "raw"])
@pytest.mark.parametrize("seeds", rest_long((2, 6)))
def test_one_kind_is_one(scene, seeds):
    for seed in range(seeds):
        assert "mixture" not in facts_of(scene, Cause(), seed)


@pytest.mark.parametrize("seeds", rest_long((2, 4)))
def test_errors_that_grow_are_no_second_kind(seeds):
    """Scatter of beta that falls with the angle, as its velocities have it."""
    for seed in range(seeds):
        table = experiment(BETA, Cause(), seed).table
        clean = experiment(replace(BETA, noise=0.0), Cause(), seed).table["value"]
        grows = 0.3 / np.sin(np.radians(table["gamma_deg"]))
        table["value"] = clean + grows * (table["value"] - clean)
        facts = fit(Observations(table), method="lsq", independent=True, fix=E_N).facts
        assert "mixture" not in facts
