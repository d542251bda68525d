"""Noise that is known where a sigma is given and unknown elsewhere, in one fit."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from factories import at_most, impacts_text, problem_of
from json_schemas import validator
from refusals import refused
from scipy import optimize, special

import ifrfit
from ifrfit.data import Observations
from ifrfit.errors import DataError
from ifrfit.inference.bootstrap.batched_solver import BatchedSolver
from ifrfit.inference.bootstrap.schemes import draw_replicates, make_scheme
from ifrfit.inference.bootstrap.sequential_solver import SequentialSolver
from ifrfit.inference.diagnostics.residuals import outliers, residuals_of
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import dof_of_functional, least_squares, satterthwaite
from ifrfit.inference.optimize.noise_modes import noise_modes, phi
from ifrfit.inference.result.restore import question
from ifrfit.physics import rebound

GAMMA = np.linspace(8.0, 78.0, 16)
FEW = np.linspace(10.0, 50.0, 5)
BETA = {"gamma": GAMMA, "noise": 0.03, "sigma": 0.03, "c": -0.8}
BETA_WITHOUT = BETA | {"sigma": None}
E_N = {"gamma": FEW, "observables": ("e_n",), "noise": 0.02, "sigma": 0.02, "c": -0.8, "seed": 3}
E_N_WITHOUT = E_N | {"sigma": None}
# two series that contradict one another: which of them is noisy?
CONTRADICTING = (
    {"gamma": GAMMA[::2], "series": "a", "mu": 0.14, "c": -0.85, "noise": 0.1, "sigma": 0.1, "seed": 4},
    {"gamma": GAMMA, "series": "b", "mu": 0.25, "c": -0.7, "noise": 0.006, "sigma": None},
)


def observed(impacts, *parts: dict[str, object]) -> Observations:
    return ifrfit.read(impacts(*parts))


def of_groups(problem: Problem) -> dict[str, int]:
    return {name: rows.size for name, rows in problem.noise_groups().items()}


@pytest.mark.parametrize(
    ("parts", "policy", "groups"),
    [
        ((BETA, E_N), "known", {}),
        ((BETA_WITHOUT, E_N_WITHOUT), "unknown", {"run/beta": 16, "run/e_n": 5}),
        ((BETA, E_N_WITHOUT), "mixed", {"run/e_n": 5}),
        ((BETA_WITHOUT, E_N), "mixed", {"run/beta": 16}),
        ((BETA, BETA_WITHOUT | {"series": "b"}, BETA_WITHOUT | {"series": "c"}), "mixed", {"beta": 32}),
    ],
)
def test_each_observable_of_a_series_is_known_where_all_its_rows_have_a_sigma(impacts, parts, policy, groups):
    problem = problem_of(observed(impacts, *parts))
    assert problem.noise.policy == policy
    assert of_groups(problem) == groups
    given = np.isfinite(problem.observations.table["sigma"].to_numpy(dtype=float))
    np.testing.assert_array_equal(problem.noise.is_given, given)


def test_separate_noise_is_one_of_each_series_without_a_sigma(impacts):
    parts = (BETA, BETA_WITHOUT | {"series": "b"}, BETA_WITHOUT | {"series": "c"})
    problem = problem_of(observed(impacts, *parts), separate_noise=True)
    assert of_groups(problem) == {"b/beta": 16, "c/beta": 16}


def test_rows_without_a_sigma_beside_others_that_have_one_are_left_out_and_counted(impacts, tmp_path):
    path = impacts(BETA, E_N)
    lines = path.read_text(encoding="utf-8").splitlines()
    lines[4], lines[7] = (line.rpartition(",")[0] + "," for line in (lines[4], lines[7]))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    found = ifrfit.fit(path, method="lsq")
    assert found.noise.policy == "known"
    assert found.inputs[0].rows_skipped == {"without a sigma, beside others that have one": 2}
    assert "2 without a sigma, beside others that have one" in found.summary()
    without = ifrfit.fit(path, method="lsq", exclude=[5, 8])
    assert found.constants == without.constants
    unknown = ifrfit.fit(path, method="lsq", noise="unknown")
    assert unknown.inputs[0].rows_used == 21
    assert any(
        said.startswith("sigma is given in 19 of 21 rows, and is not used") for said in unknown.warnings
    )


def test_few_rows_with_a_sigma_say_nothing_of_the_others(impacts):
    path = impacts(BETA, E_N)
    lines = path.read_text(encoding="utf-8").splitlines()
    lines[1:10] = (line.rpartition(",")[0] + "," for line in lines[1:10])
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    found = ifrfit.fit(path, method="lsq")
    assert found.noise.policy == "mixed"
    assert found.noise.given == ("run/e_n",)
    assert found.inputs[0].rows_used == 21
    said = next(each for each in found.warnings if "not used" in each)
    assert said.startswith("impacts.csv, line 2: no sigma, and only 7 of 16 values of beta in run have one")
    assert ifrfit.fit(path, method="lsq", noise="unknown").noise.policy == "unknown"


def test_data_not_held_in_memory_leave_the_same_rows_out(tmp_path):
    rng = np.random.default_rng(4)
    gamma = np.linspace(5.0, 80.0, 60)
    beta = ifrfit.rebound(gamma, e_n=0.9, e_t=-0.7, mu=0.15, degrees=True).beta + 0.03 * rng.normal(size=60)
    table = pd.DataFrame({"gamma_deg": gamma, "beta": beta, "sigma_beta": 0.03})
    table.loc[[3, 20, 44], "sigma_beta"] = np.nan
    table.to_csv(tmp_path / "part.csv", index=False)
    held, streamed = (ifrfit.fit(data, fix={"e_n": 0.9}) for data in (table, tmp_path))
    assert streamed.problem is None
    for name in ("e_t", "mu"):
        assert streamed.constants[name].value == pytest.approx(held.constants[name].value, abs=1e-9)
        assert streamed.constants[name].stderr == pytest.approx(held.constants[name].stderr, rel=1e-3)
    assert held.inputs[0].rows_used == streamed.inputs[0].rows_used == 57
    table.loc[:35, "sigma_beta"] = np.nan
    table.to_csv(tmp_path / "part.csv", index=False)
    assert ifrfit.fit(table, fix={"e_n": 0.9}).noise.policy == "unknown"
    with refused(DataError, match=r"only 23 of 60 values of beta"):  # one noise for all is all that is known
        ifrfit.fit(tmp_path, fix={"e_n": 0.9})


def test_a_part_without_unknown_noise_is_known(impacts):
    problem = problem_of(observed(impacts, BETA, E_N_WITHOUT))
    assert problem.with_rows(np.arange(16)).noise.is_known
    assert problem.with_rows(np.arange(16, 21)).noise.is_unknown
    assert problem.with_rows(np.arange(3, 18)).noise.is_mixed


@pytest.mark.parametrize("policy", ["known", "scaled"])
def test_a_policy_that_needs_every_sigma_names_the_row_and_the_remedy(impacts, policy):
    with refused(DataError, match=r"line 18: no sigma, but --noise .* use --noise mixed"):
        ifrfit.fit(impacts(BETA, E_N_WITHOUT), noise=policy)


def test_other_errors_than_gaussian_ones_are_refused_beside_both(impacts):
    with refused(DataError, match=r"run/e_n: no sigma, beside others that have one, and --tails student-t"):
        ifrfit.fit(impacts(BETA, E_N_WITHOUT), noise=ifrfit.Noise(tails="student-t"))
    two = impacts(BETA, BETA_WITHOUT | {"series": "b"})
    with refused(DataError, match="or take --noise unknown"):
        ifrfit.fit(two, noise=ifrfit.Noise(tails="student-t"), fix={"e_n": 0.94})
    found = ifrfit.fit(two, noise=ifrfit.Noise("unknown", tails="student-t"), fix={"e_n": 0.94})
    assert found.noise.policy == "unknown"


def test_a_few_readings_of_a_series_that_another_could_help_are_told_how(impacts):
    few = E_N_WITHOUT | {"series": "b", "gamma": FEW[:1]}
    with refused(DataError, match=r"1 value of e_n cannot .*, or take --noise unknown\."):
        ifrfit.fit(impacts(BETA, E_N, few))
    with refused(DataError, match=r"or more impacts at other angles\."):
        ifrfit.fit(impacts(BETA, few | {"series": "run"}, name="alone.csv"))


# ---- where the parts share no constant, each is as it would be alone


@pytest.mark.parametrize("method", ["lsq", "exact"])
def test_what_rests_on_given_sigma_is_as_without_the_other_readings(impacts, method):
    """e_t follows from beta alone: normal intervals of the known sigma, whatever e_n scatters."""
    both = ifrfit.fit(impacts(BETA, E_N_WITHOUT), method=method)
    alone = ifrfit.fit(
        impacts(BETA, name="alone.csv"), method=method, fix={"e_n": both.constants["e_n"].value}
    )
    for level in (0.68, 0.95):
        np.testing.assert_allclose(
            both.constants["e_t"].interval(level), alone.constants["e_t"].interval(level), atol=2e-5
        )


def test_what_rests_on_unknown_noise_has_students_interval(impacts):
    both = ifrfit.fit(impacts(BETA | {"e_n": 0.7}, E_N_WITHOUT | {"e_n": 0.7}), method="lsq")
    readings = both.points["value"][both.points["observable"] == "e_n"].to_numpy(dtype=float)
    half = special.stdtrit(4.0, 0.975) * readings.std(ddof=1) / np.sqrt(5.0)
    expected = readings.mean() - half, readings.mean() + half
    np.testing.assert_allclose(both.constants["e_n"].interval95, expected, atol=2e-5)  # the domain ends at 1
    assert both.noise.sigma["run/e_n"] == pytest.approx(readings.std(ddof=1), rel=1e-9)
    assert both.noise.sigma["run/beta"] == pytest.approx(0.03)


def test_degrees_of_freedom_are_those_of_the_noise_that_a_constant_rests_on(impacts):
    problem = problem_of(observed(impacts, BETA, E_N_WITHOUT))
    fit = least_squares(problem)
    names, to_theta = problem.parameters.names, fit.gaussian.to_theta
    assert dof_of_functional(problem, fit, to_theta[names.index("e_n")]) == pytest.approx(4.0)
    assert dof_of_functional(problem, fit, to_theta[names.index("e_t")]) == np.inf
    of_mu = dof_of_functional(problem, fit, to_theta[names.index("mu")])
    assert 4.0 < of_mu < np.inf


def test_satterthwaite():
    assert satterthwaite(np.array([1.0]), np.array([7.0])) == pytest.approx(7.0)
    assert satterthwaite(np.array([0.5, 0.5]), np.array([7.0, 7.0])) == pytest.approx(14.0)
    assert satterthwaite(np.array([0.0]), np.array([7.0])) == np.inf


# ---- the certificate


def local_minima(problem: Problem, n: int = 61) -> list[float]:
    """Local minima of Phi over two free constants, by a grid and a search from each of its low places."""
    free = np.flatnonzero(problem.parameters.free)
    start = least_squares(problem).optimum.theta
    low, high = problem.parameters.bounds()
    axes = [np.linspace(low[i], min(high[i], 1.0), n) for i in free]

    def value(x: np.ndarray) -> float:
        theta = start.copy()
        theta[free] = np.clip(x, low[free], high[free])
        return phi(problem, theta)

    grid = np.array([[value(np.array([x, y])) for y in axes[1]] for x in axes[0]])
    found: list[float] = []
    for i in range(1, n - 1):
        for j in range(1, n - 1):
            if grid[i, j] <= grid[i - 1 : i + 2, j - 1 : j + 2].min():
                options = {"xatol": 1e-9, "fatol": 1e-10, "maxiter": 4000}
                x0 = np.array([axes[0][i], axes[1][j]])
                found.append(optimize.minimize(value, x0, method="Nelder-Mead", options=options).fun)
    return sorted({round(each, 5) for each in found})


def test_modes_are_found_on_either_side_and_the_best_is_certified(impacts):
    """By the given sigma of one series the other is noisy; taken at its word, it outweighs the given one."""
    problem = problem_of(observed(impacts, *CONTRADICTING), fix={"e_n": 0.94})
    found, expected = noise_modes(problem), local_minima(problem)
    assert found.gap is not None
    assert found.gap < 1e-3
    assert len(found.modes) == 2
    np.testing.assert_allclose([mode.value for mode in found.modes], expected[:2], atol=1e-5)
    assert np.abs(found.modes[0].theta - found.modes[1].theta).max() > 0.05


def test_phi_holds_chi2_of_the_given_sigma(impacts):
    problem = problem_of(observed(impacts, BETA, E_N_WITHOUT))
    theta = np.array([0.9, -0.8, 0.13])
    residual = problem.rows.value - problem.predict(theta)
    expected = ((residual[:16] / 0.03) ** 2).sum() + 5 * np.log((residual[16:] ** 2).mean())
    assert phi(problem, theta) == pytest.approx(expected)


@pytest.mark.parametrize("seed", range(4))
def test_one_observable_known_and_one_unknown_that_share_all_constants(impacts, seed):
    parts = (
        BETA | {"seed": seed},
        BETA_WITHOUT | {"observables": ("spin_y_after",), "seed": 10 + seed, "mu": 0.16},
    )
    problem = problem_of(observed(impacts, *parts), fix={"e_n": 0.94})
    found = noise_modes(problem)
    assert found.gap is not None
    assert found.gap < 1e-3
    assert found.best.value == pytest.approx(local_minima(problem, 41)[0], abs=2e-5)


# ---- methods


def log_density_on(problem: Problem, points: np.ndarray) -> np.ndarray:
    """Log of prior times likelihood, the unknown noise integrated by the trapezoidal rule; flat priors."""
    residual = problem.rows.value - problem.predict(points)
    given = problem.noise.is_given
    z = residual[:, given] / problem.noise.sigma[given]
    ((name, rows),) = problem.noise_groups().items()
    low, high = problem.noise_bounds()[name]
    logs = np.linspace(np.log(low), np.log(high), 401)
    square = (residual[:, rows] ** 2).sum(axis=1)
    total = -0.5 * (z**2).sum(axis=1) - np.log(problem.noise.sigma[given]).sum()
    each = -rows.size * logs - 0.5 * np.outer(square, np.exp(-2.0 * logs))
    total += special.logsumexp(each, axis=1) + np.log((logs[1] - logs[0]) / np.log(high / low))
    return total - 0.5 * residual.shape[1] * np.log(2.0 * np.pi)


def test_the_posterior_is_that_of_a_dense_grid(impacts):
    """beta of a known sigma and spins of an unknown one, which share their constants."""
    parts = (
        BETA | {"gamma": GAMMA[::2]},
        BETA_WITHOUT | {"gamma": FEW, "observables": ("spin_y_after",), "seed": 1},
    )
    found = ifrfit.fit(impacts(*parts), fix={"e_n": 0.94})
    e_t, mu = np.linspace(-1.0, -0.65, 121), np.linspace(0.08, 0.18, 121)
    points = np.stack([x.reshape(-1) for x in np.meshgrid([0.94], e_t, mu, indexing="ij")], axis=1)
    log_density = log_density_on(found.problem, points)
    log_density -= np.log(0.6 * 2.0)  # the priors: e_t from -1 to -0.4, mu from 0 to 2
    weight = np.exp(log_density - log_density.max())
    cell = (e_t[1] - e_t[0]) * (mu[1] - mu[0])
    evidence = log_density.max() + np.log(weight.sum() * cell)
    assert found.fit.log_evidence == pytest.approx(evidence, abs=3e-4)
    weight /= weight.sum()
    for name, values in (("e_t", points[:, 1]), ("mu", points[:, 2])):
        mean = weight @ values
        sd = np.sqrt(weight @ (values - mean) ** 2)
        assert found.distribution.mean(name) == pytest.approx(mean, abs=1e-3 * sd)
        assert found.distribution.sd(name) == pytest.approx(sd, rel=1e-3)


def test_wide_tails_of_an_unknown_noise_end_where_the_known_one_ends_them(impacts):
    """Four precise rows of unknown noise beside many loose ones of known sigma: the evidence of a grid."""
    parts = (
        BETA | {"noise": 0.3, "sigma": 0.3, "gamma": np.linspace(5.0, 80.0, 30)},
        BETA_WITHOUT | {"gamma": FEW[:4] + 20.0, "observables": ("spin_y_after",), "seed": 1, "noise": 0.02},
    )
    found = ifrfit.fit(impacts(*parts), fix={"e_n": 0.94, "mu": 0.12})
    e_t = np.linspace(-1.0, -0.4, 4001)
    points = np.stack([x.reshape(-1) for x in np.meshgrid([0.94], e_t, [0.12], indexing="ij")], axis=1)
    weight = np.full(e_t.size, (e_t[1] - e_t[0]) / 0.6)
    weight[[0, -1]] *= 0.5
    evidence = special.logsumexp(log_density_on(found.problem, points), b=weight)
    assert found.fit.log_evidence == pytest.approx(evidence, abs=1e-4)


def test_all_methods_agree(impacts):
    path = impacts(BETA, E_N_WITHOUT)
    exact = ifrfit.fit(path)
    for method, share in (("lsq", 0.1), ("profile", 0.1), ("mcmc", 0.15), ("bootstrap", 0.5)):
        other = ifrfit.fit(path, method=method, seed=1)
        assert other.noise.policy == "mixed"
        for name in ("e_t", "mu"):
            one, two = exact.constants[name], other.constants[name]
            width = one.interval95[1] - one.interval95[0]
            assert two.value == pytest.approx(one.value, abs=0.1 * width), (method, name)
            np.testing.assert_allclose(two.interval95, one.interval95, atol=share * width, err_msg=method)
    names = set(exact.distribution.names)
    assert "noise[run/e_n]" in names
    assert "noise[run/beta]" not in names


def test_the_offset_of_the_angles_is_known_by_its_prior(impacts):
    """Least squares widens by Student's t only what rests on the unknown noise."""
    path, noise = impacts(BETA, E_N_WITHOUT), ifrfit.Noise(angles=ifrfit.AngleErrors(offset_sd=1.0))
    exact, lsq = (ifrfit.fit(path, noise=noise, method=method) for method in ("exact", "lsq"))
    one, two = exact.constants["mu"].interval95, lsq.constants["mu"].interval95
    assert one[1] - one[0] == pytest.approx(two[1] - two[0], rel=0.1)


@pytest.mark.parametrize("scheme", ["cases", "residual"])
def test_replicates_together_are_those_one_by_one(impacts, scheme):
    problem = problem_of(observed(impacts, BETA, E_N_WITHOUT))
    found = least_squares(problem)
    lot = draw_replicates(problem, make_scheme(scheme, problem, found), np.random.SeedSequence(1).spawn(20))
    together, alone = (solver.of(problem, found).solve(lot) for solver in (BatchedSolver, SequentialSolver))
    fine = np.array([not reason for reason in together.reason])
    assert fine.sum() > 10
    assert together.noise.shape == (20, 1)
    np.testing.assert_allclose(together.theta[fine], alone.theta[fine], atol=1e-7)
    np.testing.assert_allclose(together.noise[fine], alone.noise[fine], rtol=1e-7)


# ---- what is said of the residuals


def uneven(path: Path, seed: int) -> Path:
    """A clean table: beta with a sigma of its own in every row, over a factor ten, and e_n without."""
    rng = np.random.default_rng(seed)
    gamma = np.sort(rng.uniform(5.0, 80.0, 16))
    rows = [line.split(",") for line in impacts_text(gamma, c=-0.8)]
    rows += [line.split(",") for line in impacts_text(FEW, ("e_n",), c=-0.8, noise=0.02, seed=seed)]
    table = pd.DataFrame(
        rows, columns=["series", "observable", "gamma_deg", "spin_x", "spin_y", "value", "sigma"]
    )
    numbers = table.columns[2:]
    table[numbers] = table[numbers].astype(float)
    sigma = 0.01 * 10.0 ** rng.uniform(0.0, 1.0, 16)
    table.loc[:15, "value"] += sigma * rng.standard_normal(16)
    table["sigma"] = np.append(sigma, np.full(5, np.nan))
    table.to_csv(path, index=False)
    return path


def test_rows_of_a_large_given_sigma_are_no_outliers(tmp_path):
    """With the given sigmas thrown away, a tenth of such clean tables has an outlier."""
    wrong = {"mixed": 0, "unknown": 0}
    for seed in range(30):
        data = ifrfit.read(uneven(tmp_path / "uneven.csv", seed))
        for policy in wrong:
            problem = problem_of(data, noise=policy)
            found = least_squares(problem)
            wrong[policy] += not outliers(problem, found, residuals_of(problem, found)).ok
    assert wrong["mixed"] <= 2  # 1 % each
    assert wrong["unknown"] > wrong["mixed"]


def test_an_outlier_of_either_kind_is_named(impacts):
    path = impacts(BETA, E_N_WITHOUT | {"gamma": np.linspace(10.0, 50.0, 9)})
    lines = path.read_text(encoding="utf-8").splitlines()
    for line, by in ((6, 0.3), (20, -0.3)):
        cells = lines[line].split(",")
        cells[5] = repr(float(cells[5]) + by)
        lines[line] = ",".join(cells)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    fact = ifrfit.fit(path, method="lsq").facts["outliers"]
    assert set(fact.figures["rows"]) == {"impacts.csv line 7 (beta)", "impacts.csv line 21 (e_n)"}


def test_a_given_sigma_is_held_against_the_scatter(impacts):
    small = ifrfit.fit(impacts(BETA | {"sigma": 0.006}, E_N_WITHOUT), method="lsq")
    assert small.facts["scatter_too_large"].says.startswith("the values of beta scatter ")
    assert small.facts["lack_of_fit"].ok
    large = ifrfit.fit(impacts(BETA | {"sigma": 0.3}, E_N_WITHOUT, name="large.csv"), method="lsq")
    fact = large.facts["scatter_too_small"]
    assert fact.says.startswith("values whose sigma is given scatter")
    assert "--noise unknown takes its size" in fact.says
    fine = ifrfit.fit(impacts(BETA, E_N_WITHOUT, name="fine.csv"), method="lsq")
    assert fine.facts["lack_of_fit"].ok
    assert "scatter_too_small" not in fine.facts


def test_series_that_differ_are_told_though_few_readings_know_their_noise(impacts):
    """Three readings of e_n have two degrees of freedom, but mu rests on given sigmas."""
    parts = (
        BETA | {"series": "a"},
        BETA | {"series": "b", "mu": 0.2, "seed": 5},
        E_N_WITHOUT | {"series": "a", "gamma": FEW[:3]},
    )
    fact = ifrfit.fit(impacts(*parts), method="lsq").facts["pooling"]
    assert not fact.ok
    assert "mu" in fact.figures["separate"]


# ---- what is said


def test_the_result_says_whose_sigma_was_given(impacts, tmp_path):
    found = ifrfit.fit(impacts(BETA, E_N_WITHOUT))
    text = found.summary()
    assert "21 impacts, beta and e_n, provenance not stated, sigma of beta given" in text
    assert "one unknown noise beside given sigma" in text
    assert "of e_n, from the scatter\n" in text
    assert re.search(r"noise +0\.030 +- +of beta, as given\n", text)
    assert "errors of e_n as large as the scatter, those of beta as given" in found.assumed
    path = tmp_path / "result.json"
    found.save(path)
    kept = json.loads(path.read_text(encoding="utf-8"))
    validator("result").validate(kept)
    assert kept["noise"]["policy"] == "mixed"
    assert kept["noise"]["given"] == ["run/beta"]
    assert list(kept["noise"]["estimates"]) == ["run/e_n"]
    read = ifrfit.load_result(path)
    assert read.noise.given == ("run/beta",)
    problem, _ = question(read)
    assert problem.digest == found.problem.digest


def test_series_are_named_where_an_observable_is_known_in_one_alone(impacts):
    parts = (BETA | {"series": "a"}, BETA_WITHOUT | {"series": "b", "seed": 1})
    for method in ("lsq", "exact"):
        found = ifrfit.fit(impacts(*parts), fix={"e_n": 0.94}, method=method)
        assert found.noise.sigma["a/beta"] == pytest.approx(0.03)
        text = found.summary()
        assert "of beta in b, from the scatter\n" in text
        assert "of beta in a, as given\n" in text
        assert "errors of beta in b as large as the scatter, those of beta in a as given" in found.assumed


def test_sigmas_that_differ_are_told_by_their_range(tmp_path):
    found = ifrfit.fit(uneven(tmp_path / "uneven.csv", 1), method="lsq")
    low, high = found.points["sigma"].min(), found.points["sigma"].max()
    assert f"{low:.3f}..{high:.3f}" in found.summary()
    assert "of beta, as given" in found.summary()


# ---- calibration


@pytest.mark.long
@pytest.mark.parametrize("method", ["lsq", "exact"])
@pytest.mark.parametrize("known", ["beta", "e_n"])
def test_intervals_hold_the_truth_as_often_as_they_say(tmp_path, method, known):
    """400 tables, constants drawn inside their domains; sigma of beta over a factor ten from row to row."""
    rng = np.random.default_rng(11)
    n, inside = (
        400,
        dict.fromkeys([(name, level) for name in ("e_n", "e_t", "mu") for level in (0.68, 0.95)], 0),
    )
    false = 0
    for _ in range(n):
        truth = {"e_n": rng.uniform(0.7, 0.95), "e_t": rng.uniform(-0.9, -0.5), "mu": rng.uniform(0.08, 0.25)}
        gamma = {"beta": np.sort(rng.uniform(5.0, 80.0, 16)), "e_n": rng.uniform(5.0, 60.0, 5)}
        sigma = {"beta": 0.01 * 10.0 ** rng.uniform(0.0, 1.0, 16), "e_n": np.full(5, 0.02)}
        if known == "e_n":
            sigma["beta"] = np.full(16, 0.03)
        parts = []
        for name, angles in gamma.items():
            beta = rebound(angles, degrees=True, **truth).beta
            exact = beta if name == "beta" else np.full(5, truth["e_n"])
            value = exact + sigma[name] * rng.standard_normal(angles.size)
            given = sigma[name] if name == known else np.nan
            parts.append(
                pd.DataFrame({"gamma_deg": angles, "value": value, "sigma": given, "observable": name})
            )
        path = tmp_path / "table.csv"
        pd.concat(parts).assign(series="run").to_csv(path, index=False)
        found = ifrfit.fit(path, method=method)
        assert found.noise.policy == "mixed"
        for name, level in inside:
            low, high = found.constants[name].interval(level)
            inside[name, level] += low <= truth[name] <= high
        false += not found.facts["outliers"].ok
    for (_, level), count in inside.items():
        assert n - at_most(n, 1.0 - level) <= count <= at_most(n, level)
    assert false <= at_most(n, 0.01)


def test_values_without_errors_beside_others_are_refused_in_words() -> None:
    """Readings of e_n that are all the value it is fixed at leave the search no place to look."""
    rng = np.random.default_rng(2)
    gamma, spin = rng.uniform(5.0, 85.0, 60), rng.uniform(-0.5, 0.5, 60)
    after = ifrfit.rebound(gamma, e_n=0.6, e_t=-0.83, mu=0.03, spin_y=spin, degrees=True).spin_y
    is_spin = rng.random(60) < 0.5
    table = {
        "gamma_deg": gamma,
        "spin_y": spin,
        "spin_y_after": np.where(is_spin, after, np.nan),
        "e_n": np.where(is_spin, np.nan, 0.6),
    }
    with refused(DataError, match="Add a column sigma|rounded"):
        ifrfit.fit(
            table, fix={"e_n": 0.6}, prior={"mu": (0.03, 0.003)}, bounds={"mu": (0.0, 0.06)}, method="lsq"
        )
