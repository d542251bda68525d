"""Experiments in which two closures coincide: their evidence against integrals made in another way."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from closure_study import INERTIA
from numpy.typing import NDArray
from scipy import integrate, special
from simulated import simulated

from ifrfit.inference.comparison import compare
from ifrfit.inference.model.prior_specification import make_parameters
from ifrfit.inference.model.problem import make_problem
from ifrfit.inference.posterior import log_evidence
from ifrfit.physics import rebound
from ifrfit.physics.closures import get_closure

Array = NDArray[np.float64]

FIXED = {"e_n": 0.9, "mu": 0.12}
SIGMA, N = 0.05, 20
GAMMA = (5.0, 85.0)
KAPPA = FIXED["mu"] * (1.0 + FIXED["e_n"])


@dataclass(frozen=True)
class Tie:
    """One experiment of IFR at e_t = -1, which is FR at beta0 = 2/5.

    Attributes
    ----------
    exact, by_hand : float
        Log Bayes factor of FR over IFR, by the package and by one-dimensional integrals written for it.
    kind : str
        Of the verdict on FR and IFR.
    """

    exact: float
    by_hand: float
    kind: str


def tie(seed: int, number: int) -> Tie:
    """Simulate one experiment and weigh both closures."""
    rng = np.random.default_rng(np.random.SeedSequence([seed, number]))
    gamma = rng.uniform(*GAMMA, N)
    beta = rebound(gamma, e_t=-1.0, closure="ifr", inertia_factor=INERTIA, degrees=True, **FIXED).beta
    value = beta + SIGMA * rng.standard_normal(N)
    data = simulated("beta", gamma, value, SIGMA)
    found = {}
    for name in ("fr", "ifr"):
        closure = get_closure(name)
        constants = make_parameters(closure, INERTIA, fix=FIXED)
        found[name] = log_evidence(make_problem(data, closure, INERTIA, constants, "known"))
    tau = np.tan(np.radians(gamma))
    verdict = compare(data, ("fr", "ifr"), loo=False, fix=FIXED, noise="known").verdict
    return Tie(found["fr"] - found["ifr"], fr_by_hand(tau, value) - ifr_by_hand(tau, value), verdict.kind)


def ties(seed: int, repeats: int) -> list[Tie]:
    """Do so many experiments."""
    return [tie(seed, i) for i in range(repeats)]


def ifr_by_hand(tau: Array, value: Array) -> float:
    """Log evidence of IFR: beta is e_t plus what is known, so that the posterior is a normal law, cut off."""
    rest = value - np.minimum(3.5 * KAPPA / tau, 1.4)
    mean, sd = float(rest.mean()), SIGMA / np.sqrt(rest.size)
    inside = special.ndtr((-0.4 - mean) / sd) - special.ndtr((-1.0 - mean) / sd)
    return (
        _normalising(rest.size)
        - 0.5 * float(((rest - mean) ** 2).sum()) / SIGMA**2
        + np.log(np.sqrt(2.0 * np.pi) * sd * inside / 0.6)
    )


def fr_by_hand(tau: Array, value: Array) -> float:
    """Log evidence of FR: beta is the smaller of beta0 and the value of sliding; by adaptive quadrature."""
    slide = 3.5 * KAPPA / tau - 1.0

    def half_chi2(beta0: float) -> float:
        return 0.5 * float(((value - np.minimum(beta0, slide)) ** 2).sum()) / SIGMA**2

    kinks = np.unique(np.concatenate(([-1.0, 1.0], slide[(slide > -1.0) & (slide < 1.0)])))
    least = min(half_chi2(float(b)) for b in np.linspace(-1.0, 1.0, 2001))
    pieces = [
        integrate.quad(lambda b: np.exp(least - half_chi2(b)), low, high, epsabs=1e-14, epsrel=1e-12)[0]
        for low, high in itertools.pairwise(kinks)
    ]
    return _normalising(value.size) - least + float(np.log(sum(pieces) / 2.0))


def _normalising(n: int) -> float:
    return -n * float(np.log(SIGMA * np.sqrt(2.0 * np.pi)))


def tie_lines(found: Sequence[Tie]) -> list[str]:
    """What came of them, as the lines of a page."""
    factor = np.array([one.exact for one in found])
    off = max(abs(one.exact - one.by_hand) for one in found)
    undecided = sum(one.kind == "undecided" for one in found)
    low, middle, high = np.quantile(factor, [0.05, 0.5, 0.95])
    known = f"e_n {FIXED['e_n']:g} and mu {FIXED['mu']:g} known"
    made = f"{N} values of beta (sigma {SIGMA:g}, {GAMMA[0]:g} to {GAMMA[1]:g} degrees, {known})"
    spread = f"median {middle:.2f}, 5 and 95 % quantiles {low:.2f} and {high:.2f}"
    return [
        f"{len(found)} experiments of {made}",
        f"made by IFR at e_t = -1, which is FR at beta0 = 2/5. Log Bayes factor of FR over IFR: {spread};",
        f"largest distance to one-dimensional integrals written for this page: {off:.1e}.",
        f'The verdict on FR and IFR is "these data cannot tell" in {undecided} of {len(found)}.',
    ]
