"""Errors that rows have in common: those of a figure's calibration, and any covariance of values."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from factories import rest_long
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refused
from scipy import special

import ifrfit
from ifrfit import AngleErrors, Bootstrap, Exact, Model, Noise, Profile
from ifrfit.campaign.run import run_campaign
from ifrfit.data.common_errors import common_columns_in, loadings_of
from ifrfit.data.covariance import split, with_covariance
from ifrfit.data.table_text import table_text
from ifrfit.errors import DataError, IfrfitError, UsageError
from ifrfit.inference.io.read_result import from_dict
from ifrfit.inference.model.log_posterior import Density
from ifrfit.inference.optimize.common_error_search import _with_partitions
from ifrfit.inference.optimize.generalised_least_squares import partitions
from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.inference.optimize.solve import solve
from ifrfit.inference.posterior import integrate
from ifrfit.inference.result.restore import question

TRUE = {"e_n": 0.9, "e_t": -0.8, "mu": 0.15}
E_N = {"e_n": 0.9}
SIGMA = 0.02


def table(seed=1, *, n=25, low=5.0, high=80.0, value=(0.03,), angle=(0.0,), sigma=SIGMA):
    """A long table of beta with errors in common that grow along the angle, drawn with the values."""
    rng = np.random.default_rng(seed)
    gamma = np.linspace(low, high, n)
    shape = np.column_stack([np.cos(k * np.radians(gamma)) for k in range(len(value))])
    z = rng.standard_normal(len(value))
    by_value, by_angle = shape * np.array(value), shape * np.array(angle)
    true = gamma - by_angle @ z
    beta = ifrfit.rebound(true, **TRUE, degrees=True).beta + by_value @ z + sigma * rng.standard_normal(n)
    columns = {"observable": "beta", "gamma_deg": gamma, "value": beta, "sigma": np.full(n, sigma)}
    for k in range(len(value)):
        columns |= {f"common{k + 1}": by_value[:, k], f"common{k + 1}_gamma_deg": by_angle[:, k]}
    return pd.DataFrame(columns)


def fitted(data, method="lsq", noise="known", **choices):
    return ifrfit.fit(data, method=method, noise=noise, **({"fix": E_N} | choices))


def plain(data):
    return data.drop(columns=common_columns_in(data.columns))


# ---------------------------------------------------------------------------------- known answers


def sticking(n=12, seed=3):
    """Impacts that all stick, where beta is e_t + 1.4: one unknown, linear; and a dense covariance."""
    rng = np.random.default_rng(seed)
    gamma = np.linspace(5.0, 40.0, n)
    root = rng.normal(0.0, 0.02, (n, n))
    covariance = root @ root.T + 0.01**2 * np.eye(n)
    beta = 0.7 + np.linalg.cholesky(covariance) @ rng.standard_normal(n)
    return gamma, beta, covariance


def test_least_squares_are_the_generalised_ones_of_the_textbook():
    """Aitken (1936): the estimate 1' C^-1 y / 1' C^-1 1, its variance 1 / 1' C^-1 1, and its chi2."""
    gamma, beta, covariance = sticking()
    found = ifrfit.fit(
        gamma_deg=gamma, beta=beta, covariance=covariance, fix={"e_n": 0.9, "mu": 1.0}, method="lsq"
    )
    inverse, one = np.linalg.inv(covariance), np.ones(beta.size)
    weight = one @ inverse @ one
    best = one @ inverse @ beta / weight
    chi2 = (beta - best) @ inverse @ (beta - best)
    estimate = found.constants.e_t
    assert estimate.value == pytest.approx(best - 1.4, abs=1e-9)
    assert estimate.stderr == pytest.approx(weight**-0.5, rel=1e-8)
    assert found.fit.chi2 == pytest.approx(chi2, rel=1e-8)
    assert found.fit.dof == beta.size - 1
    assert found.fit.p_value == pytest.approx(special.chdtrc(beta.size - 1, chi2), rel=1e-6)
    sign, log_det = np.linalg.slogdet(2.0 * np.pi * covariance)
    assert sign == 1.0
    assert found.fit.log_likelihood == pytest.approx(-0.5 * (chi2 + log_det), abs=1e-7)
    # the control: as if rows were independent
    alone = ifrfit.fit(
        gamma_deg=gamma,
        beta=beta,
        sigma=np.sqrt(np.diag(covariance)),
        fix={"e_n": 0.9, "mu": 1.0},
        method="lsq",
    )
    assert abs(alone.constants.e_t.stderr / estimate.stderr - 1.0) > 0.1


def test_the_exact_posterior_of_a_linear_question_is_the_normal_law():
    gamma, beta, covariance = sticking()
    found = ifrfit.fit(gamma_deg=gamma, beta=beta, covariance=covariance, fix={"e_n": 0.9, "mu": 1.0})
    inverse, one = np.linalg.inv(covariance), np.ones(beta.size)
    weight = float(one @ inverse @ one)
    best, sd = one @ inverse @ beta / weight, weight**-0.5
    assert found.facts["converged"].ok
    error = found.facts["converged"].figures["error"]
    estimate = found.constants.e_t
    assert estimate.value == pytest.approx(best - 1.4, abs=4.0 * error * sd)
    assert estimate.stderr == pytest.approx(sd, rel=4.0 * error)
    # integral over e_t, whose prior is flat between -1 and 1 (no end within 30 sd)
    chi2 = (beta - best) @ inverse @ (beta - best)
    log_z = -0.5 * (chi2 + np.linalg.slogdet(2.0 * np.pi * covariance)[1])
    (prior,) = found.problem.free_parameters
    log_z += np.log(sd * np.sqrt(2.0 * np.pi)) - np.log(prior.upper - prior.lower)
    assert found.fit.log_evidence == pytest.approx(log_z, abs=4.0 * error + 1e-6)


@pytest.mark.parametrize("angle", rest_long([(1.0,), (0.0,)]))
def test_the_posterior_is_that_of_a_dense_grid_over_the_common_error_itself(angle):
    """Brute force over e_t, mu and z, from the rebound formulae: angles are turned in earnest, not linearly.

    The angles are off by up to a degree, 3 sd of mu. What is linear in the package is the turn about the best
    one, whose posterior sd is a tenth of that: the rest is below the errors of sampling.
    """
    data = table(seed=5, n=15, angle=angle)
    exact, chains = fitted(data, "exact"), fitted(data, ifrfit.MCMC(max_steps=400))
    columns = data[["gamma_deg", "value", "common1", "common1_gamma_deg"]].to_numpy()
    axes = [
        np.linspace(c.value - 5.0 * c.stderr, c.value + 5.0 * c.stderr, 61)
        for c in (exact.constants.e_t, exact.constants.mu)
    ]
    axes[0] = np.clip(axes[0], -1.0, 1.0)
    z = np.linspace(-4.5, 4.5, 91)
    e_t, mu, shift = np.meshgrid(*axes, z, indexing="ij")
    log_density = -0.5 * shift**2
    for gamma, value, by_value, by_angle in columns:
        there = ifrfit.rebound(gamma - by_angle * shift, e_n=0.9, e_t=e_t, mu=mu, degrees=True).beta
        log_density -= 0.5 * ((value - by_value * shift - there) / SIGMA) ** 2
    density = np.exp(log_density - log_density.max())
    for place, name in enumerate(("e_t", "mu")):
        own = density.sum(axis=tuple(i for i in range(3) if i != place))
        own /= own.sum()
        mean = float(own @ axes[place])
        sd = float(np.sqrt(own @ (axes[place] - mean) ** 2))
        for result, tolerance in ((exact, 0.05), (chains, 0.08)):
            assert result.constants[name].value == pytest.approx(mean, abs=tolerance * sd), name
            assert result.constants[name].stderr == pytest.approx(sd, rel=tolerance), name


def test_unknown_noise_beside_common_errors_is_that_of_a_dense_grid():
    data = table(seed=7, n=20).drop(columns="sigma")
    exact = fitted(data, "exact", "unknown")
    columns = data[["gamma_deg", "value", "common1"]].to_numpy()
    best = exact.constants
    e_t = np.linspace(best.e_t.value - 5.0 * best.e_t.stderr, best.e_t.value + 5.0 * best.e_t.stderr, 61)
    mu = np.linspace(best.mu.value - 5.0 * best.mu.stderr, best.mu.value + 5.0 * best.mu.stderr, 61)
    log_sigma = np.linspace(np.log(0.008), np.log(0.06), 61)
    gamma, value, loading = columns.T
    grid_e_t, grid_mu = np.meshgrid(np.clip(e_t, -1.0, 1.0), mu, indexing="ij")
    q = value - np.stack(
        [ifrfit.rebound(g, e_n=0.9, e_t=grid_e_t, mu=grid_mu, degrees=True).beta for g in gamma], axis=-1
    )
    log_density = np.empty((*grid_mu.shape, log_sigma.size))
    for place, s in enumerate(np.exp(log_sigma)):
        covariance = s**2 * np.eye(gamma.size) + np.outer(loading, loading)
        chi2 = np.einsum("...i,ij,...j->...", q, np.linalg.inv(covariance), q)
        log_density[..., place] = -0.5 * (chi2 + np.linalg.slogdet(covariance)[1])
    density = np.exp(log_density - log_density.max())
    for axis, grid, name in ((0, e_t, "e_t"), (1, mu, "mu"), (2, np.exp(log_sigma), "noise[table/beta]")):
        own = density.sum(axis=tuple(i for i in range(3) if i != axis))
        own /= own.sum()
        mean = float(own @ grid)
        sd = float(np.sqrt(own @ (grid - mean) ** 2))
        assert exact.distribution.mean(name) == pytest.approx(mean, abs=0.06 * sd)
        assert exact.distribution.sd(name) == pytest.approx(sd, rel=0.06)


def test_the_density_is_that_of_the_covariance():
    """Woodbury against a dense normal law, with errors of angle by effective variance, at any constants."""
    data = table(seed=2, n=9, value=(0.03, 0.01), angle=(0.5, -0.3)).assign(sigma_gamma_deg=0.4)
    problem = fitted(data, noise=Noise("known", angles=AngleErrors("effective"))).problem
    density = Density(problem)
    points = np.array([[-0.8, 0.15], [-0.5, 0.3], [-0.95, 0.05]])
    z = least_squares(problem).common.value
    value, angle, _ = loadings_of(data)
    for point, found in zip(points, density(points) - density.log_prior(points), strict=True):

        def beta(gamma, point=point):
            return ifrfit.rebound(gamma, e_n=0.9, e_t=point[0], mu=point[1], degrees=True).beta

        true = data["gamma_deg"].to_numpy() - angle @ z
        slope = (beta(true + 1e-5) - beta(true - 1e-5)) / 2e-5
        by_z = value - slope[:, None] * angle
        q = data["value"].to_numpy() - value @ z - beta(true) + by_z @ z
        covariance = np.diag(SIGMA**2 + (0.4 * slope) ** 2) + by_z @ by_z.T
        expected = -0.5 * (
            q @ np.linalg.solve(covariance, q) + np.linalg.slogdet(2.0 * np.pi * covariance)[1]
        )
        assert found == pytest.approx(expected, rel=1e-5)


def test_the_optimum_is_that_of_a_local_search_over_constants_and_errors_together():
    from scipy.optimize import least_squares as scipy_least_squares

    for seed in range(6):
        data = table(seed=seed, value=(0.03, 0.02), angle=(0.6, 0.4))
        found = fitted(data)
        value, angle, _ = loadings_of(data)
        gamma, beta = data["gamma_deg"].to_numpy(), data["value"].to_numpy()

        def residual(x, gamma=gamma, beta=beta, value=value, angle=angle):
            there = ifrfit.rebound(gamma - angle @ x[2:], e_n=0.9, e_t=x[0], mu=x[1], degrees=True).beta
            return np.concatenate(((beta - value @ x[2:] - there) / SIGMA, x[2:]))

        starts = [[e_t, mu, 0.0, 0.0] for e_t in (-0.95, -0.8, -0.4) for mu in (0.1, 0.15, 0.3)]
        bounds = ([-1.0, 0.0, -9.0, -9.0], [1.0, 2.0, 9.0, 9.0])
        best = min(2.0 * scipy_least_squares(residual, start, bounds=bounds).cost for start in starts)
        assert found.least_squares.optimum.objective <= best + 1e-6
        assert found.least_squares.optimum.objective == pytest.approx(best, abs=2e-3)


# ------------------------------------------------------------------------------------- coverage


def coverage(count, **choices):
    """Share of tables whose 95 % intervals of e_t and mu hold the truth, with common errors and without."""
    inside = np.zeros((2, 2))
    for seed in range(count):
        data = table(seed=1000 + seed, **choices)
        for place, rows in enumerate((data, plain(data))):
            found = fitted(rows).constants
            for k, name in enumerate(("e_t", "mu")):
                low, high = found[name].interval95
                inside[place, k] += low <= TRUE[name] <= high
    return inside / count


def test_intervals_hold_the_truth_with_common_errors_and_not_without():
    """z of 60 tables. With: 0.95 give or take 4 sd, sqrt(0.95 0.05/60) each.

    Without, the sd of e_t is 4.6 times too small here, and its interval holds the truth as often as a normal
    number lies within 1.96/4.6: 0.33.
    """
    data = table()
    factor = fitted(data).constants.e_t.stderr / fitted(plain(data)).constants.e_t.stderr
    share = coverage(60)
    assert (share[0] >= 0.95 - 4.0 * np.sqrt(0.95 * 0.05 / 60)).all()
    expected = 2.0 * special.ndtr(1.96 / factor) - 1.0
    assert share[1, 0] == pytest.approx(expected, abs=4.0 * np.sqrt(expected * (1.0 - expected) / 60))


# ------------------------------------------------------------------------------------ properties


def numbers(result):
    return np.array([[result.constants[name].value, result.constants[name].stderr] for name in ("e_t", "mu")])


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_errors_that_move_no_row_change_no_digit(seed):
    data = table(seed)
    nothing = plain(data).assign(common1=0.0, common1_gamma_deg=0.0, common7=0.0)
    with_none, with_nothing = fitted(plain(data)), fitted(nothing)
    assert with_nothing.problem.common is None
    assert np.array_equal(numbers(with_none), numbers(with_nothing))
    assert with_nothing.noise.common_errors is None
    tiny = fitted(plain(data).assign(common1=1e-9))
    # a variance of 1e-18 beside 4e-4
    np.testing.assert_allclose(numbers(tiny), numbers(with_none), rtol=1e-8)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_the_order_of_rows_changes_nothing(seed):
    data = table(seed, value=(0.03, 0.02), angle=(0.0, 0.0))
    np.testing.assert_allclose(numbers(fitted(shuffled(data, seed))), numbers(fitted(data)), rtol=1e-6)


@pytest.mark.parametrize("seed", [1, 82, 516])
def test_the_order_of_rows_changes_nothing_where_angles_turn(seed):
    # steps along slopes rested on kinks, at whichever rounding chose: 82 and 516 lay 0.15 and 0.42 sd apart
    data = table(seed, value=(0.03, 0.02), angle=(0.3, 0.2))
    first, other = fitted(data), fitted(shuffled(data, seed))
    assert first.fit.chi2 == pytest.approx(other.fit.chi2, abs=1e-6)
    np.testing.assert_allclose(numbers(first), numbers(other), rtol=1e-5)


def test_no_common_errors_nearby_are_better_where_angles_turn():
    """Against places about the optimum, with the constants found anew at each."""
    fit = fitted(table(516, value=(0.03, 0.02), angle=(0.3, 0.2)))
    problem, found = fit.problem, fit.least_squares
    value = found.common.value
    rng = np.random.default_rng(0)
    for size in (1e-3, 1e-2, 0.1, 0.5):
        for _ in range(40):
            there = value + size * rng.normal(size=value.size)
            best = least_squares(problem.at_common(there)).optimum.objective + float(there @ there)
            assert best >= found.optimum.objective - 1e-6


def shuffled(data, seed):
    """The same rows in another order."""
    order = np.random.default_rng(seed).permutation(len(data))
    return data.iloc[order].reset_index(drop=True)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10_000), turn=st.floats(0.1, 1.4))
def test_an_error_in_two_columns_is_the_same_error(seed, turn):
    """z1 cos + z2 sin is one standard normal number."""
    data = table(seed, angle=(0.4,))
    parted = data.assign(
        common1=data["common1"] * np.cos(turn),
        common1_gamma_deg=data["common1_gamma_deg"] * np.cos(turn),
        common2=data["common1"] * np.sin(turn),
        common2_gamma_deg=data["common1_gamma_deg"] * np.sin(turn),
    )
    np.testing.assert_allclose(numbers(fitted(parted)), numbers(fitted(data)), rtol=1e-6)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000), n=st.integers(2, 12), rank=st.integers(0, 3))
def test_a_covariance_comes_back_from_its_parts(seed, n, rank):
    rng = np.random.default_rng(seed)
    loadings = rng.normal(0.0, 1.0, (n, rank))
    covariance = np.diag(rng.uniform(0.5, 2.0, n)) + loadings @ loadings.T
    variance, parts = split(covariance)
    assert (variance > 0.0).all()
    np.testing.assert_allclose(np.diag(variance) + parts @ parts.T, covariance, atol=1e-10 * (1.0 + n * rank))
    # equal independent parts: no more errors than there are
    equal = np.eye(n) + loadings @ loadings.T
    assert split(equal)[1].shape[1] <= min(rank, n - 1)


# ---------------------------------------------------------------------------------------- the way


def test_common_errors_go_through_csv_and_result(tmp_path):
    data = ifrfit.read(table(value=(0.03, 0.02), angle=(0.3, 0.0)))
    path = tmp_path / "data.csv"
    path.write_text(table_text(data), encoding="utf-8")
    read = ifrfit.read(path)
    for here, there in zip(loadings_of(data.table), loadings_of(read.table), strict=True):
        np.testing.assert_allclose(here, there, rtol=1e-9)
    found = fitted(read)
    found.save(tmp_path / "result.json")
    again = ifrfit.load_result(tmp_path / "result.json")
    assert again.noise.common_errors == found.noise.common_errors
    assert again.noise.common_errors.are_counted
    problem, optimum = question(again)
    assert problem.digest == found.problem.digest
    assert np.array_equal(optimum.common.value, found.least_squares.common.value)
    assert "2 errors that rows have in common (columns common1 to common2)" in found.summary()
    assert "2 errors that rows have in common" in " ".join(again.warnings)


def test_the_digest_tells_common_errors_from_none_and_from_others():
    data = table()
    digests = {
        fitted(rows).problem.digest
        for rows in (data, plain(data), data.assign(common1=1.1 * data["common1"]))
    }
    assert len(digests) == 3


def test_ignored_ones_are_told():
    data = table()
    found = fitted(data, noise=Noise("known", common_errors="ignored"))
    assert np.array_equal(numbers(found), numbers(fitted(plain(data))))
    assert not found.noise.common_errors.are_counted
    assert any(says.startswith("Ignored: 1 error that rows have in common") for says in found.warnings)
    assert question(from_dict(json.loads(json.dumps(found.to_dict()))))[0].common is None


def test_tables_have_errors_of_their_own():
    """Two figures are calibrated one by one: their errors are four, not two."""
    both = ifrfit.fit([table(1), table(2).assign(series="other")], fix=E_N, noise="known", method="lsq")
    one = ifrfit.read(table(1)), ifrfit.read(table(2))
    common = both.problem.common
    assert common.numbers == (1, 2)
    n = len(one[0])
    assert not common.value[:n, 1].any()
    assert not common.value[n:, 0].any()


def test_rows_that_are_selected_keep_their_part():
    whole, part = fitted(table()), fitted(table(), gamma_min=20.0)
    kept = whole.problem.rows.gamma_deg >= 20.0
    assert np.array_equal(part.problem.common.value, whole.problem.common.value[kept])


def test_residuals_are_those_of_the_points_without_their_common_errors():
    found = fitted(table())
    points = found.points
    np.testing.assert_allclose(points["value"] - points["fitted"], points["residual"], atol=1e-12)
    theta = found.least_squares.optimum.theta
    there = found.problem.at_common(found.least_squares.common.value)
    np.testing.assert_allclose(there.residual(theta), points["residual"], atol=1e-12)


def generalised_chi2(data, e_t, mu):
    """q' C^-1 q at many constants, from the rebound formulae and a dense covariance."""
    value, _, _ = loadings_of(data)
    covariance = np.diag(data["sigma"].to_numpy() ** 2) + value @ value.T
    there = ifrfit.rebound(data["gamma_deg"].to_numpy(), e_n=0.9, e_t=e_t, mu=mu, degrees=True).beta
    q = data["value"].to_numpy() - there
    return np.einsum("...i,ij,...j->...", q, np.linalg.inv(covariance), q)


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    n=st.integers(4, 14),
    sigma=st.sampled_from([0.01, 0.05, 0.2]),
    high=st.sampled_from([30.0, 50.0, 85.0]),
)
def test_no_place_lies_below_a_certified_optimum(seed, n, sigma, high):
    data = table(seed, n=n, high=high, sigma=sigma, value=(0.05, 0.03))
    found = fitted(data)
    optimum = found.least_squares.optimum
    assert optimum.certified
    e_t, mu = np.meshgrid(np.linspace(-1.0, -0.4, 41), np.geomspace(0.01, 2.0, 81))
    chi2 = generalised_chi2(data, e_t[..., None], mu[..., None])
    assert optimum.objective <= chi2.min() + 1e-9
    theta = optimum.theta
    own = generalised_chi2(data, np.array(theta[1:2]), np.array(theta[2:3]))
    assert optimum.objective == pytest.approx(float(own), rel=1e-9, abs=1e-9)
    # other minima are where the grid has them: nothing near the best is left out
    for rise, there in ((value - optimum.objective, there) for value, there in optimum.minima[1:]):
        at = generalised_chi2(data, np.array(there[1:2]), np.array(there[2:3]))
        assert float(at) - optimum.objective == pytest.approx(rise, abs=1e-6)


@pytest.mark.parametrize(
    ("choices", "certified"),
    [
        ({}, True),
        ({"closure": "ifr-contact"}, True),
        ({"closure": "f"}, True),
        ({"prior": {"e_n": (0.9, 0.02)}}, True),
        ({"fix": E_N, "prior": {"mu": (0.15, 0.01), "e_t": (-0.8, 0.05)}}, True),
        ({"closure": "fr"}, False),  # its transition depends on both of its constants
        ({"fix": {"mu": 0.15}}, False),
    ],
)
def test_what_is_certified_beside_e_n_and_priors(choices, certified):
    """The objective is that of the dense covariance, and no place about it lies lower."""
    rng = np.random.default_rng(8)
    of_e_n = {"observable": "e_n", "gamma_deg": np.linspace(10.0, 60.0, 10), "sigma": 0.01, "common1": 0.005}
    of_e_n["value"] = 0.9 + 0.01 * rng.standard_normal(10)
    data = pd.concat([table(), pd.DataFrame(of_e_n)], ignore_index=True)
    found = ifrfit.fit(data, method="lsq", noise="known", **choices)
    problem, optimum = found.problem, found.least_squares.optimum
    assert optimum.certified is certified
    inverse = np.linalg.inv(np.diag(problem.noise.sigma**2) + problem.common.value @ problem.common.value.T)
    free = problem.parameters.free
    low, high = problem.parameters.bounds()
    theta = np.tile(optimum.theta, (3000, 1))
    scatter = 1.0 + 10.0 ** rng.uniform(-4.0, -0.5, (3000, 1)) * rng.standard_normal((3000, free.sum()))
    theta[1:, free] = np.clip(theta[:, free] * scatter, low[free], np.minimum(high[free], 3.0))[1:]
    q = problem.residual(theta)
    prior = np.array([np.sum(problem.parameters.prior_residuals(one) ** 2) for one in theta])
    objective = np.einsum("mi,ij,mj->m", q, inverse, q) + prior
    assert optimum.objective == pytest.approx(objective[0], rel=1e-11)
    assert (objective >= optimum.objective - 1e-9 * optimum.objective).all()


def test_the_proof_sees_a_place_that_is_not_the_best():
    """The control: 0.1 above the least of all partitions there is no certificate."""
    problem = fitted(table()).problem
    least = min(each.objective for each in partitions(problem, problem.noise.sigma, np.zeros(1)))
    fit = least_squares(problem)
    assert fit.optimum.objective == pytest.approx(least, rel=1e-9)
    worse = replace(fit, optimum=replace(fit.optimum, objective=fit.optimum.objective + 0.1))
    assert not _with_partitions(problem, worse, []).certified


def test_the_optimum_claims_no_proof_where_angles_are_moved():
    fact = fitted(table(angle=(0.5,))).facts["global_optimum"]
    assert not fact.ok
    assert "the search over them is not" in fact.says
    scaled = fitted(table(), noise="scaled").facts["global_optimum"]
    assert not scaled.ok


def test_a_constant_that_its_gaussian_is_too_narrow_for_has_no_value_of_least_squares():
    """All impacts stick but perhaps the last: mu has no upper end, and no profile is there to say so."""
    found = fitted(table(high=30.0)).constants["mu"]
    assert found.value is None
    assert found.reason.endswith("take --method exact")


def test_facts_are_quiet_on_data_that_are_as_they_should_be():
    for seed in range(4):
        found = fitted(table(seed), "exact")
        bad = [name for name, fact in found.facts.items() if not fact.ok and name != "global_optimum"]
        assert bad == [], seed
        assert found.facts["predictive"].figures["p_chi2"] > 1e-3


def test_the_closures_are_weighed_with_common_errors():
    data = table(angle=(0.3,))
    both = ifrfit.compare(data, ["ifr", "f"], fix=E_N, noise="known")
    assert both.ranked[0] == "ifr"
    assert any("none is left out by turns" in note for note in both.notes)
    assert "no errors that rows have in common" in both.psi_plane.reason


def test_separate_constants_are_tied_by_common_errors():
    """Two series of one figure: their difference is known better than either."""
    data = pd.concat([table(1).assign(series="a"), table(1).assign(series="b")], ignore_index=True)
    found = fitted(data, "exact", separate=["e_t"])
    draws = found.distribution.draws(2000, np.random.default_rng(1))
    assert np.corrcoef(draws["e_t[a]"], draws["e_t[b]"])[0, 1] > 0.5


# -------------------------------------------------------------------------------------- refusals


REFUSED = {
    "profile": (lambda d: fitted(d, Profile()), "--method profile knows independent errors only"),
    "bootstrap": (lambda d: fitted(d, Bootstrap()), "--method bootstrap knows independent errors only"),
    "tails": (
        lambda d: fitted(d, noise=Noise("known", tails="student-t")),
        "--tails student-t is not known beside errors that rows have in common",
    ),
    "set": (
        lambda d: fitted(d, "exact", Noise("known", angles=AngleErrors("set", sigma_deg=1.0))),
        "--angle-errors set is not known beside errors that rows have in common .* --angle-errors effective",
    ),
    "offset": (
        lambda d: fitted(d, noise=Noise("known", angles=AngleErrors(offset_sd=1.0))),
        "--angle-offset is not known beside errors that rows have in common",
    ),
    "quadrature": (
        lambda d: fitted(d, Exact(integrator="quadrature")),
        "which the quadrature does not take on",
    ),
    "everything fixed": (
        lambda d: fitted(d, "exact", fix=TRUE),
        "Every constant is fixed, and rows have errors in common: use --method lsq",
    ),
    "intervals": (lambda d: fitted(d, "exact").intervals(), "A comparison of intervals knows independent"),
    "single rows": (
        lambda d: Density(fitted(d).problem).impacts(np.zeros((1, 2))),
        "The likelihood of single impacts knows independent errors only",
    ),
    "log posterior": (
        lambda d: fitted(d).problem.log_posterior(np.array([0.9, -0.8, 0.15])),
        "Rows have errors in common. Take",
    ),
    "the search": (
        lambda d: solve(fitted(d).problem, np.full(len(d), SIGMA)),
        "The search for the optimum knows independent errors only",
    ),
    "grids": (lambda d: integrate(fitted(d).problem), "which the quadrature does not take on"),
    "choice": (lambda d: Noise(common_errors="some"), "--common-errors some: choose counted or ignored"),
    "too far": (
        lambda d: fitted(d.assign(common1_gamma_deg=50.0)),
        "column common1_gamma_deg: 50 is more than one standard error can do here",
    ),
    "two observables": (
        lambda d: ifrfit.read({"gamma_deg": [10.0], "beta": [0.7], "v_x": [0.1], "common1": [0.1]}),
        "moves one value a row, and a row here has 2",
    ),
    "raw": (
        lambda d: ifrfit.read(
            {"u_x_m_s": [1.0], "u_z_m_s": [1.0], "v_x_m_s": [0.8], "v_z_m_s": [0.9], "common1": [0.1]}
        ),
        "errors that rows have in common are those of observables",
    ),
    "cost": (lambda d: ifrfit.measure_costs(d, fix=E_N), "ifrfit cost knows independent errors only"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused_in_words(name):
    call, says = REFUSED[name]
    with refused(IfrfitError, says):
        call(table(n=12))


def test_a_stream_is_read_into_memory(tmp_path):
    """A Parquet file that would be streamed is held, so that its common errors count."""
    n = 12
    data = table(n=n)
    wide = pd.DataFrame(
        {"gamma_deg": data["gamma_deg"], "beta": data["value"], "sigma_beta": SIGMA, "common1": 0.03}
    )
    folder = tmp_path / "parts"
    folder.mkdir()
    wide.to_parquet(folder / "a.parquet")
    with pytest.raises(IfrfitError, match="errors that rows have in common need the table in memory"):
        ifrfit.fit(folder, fix=E_N, method="lsq")


N = 6
GAMMA, BETA = np.linspace(10.0, 70.0, N), np.full(N, 0.3)
GOOD = 0.01**2 * (np.eye(N) + 0.5)
BAD = {
    "a vector": (np.full(N, 0.01), {}, "Independent errors are a column sigma of the table"),
    "of others": (np.eye(3), {}, "covariance: is 3 by 3, and the table has n = 6 values"),
    "text": ("big", {}, "covariance: is no matrix of numbers"),
    "complex": (GOOD + 1e-6j, {}, "covariance: is no matrix of numbers"),
    "not finite": (np.full((N, N), np.nan), {}, r"element \(0, 0\) is nan"),
    "negative": (-GOOD, {}, "the variance of row 0 is -0.00015"),
    "lopsided": (GOOD + np.triu(np.full((N, N), 2e-5), 1), {}, "covariance: is not symmetric"),
    "singular": (np.full((N, N), 1e-4), {}, "covariance: is not positive definite"),
    "sigma on the diagonal": (
        0.01 * np.eye(N) + 1e-5 * (1.0 - np.eye(N)),
        {"sigma": 0.01},
        r"Did you mean sigma\*\*2 on its diagonal",
    ),
    "other sigma": (GOOD, {"sigma": 0.02}, "and the table states sigma = 0.02"),
    "two of them": (GOOD, {"common1": 0.01}, "the table has errors in common of its own"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_is_no_covariance_is_refused(name):
    matrix, columns, says = BAD[name]
    data = {"gamma_deg": GAMMA, "beta": BETA} | columns
    with pytest.raises(UsageError, match=says):
        ifrfit.fit(data, covariance=matrix, fix=E_N, method="lsq")


def test_a_covariance_and_a_noise_both_say_how_large_errors_are():
    for noise, says in (
        ("scaled", '--noise scaled takes it from the scatter|noise="scaled" takes it from the scatter'),
        (Noise(sigma_velocity=0.1, sigma_spin=0.1), "both say what the errors are"),
        (Noise(common_errors="ignored"), "both say what the errors are"),
    ):
        with pytest.raises(UsageError, match=says):
            ifrfit.fit(gamma_deg=GAMMA, beta=BETA, covariance=GOOD, noise=noise, fix=E_N, method="lsq")


def test_a_diagonal_covariance_is_sigma():
    data = plain(table())
    of_sigma = fitted(data)
    matrix = np.diag(data["sigma"] ** 2)
    by_covariance = ifrfit.fit(data, covariance=matrix, fix=E_N, method="lsq")
    assert by_covariance.problem.common is None
    np.testing.assert_allclose(numbers(by_covariance), numbers(of_sigma), rtol=1e-12)


def test_a_covariance_is_of_rows_before_they_are_selected():
    data = ifrfit.read(plain(table()).drop(columns="sigma"))
    n = len(data)
    gap = np.subtract.outer(np.arange(n), np.arange(n))
    matrix = SIGMA**2 * np.exp(-np.abs(gap) / 5.0)
    part = ifrfit.fit(data, covariance=matrix, fix=E_N, method="lsq", gamma_min=30.0)
    kept = (data.table["gamma_deg"] >= 30.0).to_numpy()
    common, sigma = part.problem.common, part.problem.noise.sigma
    own = np.diag(sigma**2) + common.value @ common.value.T
    np.testing.assert_allclose(own, matrix[np.ix_(kept, kept)], rtol=1e-9)
    assert with_covariance(data, matrix).notes[-1].startswith(f"covariance of {n} values")


def test_an_error_that_is_not_finite_is_refused():
    with pytest.raises(DataError, match="is infinite"):
        ifrfit.read(table().assign(common1=np.inf))


def test_a_campaign_takes_groups_as_independent_and_says_so(tmp_path):
    data = pd.concat([table(seed).assign(run=str(seed)) for seed in range(2)], ignore_index=True)
    path = tmp_path / "runs.csv"
    data.to_csv(path, index=False)

    def campaign(choice):
        noise = Noise("known", common_errors=choice)
        return run_campaign(
            [path], ["run"], tmp_path / choice, lambda _: [], model=Model(fix=E_N), noise=noise
        )

    with refused(DataError, match="All 2 groups failed.* which tie groups"):
        campaign("counted")
    found, _ = campaign("ignored")
    assert [row["failure"] for row in found.rows] == ["", ""]
