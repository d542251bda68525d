"""Angles that were read with errors: the scatter goes with the slope of the values in the angle."""

from __future__ import annotations

import re
import warnings
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from factories import each_once, rest_long, table_file
from hard_cases.case import command
from scipy import stats

from ifrfit import Noise, compare, fit, rebound
from ifrfit.inference.diagnostics.angle_error_size import (
    AngleSlopes,
    careful_p,
    deviance_of,
    fitted_errors,
)
from ifrfit.inference.diagnostics.angle_scatter import angle_scatter
from ifrfit.inference.diagnostics.rival_scatter import drop_of_even, drop_of_growth, fall_of_outliers
from ifrfit.inference.options import AngleErrors
from ifrfit.report.sentences import findings

TRUTH = {"e_n": 0.9, "e_t": -0.85, "mu": 0.14}
OBSERVABLES = [("beta", "e_n"), ("v_x", "v_n"), ("beta_cm", "v_n")]
LIKE_IT = ("truncation", "mixture", "outliers", "lack_of_fit", "growing_scatter", "scatter_too_large")


def readings(
    degrees=0.0, seed=0, names=("beta", "e_n"), *, n=80, noise=0.01, sigma=False, offset=0.0, mu=0.14, **more
):
    """A table with an error of the angle in each impact, of so many degrees; `mu` may be one of each."""
    rng = np.random.default_rng([seed, 5])
    gamma = np.sort(rng.uniform(5.0, 80.0, n))
    turned = gamma + offset + degrees * rng.standard_normal(n)
    state = rebound(turned, degrees=True, **(TRUTH | {"mu": mu}))
    table = {"gamma_deg": np.round(gamma, 3)}
    for name in names:
        value = np.full(n, TRUTH["e_n"]) if name == "e_n" else getattr(state, name)
        table[name] = value + noise * rng.standard_normal(n)
        if sigma:
            table[f"sigma_{name}"] = noise
    return pd.DataFrame(table | more)


def fitted(folder, table, **options):
    return fit(table_file(folder / "impacts.csv", table), **({"method": "lsq"} | options))


def effective(fact, policy=None):
    """The remedy of a fact, in Python."""
    return Noise(policy, angles=AngleErrors("effective", sigma_deg=fact.figures["size"]))


def failing(result):
    return [name for name, fact in result.facts.items() if not fact.ok and name != "global_optimum"]


@pytest.mark.parametrize(("names", "sigma"), each_once(OBSERVABLES, [True, False]))
@pytest.mark.parametrize("seeds", rest_long((6, 20)))
def test_errors_of_angles_are_named_first(tmp_path, names, sigma, seeds):
    sizes = []
    for seed in range(seeds):
        result = fitted(tmp_path, readings(1.2, seed, names, sigma=sigma))
        if "angle_scatter" not in failing(result):
            continue
        assert failing(result)[0] == "angle_scatter"
        sizes.append(result.facts["angle_scatter"].figures["size"])
        assert any('AngleErrors(kind="effective", sigma_deg=' in says for _, says in findings(result))
    assert len(sizes) >= 0.6 * seeds
    assert np.median(sizes) == pytest.approx(1.2, rel=0.2)


@pytest.mark.parametrize("sigma", [True, False])
def test_what_they_look_like_is_not_named_in_their_place(tmp_path, sigma):
    """Without this fact each of these tables is called something else, or nothing."""
    seen = [failing(fitted(tmp_path, readings(1.3, seed, sigma=sigma))) for seed in range(10)]
    others = [names for names in seen if "angle_scatter" not in names and set(names) & set(LIKE_IT)]
    assert len(others) <= 2


@pytest.mark.parametrize("names", OBSERVABLES)
def test_the_remedy_runs_and_finds_the_constants(tmp_path, names):
    for seed in range(3):
        table = readings(1.2, seed, names, sigma=True)
        fact = fitted(tmp_path, table).facts["angle_scatter"]
        options = re.search(r"--angle-errors effective --sigma-gamma [0-9.]+( --noise scaled)?", fact.says)[0]
        done = command(tmp_path, ["fit", "impacts.csv", "--method", "lsq", "--quiet", *options.split()])
        assert done.status == 0, done
        again = fitted(
            tmp_path,
            table,
            noise=effective(fact, "scaled" if "scaled" in options else None),
        )
        _near_the_truth(again)
        # its own errors are in the model: nothing is left to be asked
        assert "angle_scatter" not in again.facts


def test_the_remedy_where_noises_are_unknown(tmp_path):
    """It names the sigma that every row needs then."""
    table = readings(1.2, 1)
    fact = fitted(tmp_path, table).facts["angle_scatter"]
    sigma = {name: float(x) for x, name in re.findall(r"([0-9.]+) for (\w+)", fact.says)}
    assert set(sigma) == {"beta", "e_n"}
    assert all(0.005 < each < 0.02 for each in sigma.values())
    stated = table.assign(**{f"sigma_{name}": each for name, each in sigma.items()})
    _near_the_truth(fitted(tmp_path, stated, noise=effective(fact, "scaled")))
    alone = fitted(tmp_path, table[["gamma_deg", "beta"]], fix={"e_n": 0.9}).facts["angle_scatter"]
    assert re.search(r"--angle-errors effective --sigma-gamma [0-9.]+ counts them$", alone.says)
    _near_the_truth(fitted(tmp_path, table[["gamma_deg", "beta"]], noise=effective(alone), fix={"e_n": 0.9}))


def _near_the_truth(result):
    for name, estimate in result.constants.items():
        if estimate.status != "fixed":
            assert abs(estimate.value - TRUTH[name]) < 3.0 * estimate.stderr, name


def test_words_for_what_the_remedy_needs(tmp_path):
    stated = readings(1.2, 1, sigma=True, sigma_gamma_deg=1.0)
    says = fitted(tmp_path, stated).facts["angle_scatter"].says
    assert "--angle-errors effective counts them, by the sigma_gamma_deg of the table (1)" in says
    table = readings(1.2, 1, sigma=True)
    noise = Noise(angles=AngleErrors(offset_sd=0.1))
    says = fitted(tmp_path, table, noise=noise).facts["angle_scatter"].says
    assert says.endswith("without --angle-offset")


def test_a_closure_is_not_refuted_for_them(tmp_path):
    path = table_file(tmp_path / "impacts.csv", readings(1.2, 1, sigma=True))
    found = compare(path, ["f", "ifr"], loo=False).verdict
    assert "the law need not be the reason: the values scatter as if each angle" in found.says


def slopes_of(problem, optimum):
    return AngleSlopes.of(problem, optimum.optimum.theta, optimum.sigma)


@pytest.fixture(scope="module", params=[("beta", "e_n"), ("v_x", "v_n", "spin_y"), ("mu_app", "tan_psi_out")])
def clean(request, tmp_path_factory):
    names = tuple(name.replace("spin_y", "spin_y_after") for name in request.param)
    rng = np.random.default_rng(3)
    gamma = np.sort(rng.uniform(5.0, 80.0, 40))
    state = rebound(gamma, degrees=True, **TRUTH)
    table = {"gamma_deg": gamma}
    for name in names:
        value = TRUTH["e_n"] * np.ones(40) if name == "e_n" else getattr(state, name.removesuffix("_after"))
        table[name] = value + 0.01 * rng.standard_normal(40)
        table[f"sigma_{name}"] = 0.01
    result = fitted(tmp_path_factory.mktemp("clean"), pd.DataFrame(table))
    return result.problem, result.least_squares


def misread(slopes, size, rng):
    """The same slopes under residuals of errors of the angles, so many degrees, beside those of the noise."""
    error = size * rng.standard_normal(slopes.impacts.max() + 1)
    left = rng.standard_normal(slopes.left.size) + slopes.along * error[slopes.impacts]
    return replace(slopes, left=left)


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("draws", rest_long((1000, 4000)))
def test_p_values_of_exact_angles_are_those_of_chance(clean, known, draws):
    """Over normal errors, with noises known and one unknown of each observable; the worst impact left out."""
    problem, optimum = clean
    slopes = slopes_of(problem, optimum)
    unknown = () if known else tuple(problem.rows.rows_of(name) for name in problem.rows.names)
    rng = np.random.default_rng(11)
    p = np.array(
        [
            careful_p(replace(slopes, left=rng.standard_normal(slopes.left.size)), unknown)
            for _ in range(draws)
        ]
    )
    for level in (1e-3, 1e-2):
        count = int((p < level).sum())
        assert stats.binomtest(count, draws, level, alternative="greater").pvalue > 1e-3
    # the control: errors of 1.5 degrees are seen
    seen = 0
    for _ in range(50):
        seen += careful_p(misread(slopes, 1.5, rng), unknown) < 1e-3
    assert seen > 30


def test_observables_of_one_impact_share_its_error(clean):
    """Where rows are taken for impacts of their own the same residuals say less."""
    problem, optimum = clean
    slopes, rng = slopes_of(problem, optimum), np.random.default_rng(2)
    own = np.arange(slopes.impacts.size)
    unknown = tuple(problem.rows.rows_of(name) for name in problem.rows.names)
    together, each = 0, 0
    for _ in range(60):
        drawn = misread(slopes, 0.8, rng)
        together += careful_p(drawn, unknown) < 1e-3
        each += careful_p(replace(drawn, impacts=own), unknown) < 1e-3
    # of one observable that knows the angle there is nothing to share
    assert together > each + 15 if problem.rows.names[0] == "v_x" else together == each


def test_many_rows_have_the_p_of_few(clean, monkeypatch):
    problem, optimum = clean
    slopes, rng = slopes_of(problem, optimum), np.random.default_rng(4)
    unknown = tuple(problem.rows.rows_of(name) for name in problem.rows.names)
    basis = np.linalg.qr(slopes.by_constant)[0]
    for _ in range(30):
        left = misread(slopes, 0.6, rng).left
        drawn = replace(slopes, left=left - basis @ (basis.T @ left))
        few = careful_p(drawn, unknown)
        monkeypatch.setattr("ifrfit.inference.diagnostics.angle_error_size._EXACT", 10)
        many = careful_p(drawn, unknown)
        monkeypatch.undo()
        assert many == 1.0 if few == 1.0 else abs(np.log(many) - np.log(few)) < 0.15 * abs(np.log(few)) + 0.7


def test_the_size_is_that_of_the_likelihood(clean):
    """Against the maximum over a grid of sizes, sigma known."""
    problem, optimum = clean
    slopes, rng = slopes_of(problem, optimum), np.random.default_rng(6)
    drawn = misread(slopes, 1.0, rng)
    found = fitted_errors(drawn, deviance_of(drawn, ()), ())
    grid = np.linspace(0.3, 2.0, 341)
    deviances = [_deviance(drawn, size) for size in grid]
    assert found.size == pytest.approx(grid[int(np.argmin(deviances))], abs=0.01)
    assert found.fall == pytest.approx(float(drawn.left @ drawn.left) - min(deviances), rel=0.01)
    # what is left of them is independent and of size 1
    white = drawn.without(found)
    assert float((white.left**2).mean()) == pytest.approx(1.0, abs=0.35)


def _deviance(slopes, size):
    """-2 log likelihood at the best constants, by the covariance as it is written."""
    along = size * slopes.along
    same = slopes.impacts[:, None] == slopes.impacts
    covariance = np.eye(along.size) + np.where(same, np.outer(along, along), 0.0)
    root = np.linalg.cholesky(covariance)
    by, left = np.linalg.solve(root, slopes.by_constant), np.linalg.solve(root, slopes.left)
    rest = left - by @ np.linalg.lstsq(by, left, rcond=None)[0]
    return float(rest @ rest) + 2.0 * float(np.log(np.diag(root)).sum())


@pytest.mark.parametrize("sigma", rest_long([True, False]))
def test_other_flaws_are_not_called_so(tmp_path, sigma):
    """Outliers, impacts of two kinds, an offset of the angles, a noise that grows: none alone is."""
    rng = np.random.default_rng(8)
    called = []
    for seed in range(4):
        plain = readings(0.0, seed, sigma=sigma)
        gross = plain.copy()
        places = rng.choice(len(gross), 4, replace=False)
        gross.loc[places, "beta"] += rng.choice([-0.1, 0.1], 4)
        kinds = readings(0.0, seed, sigma=sigma, mu=np.where(rng.random(80) < 0.5, 0.14, 0.22))
        off = readings(0.0, seed, ("v_x", "v_n"), sigma=sigma, offset=2.0)
        grown = readings(0.0, seed, ("mu_app", "tan_psi_out"), sigma=sigma, noise=0.003)
        grown["tan_psi_out"] *= 1.0 + 0.05 * rng.standard_normal(80)
        grown["mu_app"] *= 1.0 + 0.05 * rng.standard_normal(80)
        for table in (plain, gross, kinds, off, grown):
            fact = fitted(tmp_path, table).facts.get("angle_scatter")
            called.append(fact is not None and not fact.figures["alike"])
    assert sum(called) <= 1


@pytest.mark.parametrize("size", [(0.2, 1.25), (0.3, 2.0)])
def test_errors_whose_size_changes_with_the_angle_are_no_errors_of_angles(tmp_path, size):
    """Both grow where sliding makes the values depend on the angle."""
    for seed in range(4):
        rng = np.random.default_rng(seed)
        gamma = np.round(rng.uniform(3.0, 85.0, 400), 2)
        beta = rebound(gamma, degrees=True, e_n=0.9, e_t=-0.75, mu=0.2).beta
        table = pd.DataFrame(
            {
                "gamma_deg": gamma,
                "beta": beta + 0.03 * (size[0] + (gamma / 50.0) ** size[1]) * rng.standard_normal(400),
            }
        )
        fact = fitted(tmp_path, table, fix={"e_n": 0.9}).facts.get("angle_scatter")
        assert fact is None or "errors whose size changes with the angle" in fact.says


def test_rivals_explain_what_they_stand_for(clean):
    problem, optimum = clean
    slopes, rng = slopes_of(problem, optimum), np.random.default_rng(9)
    even = rng.standard_normal(slopes.left.size)
    gross = even.copy()
    gross[[3, 17, 30]] += (12.0, -11.0, 13.0)
    assert fall_of_outliers(problem, replace(slopes, left=even)) < 10.0
    assert fall_of_outliers(problem, replace(slopes, left=gross)) > 250.0
    assert drop_of_even(problem, replace(slopes, left=2.0 * even)) > 30.0
    assert abs(drop_of_even(problem, replace(slopes, left=even))) < 10.0
    values = problem.predict(optimum.optimum.theta) / optimum.sigma
    grown = even + 0.1 * values * rng.standard_normal(even.size)
    assert drop_of_growth(problem, optimum, replace(slopes, left=grown)) > 30.0


def test_nothing_is_asked_where_it_cannot_be(tmp_path):
    table = readings(1.2, 1, sigma=True)
    noise = effective(fitted(tmp_path, table).facts["angle_scatter"])
    result = fitted(tmp_path, table, noise=noise)
    assert angle_scatter(result.problem, result.least_squares, {}) is None
    few = fitted(tmp_path, readings(3.0, 1, n=7, sigma=True))
    assert "angle_scatter" not in few.facts


def test_next_to_no_noise_is_no_number_to_give(tmp_path):
    """Where errors of the angles are all the scatter, a sigma is told that makes a fit."""
    table = readings(2.0, 1, ("v_x", "v_n"), n=40, noise=0.0)
    says = fitted(tmp_path, table).facts["angle_scatter"].says
    sigmas = {name: float(x) for x, name in re.findall(r"([\d.e-]+)(?: or less)? for (v_x|v_n)", says)}
    assert "or less for" in says
    assert min(sigmas.values()) > 1e-4
    for name, sigma in sigmas.items():
        table[f"sigma_{name}"] = sigma
    size = float(re.search(r"--sigma-gamma ([\d.]+)", says)[1])
    noise = Noise("scaled", angles=AngleErrors("effective", sigma_deg=size))
    found = fitted(tmp_path, table, noise=noise)
    for name, true in TRUTH.items():
        assert abs(found.constants[name].value - true) < 4.0 * found.constants[name].stderr


def test_rounding_is_no_error_of_the_angles(tmp_path):
    """Equal readings where no angle matters, and the scatter of rounding where it does."""
    gamma = np.linspace(8.0, 80.0, 36)
    state = rebound(gamma, degrees=True, e_n=0.9, e_t=-0.7, mu=0.15)
    e_n = np.round(0.9 + 1e-4 * np.random.default_rng(1).standard_normal(36), 4)
    table = pd.DataFrame({"gamma_deg": gamma, "beta": np.round(state.beta, 4), "e_n": e_n})
    facts = fitted(tmp_path, table).facts
    assert "angle_scatter" not in facts
    assert "rounded_readings" in facts


@pytest.mark.long
def test_a_weight_that_no_integral_bears_makes_no_answer(tmp_path):
    table = readings(0.0, 1, n=36, noise=0.0, sigma=False)
    table["beta"] = table["beta"].round(4)
    table["e_n"] = np.round(0.9 + 1e-4 * np.random.default_rng(1).standard_normal(36), 4)
    table["sigma_beta"], table["sigma_e_n"] = 2.1e-11, 1.2e-4
    noise = Noise("scaled", angles=AngleErrors("effective", sigma_deg=0.0011))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = fitted(tmp_path, table, noise=noise, method="exact")
        found.summary()
    assert not found.facts["converged"].ok
    e_t = found.constants["e_t"]
    # weights beyond a million millions: no answer, or the right one
    assert e_t.status == "not_determined" or e_t.value == pytest.approx(TRUTH["e_t"], abs=1e-9)
