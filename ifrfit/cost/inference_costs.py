"""What each method of inference costs on a problem, and how far its numbers are from the posterior's."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from ifrfit.cost.timing import Cost, Timing, in_turns, timed_result
from ifrfit.errors import UsageError
from ifrfit.inference.accuracy.select_method import LADDER, foreseen
from ifrfit.inference.bootstrap.batched_solver import BatchedSolver
from ifrfit.inference.distributions.protocol import LEVELS, Distribution
from ifrfit.inference.distributions.truncated_normal import half_width
from ifrfit.inference.estimator import Estimator
from ifrfit.inference.estimators import ESTIMATORS, Bootstrap
from ifrfit.inference.model.log_posterior import Density
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, dof_of_functional, least_squares
from ifrfit.inference.posterior import QuadraturePosterior, integrate
from ifrfit.inference.posterior.adaptive_quadrature import GridTooLargeError
from ifrfit.inference.profile.types import ProfileLikelihood
from ifrfit.text import power_of_ten

Array = NDArray[np.float64]

QUANTITIES = ("mean", "sd", "interval95")
_TAILS = np.array([LEVELS[0], LEVELS[-1]])
_LEVEL = LEVELS[-1] - LEVELS[0]
UNIT = "posterior sd"
LSQ, PROFILE, BOOTSTRAP, EXACT, MCMC = "lsq", "profile", "bootstrap", "exact", "mcmc"
# they answer another question: how far they are from the posterior is no error of arithmetic
OTHER_QUESTION = (LSQ, PROFILE, BOOTSTRAP)

REFERENCE = 1e-9  # a step beyond the finest that is measured
WORST = 0.1  # error of a reference, in sd, beyond which it is none

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Numbers:
    """Mean, sd and ends of the central 95 % interval of every free constant.

    Attributes
    ----------
    mean, sd : ndarray, (p,)
    ends : ndarray, (p, 2)
    """

    mean: Array
    sd: Array
    ends: Array

    def errors(self, reference: Numbers) -> dict[str, Array]:
        """Distance from the reference in its standard deviations, (p, ...), by `QUANTITIES`."""
        return {
            "mean": np.abs(self.mean - reference.mean) / reference.sd,
            "sd": np.abs(self.sd - reference.sd) / reference.sd,
            "interval95": np.abs(self.ends - reference.ends) / reference.sd[:, None],
        }


def largest_errors(given: Sequence[Numbers], reference: Numbers) -> dict[str, float]:
    """Error of each quantity, in standard deviations of the reference: the largest over the constants.

    Parameters
    ----------
    given : sequence of Numbers
        Of several seeds where a method draws: the error of each constant is then the root mean square over
        them, so that no lucky run passes for an exact one.
    reference : Numbers
    """
    each = [numbers.errors(reference) for numbers in given]
    return {
        name: float(np.sqrt(np.mean([one[name] ** 2 for one in each], axis=0)).max()) for name in QUANTITIES
    }


def of_distribution(problem: Problem, distribution: Distribution) -> Numbers:
    """From marginals: of the exact posterior, of chains, of replicates."""
    names = problem.parameters.free_names
    return Numbers(
        np.array([distribution.mean(name) for name in names]),
        np.array([distribution.sd(name) for name in names]),
        np.array([np.asarray(distribution.quantile(name, _TAILS)) for name in names]),
    )


def of_least_squares(problem: Problem, found: LeastSquaresFit) -> Numbers:
    """Optimum, standard deviation by the covariance, and the symmetric interval cut at the domain's ends.

    Directions that the data leave loose have the standard deviation of the default prior.
    """
    sd = found.gaussian.theta_sd[problem.parameters.free]
    low, high = _domain(problem)
    value = np.clip(found.optimum.theta[problem.parameters.free], low, high)
    free = found.gaussian.to_theta[problem.parameters.free]
    half = np.array([half_width(_LEVEL, dof_of_functional(problem, found, each)) for each in free]) * sd
    return Numbers(
        value, sd, np.clip(np.stack((value - half, value + half), axis=1), low[:, None], high[:, None])
    )


def of_profiles(problem: Problem, profiles: Mapping[str, ProfileLikelihood]) -> Numbers:
    """Optimum, and the interval whose half width gives the standard deviation, cut at the domain's ends."""
    own = [profiles[name] for name in problem.parameters.free_names]
    low, high = _domain(problem)
    ends = np.clip(np.array([profile.central95 for profile in own]), low[:, None], high[:, None])
    half = [half_width(_LEVEL, profile.dof) for profile in own]
    return Numbers(
        np.clip([profile.value for profile in own], low, high),
        0.5 * np.ptp(ends, axis=1) / np.array(half),
        ends,
    )


def _domain(problem: Problem) -> tuple[Array, Array]:
    """Ends of the default prior of each free constant."""
    own = [constant for constant in problem.parameters.entries if constant.fixed is None]
    return np.array([c.lower for c in own]), np.array([c.prior_upper for c in own])


@dataclass(frozen=True)
class Extent:
    """How much is measured.

    Attributes
    ----------
    tolerances : tuple of float
        Of exact, from coarse to fine; the reference comes after them.
    replicates : tuple of int
        Of the bootstrap.
    steps : tuple of int
        Of mcmc, each ensemble's, from few to many.
    seeds : int
        Of the bootstrap and of mcmc.
    repeats : int
        Of everything else.
    longest : float
        Seconds that one call may take; what is foreseen to take longer is left out, and that is said.
    reference : float
        Seconds that the reference may take, as far as that can be foreseen.
    """

    tolerances: tuple[float, ...] = LADDER
    replicates: tuple[int, ...] = (100, 1_000, 10_000)
    steps: tuple[int, ...] = (100, 300, 1_000)
    seeds: int = 4
    repeats: int = 5
    longest: float = 8.0
    reference: float = 20.0


FULL = Extent()
QUICK = Extent(
    tolerances=(1e-1, 1e-3, 1e-6),
    replicates=(100, 1_000),
    steps=(50, 150),
    seeds=2,
    repeats=3,
    longest=0.7,
    reference=3.0,
)


@dataclass(frozen=True)
class Reference:
    """What errors are measured against.

    Attributes
    ----------
    tolerance : float
        Asked of the quadrature.
    error : float
        That it says to have reached, in posterior standard deviations.
    """

    tolerance: float
    error: float


@dataclass(frozen=True)
class Measured:
    """Costs of all methods on a problem.

    Attributes
    ----------
    costs : tuple of Cost
        One a quantity: mean, sd, interval95; errors in posterior standard deviations, not below what the
        reference itself reached.
    reference : Reference
    notes : tuple of str
        What was left out, and why.
    """

    costs: tuple[Cost, ...]
    reference: Reference
    notes: tuple[str, ...]


@dataclass(frozen=True)
class _Answer:
    """One method at one setting: its numbers, of each seed, and its time."""

    method: str
    setting: str
    numbers: tuple[Numbers, ...]
    time: Timing


def inference_costs(
    problem: Problem, *, extent: Extent = FULL, seed: int = 0, progress: Progress | None = None
) -> Measured:
    """Measure every method on a problem, now and on this machine.

    The clock runs from data in memory to the mean, the standard deviation and the 95 % interval of every free
    constant, the certified least squares that each method starts from included, and whatever else `--method`
    does on the way (facts, curves of profiles, looks at chains); of the exact posterior the quadrature alone.

    Parameters
    ----------
    problem : Problem
    extent : Extent
        `FULL` or `QUICK`.
    seed : int
        Of chains and replicates; each repeat has a seed of its own.
    progress : callable, optional
        Called with the number of choices measured and the most there may be.

    Returns
    -------
    Measured

    Raises
    ------
    UsageError
        If nothing is free, for a problem that the exact posterior refuses, as there is no reference then,
        and where every method takes too long.
    DataError
        Where the noise is unknown and the data cannot tell it from the constants.
    """
    if not problem.parameters.free.any():
        raise UsageError("Every constant is fixed: no method has anything to find. Leave out a --fix.")
    answers: list[_Answer] = []
    notes: list[str] = []
    methods = _methods(problem, notes)
    most = len(methods) + len(extent.tolerances) + len(extent.replicates) + len(extent.steps)
    ladder, finest = _ladder(problem, extent, notes)
    for answer in chain(
        _deterministic(problem, extent, methods, ladder),
        _bootstraps(problem, extent, methods, seed, notes),
        _chains(problem, extent, seed, notes),
        _registered(problem, extent, methods, seed),
    ):
        answers.append(answer)
        if progress is not None:
            progress(len(answers), most)
    if not answers:
        raise UsageError(
            f"Every method of inference takes longer on these data than {extent.longest:g} s: "
            + ("leave --quick out, or choose" if extent is QUICK else "choose")
            + " --kind physics or arithmetic."
        )
    reference = Reference(finest.tolerance, finest.error)
    right = of_distribution(problem, finest)
    return Measured(
        tuple(cost for a in answers for cost in _costs(a, right, reference)), reference, tuple(notes)
    )


def _costs(answer: _Answer, right: Numbers, reference: Reference) -> Iterator[Cost]:
    found = largest_errors(answer.numbers, right)
    for quantity in QUANTITIES:
        # what the reference does not resolve is not claimed
        error = max(found[quantity], reference.error)
        yield Cost("inference", answer.method, answer.setting, quantity, answer.time, error, UNIT)


def _methods(problem: Problem, notes: list[str]) -> dict[str, Estimator]:
    """The methods that can do a problem, with default options."""
    found = {}
    for name, estimator in ESTIMATORS.items():
        refusal = estimator.refuses(problem)
        if refusal:
            notes.append(f"{estimator.title} is left out: {refusal}")
        else:
            found[name] = estimator
    return found


def _numbers(problem: Problem, estimator: Estimator, seed: int = 0) -> Numbers:
    """What a method says of every free constant, from data in memory on."""
    optimum = least_squares(problem)
    found = estimator.run(problem, optimum, seed=seed)
    if found.profiles:
        return of_profiles(problem, found.profiles)
    if found.distribution is None:  # the Gaussian approximation stands in its place
        return of_least_squares(problem, optimum)
    return of_distribution(problem, found.distribution)


def _deterministic(
    problem: Problem, extent: Extent, methods: Mapping[str, Estimator], ladder: Sequence[float]
) -> Iterator[_Answer]:
    """Least squares, profiles and the exact posterior at each tolerance, which take turns."""
    calls: dict[tuple[str, str], Callable[[], Numbers]] = {
        (name, ""): partial(_numbers, problem, methods[name]) for name in (LSQ, PROFILE) if name in methods
    }
    for tolerance in ladder:
        calls[EXACT, f"tolerance {power_of_ten(tolerance)}"] = partial(_exact, problem, tolerance)
    found = in_turns(calls, repeats=extent.repeats, enough=0.01, most=0.5 * extent.longest)
    for (method, setting), (numbers, taken) in found.items():
        yield _Answer(method, setting, (numbers,), taken)


def _exact(problem: Problem, tolerance: float) -> Numbers:
    return of_distribution(problem, integrate(problem, tolerance))


def _ladder(problem: Problem, extent: Extent, notes: list[str]) -> tuple[list[float], QuadraturePosterior]:
    """Tolerances that are measured, and the posterior that is their reference: the next finer one."""
    tried: list[tuple[float, QuadraturePosterior]] = []
    last = before = 0.0
    for tolerance in (*extent.tolerances, REFERENCE):
        if tried:
            known = tried[-1][1].error <= WORST
            if known and foreseen(tried[-1][1], last, before) > extent.reference:
                break
        before = last
        try:
            posterior, last = timed_result(partial(integrate, problem, tolerance))
        except GridTooLargeError:  # a first grid grows as its tolerance falls
            if not tried:
                raise
            break
        if tried and not posterior.error < tried[-1][1].error and not posterior.converged:
            break
        tried.append((tolerance, posterior))
    finest, reference = tried[-1]
    if not reference.error <= WORST:
        raise UsageError(
            f"The exact posterior of these data comes to {power_of_ten(reference.error)} of an sd only: "
            "there is nothing to measure errors against."
        )
    if finest != REFERENCE:
        notes.append(
            f"Tolerances of exact below {power_of_ten(finest)} are out of reach, or take longer than "
            f"{extent.reference:g} s: that one is the reference."
        )
    return [tolerance for tolerance, _ in tried[:-1]], reference


def _bootstraps(
    problem: Problem, extent: Extent, methods: Mapping[str, Estimator], seed: int, notes: list[str]
) -> Iterator[_Answer]:
    """Cases drawn anew, with several seeds."""
    if BOOTSTRAP not in methods:
        return

    def run(replicates: int, own: int) -> Numbers:
        return _numbers(problem, Bootstrap(replicates=replicates), own)

    start, taken = timed_result(lambda: least_squares(problem))
    # a replicate that is fitted on its own takes about as long as the data; all at once are fast
    each = 0.0 if BatchedSolver.of(problem, start) is not None else taken
    yield from _sizes(BOOTSTRAP, "replicates", extent.replicates, run, (taken, each), extent, seed, notes)


def _chains(problem: Problem, extent: Extent, seed: int, notes: list[str]) -> Iterator[_Answer]:
    """Chains of `--method mcmc` that stop at given lengths, with several seeds."""
    from ifrfit.inference import mcmc

    def run(steps: int, own: int) -> Numbers:
        found = mcmc.sample(problem, least_squares(problem), own, max_steps=steps, halt=lambda _: False)
        return of_distribution(problem, found.distribution)

    coordinates = mcmc.Coordinates(Density(problem))
    chains, taken = timed_result(lambda: mcmc.fresh(coordinates, least_squares(problem), 0))
    _, each = timed_result(lambda: [coordinates(rest.at) for rest in chains.ends])
    yield from _sizes(MCMC, "steps", extent.steps, run, (taken, each), extent, seed, notes)


def _registered(
    problem: Problem, extent: Extent, methods: Mapping[str, Estimator], seed: int
) -> Iterator[_Answer]:
    """Methods that were registered, as they are."""
    for name, estimator in methods.items():
        if name not in (*OTHER_QUESTION, EXACT, MCMC):
            numbers, seconds = _over_seeds(partial(_numbers, problem, estimator), extent, seed)
            yield _Answer(name, "default options", numbers, Timing.of(seconds))


def _sizes(
    method: str,
    unit: str,
    sizes: Sequence[int],
    run: Callable[[int, int], Numbers],
    expected: tuple[float, float],
    extent: Extent,
    seed: int,
    notes: list[str],
) -> Iterator[_Answer]:
    """A method that draws, at growing sizes as far as one call does not take too long.

    Parameters
    ----------
    method, unit : str
        What is drawn, as replicates.
    sizes : sequence of int
    run : callable
        Size and seed to what the method gives.
    expected : (float, float)
        Seconds of the beginning, and of one unit.
    extent, seed, notes
        As in `inference_costs`.
    """
    beginning, each = expected
    for size in sizes:
        if beginning + size * each > extent.longest:
            of = f" of {method}" if method == MCMC else ""
            notes.append(f"{size:,} {unit}{of} would take longer than {extent.longest:g} s.")
            return
        numbers, seconds = _over_seeds(partial(run, size), extent, seed)
        each = max(max(seconds) - beginning, 0.0) / size
        yield _Answer(method, f"{size:,} {unit}", numbers, Timing.of(seconds))


def _over_seeds(
    run: Callable[[int], Numbers], extent: Extent, seed: int
) -> tuple[tuple[Numbers, ...], list[float]]:
    """What a method gives with each seed, and its seconds; no further seed after the longest time."""
    numbers: list[Numbers] = []
    seconds: list[float] = []
    for own in range(seed, seed + extent.seeds):
        if sum(seconds) > extent.longest:
            break
        found, taken = timed_result(partial(run, own))
        numbers.append(found)
        seconds.append(taken)
    return tuple(numbers), seconds
