"""Profiles in closed form are those of certified fits, of the search, and of a dense grid."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from factories import impacts_file, own_constant, problem_of, rest_long

from ifrfit.data import read
from ifrfit.data.observations import Observations, make_table
from ifrfit.inference.model.prior_specification import make_parameters
from ifrfit.inference.model.problem import Problem, make_problem
from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.inference.optimize.solve import solve
from ifrfit.inference.profile.closed_profile import closed_profile
from ifrfit.inference.profile.objective import Misfit
from ifrfit.inference.profile.quantities import Quantity, quantities_of, transition_tau
from ifrfit.inference.profile.searched_profile import SearchedProfile
from ifrfit.physics import OBSERVABLES, get_closure, rebound

TANGENTIAL = ("beta", "v_x", "spin_y_after", "beta_cm")
CLOSURES = ("ifr", "fr", "ifr-contact", "f")
# a sum of squares of n rows is right to some 1e-13 of itself; the search ends within 1e-9 of a minimum
ROUNDING = 1e-8
SEEDS = 200


def plain_problem(seed: int, noise: str) -> Problem:
    """5 to 60 rows of tangential observables and e_n: one regime or both, spins, bounds, priors."""
    rng = np.random.default_rng(seed)
    closure = get_closure(CLOSURES[seed % len(CLOSURES)])
    names = [*rng.choice(TANGENTIAL, size=1 if noise == "unknown" else rng.integers(1, 4), replace=False)]
    least = 2 if noise == "known" else 5
    n = int(rng.integers(max(5, 2 * least), 61))
    regime = rng.choice(["sticks", "slides", "both"])
    mu = {"sticks": 2.0, "slides": 0.01, "both": rng.uniform(0.05, 0.4)}[regime]
    own, e_n = own_constant(closure.name, rng.uniform()), float(rng.uniform(0.3, 1.0))
    gamma, spin = rng.uniform(4.0, 80.0, n), rng.normal(0.0, 0.3, n) * rng.integers(0, 2)
    state = rebound(gamma, 0.0, spin, e_n=e_n, mu=mu, closure=closure.name, degrees=True, **own)
    which = np.concatenate(
        (np.repeat([0, len(names)], least), rng.integers(0, len(names) + 1, n - 2 * least))
    )
    sigma = 0.03 * 10.0 ** rng.uniform(-1.0, 1.0)
    value = np.choose(which, [OBSERVABLES[x].value(state, np.full(n, mu)) for x in (*names, "e_n")])
    table = make_table({"series": ["run"] * n, "observable": [(*names, "e_n")[i] for i in which],
                        "gamma_deg": gamma, "spin_x": np.zeros(n), "spin_y": spin,
                        "value": value + sigma * rng.standard_normal(n),
                        "sigma": np.full(n, sigma)})  # fmt: skip
    choices: dict[str, dict[str, object]] = {"fix": {}, "bounds": {}, "prior": {}}
    for name, at, spread in (("e_n", e_n, 0.1), *((name, at, 0.2) for name, at in own.items())):
        say = rng.choice(["nothing", "nothing", "fix", "bounds", "prior"])
        low, high = (0.0, 1.0) if name == "e_n" else closure.domain(0.4)
        if say == "fix":
            choices["fix"][name] = at
        if say == "bounds":
            choices["bounds"][name] = (max(low, at - spread), min(high, at + 0.5 * spread))
        if say == "prior" and noise == "known":
            choices["prior"][name] = (at, spread)
    if rng.random() < 0.2:
        choices["bounds"]["mu"] = (float(rng.choice([0.0, 0.5 * mu])), 1.5 * mu)
    elif rng.random() < 0.15:
        choices["fix"]["mu"] = mu
    return make_problem(Observations(table), closure, 0.4, make_parameters(closure, 0.4, **choices), noise)


def every_quantity(misfit: Misfit) -> dict[str, Quantity]:
    found = dict(quantities_of(misfit.problem, misfit.fit))
    if misfit.problem.closure.name in ("fr", "maw"):  # where the bound of sticking depends on the constant
        tau = transition_tau(misfit.problem, misfit.fit, 0)
        found |= {} if tau is None else {"transition": tau}
    return found


def places(misfit: Misfit, quantity: Quantity) -> np.ndarray:
    """The optimum, places about it, and some spread over the domain."""
    at, domain = quantity.of(misfit.fit.optimum.theta), quantity.domain
    high = domain.upper if np.isfinite(domain.upper) else max(quantity.far or 1.0, 2.0 * at)
    sd = np.sqrt(misfit.fit.gaussian.variance(quantity.functional, domain.prior_sd))
    near = at + min(sd, 1.0) * np.array([-3.0, -1.5, -0.5, 0.0, 0.5, 1.5, 3.0])
    return np.unique(np.clip([*near, *np.linspace(domain.lower, high, 5)], domain.lower, high))


def compared(seeds: range, noise: str) -> tuple[int, int, int]:
    """Number of profiles, of those that have a closed form, and of those that the search has higher."""
    n, n_closed, n_lower = 0, 0, 0
    for seed in seeds:
        problem = plain_problem(seed, noise)
        misfit = Misfit.of(problem, least_squares(problem))
        for name, quantity in every_quantity(misfit).items():
            closed = closed_profile(misfit, quantity.constraint)
            n, n_closed = n + 1, n_closed + (closed is not None)
            if closed is None:
                continue
            x = places(misfit, quantity)
            with np.errstate(all="ignore"):
                searched = SearchedProfile(
                    misfit, quantity.constraint, quantity.of(misfit.fit.optimum.theta)
                )(x)
            fall = (searched - closed(x)) / np.maximum(1.0, searched)
            assert fall.min() > -ROUNDING, (seed, name)
            n_lower += bool(fall.max() > 1e-5)
    return n, n_closed, n_lower


@pytest.mark.parametrize("noise", ["known", "unknown", "scaled"])
@pytest.mark.parametrize("start", rest_long(range(0, 200, 20)))
def test_no_search_finds_less(start, noise) -> None:
    n, n_closed, n_lower = compared(range(start, start + 20), noise)
    assert n_closed > 0.8 * n
    # of 200 tables each: 16 of 617 profiles, 12 of 624, and 13 of 635
    assert n_lower <= 8


def quantity_prior(problem: Problem, name: str) -> tuple[float, float]:
    """Of an entry, which a fit with the entry fixed leaves out."""
    return problem.parameters[name].prior or (0.0, np.inf)


@pytest.mark.parametrize("start", rest_long(range(0, 200, 20)))
def test_entries_are_those_of_the_certified_method(start) -> None:
    """Each value has a fit of its own, proven to be the best with the constant fixed there."""
    for seed in range(start, start + 20):
        problem = plain_problem(seed, "known")
        misfit = Misfit.of(problem, least_squares(problem))
        for name, quantity in every_quantity(misfit).items():
            closed = closed_profile(misfit, quantity.constraint)
            if closed is None or name not in problem.parameters.names:
                continue
            x = places(misfit, quantity)
            for value, rise in zip(x.tolist(), closed(x).tolist(), strict=True):
                found = solve(problem.with_fixed({name: value}), misfit.fit.sigma)
                mean, sd = quantity_prior(problem, name)
                proven = found.objective + ((value - mean) / sd) ** 2 - misfit.fit.optimum.objective
                # nothing lies lower than the gap below it
                slack = ROUNDING * max(1.0, proven)
                assert proven - (found.gap or 0.0) - slack < rise < proven + slack, (seed, name, value)


@pytest.mark.parametrize(
    ("closure", "noise"), [("ifr", "unknown"), ("fr", "unknown"), ("fr", "known"), ("fr", "scaled")]
)
@pytest.mark.parametrize("mu", [0.1, 1.5])
def test_mu_and_kappa_are_those_of_a_dense_grid(tmp_path, closure, noise, mu) -> None:
    gamma = np.linspace(8.0, 70.0, 12)
    c = {"fr": 0.3, "ifr": -0.8}[closure]
    part = {"gamma": gamma, "observables": ("beta", "e_n"), "closure": closure, "c": c, "mu": mu, "seed": 5}
    path = impacts_file(tmp_path / "t.csv", {**part, "noise": 0.1, "sigma": 0.1})
    problem = problem_of(read(path), closure, noise=noise)
    misfit = Misfit.of(problem, least_squares(problem))
    own = np.linspace(*problem.parameters.entries[1].ends, 801)
    e_n = np.linspace(0.6, 1.0, 201)  # in steps of 0.07 of its sd, 0.1/sqrt(12): chi2 is off by 1e-3
    every = np.array(np.meshgrid(e_n, own)).reshape(2, -1)
    for name, quantity in every_quantity(misfit).items():
        if name not in ("mu", "kappa"):
            continue
        closed = closed_profile(misfit, quantity.constraint)
        assert closed is not None
        at = quantity.of(misfit.fit.optimum.theta)
        x = at * np.array([0.7, 0.9, 1.05, 1.3])
        for value, rise in zip(x.tolist(), closed(x).tolist(), strict=True):
            follows = np.full(every.shape[1], value) if name == "mu" else value / (1.0 + every[0])
            grid = float(misfit.rises(np.column_stack((*every, follows))).min())
            assert rise <= grid + 1e-9
            # the grid misses the place by half a step at most: some hundredths of an sd
            assert rise == pytest.approx(grid, rel=5e-3, abs=5e-3)


@pytest.mark.parametrize("noise", ["known", "unknown"])
def test_a_lower_value_is_met_by_constants(noise) -> None:
    """The search ends in another valley here: constants on a grid lie as low as the closed form says."""
    seed, name = {"known": (0, "e_n"), "unknown": (141, "beta0")}[noise]
    problem = plain_problem(seed, noise)
    misfit = Misfit.of(problem, least_squares(problem))
    quantity = every_quantity(misfit)[name]
    x, closed = places(misfit, quantity), closed_profile(misfit, quantity.constraint)
    assert closed is not None
    searched = SearchedProfile(misfit, quantity.constraint, quantity.of(misfit.fit.optimum.theta))(x)
    worst = int((searched - closed(x)).argmax())
    theta = np.tile(misfit.fit.optimum.theta, (200_001, 1))
    theta[:, problem.parameters.names.index(name)] = x[worst]
    theta[:, -1] = np.linspace(0.0, 2.0, len(theta))
    grid = float(misfit.rises(theta).min())
    assert grid < searched[worst] - 1e-3


def separate(folder, **choices) -> Misfit:
    parts = [{"gamma": np.linspace(6.0, 70.0, 12), "observables": ("beta", "e_n"), "closure": "ifr", "c": c,
              "mu": mu, "noise": 0.03, "sigma": 0.03, "series": name, "seed": seed}
             for seed, (name, c, mu) in enumerate((("a", -0.8, 0.1), ("b", -0.6, 1.5)))]  # fmt: skip
    problem = problem_of(read(impacts_file(folder / "t.csv", *parts)), "ifr", **choices)
    return Misfit.of(problem, least_squares(problem))


def test_series_with_constants_of_their_own(tmp_path) -> None:
    misfit = separate(tmp_path, separate=("e_n", "e_t", "mu"), prior={"e_t": (-0.7, 0.2)})
    found = every_quantity(misfit)
    assert len(found) == 8
    for quantity in found.values():
        at, x = quantity.of(misfit.fit.optimum.theta), places(misfit, quantity)
        closed = closed_profile(misfit, quantity.constraint)
        assert closed is not None
        assert closed(np.array([at])) == pytest.approx([0.0], abs=1e-10)
        assert closed(x) == pytest.approx(
            SearchedProfile(misfit, quantity.constraint, at)(x), rel=1e-7, abs=1e-7
        )


def test_what_is_left_to_the_search(tmp_path) -> None:
    def is_closed(problem: Problem, name: str) -> bool:
        misfit = Misfit.of(problem, least_squares(problem))
        return closed_profile(misfit, every_quantity(misfit)[name].constraint) is not None

    part = {"gamma": np.linspace(6.0, 70.0, 14), "closure": "ifr", "noise": 0.03, "sigma": 0.03}

    def of(*observables: str, **more: object) -> Problem:
        closure, noise = more.pop("closure", "ifr"), more.pop("noise", None)
        path = impacts_file(tmp_path / "t.csv", part | {"observables": observables})
        return problem_of(read(path), closure, noise=noise, **more)

    assert is_closed(of("beta", "e_n"), "mu")
    assert is_closed(of("mu_app", "beta", fix={"e_n": 0.9}), "mu")
    assert is_closed(of("beta", "v_n", bounds={"mu": (0.05, 0.5)}), "kappa")
    # rows and priors that tie e_n to friction in another way
    assert not is_closed(of("mu_app", "e_n"), "mu")
    assert not is_closed(of("beta", "e_n", "mu"), "mu")
    assert not is_closed(of("beta", "e_n", prior={"mu": (0.1, 0.1)}), "mu")
    # rows without a form that is linear in the impulse
    assert not is_closed(of("beta_tot", "e_n"), "mu")
    assert not is_closed(of("beta", "e_n", closure="maw"), "mu")
    # the ends of mu tie kappa to e_n where c is given
    assert not is_closed(of("beta", "e_n", bounds={"mu": (0.05, 0.5)}), "e_t")
    # tangential rows of two noises, or a prior beside one
    assert not is_closed(of("beta", "v_x", "e_n", noise="unknown"), "mu")
    assert not is_closed(of("beta", "e_n", noise="unknown", prior={"e_t": (-0.8, 0.1)}), "mu")
    assert is_closed(of("beta", "e_n", noise="unknown"), "mu")
    # series that share some constants only
    misfit = separate(tmp_path, separate=("mu",))
    assert closed_profile(misfit, every_quantity(misfit)["mu[a]"].constraint) is None


def test_sums_that_lose_the_digits_of_a_profile_are_left_to_the_search() -> None:
    problem = plain_problem(0, "known")
    assert Misfit.of(problem, least_squares(problem)).separable(0) is not None
    # chi2 is 4e14 times what it was, and its rounding error a tenth
    sharp = replace(problem, noise=replace(problem.noise, sigma=5e-8 * problem.noise.sigma))
    assert Misfit.of(sharp, least_squares(sharp)).separable(0) is None
