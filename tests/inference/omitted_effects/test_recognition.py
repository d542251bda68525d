"""Blind: effects made by the simulation are named, and plain impacts call for nothing.

Every rate is over fixed seeds 0, 1, 2, ..., none left out: 38 of 40 at least; here all but one of four.
"""

from __future__ import annotations

import numpy as np
import pytest
from factories import BILINEAR, at_most, rest_long

from ifrfit.inference.fit import fit

SEEDS = [4, pytest.param(40, marks=pytest.mark.long)]
FINE = 5e-6  # m: a sphere small enough for adhesion
FIXED = {"fix": {"e_n": 0.9}}

# effect, what is measured, how it is made, how it is fitted
CASES = [
    pytest.param("compliance", ("beta",), {"spins": False}, FIXED, id="compliance-beta"),
    pytest.param("compliance", None, {"n": 90, "noise": 0.01}, {}, id="compliance-velocities"),
    pytest.param("memory", ("beta",), {"spins": False, "chi": 1.3}, FIXED, id="compliance-by-memory"),
    pytest.param("viscoelastic", None, {}, {}, id="viscoelastic-velocities"),
    pytest.param("viscoelastic", ("e_n",), {"spins": False}, {}, id="viscoelastic-e_n"),
    pytest.param("plasticity", None, {}, {}, id="yield-velocities"),
    pytest.param("plasticity", ("e_n",), {"spins": False}, {}, id="yield-e_n"),
    pytest.param("rolling", None, {}, {}, id="rolling-velocities"),
    pytest.param(
        "rolling", ("beta_cm", "spin_y_after"), {"spins": False}, FIXED, id="rolling-centre-and-spin"
    ),
    pytest.param("adhesion", None, {"diameter": 2 * FINE}, {}, id="adhesion-velocities"),
]


def fitted(make, effect, seed, observables=None, known=True, made=None, asked=None):
    data = make(
        effect, seed, **({"observables": observables} if observables else {}), known=known, **(made or {})
    )
    return fit(data, method="lsq", independent=True, noise="known" if known else "unknown", **(asked or {}))


def called(*args, **choices):
    return fitted(*args, **choices).facts["effects"]


def named(result):
    """Effects that are called for, also beside a slip that is not told from them."""
    facts = result.facts
    return facts["effects"].figures["called"] if facts["slips"].ok else facts["slips"].figures["effects"]


@pytest.mark.parametrize("seeds", SEEDS)
@pytest.mark.parametrize("known", rest_long((False, True)), ids=["sigma-unknown", "sigma-known"])
@pytest.mark.parametrize(("effect", "observables", "made", "asked"), CASES)
def test_an_effect_is_named(make, effect, observables, made, asked, known, seeds):
    name = "compliance" if effect == "memory" else effect
    found = [fitted(make, effect, seed, observables, known, made, asked) for seed in range(seeds)]
    hits = [named(one) == [name] for one in found]
    assert sum(hits) >= seeds - max(seeds // 20, 1), [named(one) for one in found]


@pytest.mark.parametrize("seeds", [3, pytest.param(1000, marks=pytest.mark.long)])
@pytest.mark.parametrize("known", [True, False], ids=["sigma-known", "sigma-unknown"])
@pytest.mark.parametrize(
    ("observables", "made", "asked"),
    [
        (None, {}, {}),
        (None, {"n": 12}, {}),
        (("beta",), {"spins": False}, FIXED),
        (("beta",), {"n": 20}, FIXED),
        (("beta_cm",), {"spins": False, "e_t": -0.7}, {}),
    ],
    ids=["velocities", "few", "beta", "beta-spins", "beta_cm"],
)
def test_plain_impacts_call_for_nothing(make, observables, made, asked, known, seeds):
    """Falsely named at most once in a thousand; the smallest corrected p is below 0.05 at most so often."""
    facts = [called(make, "", seed, observables, known, made, asked) for seed in range(seeds)]
    assert sum(not fact.ok for fact in facts) <= at_most(seeds, 0.001)
    low = [min(test["p"] for test in fact.figures["tests"].values()) < 0.05 for fact in facts]
    assert sum(low) <= at_most(seeds, 0.05)


@pytest.mark.parametrize("known", [True, False], ids=["sigma-known", "sigma-unknown"])
def test_a_constant_of_another_closure_is_no_effect(make, known):
    """Walton's closure with beta0 = 0.1, which IFR cannot have, is no microslip."""
    from ifrfit.physics import rebound

    for seed in range(5):
        data = make("", seed, ("beta",), known=known, spins=False)
        table = data.table
        gamma = table["gamma_deg"].to_numpy()
        law = {"e_n": 0.9, "mu": 0.15, "degrees": True}
        walton = rebound(gamma, beta0=0.1, closure="fr", **law).beta
        table["value"] += walton - rebound(gamma, e_t=-0.95, **law).beta
        moved = type(data)(table, data.sources, ())
        noise = "known" if known else "unknown"
        ifr = fit(moved, method="lsq", noise=noise, **FIXED).facts["effects"]
        assert ifr.figures["called"][0] == "sticking-law"
        assert set(ifr.figures["called"]) <= {"sticking-law", "sticking-by-angle"}
        assert "another constant law of sticking" in ifr.says
        assert fit(moved, method="lsq", noise=noise, closure="fr", **FIXED).facts["effects"].ok


@pytest.mark.parametrize("closure", [name for name in BILINEAR if name != "ifr"])
@pytest.mark.parametrize("chi", rest_long((1.2, 1.7)))
def test_compliance_is_named_whatever_closure_and_materials(make, closure, chi):
    """Poisson ratios from 0.48 to 0.06, none of which the directions are made with."""
    for seed in range(3):
        data = make("memory", seed, n=100, noise=0.01, chi=chi)
        fact = fit(data, method="lsq", closure=closure, independent=True).facts["effects"]
        assert fact.figures["called"] == ["compliance"]


def test_another_inertia_factor_is_no_rolling_friction(make):
    for seed in range(5):
        fact = fitted(make, "", seed, asked={"inertia_factor": 0.5}).facts["slips"]
        assert fact.figures["called"] == ["inertia-factor"]
        size = fact.figures["tests"]["inertia-factor"]["size"]
        assert 0.5 * (1.0 + size) == pytest.approx(0.4, abs=0.03)
        assert "--inertia-factor" in fact.says


def test_the_closure_that_holds_an_effect_does_not_call_for_it(make):
    for seed in range(3):
        data = make("memory", seed, ("beta",), spins=False)
        fact = fit(data, method="lsq", closure="maw", **FIXED).facts["effects"]
        assert fact.ok, fact.says
        assert "compliance" not in fact.figures["tests"]


def test_restitution_through_kappa_alone_may_be_friction(make):
    """The centre's tangential velocity knows kappa only, and the words say so."""
    data = make("plasticity", 3, ("beta_cm",), n=150, spins=False)
    fact = fit(data, method="lsq").facts["effects"]
    assert {"plasticity", "viscoelastic"} & set(fact.figures["called"])
    assert "so that mu may depend on the speed instead: measure e_n at several speeds" in fact.says
    assert "for ten times the speed" not in fact.says
    assert "call for a restitution that falls with the speed" in fact.says


def test_of_a_hollow_ball_no_law_is_named(make):
    """Viscoelasticity and yield are laws of Hertz' contact, which a shell does not have."""
    data = make("plasticity", 1, ("e_n",))
    says = fit(data, method="lsq", inertia_factor=2.0 / 3.0).facts["effects"].says
    assert "call for a restitution that falls with the speed: p" in says
    assert "for ten times the speed" in says
    assert "yield" not in says


def test_strengths_are_those_that_were_put_in(make):
    """The estimates to first order: mu_r, and compliance at 1 where chi is the materials'."""
    rolling = called(make, "rolling", 0).figures["tests"]["rolling"]
    assert abs(rolling["strength"] - 0.01) < 3.0 * rolling["sd"]
    compliance = called(make, "compliance", 0, ("beta",), True, {"spins": False}, FIXED)
    assert compliance.figures["tests"]["compliance"]["strength"] == pytest.approx(1.0, abs=0.2)
    dissipation = called(make, "viscoelastic", 0).figures["tests"]["viscoelastic"]
    assert abs(dissipation["strength"] - 1.0) < 4.0 * dissipation["sd"]
    assert np.isfinite(dissipation["fall"])
