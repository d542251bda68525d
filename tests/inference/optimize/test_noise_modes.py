"""Modes of the likelihood over constants and noises: all are found, none better exists."""

from __future__ import annotations

import importlib
from dataclasses import replace

import numpy as np
import pytest
from factories import BILINEAR, impacts_file, own_constant, problem_of
from scipy.optimize import minimize
from simulated import simulated

import ifrfit
from ifrfit import fit
from ifrfit.data import read
from ifrfit.inference.diagnostics.thresholds import NOISE_GAP
from ifrfit.inference.optimize.concentrated_likelihood import ConcentratedLikelihood, _inverses
from ifrfit.inference.optimize.least_squares import least_squares, refit
from ifrfit.inference.optimize.noise_components import noise_components, without_restitution
from ifrfit.inference.optimize.noise_modes import likely_sigma, noise_modes
from ifrfit.inference.optimize.solve import solve

ANGLES = np.linspace(4.0, 84.0, 17)
SERIES = ({"mu": 0.14, "c": -0.85, "series": "A"}, {"mu": 0.25, "c": -0.70, "series": "B"})


def question(path, closure="ifr", **choices):
    return problem_of(read(path), closure, noise="unknown", separate_noise=True, **choices)


def contradiction(path, seed, noise=0.02):
    """Two series that do not share their constants, no sigma."""
    parts = [
        {"gamma": ANGLES, "e_n": 0.9, "noise": noise, "sigma": None, "seed": 2 * seed + i} | own
        for i, own in enumerate(SERIES)
    ]
    return impacts_file(path / "two.csv", *parts)


def phi(problem, theta):
    """Minus twice the log likelihood with each noise at its best, up to a constant, and the priors."""
    residual = problem.rows.value - problem.predict(theta)
    prior = problem.parameters.prior_residuals(theta)
    groups = problem.noise_groups().values()
    return sum(r.size * np.log(np.mean(residual[r] ** 2)) for r in groups) + prior @ prior


def lowest_of_searches(problem, found, rng, searches=8):
    """The least Phi that local searches from random places, and from the best mode, come to."""
    free = problem.parameters.free
    low, high = problem.parameters.bounds()
    high = np.minimum(high, 2.0)
    lowest = np.inf
    for number in range(searches):
        theta = low + (high - low) * rng.uniform(size=low.size)
        theta[~free] = found.best.theta[~free]
        start = found.best.theta if number == 0 else theta

        def objective(x, theta=theta):
            at = theta.copy()
            at[free] = np.clip(x, low[free], high[free])
            return phi(problem, at)

        lowest = min(lowest, minimize(objective, start[free], method="Nelder-Mead").fun)
    return lowest


@pytest.mark.parametrize("seed", range(2))
def test_every_method_reports_the_better_of_two_contradicting_series(tmp_path, seed):
    path = contradiction(tmp_path, seed)
    problem = question(path, fix={"e_n": 0.9})
    modes = noise_modes(problem).modes
    assert len(modes) == 2
    assert sorted(m.theta[2] for m in modes) == pytest.approx([0.14, 0.25], abs=0.01)
    assert phi(problem, modes[0].theta) <= phi(problem, modes[1].theta)
    if modes[1].value - modes[0].value < 4.0:
        pytest.fail("a seed whose modes are alike tells nothing here")
    # the exact posterior of two noises and a profile take long, so one of the tables does
    for method in ("lsq", "exact", "profile") if seed else ("lsq",):
        found = fit(path, fix={"e_n": 0.9}, method=method, separate="noise")
        assert found.constants["mu"].value == pytest.approx(modes[0].theta[2], abs=0.003), method


@pytest.mark.parametrize("closure", BILINEAR)
@pytest.mark.parametrize("seed", range(2))
def test_no_search_goes_below_the_bound(tmp_path, closure, seed):
    """Random tables of several groups and priors, against local searches from everywhere."""
    rng = np.random.default_rng([seed, len(closure)])
    truth = own_constant(closure, rng.uniform(0.1, 0.9))
    parts = []
    for series in range(int(rng.integers(2, 4))):
        parts.append(
            {
                "gamma": np.sort(rng.uniform(3.0, 86.0, int(rng.integers(6, 14)))),
                "observables": ("beta",) if rng.uniform() < 0.6 else ("beta", "e_n"),
                "closure": closure, "e_n": 0.85, "c": next(iter(truth.values()), 0.0),
                "mu": 0.15 * 2.0 ** rng.uniform(-1.0, 1.0), "noise": 10.0 ** rng.uniform(-2.5, -1.0),
                "sigma": None, "series": f"s{series}", "seed": int(rng.integers(1000)),
            }
        )  # fmt: skip
    choices = {"fix": {"e_n": 0.85}} | ({} if seed % 2 else {"prior": {"mu": (0.2, 0.1)}})
    problem = question(impacts_file(tmp_path / "t.csv", *parts), closure, **choices)
    found = noise_modes(problem)
    assert found.gap is not None
    best = found.best.value
    assert best == pytest.approx(phi(problem, found.best.theta), abs=1e-9)
    assert lowest_of_searches(problem, found, rng) >= best - found.gap - 1e-9
    assert found.gap <= NOISE_GAP


FAMILIES = {
    "kappa": (("beta", "mu_app"), 5, True),
    "kappa-e_n": (("beta", "v_x", "e_n"), 3, False),
    "friction": (("beta", "mu"), 5, False),
    "impulse": (("mu_app", "mu"), 3, False),
    "direct": (("e_n", "mu"), 5, False),
}


@pytest.mark.parametrize("family", FAMILIES)
def test_ten_noises_are_certified_as_one(tmp_path, family):
    """Every family of linear unknowns, with up to ten noises and series that contradict one another."""
    observables, series, fixed = FAMILIES[family]
    rng = np.random.default_rng(len(family))
    parts = [
        {
            "gamma": np.sort(rng.uniform(3.0, 86.0, 9)), "observables": (observable,), "e_n": 0.8,
            "c": -0.7, "mu": 0.15 * 2.0 ** rng.uniform(-0.4, 0.4), "noise": 10.0 ** rng.uniform(-2.5, -1.5),
            "sigma": None, "series": f"s{number}", "seed": int(rng.integers(1000)),
        }
        for number in range(series)
        for observable in observables
    ]  # fmt: skip
    problem = question(impacts_file(tmp_path / "t.csv", *parts), **({"fix": {"e_n": 0.8}} if fixed else {}))
    assert len(problem.noise_groups()) == series * len(observables)
    found = noise_modes(problem)
    assert found.gap is not None
    assert found.gap <= NOISE_GAP
    assert lowest_of_searches(problem, found, rng) >= found.best.value - found.gap - 1e-9


def test_a_bound_is_no_higher_than_the_modes_that_a_proof_was_not_given(tmp_path):
    """A proof that begins at the worse of two modes meets the better one."""
    problem = question(contradiction(tmp_path, 0), fix={"e_n": 0.9})
    (component,) = noise_components(problem)
    best, rival = component.solve(1e-3)[0]
    always = np.where(component.form.always >= 0, component.of_row[component.form.always], -1)
    likelihood = ConcentratedLikelihood.of(
        component.form.problem,
        component.of_row[component.form.switching],
        always,
        component.sizes,
        component.least,
        component.scatter,
    )
    minima, bound = likelihood.prove([rival], 1e-3)
    assert minima[0].value == pytest.approx(best.value, abs=1e-6)
    assert best.value - 1e-3 - 1e-9 <= bound <= best.value


def test_what_measures_e_n_is_certified_by_itself_where_series_share_some_constants(tmp_path):
    parts = [
        {"gamma": ANGLES, "observables": ("beta", "e_n"), "e_n": 0.9, "noise": 0.02, "sigma": None} | own
        for own in ({"mu": 0.14, "series": "A", "seed": 1}, {"mu": 0.2, "series": "B", "seed": 2})
    ]
    problem = question(impacts_file(tmp_path / "t.csv", *parts), separate=("mu",))
    split = without_restitution(problem)
    assert [each.groups.size for each in split.restitution] == [2]
    assert len(split.rest.noise_groups()) == 2
    found = noise_modes(problem)
    assert found.gap <= NOISE_GAP
    rng = np.random.default_rng(1)
    assert lowest_of_searches(problem, found, rng) >= found.best.value - found.gap - 1e-9


def test_a_refit_follows_the_mode_of_the_fit(tmp_path):
    """Without a proof, and whichever of the modes that is."""
    problem = question(contradiction(tmp_path, 0), fix={"e_n": 0.9})
    found = least_squares(problem)
    same = refit(problem, found.sigma)
    assert same.optimum.theta == pytest.approx(found.optimum.theta, abs=1e-8)
    assert same.optimum.gap is None
    rival = noise_modes(problem).modes[1].theta
    other = refit(problem, likely_sigma(problem, rival))
    assert other.optimum.theta[2] == pytest.approx(rival[2], abs=0.01)


def test_a_single_noise_needs_no_boxes(tmp_path):
    path = impacts_file(tmp_path / "one.csv", {"gamma": ANGLES, "noise": 0.02, "sigma": None})
    found = noise_modes(question(path, fix={"e_n": 0.94}))
    assert found.follows_squares
    assert len(found.modes) == 1
    assert found.gap < 1e-9


def test_one_fit_without_a_proof_leaves_no_proof_of_the_whole(tmp_path, monkeypatch):
    """The bound is only as good as each weighted fit: a single one that was searched spoils it."""
    problem = question(contradiction(tmp_path, 0), fix={"e_n": 0.9}, separate=("mu",))
    alone = int(min(rows.size for rows in problem.noise_groups().values()))

    def searched(part, sigma, near=None, **options):
        found = solve(part, sigma, near, **options)
        return replace(found, gap=None) if len(part.rows) == alone else found

    assert noise_modes(problem).gap is not None
    monkeypatch.setattr("ifrfit.inference.optimize.noise_modes.solve", searched)
    assert noise_modes(problem).gap is None


def test_modes_are_those_of_the_proof_where_none_is_wanted(tmp_path):
    problem = question(contradiction(tmp_path, 0), fix={"e_n": 0.9}, separate=("mu",))
    proven, found = noise_modes(problem), noise_modes(problem, proven=False)
    assert found.gap is None
    assert found.best.value == pytest.approx(proven.best.value, abs=1e-9)
    np.testing.assert_allclose(found.best.theta, proven.best.theta, atol=1e-7)


def test_constants_that_left_the_best_mode_are_not_certified(tmp_path, monkeypatch):
    """The noise's degrees of freedom move the constants a little; into another mode they must not."""
    problem = question(contradiction(tmp_path, 0), fix={"e_n": 0.9})
    assert least_squares(problem).optimum.certified
    modes = noise_modes(problem)
    rival = likely_sigma(problem, modes.modes[1].theta) / problem.noise.base
    monkeypatch.setattr("ifrfit.inference.optimize.least_squares._factors", lambda *_: rival)
    strayed = least_squares(problem).optimum
    assert strayed.theta[2] == pytest.approx(modes.modes[1].theta[2], abs=0.01)
    assert not strayed.certified


def test_a_singular_matrix_of_a_region_tells_nothing() -> None:
    """It must not end a proof in which other regions are bounded."""
    regular = np.array([[2.0, 1.0], [1.0, 3.0]])
    found = _inverses(np.stack((regular, np.ones((2, 2)), np.eye(2))))
    np.testing.assert_allclose(found[[0, 2]], np.linalg.inv(np.stack((regular, np.eye(2)))), rtol=1e-15)
    assert np.isnan(found[1]).all()


def test_a_prior_of_mu_beside_two_unknown_noises_is_proven_in_few_weighted_fits(monkeypatch) -> None:
    """v_x and v_n of 11,318 impacts took long: each e_n that was looked at had all its cells solved."""
    rng = np.random.default_rng(3)
    gamma = rng.uniform(38.0, 67.0, 600)
    state = ifrfit.rebound(gamma, e_n=0.9, beta0=0.4, mu=0.2, closure="fr", degrees=True)
    value = np.concatenate((state.v_x, state.v_n)) + rng.normal(0.0, 0.02, 1200)
    data = simulated(np.repeat(["v_x", "v_n"], 600), np.tile(gamma, 2), value, np.full(1200, 0.02))
    problem = problem_of(data, "fr", noise="unknown", prior={"mu": (0.2, 0.02)})
    searched = []
    module = importlib.import_module("ifrfit.inference.optimize.restitution_and_friction")
    general = module.minimise
    monkeypatch.setattr(module, "minimise", lambda each: searched.append(1) or general(each))
    found = noise_modes(problem)
    assert found.gap is not None
    assert found.gap <= 0.05
    # what is left to the search in three unknowns is what rounding leaves in doubt
    assert len(searched) <= 10
    # and no grid point lies lower
    best = found.best
    lowest = min(
        phi(problem, best.theta + np.array([a, b, c]))
        for a in np.linspace(-0.01, 0.01, 5)
        for b in np.linspace(-0.1, 0.1, 5)
        for c in np.linspace(-0.01, 0.01, 5)
    )
    assert phi(problem, best.theta) <= lowest + 1e-6


def test_of_large_tables_fewer_boxes_are_cut_and_the_gap_says_what_is_left(monkeypatch) -> None:
    rng = np.random.default_rng(1)
    gamma = rng.uniform(20.0, 70.0, 60)
    state = ifrfit.rebound(gamma, e_n=0.9, e_t=-0.8, mu=0.2, degrees=True)
    value = np.concatenate((state.beta, state.v_n)) + rng.normal(0.0, 0.05, 120)
    data = simulated(np.repeat(["beta", "v_n"], 60), np.tile(gamma, 2), value, np.full(120, 0.05))
    problem = problem_of(data, noise="unknown", prior={"mu": (0.45, 0.01)})
    module = importlib.import_module("ifrfit.inference.optimize.noise_modes")
    whole = noise_modes(problem)
    monkeypatch.setattr(module, "_ROWS_OF_CUTS", 0)
    monkeypatch.setattr(module, "_FEWEST_CUTS", 0)
    none = noise_modes(problem)
    assert whole.gap is not None
    assert none.gap is not None
    assert none.best.value == pytest.approx(whole.best.value, abs=1e-3)
    assert none.gap >= whole.gap
