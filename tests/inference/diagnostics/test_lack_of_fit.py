"""Lack of fit names the observable of which the failed test speaks."""

from __future__ import annotations

import numpy as np
import pytest
from factories import rest_long, table_file

from ifrfit import compare, fit
from ifrfit.inference.diagnostics.lack_of_fit import lack_of_fit
from ifrfit.inference.diagnostics.residuals import residuals_of
from ifrfit.physics import rebound


def table(path, seed, change, *, n=40, gamma=None, noise=0.02):
    """Impacts of which `change` gives beta and e_n without errors anew."""
    rng = np.random.default_rng(seed)
    gamma = rng.uniform(5.0, 80.0, n) if gamma is None else gamma
    beta = rebound(gamma, e_n=0.9, e_t=-0.85, mu=0.14, degrees=True).beta
    beta, e_n = change(gamma, beta, np.full(gamma.size, 0.9))
    beta, e_n = (value + noise * rng.standard_normal(gamma.size) for value in (beta, e_n))
    return table_file(path, {"gamma_deg": np.round(gamma, 3), "beta": beta, "e_n": e_n}, "%.6f")


def gained(gamma, beta, e_n):
    return 0.9 * beta, e_n


@pytest.mark.parametrize("seeds", rest_long((3, 40)))
def test_a_wrong_beta_with_unknown_noises_is_a_misfit_of_beta(tmp_path, seeds):
    failed = 0
    for seed in range(seeds):
        fact = fit(table(tmp_path / "t.csv", seed, gained), method="lsq").facts["lack_of_fit"]
        failed += not fact.ok
        if not fact.ok:
            assert fact.figures["test"] == "smooth departure"
            assert fact.figures["where"].startswith("in beta "), fact.says
            assert fact.says.split("the misfit sits in beta")[1].endswith("% of the sum of squares of beta")
            assert int(fact.says.split(" residuals ")[0].split(" of ")[-1]) >= 3
    assert failed >= 2 * seeds // 3


def test_a_misfit_of_e_n_among_repeats_is_one_of_e_n(tmp_path):
    """Control: readings of e_n that depend on the angle, beside a beta that is as the law has it."""
    gamma = np.repeat(np.linspace(8.0, 75.0, 6), 6)
    for seed in range(3):
        path = table(
            tmp_path / "t.csv", seed, lambda g, b, e: (b, e + 0.08 * np.cos(6.0 * np.radians(g))), gamma=gamma
        )
        fact = fit(path, method="lsq").facts["lack_of_fit"]
        assert not fact.ok
        assert fact.figures["where"] == "in e_n"
        assert "% of the sum of squares" not in fact.says


def test_the_comparison_names_the_same_observable(tmp_path):
    path = table(tmp_path / "t.csv", 0, gained)
    verdict = compare(path, closures=("ifr", "f")).verdict
    assert "the misfit sits in beta " in verdict.says, verdict.says


def test_a_few_repeats_do_not_judge_all_other_rows(tmp_path):
    """Three angles that happen to repeat among 75 have next to no power by themselves."""
    gamma = np.random.default_rng(8).uniform(5.0, 80.0, 75)
    gamma[:3] = gamma[3:6]
    facts = fit(table(tmp_path / "t.csv", 8, gained, gamma=gamma), method="lsq").facts
    assert facts["lack_of_fit"].figures["p_pure"]["all"] > 0.01
    assert facts["lack_of_fit"].figures["test"] == "smooth departure"
    assert not facts["lack_of_fit"].ok
    rocks = fit("wang-2018-limestone", method="lsq").facts["lack_of_fit"]
    assert not rocks.ok
    assert rocks.figures["p"] < 1e-6


@pytest.mark.parametrize("stated", [0.0, 0.5])
def test_uncertainties_of_angles_that_are_not_counted_are_a_remedy(tmp_path, stated):
    gamma = np.linspace(8.0, 80.0, 30)
    beta = rebound(gamma, degrees=True, e_n=0.9, e_t=-0.9, mu=0.12).beta + np.where(gamma > 60.0, 0.1, 0.0)
    columns = {"gamma_deg": gamma, "beta": beta, "sigma_beta": np.full(30, 0.02)}
    columns["sigma_gamma_deg"] = np.full(30, stated)
    found = fit(table_file(tmp_path / "t.csv", columns, "%.5g"), method="lsq", fix={"e_n": 0.9})
    fact = lack_of_fit(found.problem, found.least_squares, residuals_of(found.problem, found.least_squares))
    assert not fact.ok
    assert ("; the uncertainty of the angle" in fact.says) == (stated > 0.0)
    assert fact.says.endswith("try --angle-errors effective first, which counts it") == (stated > 0.0)
