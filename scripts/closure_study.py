"""Simulated experiments of each closure, and the evidence that every closure finds in them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from calibration_verdict import Line, judge
from numpy.typing import NDArray
from simulated import simulated
from studies import in_order

from ifrfit.data.observations import Observations
from ifrfit.inference.comparison.compare import probabilities
from ifrfit.inference.model.prior_specification import make_parameters
from ifrfit.inference.model.problem import Problem, make_problem
from ifrfit.inference.posterior import log_evidence
from ifrfit.physics import rebound
from ifrfit.physics.closures import CLOSURES as REGISTRY
from ifrfit.physics.closures import get_closure

Array = NDArray[np.float64]

BILINEAR = tuple(name for name, closure in REGISTRY.items() if closure.bilinear)
CLOSURES = tuple(REGISTRY)  # the evidence of maw takes seven times as long as that of the others together
BOUNDS = {"e_n": (0.5, 1.0), "mu": (0.0, 0.5)}  # each closure's own constant: its passive domain
N_BETA, N_E_N = 12, 3
SIGMA = {"beta": 0.15, "e_n": 0.02}
GAMMA = (5.0, 85.0)
INERTIA = 0.4
TOLERANCE = 1e-3  # of a log evidence: far below what moves a probability
BINS = 10
RIGHT, WRONG_SIGMA, SWAPPED = "exact evidence", "sigma claimed half as large", "two labels swapped"
FACTOR = 0.5
SWAP = {"fr": "ifr", "ifr": "fr"}


@dataclass(frozen=True)
class Task:
    """One experiment to do: the closure that makes it, its number, the seed of the study."""

    truth: str
    number: int
    seed: int
    control: bool = False
    closures: tuple[str, ...] = CLOSURES  # that are weighed

    def rng(self) -> np.random.Generator:
        """Return the generator of this experiment, the same in whatever process."""
        return np.random.default_rng(np.random.SeedSequence([self.seed, self.number, *self.truth.encode()]))


@dataclass(frozen=True)
class Outcome:
    """Log evidences of one experiment by closure; also under a wrong sigma, where that was asked for."""

    task: Task
    evidence: Mapping[str, float]
    wrong: Mapping[str, float] | None


def simulate(truth: str, rng: np.random.Generator) -> Observations:
    """Draw constants from the prior and measure with them."""
    closure = get_closure(truth)
    own = {closure.constant: float(rng.uniform(*closure.domain(INERTIA)))} if closure.constant else {}
    e_n, mu = (float(rng.uniform(*BOUNDS[name])) for name in ("e_n", "mu"))
    gamma = rng.uniform(*GAMMA, N_BETA)
    beta = rebound(gamma, e_n=e_n, mu=mu, closure=truth, inertia_factor=INERTIA, degrees=True, **own).beta  # type: ignore[arg-type]
    observable = np.repeat(["beta", "e_n"], (N_BETA, N_E_N))
    sigma = np.array([SIGMA[str(name)] for name in observable])
    value = np.concatenate((beta, np.full(N_E_N, e_n))) + sigma * rng.standard_normal(sigma.size)
    return simulated(observable, np.concatenate((gamma, np.full(N_E_N, np.nan))), value, sigma)


def problem_of(data: Observations, name: str) -> Problem:
    """The question of one closure under the prior that the constants were drawn from."""
    closure = get_closure(name)
    return make_problem(data, closure, INERTIA, make_parameters(closure, INERTIA, bounds=BOUNDS), "known")


def run(task: Task) -> Outcome:
    """Simulate one experiment and integrate it under every closure."""
    data = simulate(task.truth, task.rng())
    problems = {name: problem_of(data, name) for name in task.closures}
    evidence = {name: log_evidence(problem, TOLERANCE) for name, problem in problems.items()}
    wrong = None
    if task.control:
        wrong = {
            name: log_evidence(
                problem.with_noise(replace(problem.noise, sigma=FACTOR * problem.noise.sigma)), TOLERANCE
            )
            for name, problem in problems.items()
        }
    return Outcome(task, evidence, wrong)


def tasks_of(seed: int, repeats: int, controls: int, closures: tuple[str, ...] = CLOSURES) -> list[Task]:
    """List the experiments: as many of each closure, the first `controls` of them also seen wrongly."""
    return [Task(name, i, seed, i < controls, closures) for name in closures for i in range(repeats)]


def run_many(tasks: Sequence[Task], workers: int) -> Iterator[Outcome]:
    """Do the experiments, in order; the same for any number of workers."""
    return in_order(run, tasks, workers)


@dataclass(frozen=True)
class Seen:
    """Experiments as one method sees them.

    Attributes
    ----------
    method : str
    truth : ndarray of int, (n,)
        Which closure made each.
    probability : ndarray, (n, n_closures)
        Posterior probability of each closure.
    log_bayes_factor : ndarray, (n,)
        Of the best closure over the next.
    closures : tuple of str
        What truth and probability count.
    """

    method: str
    truth: NDArray[np.intp]
    probability: Array
    log_bayes_factor: Array
    closures: tuple[str, ...] = CLOSURES

    @property
    def picked(self) -> NDArray[np.intp]:
        """The closure with the largest evidence."""
        return np.asarray(self.probability.argmax(axis=1), dtype=np.intp)


def seen_by(outcomes: Sequence[Outcome]) -> list[Seen]:
    """Look at the experiments rightly, and wrongly in two ways."""
    seen = [
        _seen(RIGHT, outcomes, [o.evidence for o in outcomes]),
        _seen(SWAPPED, outcomes, [_swapped(o.evidence) for o in outcomes]),
    ]
    controls = [(o, o.wrong) for o in outcomes if o.wrong is not None]
    if controls:
        seen.append(_seen(WRONG_SIGMA, [o for o, _ in controls], [wrong for _, wrong in controls]))
    return seen


def _swapped(evidence: Mapping[str, float]) -> dict[str, float]:
    return {name: evidence[SWAP.get(name, name)] for name in evidence}


def _seen(method: str, outcomes: Sequence[Outcome], evidences: Sequence[Mapping[str, float]]) -> Seen:
    closures = outcomes[0].task.closures
    truth = np.array([closures.index(o.task.truth) for o in outcomes], dtype=np.intp)
    chances = [probabilities(evidence) for evidence in evidences]
    probability = np.array([[chance[name] for name in closures] for chance in chances])
    ordered = np.sort([[evidence[name] for name in closures] for evidence in evidences], axis=1)
    return Seen(method, truth, probability, ordered[:, -1] - ordered[:, -2], closures)


def poisson_binomial_p(hits: int, chances: Array) -> float:
    """Two-sided p of so many hits where each happens with its own chance: twice the smaller tail."""
    law = np.ones(1)
    for p in chances:
        law = np.convolve(law, [1.0 - p, p])
    below, above = float(law[: hits + 1].sum()), float(law[hits:].sum())
    return min(1.0, 2.0 * min(below, above))


def lines_of(seen: Seen) -> list[Line]:
    """Test, closure by closure and bin by bin of the probability given, how often it was the right one.

    The last line of a closure is of the experiments in which it has the largest evidence. `coverage` holds
    the share that is right, and the mean probability given.
    """
    found = []
    for i, name in enumerate(seen.closures):
        p, right = seen.probability[:, i], seen.truth == i
        where = np.clip((p * BINS).astype(int), 0, BINS - 1)
        for number in np.unique(where):
            words = f"{number / BINS:g} to {(number + 1) / BINS:g}"
            found.append(_line(seen.method, name, words, p, right, where == number))
        found.append(_line(seen.method, name, "picked", p, right, seen.picked == i))
    return judge([line for line in found if line.n])


def _line(method: str, name: str, words: str, p: Array, right: Array, own: NDArray[np.bool_]) -> Line:
    n = int(own.sum())
    hits = int(right[own].sum())
    test = poisson_binomial_p(hits, p[own])
    share = (hits / max(n, 1), float(p[own].mean()) if n else float("nan"))
    return Line(name, method, words, n, 0, share, (test,), (), float("nan"))
