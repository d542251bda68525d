"""An offset that all set angles have in common, fitted beside the constants."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from factories import at_most, rest_long, table_file
from refusals import refused
from scipy import special

import ifrfit
from ifrfit import AngleErrors, Bootstrap, Exact, Model, Noise, Profile
from ifrfit.errors import DataError, IfrfitError, UsageError
from ifrfit.inference.appraise import appraise
from ifrfit.inference.diagnostics.optimum_facts import angle_offset
from ifrfit.inference.fit import make_question
from ifrfit.inference.mcmc.starts import Coordinates
from ifrfit.inference.model.error_model import ErrorModel
from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.model.log_posterior import Density
from ifrfit.inference.model.parameters import Parameter
from ifrfit.inference.optimize.angle_offset import AngleOffset, slope_by_offset
from ifrfit.inference.optimize.laplace import gaussian_approximation, weighted_jacobian
from ifrfit.inference.optimize.least_squares import at_fitted_offset, least_squares
from ifrfit.inference.posterior import integrate, integrate_over_offset, log_evidence
from ifrfit.inference.result.restore import question
from ifrfit.inference.summary.estimates import angle_offset_of
from ifrfit.inference.summary.gaussian import truncated_gaussian
from ifrfit.physics import get_closure, rebound


def with_offset(sd, policy=None):
    return Noise(policy, angles=AngleErrors(offset_sd=sd))


TRUE = {"e_n": 0.9, "e_t": -0.8, "mu": 0.15}
SIGMA = 0.02


def table(seed=1, *, offset=2.0, n=25, sigma=SIGMA, low=8.0, high=80.0, stated=True):
    """beta and v_n of impacts whose true angles are the set ones plus an offset."""
    rng = np.random.default_rng(seed)
    gamma = np.linspace(low, high, n)
    r = rebound(gamma + offset, **TRUE, degrees=True)
    columns = {"gamma_deg": gamma}
    for name in ("beta", "v_n"):
        columns[name] = getattr(r, name) + sigma * rng.standard_normal(n)
        if stated:
            columns[f"sigma_{name}"] = np.full(n, sigma)
    return pd.DataFrame(columns)


@pytest.fixture
def path(tmp_path):
    def written(**choices):
        return table_file(tmp_path / "a.csv", table(**choices))

    return written


def problem_of(file, sd=2.0, **choices):
    return ifrfit.fit(file, method="lsq", noise=with_offset(sd), **choices).problem


def test_the_posterior_is_that_of_a_dense_grid(path):
    """Brute force over four unknowns, from the rebound formulae and nothing of the package's inference."""
    data = table(n=6, sigma=0.03, seed=4)
    problem = problem_of(path(n=6, sigma=0.03, seed=4), 1.5)
    found = integrate_over_offset(problem)
    assert found.converged
    names = ("e_n", "e_t", "mu", "angle_offset")
    domain = {"e_n": (0.0, 1.0), "e_t": (-1.0, -0.4), "mu": (0.0, 2.0), "angle_offset": (-8.0, 10.0)}
    axes = []
    for name in names:
        low, high = domain[name]
        middle, sd = found.mean(name), found.sd(name)
        axes.append(np.linspace(max(low, middle - 5.5 * sd), min(high, middle + 5.5 * sd), 37))
    e_n, e_t, mu = np.meshgrid(*axes[:3], indexing="ij")
    log_density = np.empty((37, 37, 37, 37))
    for i, offset in enumerate(axes[3]):
        chi2 = (offset / 1.5) ** 2
        for row in data.itertuples():
            r = rebound(row.gamma_deg + offset, e_n=e_n, e_t=e_t, mu=mu, degrees=True)
            chi2 = chi2 + ((row.beta - r.beta) / 0.03) ** 2 + ((row.v_n - r.v_n) / 0.03) ** 2
        log_density[..., i] = -0.5 * chi2
    steps = [axis[1] - axis[0] for axis in axes]
    total = special.logsumexp(log_density) + np.log(steps).sum()
    log_z = total - 12.0 * np.log(0.03 * np.sqrt(2.0 * np.pi)) - np.log(0.6) - np.log(2.0)
    log_z -= np.log(1.5 * np.sqrt(2.0 * np.pi) * (special.ndtr(10.0 / 1.5) - special.ndtr(-8.0 / 1.5)))
    assert found.log_evidence == pytest.approx(log_z, abs=0.01)
    assert log_evidence(problem) == pytest.approx(found.log_evidence, abs=2e-4)
    density = np.exp(log_density - log_density.max())
    for number, name in enumerate(names):
        own = density.sum(axis=tuple(i for i in range(4) if i != number))
        own /= own.sum()
        mean = own @ axes[number]
        sd = np.sqrt(own @ (axes[number] - mean) ** 2)
        assert found.mean(name) == pytest.approx(mean, abs=0.01 * sd), name
        assert found.sd(name) == pytest.approx(sd, rel=0.01), name
        below = np.cumsum(own) - 0.5 * own
        for p in (0.16, 0.84):
            assert np.interp(found.quantile(name, p), axes[number], below) == pytest.approx(p, abs=0.01), name
    # the offset counts: at the best one mu is far less uncertain
    best = problem.at_offset(found.mean("angle_offset"))
    assert integrate(best).sd("mu") < 0.8 * found.sd("mu")


def test_methods_agree(path):
    file = path()
    exact, lsq = (ifrfit.fit(file, method=method, noise=with_offset(2.0)) for method in ("exact", "lsq"))
    chains = ifrfit.fit(file, method=ifrfit.MCMC(max_steps=400), noise=with_offset(2.0))
    for name in ("e_n", "e_t", "mu"):
        sd = exact.constants[name].stderr
        for other, tolerance in ((lsq, 0.05), (chains, 0.1)):
            assert other.constants[name].value == pytest.approx(
                exact.constants[name].value, abs=tolerance * sd
            )
            assert other.constants[name].stderr == pytest.approx(sd, rel=tolerance)
    mine = exact.noise.angle_offset
    for other in (lsq.noise.angle_offset, chains.noise.angle_offset):
        assert other.value == pytest.approx(mine.value, abs=0.1 * mine.stderr)
        assert other.stderr == pytest.approx(mine.stderr, rel=0.1)
    assert mine.interval95[0] < 2.0 < mine.interval95[1]
    # without the offset mu is less uncertain, and elsewhere
    assert ifrfit.fit(file, method="lsq").constants["mu"].stderr < 0.8 * lsq.constants["mu"].stderr


@pytest.mark.parametrize("seeds", rest_long((10, 20)))
def test_two_degrees_are_recovered_and_the_constants_with_them(path, seeds):
    """Experiments with an offset of 2 degrees: 95 % intervals miss as often as they may (tail 1e-3)."""
    names = ("e_n", "e_t", "mu", "angle offset")
    missed, plain = dict.fromkeys(names, 0), 0
    for seed in range(seeds):
        file = path(seed=100 + seed)
        fit = ifrfit.fit(file, method="lsq", noise=with_offset(2.0))
        truth = {**TRUE, "angle offset": 2.0}
        found = {**fit.constants, "angle offset": fit.noise.angle_offset}
        for name in names:
            low, high = found[name].interval95
            missed[name] += not low <= truth[name] <= high
        low, high = ifrfit.fit(file, method="lsq").constants["mu"].interval95
        plain += not low <= TRUE["mu"] <= high
    allowed = at_most(seeds, 0.05)
    assert max(missed.values()) <= allowed, missed
    assert plain > allowed  # what the option is for


@pytest.mark.parametrize("policy", ["known", "unknown"])
def test_a_prior_without_width_is_the_ordinary_fit(path, policy):
    file = path(offset=0.5, n=15)
    plain = ifrfit.fit(file, method="lsq", noise=policy)
    narrow = ifrfit.fit(file, method="lsq", noise=with_offset(1e-9, policy))
    for name, own in plain.constants.items():
        other = narrow.constants[name]
        assert (other.value, other.stderr) == pytest.approx((own.value, own.stderr), rel=1e-9)
        assert other.interval95 == pytest.approx(own.interval95, rel=1e-9)
        assert other.status == own.status
    assert narrow.fit.chi2 == pytest.approx(plain.fit.chi2, rel=1e-9)
    assert (narrow.fit.dof, narrow.fit.aic) == pytest.approx((plain.fit.dof, plain.fit.aic), rel=1e-9)
    before, after = integrate(plain.problem), integrate_over_offset(narrow.problem)
    assert after.log_evidence == pytest.approx(before.log_evidence, abs=1e-6)
    for name in before.names:
        assert (after.mean(name), after.sd(name)) == pytest.approx(
            (before.mean(name), before.sd(name)), rel=1e-9
        )
        # a quadrature finds quantiles to a thousandth of its tolerance, 1e-4 sd of the component
        assert after.quantile(name, 0.975) == pytest.approx(
            before.quantile(name, 0.975), abs=1e-5 * before.sd(name)
        )


def test_the_gaussian_has_the_offset_integrated_out(path):
    """The covariance and the leverages of the joint linear problem, written out."""
    problem = problem_of(path(), 2.0)
    fit = least_squares(problem)
    here = at_fitted_offset(problem, fit)
    common = slope_by_offset(here, fit.optimum.theta) * 2.0
    _, _, _, rows, _ = weighted_jacobian(here, fit.sigma, fit.optimum.theta)
    joint = np.zeros((rows.shape[0] + 1, rows.shape[1] + 1))
    joint[:-1, :-1], joint[:-1, -1], joint[-1, -1] = rows, common / fit.sigma, 1.0
    covariance = np.linalg.inv(joint.T @ joint)
    np.testing.assert_allclose(fit.gaussian.covariance(capped=False), covariance[:-1, :-1], rtol=1e-8)
    assert fit.angle_offset.sd == pytest.approx(2.0 * np.sqrt(covariance[-1, -1]), rel=1e-8)
    hat = joint @ covariance @ joint.T
    np.testing.assert_allclose(fit.gaussian.leverage, np.diag(hat)[:-1], rtol=1e-8, atol=1e-12)
    carried = covariance[:-1, -1] / covariance[-1, -1] / 2.0
    np.testing.assert_allclose(fit.angle_offset.carried, carried, rtol=1e-6, atol=1e-12)
    alone = gaussian_approximation(here, fit.sigma, fit.optimum.theta)
    assert alone.covariance(capped=False)[2, 2] < 0.7 * covariance[2, 2]


def test_unknown_noise_gives_up_a_degree_of_freedom(path):
    file = path(stated=False)
    free = ifrfit.fit(file, Model(fix={"e_n": 0.9}), method="lsq", observable="beta", noise=with_offset(5.0))
    fixed = ifrfit.fit(file, Model(fix={"e_n": 0.9}), method="lsq", observable="beta")
    assert (fixed.fit.dof, free.fit.dof) == (23, 22)
    assert free.least_squares.noise_dof == pytest.approx(22.0, abs=0.1)
    assert free.noise.sigma["a/beta"] == pytest.approx(SIGMA, rel=0.4)


def test_the_offset_turns_the_angle_of_incidence_alone(path):
    problem = problem_of(path())
    theta = np.array([0.9, -0.8, 0.15])
    turned = problem.at_offset(1.5)
    r = rebound(problem.rows.gamma_deg + 1.5, **TRUE, degrees=True)
    rows = {o.name: at for o, at, _ in problem.rows.by_observable}
    np.testing.assert_allclose(turned.predict(theta)[rows["beta"]], r.beta[rows["beta"]], rtol=1e-12)
    np.testing.assert_allclose(turned.predict(theta)[rows["v_n"]], r.v_n[rows["v_n"]], rtol=1e-12)
    np.testing.assert_array_equal(turned.rows.value, problem.rows.value)
    assert turned.offset is None
    several = problem.at_offset(np.array([[0.0], [1.5]])).predict(np.stack([theta, theta]))
    np.testing.assert_array_equal(several[1], turned.predict(theta))
    np.testing.assert_array_equal(several[0], problem.predict(theta))
    # no impact is turned to the other side of the normal, or into the wall
    assert (problem.offset.lower, problem.offset.upper) == pytest.approx((-8.0, 10.0), abs=1e-5)


def test_the_density_for_samplers_is_that_of_the_problem_at_each_offset(path):
    problem = problem_of(path(stated=False))
    density = Density(problem)
    assert density.names == ("e_n", "e_t", "mu", "noise[a/beta]", "noise[a/v_n]", "angle_offset")
    points = np.array([[0.9, -0.8, 0.15, -4.0, -4.1, each] for each in (-1.0, 2.5)])
    prior = [float(problem.offset.log_prior(np.array(each))) for each in (-1.0, 2.5)]
    at = [problem.at_offset(each) for each in (-1.0, 2.5)]
    expected = [p.log_posterior(x[:3], np.exp(x[3:5])) for p, x in zip(at, points, strict=True)]
    np.testing.assert_allclose(density(points), np.add(expected, prior), rtol=1e-12)
    assert np.isneginf(density(np.add(points, [0.0, 0.0, 0.0, 0.0, 0.0, 20.0]))).all()
    draws = density.draws(points)
    np.testing.assert_allclose(density.points(draws), points, rtol=1e-14)
    assert set(Coordinates(density).quantities(points)) == {*density.names, "kappa"}
    with refused(UsageError, match="The angle offset is unknown, too"):
        problem.log_posterior(np.array([0.9, -0.8, 0.15]), np.array([0.02, 0.02]))


def test_output_and_file_have_the_offset_and_its_prior(path, tmp_path):
    file = path()
    fit = ifrfit.fit(file, noise=with_offset(2.0))
    text = fit.summary()
    assert "angle offset fitted (prior 0 +- 2 degrees)" in text
    assert "  angle offset  " in text
    assert "degrees; determined" in text
    fact = fit.facts["angle_offset"]
    assert fact.ok
    assert fact.figures["prior_sd"] == 2.0
    fit.save(tmp_path / "r.json")
    content = json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))
    assert content["noise"]["scatter"]["angle_offset"] == 2.0
    assert content["noise"]["angle_offset"]["value"] == fit.noise.angle_offset.value
    again = ifrfit.load_result(tmp_path / "r.json")
    assert again.to_dict() == fit.to_dict()
    problem, optimum = question(again)
    assert problem.offset == fit.problem.offset
    assert optimum.angle_offset.value == pytest.approx(fit.least_squares.angle_offset.value, abs=1e-6)
    shown = appraise(again, closures=False)
    assert shown.without_profiles == "Profiles do not fit an angle offset."
    plain = ifrfit.fit(file)
    assert plain.noise.angle_offset is None
    assert "angle_offset" not in plain.to_dict()["noise"]
    assert plain.problem.digest != fit.problem.digest
    assert fit.problem.digest != replace(fit.problem, error_model=ErrorModel(offset=1.0)).digest


def test_an_offset_far_outside_its_prior_is_told(path):
    fit = ifrfit.fit(path(offset=5.0), method="lsq", noise=with_offset(0.4))
    assert not fit.facts["angle_offset"].ok
    assert (
        "sd off: look for what turned the angles, or widen --angle-offset" in fit.facts["angle_offset"].says
    )
    assert "the angle offset is not credible" in fit.summary().split(". Details")[0]


def test_an_offset_that_the_data_do_not_see_follows_its_prior(path):
    fit = ifrfit.fit(path(n=4, low=50.0, high=70.0), Model(fix={"e_n": 0.9}), noise=with_offset(0.3))
    found = fit.noise.angle_offset
    assert (found.status, found.reason) == ("prior", "rests on its prior")
    assert found.stderr == pytest.approx(0.3, rel=0.1)


def test_a_comparison_passes_it_on(path):
    found = ifrfit.compare(path(n=8), ["ifr", "fr"], model=Model(fix={"e_n": 0.9}), noise=with_offset(2.0))
    fits = {name: entry.fit for name, entry in found.entries.items()}
    assert all(fit.noise.angle_offset is not None for fit in fits.values())
    for name, fit in fits.items():
        # the evidence alone is sampled, to 0.02
        assert fit.fit.log_evidence == pytest.approx(log_evidence(fit.problem), abs=0.02), name
    assert found.entries["ifr"].loo.elpd > found.entries["fr"].loo.elpd


@pytest.mark.long
def test_the_closures_of_a_page_are_those_of_the_comparison(path):
    # the more constants are free, the longer each closure takes
    asked = {"model": Model(fix={"e_n": 0.9}), "noise": with_offset(3.0)}
    made = path(offset=2.0, n=8)
    of_page = appraise(ifrfit.fit(made, **asked)).comparison
    beside = ifrfit.compare(made, **asked, loo=False)
    chi2 = {name: entry.fit.fit.chi2 for name, entry in of_page.entries.items()}
    assert chi2 == pytest.approx({name: entry.fit.fit.chi2 for name, entry in beside.entries.items()})


@pytest.mark.parametrize(
    ("choices", "says"),
    [
        ({"method": Profile()}, "--method profile fits no angle offset: use --method exact"),
        ({"method": Bootstrap()}, "--method bootstrap fits no angle offset: use --method exact"),
        ({"method": Exact(accuracy=1e-2)}, "--accuracy and --budget do not know what an angle offset costs"),
        ({"observable": "e_n"}, "--angle-offset, but the angle of incidence enters no row"),
    ],
)
def test_what_is_not_supported_is_refused_in_words(tmp_path, choices, says):
    frame = (
        table()
        .assign(e_n=0.9 + 0.01 * np.sin(np.arange(25.0)), sigma_e_n=0.01)
        .drop(columns=["v_n", "sigma_v_n"])
    )
    path = table_file(tmp_path / "a.csv", frame)
    with refused((UsageError, DataError), match=says):
        ifrfit.fit(path, noise=with_offset(2.0), **choices)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: with_offset(0.0), "--angle-offset 0: give the standard deviation of its prior"),
        (lambda: with_offset(60.0), "--angle-offset 60: give the standard deviation"),
        (lambda: Noise(tails="student-t", angles=AngleErrors(offset_sd=1.0)), "leave --tails student-t out"),
        (lambda: Noise(angles=AngleErrors("set", offset_sd=1.0)), "leave --angle-errors set out"),
    ],
)
def test_a_wrong_combination_cannot_be_made(make, says):
    with refused(IfrfitError, match=says):
        make()


def test_an_offset_at_the_end_of_its_domain_is_not_credible():
    """There an impact would cross the wall: whatever turned the values, it is no offset."""
    domain = FreeParameter.of("angle_offset", Parameter("angle_offset", -4.0, 5.0, prior=(0.0, 7.0)))
    found = AngleOffset(5.0, 0.5, 7.0, np.zeros(3), np.zeros(3), ())
    assert not angle_offset(found, domain).ok
    assert "no offset is the reason" in angle_offset(found, domain).says
    assert angle_offset(replace(found, value=4.5), domain).ok


@pytest.mark.long
def test_intervals_beside_an_offset_hold_the_truth_as_often_as_they_say(tmp_path):
    """1,200 tables of 25 impacts, offsets of 1 degree (as the prior says), by least squares."""
    rng, n = np.random.default_rng(21), 1200
    model, noise = Model("ifr"), with_offset(1.0)
    inside: Counter[tuple[str, float]] = Counter()
    for _ in range(n):
        truth = {"e_n": rng.uniform(0.7, 0.95), "e_t": rng.uniform(-0.9, -0.5), "mu": rng.uniform(0.08, 0.25)}
        offset = rng.standard_normal()
        gamma = np.sort(rng.uniform(8.0, 78.0, 25))
        r = rebound(gamma + offset, **truth, degrees=True)
        columns = {"gamma_deg": gamma}
        for name in ("beta", "v_n"):
            columns[name] = getattr(r, name) + SIGMA * rng.standard_normal(25)
            columns[f"sigma_{name}"] = SIGMA
        path = table_file(tmp_path / "a.csv", columns)
        asked = make_question(path, model, noise, 0, None, {})
        problem = asked.problem(get_closure("ifr"), model.parameters(asked.inertia_factor))
        found = least_squares(problem)
        about = truncated_gaussian(at_fitted_offset(problem, found), found)
        for level in (0.68, 0.95):
            tails = np.array([0.5 - 0.5 * level, 0.5 + 0.5 * level])
            ends = {name: about.quantile(name, tails) for name in truth}
            ends["offset"] = angle_offset_of(found.angle_offset, about).interval(level)
            for name, value in (truth | {"offset": offset}).items():
                inside[name, level] += ends[name][0] <= value <= ends[name][1]
    for (_, level), count in inside.items():
        assert n - at_most(n, 1.0 - level) <= count <= at_most(n, level)
