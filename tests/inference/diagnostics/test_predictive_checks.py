"""Posterior predictive checks: the laws of their p-values, and misfits that each of them must see."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from factories import BILINEAR, problem_of
from scipy import stats

from ifrfit.data.observations import Observations, make_table
from ifrfit.inference.diagnostics import predictive_checks as module
from ifrfit.inference.diagnostics.predictive_checks import predictive
from ifrfit.inference.diagnostics.thresholds import FACTS
from ifrfit.inference.model.problem import make_problem
from ifrfit.physics import OBSERVABLES, get_closure

TRUTH = {"e_n": np.array([0.9]), "e_t": np.array([-0.8]), "mu": np.array([0.15])}
SIGMA = 0.03


def build(
    n=80, observables=("beta",), *, noise="known", closure="ifr", series=1, separate=(), fix=None,
    sigma=SIGMA, truth=(0.9, -0.8, 0.15), seed=0,
):  # fmt: skip
    """Rows of the model's own values at the truth, without noise; series and observables take turns."""
    rng = np.random.default_rng(seed)
    names = [observables[i % len(observables)] for i in range(n)]
    table = make_table(
        {
            "series": [f"run {1 + i // len(observables) % series}" for i in range(n)],
            "observable": names,
            "gamma_deg": np.sort(rng.uniform(4.0, 86.0, n)),
            "spin_x": np.full(n, 0.1),
            "spin_y": np.full(n, 0.05),
            "value": np.zeros(n),
            "sigma": np.full(n, sigma),
            "source": ["run.csv"] * n,
            "row": np.arange(n) + 2,
        }
    )
    empty = problem_of(table, closure, noise=noise, separate=separate, fix=fix)
    values = dict(zip(("e_n", empty.closure.constant, "mu"), truth, strict=True))
    return with_values(empty, empty.predict(np.array([values[c.name] for c in empty.parameters.entries])))


def with_values(problem, value):
    table = problem.observations.table.assign(value=value)
    return make_problem(
        Observations(table), problem.closure, problem.inertia_factor, problem.parameters, problem.noise.policy
    )


def noisy(problem, z, sigma=SIGMA):
    return with_values(problem, problem.rows.value + sigma * z)


@pytest.mark.parametrize("closure", BILINEAR)
@pytest.mark.parametrize("separate", [(), ("mu",), ("e_n", "mu")])
def test_many_draws_at_once_are_the_same_as_one_by_one(closure, separate):
    rng = np.random.default_rng(1)
    constant = get_closure(closure).constant
    truth = (0.8, -0.7 if constant == "e_t" else 0.3, 0.15)
    separate = (*separate, *([constant] if constant and separate else []))
    problem = build(60, tuple(OBSERVABLES), closure=closure, series=3, separate=separate, truth=truth)
    scale = {"e_n": (0.2, 1.0), "mu": (0.0, 1.5), constant: (-1.0, -0.4)}
    theta = np.column_stack([rng.uniform(*scale[c.name], 50) for c in problem.parameters.entries])
    expected = np.array([problem.predict(row) for row in theta])
    assert np.isfinite(expected).all()
    np.testing.assert_allclose(problem.predict(theta), expected, rtol=1e-13, atol=1e-14)


def test_p_values_at_the_truth_are_uniform():
    """A posterior that is a point at the truth: no data are used twice, so the laws are exact."""
    rng = np.random.default_rng(2)
    problem = build(60, ("beta", "e_n"))
    found = [predictive(noisy(problem, rng.standard_normal(60)), TRUTH).figures for _ in range(400)]
    for name in ("p_chi2", "p_largest"):
        p = [figures[name] for figures in found]
        assert stats.kstest(p, "uniform").pvalue > 1e-3, name
    # discrete quantities: the p-values that can be reached, each as often as the binomial law says
    for name, n, chance in (("p_runs", 29, 0.5), ("p_share", 60, 0.95)):
        count = np.arange(n + 1)
        law = stats.binom(n, chance)
        reached = np.minimum(1.0, 2.0 * np.minimum(law.cdf(count), law.sf(count - 1)))
        p = np.array([figures[name] for figures in found])
        for level in (0.02, 0.1, 0.3):
            expected = law.pmf(count)[reached <= level].sum()
            assert expected <= level
            hits = int((p <= level).sum())
            assert stats.binomtest(hits, p.size, expected).pvalue > 1e-3, (name, level)


def test_the_law_of_sign_changes_is_that_of_all_orders_of_signs():
    problem = build(7)
    signs = np.array(list(itertools.product((-1.0, 1.0), repeat=7)))
    changes = (signs[:, 1:] != signs[:, :-1]).sum(axis=1)
    for z in signs[::9]:
        own = (z[1:] != z[:-1]).sum()
        expected = min(1.0, 2.0 * min((changes <= own).mean(), (changes >= own).mean()))
        figures = predictive(noisy(problem, z), TRUTH).figures
        assert figures["p_runs"] == pytest.approx(expected, rel=1e-12)


def test_the_figures_are_means_over_the_draws():
    rng = np.random.default_rng(3)
    problem = noisy(build(40, ("beta", "e_n")), rng.standard_normal(40))
    draws = {
        "e_n": rng.normal(0.9, 0.01, 30),
        "e_t": rng.normal(-0.8, 0.01, 30),
        "mu": rng.normal(0.15, 0.01, 30),
        "kappa": np.full(30, np.nan),  # not an entry of theta: not looked at
    }
    z = np.array(
        [
            (problem.rows.value - problem.predict(np.array(theta))) / problem.noise.sigma
            for theta in zip(draws["e_n"], draws["e_t"], draws["mu"], strict=True)
        ]
    )
    figures = predictive(problem, draws).figures
    assert figures["p_chi2"] == pytest.approx(stats.chi2.sf((z**2).sum(axis=1), 40).mean(), rel=1e-10)
    within = stats.norm.sf(np.abs(z).max(axis=1))
    assert figures["p_largest"] == pytest.approx((1.0 - (1.0 - 2.0 * within) ** 40).mean(), rel=1e-9)
    inside = np.abs(z) < stats.norm.ppf(0.975)
    assert figures["share_inside"] == pytest.approx(inside.mean(), rel=1e-12)
    tails = stats.binom.cdf(inside.sum(axis=1), 40, 0.95), stats.binom.sf(inside.sum(axis=1) - 1, 40, 0.95)
    assert figures["p_share"] == pytest.approx(min(1.0, 2 * tails[0].mean(), 2 * tails[1].mean()), rel=1e-10)
    worst = int(np.argmax(np.abs(z.mean(axis=0))))
    assert figures["largest"]["standardised"] == pytest.approx(z.mean(axis=0)[worst], rel=1e-10)
    assert figures["largest"]["row"].startswith(f"run.csv line {worst + 2} ")
    assert (figures["n_checks"], figures["n_draws"]) == (4, 30)


@pytest.mark.parametrize("noise", ["scaled", "unknown"])
def test_the_noise_of_each_draw_is_used(noise):
    rng = np.random.default_rng(4)
    problem = build(60, ("beta", "e_n"), noise=noise, series=2)
    z = rng.standard_normal(60)
    sizes = {group: 0.02 * (1 + i) for i, group in enumerate(problem.noise_groups())}
    if noise == "scaled":
        sizes = dict.fromkeys(sizes, 2.5 * SIGMA)
    sigma = np.empty(60)
    for group, rows in problem.noise_groups().items():
        sigma[rows] = sizes[group]
    draws = dict(TRUTH)
    if noise == "scaled":
        draws["noise"] = np.array([2.5])
    else:
        draws |= {f"noise[{group}]": np.array([size]) for group, size in sizes.items()}
    fact = predictive(noisy(problem, z, sigma), draws)
    assert fact.ok
    assert fact.figures["p_chi2"] == pytest.approx(stats.chi2.sf((z**2).sum(), 60), rel=1e-9)
    wrong = {name: draw * (0.6 if name.startswith("noise") else 1.0) for name, draw in draws.items()}
    assert "chi2" in predictive(noisy(problem, z, sigma), wrong).figures["failed"]


def test_draws_that_are_missing_are_not_made_up():
    with pytest.raises(KeyError, match="mu"):
        predictive(build(10), {"e_n": np.array([0.9]), "e_t": np.array([-0.8])})


def test_fixed_constants_need_no_draws():
    rng = np.random.default_rng(5)
    problem = noisy(build(30, fix={"e_n": 0.9}), rng.standard_normal(30))
    free = noisy(build(30), rng.standard_normal(30))
    assert predictive(problem, {n: TRUTH[n] for n in ("e_t", "mu")}).ok
    held = build(30, fix={"e_n": 0.9, "e_t": -0.8, "mu": 0.15})
    assert predictive(with_values(held, free.rows.value), {}) == predictive(free, TRUTH)


def test_a_sound_fit_is_said_to_be_one():
    rng = np.random.default_rng(6)
    fact = predictive(noisy(build(80), rng.standard_normal(80)), TRUTH)
    assert fact.ok
    assert fact.threshold == FACTS["predictive"]
    least = min(fact.figures[f"p_{name}"] for name in ("chi2", "runs", "largest", "share"))
    assert fact.says.startswith(
        f"the posterior predicts data like these (smallest p of 4 checks = {least:.2g}, "
    )
    assert "where" not in fact.figures


def test_sigma_that_is_too_small_fails_chi2_and_the_share():
    rng = np.random.default_rng(7)
    fact = predictive(noisy(build(80), rng.standard_normal(80) / 0.6), TRUTH)
    assert not fact.ok
    assert {"chi2", "share"} <= set(fact.figures["failed"])
    assert "runs" not in fact.figures["failed"]
    share = 100 * fact.figures["share_inside"]
    assert fact.says.startswith("the posterior does not predict such data, by ")
    assert " of 4 checks: chi2 is " in fact.says
    assert f"; {share:.3g} % of the rows inside the 95 % band (p = " in fact.says
    assert f"; the misfit sits {fact.figures['where']}: " in fact.says


def test_a_smooth_departure_fails_the_runs():
    rng = np.random.default_rng(8)
    problem = build(80)
    wave = 0.9 * np.sin(np.linspace(0.0, 2.0 * np.pi, 80))
    fact = predictive(noisy(problem, wave + 0.3 * rng.standard_normal(80)), TRUTH)
    assert fact.figures["failed"] == ["runs"]
    assert fact.figures["p_chi2"] > 0.5  # the residuals are small, it is their order that is wrong
    assert "by 1 of 4 checks: residuals change sign " in fact.says
    assert " times in 79 steps along tau (p = " in fact.says
    assert "; the misfit sits in beta " in fact.says


def test_one_change_of_sign_is_one_time():
    fact = predictive(noisy(build(40), np.where(np.arange(40) < 20, 5.0, -5.0)), TRUTH)
    assert "residuals change sign 1 time in 39 steps along tau" in fact.says


def test_residuals_that_take_turns_fail_the_runs_too():
    fact = predictive(noisy(build(40), 0.7 * (-1.0) ** np.arange(40)), TRUTH)
    assert "runs" in fact.figures["failed"]
    assert "residuals change sign 39 times in 39 steps along tau" in fact.says


def test_one_far_row_is_named_and_only_that():
    rng = np.random.default_rng(9)
    z = rng.standard_normal(80)
    z[33] = -6.0
    fact = predictive(noisy(build(80), z), TRUTH)
    assert fact.figures["failed"] == ["largest"]
    assert fact.figures["largest"] == {
        "row": "run.csv line 35 (beta)",
        "standardised": pytest.approx(-6.0, abs=1e-9),
    }
    p = 80 * 2 * stats.norm.sf(6.0)
    assert fact.figures["p_largest"] == pytest.approx(p, rel=1e-5)
    assert fact.says == (
        "the posterior does not predict such data, by 1 of 4 checks: "
        f"run.csv line 35 (beta) lies -6.0 sigma off (p = {p:.0e})"
    )


def test_the_tail_of_the_largest_residual_keeps_its_digits():
    z = np.zeros(50)
    z[7] = 12.0
    figures = predictive(noisy(build(50), z), TRUTH).figures
    assert figures["p_largest"] == pytest.approx(50 * 2 * stats.norm.sf(12.0), rel=1e-6)


def test_sigma_that_is_too_large_is_told_from_a_misfit():
    rng = np.random.default_rng(10)
    z = 0.3 * rng.standard_normal(300)
    fact = predictive(noisy(build(300), z), TRUTH)
    assert fact.figures["failed"] == ["share"]
    assert fact.says.endswith("; sigma is larger than the scatter: --noise scaled takes it from the data")
    assert "misfit" not in fact.says


def test_data_without_noise_are_no_departure():
    """Each draw runs smoothly past such data: its signs say nothing of them."""
    rng = np.random.default_rng(14)
    draws = {name: value + rng.normal(0.0, 1e-3, 50) for name, value in TRUTH.items()}
    for given in (TRUTH, draws):
        fact = predictive(build(80), given)
        assert fact.ok
        assert fact.figures["p_runs"] is None
        assert fact.figures["p_chi2"] == pytest.approx(1.0)
        assert fact.figures["p_largest"] == pytest.approx(1.0)
    fact = predictive(build(200), draws)
    assert fact.figures["failed"] == ["share"]
    assert fact.says.endswith("; sigma is larger than the scatter")  # nothing that could be scaled to


def test_repeats_of_e_n_have_no_runs():
    rng = np.random.default_rng(11)
    fact = predictive(noisy(build(20, ("e_n",)), rng.standard_normal(20)), TRUTH)
    assert fact.ok
    assert fact.figures["p_runs"] is None
    assert fact.figures["n_checks"] == 3
    assert "smallest p of 3 checks" in fact.says


def test_many_rows_take_fewer_draws_and_the_blocks_do_not_show(monkeypatch):
    rng = np.random.default_rng(12)
    problem = noisy(build(50, ("beta", "e_n")), rng.standard_normal(50))
    draws = {name: value + rng.normal(0.0, 0.01, 40) for name, value in TRUTH.items()}
    whole = predictive(problem, draws)
    monkeypatch.setattr(module, "_AT_ONCE", 350)
    assert predictive(problem, draws).figures["p_chi2"] == pytest.approx(whole.figures["p_chi2"], rel=1e-13)
    monkeypatch.setattr(module, "_MOST", 50 * 12)
    fewer = predictive(problem, draws)
    assert fewer.figures["n_draws"] == 12
    first = predictive(problem, {name: draw[:12] for name, draw in draws.items()})
    assert fewer == first
    monkeypatch.setattr(module, "_MOST", 50)
    assert predictive(problem, draws).figures["n_draws"] == 8


def test_used_twice_the_p_values_crowd_around_one_half():
    """What the docstring warns of: with a real posterior p is conservative, never the other way."""
    rng = np.random.default_rng(13)
    p = []
    for _ in range(200):
        value = 0.9 + SIGMA * rng.standard_normal(4)
        problem = with_values(build(4, ("e_n",)), value)
        draws = {name: np.full(200, x[0]) for name, x in TRUTH.items()}
        draws["e_n"] = value.mean() + SIGMA / 2.0 * rng.standard_normal(200)
        p.append(predictive(problem, draws).figures["p_chi2"])
    assert np.std(p) < 0.9 * np.sqrt(1.0 / 12.0)
    assert np.mean(np.array(p) < 0.05) < 0.05
    assert np.mean(p) == pytest.approx(0.5, abs=0.06)
