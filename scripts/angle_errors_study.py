"""Fits of one experiment whose angles err, treated in four ways, over and over with new errors."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain

import numpy as np
from simulated import simulated
from studies import in_order

from ifrfit.inference.model.apply_error_model import with_error_model
from ifrfit.inference.model.error_model import ErrorModel
from ifrfit.inference.model.parameters import make_parameters
from ifrfit.inference.model.problem import make_problem
from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.inference.posterior import integrate
from ifrfit.physics import rebound
from ifrfit.physics.closures import get_closure

TRUTH = {"e_n": 0.9, "e_t": -0.85, "mu": 0.15}
ASKED = ("e_t", "mu")
ANGLES = (8.0, 78.0)  # degrees, between which true angles lie
N = 24
SIGMA, SIGMA_GAMMA = 0.05, 3.0  # of beta; of the angle, degrees
TOLERANCE = 1e-2
LEVEL = 0.95
KINDS = ("set", "measured")
TREATMENTS = {
    "none": ErrorModel(),
    "effective": ErrorModel(angles="effective", gamma=SIGMA_GAMMA),
    "set": ErrorModel(angles="set", gamma=SIGMA_GAMMA),
    "measured": ErrorModel(angles="measured", population=ANGLES, gamma=SIGMA_GAMMA),
}


@dataclass(frozen=True)
class Found:
    """What one treatment says of one experiment: mean, sd, and whether the 95 % interval holds the truth."""

    kind: str
    treatment: str
    mean: tuple[float, ...]
    sd: tuple[float, ...]
    covers: tuple[bool, ...]


@dataclass(frozen=True)
class Summary:
    """One constant under one treatment: bias and its standard error, spread, stated sd, share covered."""

    kind: str
    treatment: str
    constant: str
    n: int
    bias: float
    error: float
    spread: float
    stated: float
    coverage: float

    @property
    def coverage_error(self) -> float:
        """Binomial standard error of a coverage of 95 %."""
        return math.sqrt(LEVEL * (1.0 - LEVEL) / self.n)


def treat(task: tuple[int, str, int]) -> list[Found]:
    """Simulate one experiment (seed, kind of angles, number) and fit it in every way."""
    seed, kind, number = task
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(KINDS.index(kind), number)))
    if kind == "set":
        shown = np.linspace(*ANGLES, N)
        true = shown + SIGMA_GAMMA * rng.standard_normal(N)
    else:
        true = rng.uniform(*ANGLES, N)
        shown = true + SIGMA_GAMMA * rng.standard_normal(N)
    beta = rebound(np.abs(true), **TRUTH, degrees=True).beta + SIGMA * rng.standard_normal(N)
    closure = get_closure("ifr")
    constants = make_parameters(closure, 0.4, fix={"e_n": TRUTH["e_n"]})
    plain = make_problem(simulated("beta", np.abs(shown), beta, SIGMA), closure, 0.4, constants, "known")
    found = []
    for name, error_model in TREATMENTS.items():
        problem = with_error_model(plain, error_model)
        post = integrate(problem, tolerance=TOLERANCE, start=least_squares(problem))
        inside = []
        for constant in ASKED:
            low, high = np.asarray(post.quantile(constant, np.array([0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL])))
            inside.append(bool(low <= TRUTH[constant] <= high))
        means, sds = (tuple(float(of(c)) for c in ASKED) for of in (post.mean, post.sd))
        found.append(Found(kind, name, means, sds, tuple(inside)))
    return found


def treat_many(seed: int, repeats: int, workers: int) -> Iterator[Found]:
    """All experiments in every way; the same for any number of workers."""
    tasks = [(seed, kind, number) for kind in KINDS for number in range(repeats)]
    return chain.from_iterable(in_order(treat, tasks, workers))


def summarise(results: Iterable[Found]) -> list[Summary]:
    """Bias and coverage of each constant, by kind of angles and treatment."""
    groups: dict[tuple[str, str], list[Found]] = {}
    for one in results:
        groups.setdefault((one.kind, one.treatment), []).append(one)
    found = []
    for (kind, treatment), own in groups.items():
        for i, constant in enumerate(ASKED):
            off = np.array([one.mean[i] for one in own]) - TRUTH[constant]
            spread = float(off.std(ddof=1))
            found.append(
                Summary(
                    kind,
                    treatment,
                    constant,
                    len(own),
                    float(off.mean()),
                    spread / math.sqrt(len(own)),
                    spread,
                    float(np.mean([one.sd[i] for one in own])),
                    float(np.mean([one.covers[i] for one in own])),
                )
            )
    return found
