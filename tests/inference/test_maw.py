"""Closure maw fitted: recovered constants, the posterior against brute force, statuses, blind tests."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from factories import at_most
from refusals import refused

import ifrfit
from ifrfit.errors import UsageError
from ifrfit.inference.distributions.protocol import LEVELS
from ifrfit.inference.model.log_posterior import Density
from ifrfit.physics import get_closure, transition_angles, transition_tau
from ifrfit.physics.compliance import chi_of, poisson_ratio

Impacts = Callable[..., Path]
GAMMA = np.linspace(3.0, 75.0, 25)
TRUE = {"e_n": 0.9, "c": 1.44, "mu": 0.15, "closure": "maw"}


def fit(path: Path, **choices: object) -> ifrfit.FitResult:
    return ifrfit.fit(path, **({"closure": "maw"} | choices))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("method", "fix"),
    [
        ("lsq", {}),
        ("exact", {}),
        ("profile", {"e_n": 0.9}),  # each place of a profile is a search of its own
        pytest.param("profile", {}, marks=pytest.mark.long),
    ],
)
def test_recovers_the_constants(impacts: Impacts, method: str, fix: dict[str, float]) -> None:
    path = impacts(
        {"gamma": GAMMA[::2], "noise": 0.02, "sigma": 0.02} | TRUE,
        {"gamma": np.zeros(4), "observables": ("e_n",), "noise": 0.01, "sigma": 0.01, "seed": 1} | TRUE,
    )
    found = fit(path, method=method, fix=fix)
    for name, true in {"e_n": 0.9, "chi": 1.44, "mu": 0.15}.items() - fix.items():
        one = found.constants[name]
        assert one.status == "determined"
        assert abs(one.value - true) < 3.0 * one.stderr
    nu = found.derived["poisson_ratio"]
    assert "beta_sticking" not in found.derived
    assert nu.value == pytest.approx(float(poisson_ratio(found.constants["chi"].value)), abs=1e-9)
    assert nu.interval95[0] < poisson_ratio(1.44) < nu.interval95[1]
    (angle,) = transition_angles(transition_tau(get_closure("maw"), 1.44, 0.15 * 1.9))
    assert found.derived["transition_angle_deg"]["run"].value == pytest.approx(angle, abs=1.0)
    assert not found.facts["global_optimum"].ok  # found, not proven
    assert "no bound is known for this closure" in found.facts["global_optimum"].says
    assert found.facts["lack_of_fit"].ok


def test_exact_data_are_met_exactly(impacts: Impacts) -> None:
    found = fit(impacts(gamma=GAMMA, **TRUE), method="lsq", fix={"e_n": 0.9})
    assert found.constants["chi"].value == pytest.approx(1.44, abs=1e-6)
    assert found.constants["mu"].value == pytest.approx(0.15, abs=1e-7)
    assert found.fit.chi2 < 1e-8


def brute(found: ifrfit.FitResult, per_panel: int = 8) -> tuple[float, np.ndarray, np.ndarray]:
    """Evidence, means and standard deviations by Gauss-Legendre panels over the whole domain."""
    density = Density(found.problem)
    drawn = found.distribution.draws(4000, np.random.default_rng(1))
    nodes, weights = np.polynomial.legendre.leggauss(per_panel)
    axes, sizes = [], []
    for name, low, high in zip(density.names, density.lower, density.upper, strict=True):
        q = np.quantile(drawn[name], [0.0, 0.02, 0.25, 0.75, 0.98, 1.0])
        reach = 0.4 * (q[-1] - q[0])
        edges = np.unique(np.clip([low, q[0] - reach, *q, q[-1] + reach, high], low, high))
        half = 0.5 * np.diff(edges)[:, None]
        axes.append((edges[:-1, None] + half * (nodes + 1.0)).ravel())
        sizes.append((half * weights).ravel())
    points = np.stack([g.ravel() for g in np.meshgrid(*axes, indexing="ij")], axis=1)
    weight = sizes[0]
    for size in sizes[1:]:
        weight = np.multiply.outer(weight, size)
    log = np.concatenate([density(part) for part in np.array_split(points, 1 + points.shape[0] // 20_000)])
    mass = weight.ravel() * np.exp(log - log.max())
    mean = (mass[:, None] * points).sum(axis=0) / mass.sum()
    square = (mass[:, None] * (points - mean) ** 2).sum(axis=0) / mass.sum()
    return float(np.log(mass.sum()) + log.max()), mean, np.sqrt(square)


@pytest.mark.parametrize(
    ("observables", "n", "noise", "choices"),
    [
        (("beta",), 8, 0.1, {"fix": {"e_n": 0.8}}),
        (("beta", "e_n"), 7, 0.05, {}),
        (("beta",), 6, 0.05, {"fix": {"mu": 0.2}}),
        (("beta",), 8, 0.05, {"fix": {"e_n": 0.8}, "prior": {"chi": (1.4, 0.05)}}),
        (("spin_y_after", "v_x", "v_n"), 6, 0.05, {}),
        (("tan_psi_out", "beta"), 5, 0.05, {}),
    ],
)
def test_posterior_against_brute_force(
    impacts: Impacts, observables: tuple[str, ...], n: int, noise: float, choices: dict[str, object]
) -> None:
    gamma = np.linspace(5.0, 75.0, n)
    path = impacts(
        gamma=gamma, observables=observables, e_n=0.8, c=1.5, mu=0.2, closure="maw", noise=noise, sigma=noise
    )
    found = fit(path, **choices)
    posterior = found.distribution
    assert posterior.converged
    log_evidence, mean, sd = brute(found)
    assert posterior.log_evidence == pytest.approx(log_evidence, abs=2e-3)
    for i, name in enumerate(Density(found.problem).names):
        assert abs(posterior.mean(name) - mean[i]) < 5e-3 * sd[i]
        assert posterior.sd(name) == pytest.approx(sd[i], rel=5e-3)


def test_one_transition_quantile_by_draws(impacts: Impacts) -> None:
    """The slip ratio where gross slip begins depends on chi too: its quantiles against draws of both."""
    found = fit(impacts(gamma=GAMMA[::2], noise=0.1, sigma=0.1, **TRUE), fix={"e_n": 0.9})
    drawn = found.draws(40_000, np.random.default_rng(3))
    law = get_closure("maw").law(0.4)
    tau = drawn["kappa"] / law.bound(drawn["chi"])
    expected = np.quantile(tau, [0.025, 0.16, 0.5, 0.84, 0.975])
    quantiles = found.distribution.quantile("transition_tau[run]", LEVELS)
    assert np.abs(quantiles - expected).max() < 0.05 * tau.std()


def test_only_kappa_is_seen(impacts: Impacts) -> None:
    found = fit(impacts(gamma=GAMMA, noise=0.03, sigma=0.03, **TRUE))
    assert [found.constants[name].status for name in ("e_n", "chi", "mu")] == [
        "not_determined",
        "determined",
        "not_determined",
    ]
    kappa = found.derived["kappa"]
    assert abs(kappa.value - 0.15 * 1.9) < 3.0 * kappa.stderr
    assert "beta alone determines chi and kappa" in found.facts["identifiable"].says


def test_gross_slip_alone_says_nothing_of_chi(impacts: Impacts) -> None:
    found = fit(impacts(gamma=np.linspace(60.0, 85.0, 15), noise=0.02, sigma=0.02, **TRUE), fix={"e_n": 0.9})
    assert found.constants["mu"].status == "determined"
    assert found.constants["chi"].value is None
    assert found.fit.n_sticking == 0
    assert "chi shows only in sticking" in found.facts["identifiable"].says


def test_microslip_alone_says_kappa_too(impacts: Impacts) -> None:
    """Unlike a constant closure: without any gross slip the course of beta holds kappa."""
    found = fit(impacts(gamma=np.linspace(2.0, 30.0, 20), noise=0.02, sigma=0.02, **TRUE), fix={"e_n": 0.9})
    assert found.fit.n_sliding == 0
    assert found.constants["mu"].status == "determined"
    assert abs(found.constants["mu"].value - 0.15) < 3.0 * found.constants["mu"].stderr


def test_words(impacts: Impacts) -> None:
    text = fit(impacts(gamma=GAMMA, noise=0.03, sigma=0.03, **TRUE), fix={"e_n": 0.9}, method="lsq").summary()
    assert "closure MAW, least squares" in text
    assert re.search(r"\d+ impacts in partial slip, \d+ in gross slip; transition at \d+", text)
    assert "Poisson ratio, if sphere and wall are of one material" in text


@pytest.mark.parametrize("closure", ["maw", "ifr"])
def test_without_friction_kappa_is_zero(impacts: Impacts, closure: str) -> None:
    found = fit(impacts(gamma=GAMMA[::4], **(TRUE | {"mu": 0.0})), closure=closure, fix={"mu": 0.0})
    assert (found.derived["kappa"].value, found.derived["kappa"].status) == (0.0, "fixed")


@pytest.mark.parametrize(
    ("choices", "says"),
    [
        (
            {"bounds": {"chi": (0.1, 5.0)}},
            r"chi from 0\.1 to 5: the table of closure MAW reaches from 0\.65 to 3",
        ),
        ({"inertia_factor": 0.05}, r"chi from 7 to 10\.5: the table .* Give --bounds chi=LO,HI inside"),
        ({"fix": {"chi": 1.0}}, r"--fix chi=1: outside the domain \[1\.16667, 1\.75\]"),
        ({"fix": {"e_t": -0.9}}, "closure MAW has no such constant. It has e_n, chi, mu"),
    ],
)
def test_refusals(impacts: Impacts, choices: dict[str, object], says: str) -> None:
    with refused(UsageError, match=says):
        fit(impacts(gamma=GAMMA, **TRUE), **choices)


def gain(impacts: Impacts, closure: str, seed: int) -> tuple[float, bool]:
    """Log evidence of maw over that of ifr, of impacts made by one of them with constants of their own.

    And whether the right one is refuted, which is to happen once in a thousand times.
    """
    rng = np.random.default_rng(seed)
    e_n, mu = rng.uniform(0.7, 0.95), rng.uniform(0.08, 0.25)
    c = rng.uniform(*get_closure(closure).domain(0.4)) if closure == "maw" else rng.uniform(-1.0, -0.5)
    path = impacts(
        gamma=GAMMA, closure=closure, e_n=e_n, c=c, mu=mu, noise=0.04, sigma=0.04, seed=seed, name="blind.csv"
    )
    maw, ifr = (fit(path, closure=name, fix={"e_n": e_n}) for name in ("maw", "ifr"))
    right, wrong = (maw, ifr) if closure == "maw" else (ifr, maw)
    assert not wrong.facts["lack_of_fit"].ok
    return float(maw.fit.log_evidence - ifr.fit.log_evidence), not right.facts["lack_of_fit"].ok


@pytest.mark.parametrize("n", [1, pytest.param(40, marks=pytest.mark.long)])
def test_blind(impacts: Impacts, n: int) -> None:
    """25 impacts with a noise of 0.04 tell compliance from a constant closure, every time, either way."""
    for_maw, refuted = zip(*(gain(impacts, "maw", 100 + seed) for seed in range(n)), strict=True)
    for_ifr, also = zip(*(gain(impacts, "ifr", 200 + seed) for seed in range(n)), strict=True)
    assert min(for_maw) > np.log(20.0)
    assert max(for_ifr) < -np.log(20.0)
    assert sum(refuted + also) <= at_most(2 * n, 0.001)


def test_kharaz_is_described_better_than_by_any_constant_closure() -> None:
    found = {name: ifrfit.fit("kharaz-2001", closure=name) for name in ("maw", "ifr", "fr")}
    assert found["maw"].fit.log_evidence > max(found[name].fit.log_evidence for name in ("ifr", "fr")) + 10.0
    nu = found["maw"].derived["poisson_ratio"]
    assert nu.interval95[0] < 0.235 < nu.interval95[1]  # aluminium oxide 0.23, soda-lime glass 0.24


@pytest.mark.long  # a handful of experiments could not tell
def test_coverage_of_the_exact_intervals(impacts: Impacts) -> None:
    """Constants drawn from the prior: their posterior probabilities are uniform (Kolmogorov, 1e-4)."""
    n = 60
    rng, below = np.random.default_rng(11), []
    low, high = float(chi_of(0.5)), float(chi_of(0.0))
    for seed in range(n):
        chi, mu = rng.uniform(low, high), rng.uniform(0.05, 0.4)
        path = impacts(
            gamma=GAMMA[::3], closure="maw", e_n=0.9, c=chi, mu=mu, noise=0.1, sigma=0.1, seed=500 + seed
        )
        found = fit(path, fix={"e_n": 0.9}, bounds={"mu": (0.05, 0.4)})
        below += [found.distribution.cdf("chi", chi), found.distribution.cdf("mu", mu)]
    for ranks in (np.sort(below[::2]), np.sort(below[1::2])):
        steps = np.arange(n + 1) / n
        distance = max(np.abs(ranks - steps[1:]).max(), np.abs(ranks - steps[:-1]).max())
        assert distance < np.sqrt(-0.5 * np.log(0.5e-4) / n)


def test_separate_compliance_numbers_have_transitions_each(impacts):
    gamma = np.linspace(4.0, 84.0, 12)
    one = {"gamma": gamma, "closure": "maw", "mu": 0.15, "e_n": 0.9, "noise": 0.05, "sigma": 0.05}
    path = impacts({**one, "c": 1.3, "series": "a"}, {**one, "c": 1.5, "series": "b", "seed": 1})
    found = ifrfit.fit(path, closure="maw", fix={"e_n": 0.9}, separate="chi")
    for series, chi in (("a", 1.3), ("b", 1.5)):
        own = found.constants["chi"][series]
        assert abs(own.value - chi) < 4.0 * own.stderr
        low, high = found.derived["transition_angle_deg"][series].interval95
        assert 20.0 < low < high < 60.0


def test_series_without_an_oblique_impact_have_a_friction_each(impacts: Impacts) -> None:
    """Nothing is searched for there, and nothing is linear in the law of MAW either."""
    gamma = np.array([20.0, 35.0, 50.0])
    parts = [
        {"gamma": gamma, "observables": ("mu",), "noise": 0.01, "sigma": 0.01, "series": s, "seed": n} | TRUE
        for n, s in enumerate(("a", "b"))
    ]
    found = fit(impacts(*parts), fix={"e_n": 0.9}, separate=["mu"], method="lsq")
    for series in ("a", "b"):
        assert found.constants["mu"][series].value == pytest.approx(TRUE["mu"], abs=0.03)
