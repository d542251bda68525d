"""The bootstrap law of the constants: draw experiments anew, fit each, keep the fits."""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ifrfit.errors import UsageError
from ifrfit.inference.bootstrap.batched_solver import BatchedSolver
from ifrfit.inference.bootstrap.kept_replicates import keep_replicates, kept_replicates
from ifrfit.inference.bootstrap.replicate_fits import ReplicateFits, concatenate_fits
from ifrfit.inference.bootstrap.schemes import Scheme, draw_replicates, make_scheme
from ifrfit.inference.bootstrap.searched_solver import SearchedSolver
from ifrfit.inference.bootstrap.sequential_solver import SequentialSolver
from ifrfit.inference.diagnostics.optimum_facts import only_kappa_is_seen
from ifrfit.inference.distributions.draws import kappa_draws
from ifrfit.inference.model.digest import digest
from ifrfit.inference.model.noise import noise_name
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.unfinished_run import KEPT
from ifrfit.inference.workers.worker_processes import interrupts_deferred, worker_processes

Array = NDArray[np.float64]
Progress = Callable[[int, int], None]
Solver = BatchedSolver | SearchedSolver | SequentialSolver
FitLot = Callable[[list[np.random.SeedSequence]], ReplicateFits]

REPLICATES = 1000
_FEWEST, _MOST = 100, 1_000_000
_AT_ONCE = 100_000  # row evaluations of a lot that is solved together
_LOT = 10  # replicates of a lot that are solved one by one


@dataclass(frozen=True)
class BootstrapDraws:
    """Fits of all replicates.

    Attributes
    ----------
    problem : Problem
    scheme : Scheme
    draws : mapping of str to ndarray
        Constants and noises of the replicates that have an answer, by the names of `Distribution`.
    replicates : int
    reasons : mapping of str to int
        Why replicates have no answer, and how many.
    undetermined : mapping of str to mapping
        Entry of theta to how many replicates leave it open although the data do not, by reason.
    certified : int
        Replicates with an answer whose optimum is proven to be global.
    """

    problem: Problem
    scheme: Scheme
    draws: Mapping[str, Array] = field(repr=False)
    replicates: int
    reasons: Mapping[str, int]
    undetermined: Mapping[str, Mapping[str, int]]
    certified: int

    @property
    def failed(self) -> int:
        """Replicates without an answer."""
        return sum(self.reasons.values())

    @property
    def answered(self) -> int:
        """Replicates with an answer."""
        return self.replicates - self.failed

    @cached_property
    def kappas(self) -> Mapping[str, Array]:
        """Draws of kappa, by the names of `Distribution`."""
        return kappa_draws(self.problem, self.draws)


def bootstrap(
    problem: Problem,
    found: LeastSquaresFit,
    *,
    scheme: str | Scheme = "cases",
    replicates: int = REPLICATES,
    seed: int = 0,
    workers: int = 1,
    keep: Path | None = None,
    progress: Progress | None = None,
    at_once: int = _AT_ONCE,
) -> BootstrapDraws:
    """Draw experiments anew and fit each of them.

    Parameters
    ----------
    problem : Problem
    found : LeastSquaresFit
        Its fit.
    scheme : str or Scheme
        cases, residual, wild (Rademacher weights) or wild-mammen; see `ifrfit.inference.bootstrap.schemes`.
    replicates : int
        100 to 1,000,000.
    seed : int
        Each replicate has a child stream of its own: the first 1,000 of 2,000 are those of 1,000.
    workers : int
        Processes, where replicates are fitted one by one. The result does not depend on it.
    keep : Path, optional
        Folder for the replicates of a run that is interrupted, and of one that is done. Those that are there
        already, of this question, are not fitted again.
    progress : callable, optional
        Called with the number of replicates done and wanted.
    at_once : int
        Row evaluations that are solved together. The result does not depend on it beyond rounding.

    Returns
    -------
    BootstrapDraws

    Raises
    ------
    UsageError
        For a scheme or a number that does not exist.

    Notes
    -----
    Each replicate is fitted as the data were: all partitions into sticking and sliding, the least of them
    certified by a bound on all others (1e-9 relative); `certified` counts. Where nothing is certified, all
    are searched together, from the optima of the fit and the best of other places. Where constants are shared
    by some series and not by others, replicates are fitted one by one, as the fit of the data is. Bounds and
    fixed constants hold in every replicate; the means of priors are drawn anew. Known noise stays as given:
    it weighs the rows, and the scatter is that of the data. A scaled or unknown noise is estimated again in
    each replicate, from its own misfit over its own degrees of
    freedom. Wild weights keep the size of every residual: they tell nothing of the noise, which gets no
    draws. Where the data know kappa = mu (1 + e_n) only, e_n is drawn from its default prior.
    """
    check_replicates(replicates)
    if workers < 1:
        raise UsageError(f"--workers {workers}: at least one.")
    chosen = make_scheme(scheme, problem, found) if isinstance(scheme, str) else scheme
    solver = solver_of(problem, found)
    together = not isinstance(solver, SequentialSolver)
    size = max(1, at_once // problem.rows.value.size) if together else _LOT
    seeds = np.random.SeedSequence(seed).spawn(replicates)
    question = digest((problem.digest, seed, chosen))
    parts = [] if keep is None else kept_replicates(keep, question, replicates)
    begin = sum(len(part.reason) for part in parts)
    lots = [seeds[start : start + size] for start in range(begin, replicates, size)]
    task = partial(fit_lot, solver, chosen)
    try:
        for part in each(task, lots, 1 if together else workers):
            parts.append(part)
            if progress is not None:
                progress(sum(len(p.reason) for p in parts), replicates)
    except KeyboardInterrupt:
        if keep is None or not parts:
            raise
        with interrupts_deferred():
            found_so_far = concatenate_fits(parts)
            keep_replicates(keep, found_so_far, question)
        done = f"{len(found_so_far.reason):,} replicates"
        raise KeyboardInterrupt(f"{done} {KEPT.format(keep)}") from None
    if keep is not None:  # until the results are written
        with contextlib.suppress(UsageError):
            keep_replicates(keep, concatenate_fits(parts), question)
    return _collect(problem, chosen, concatenate_fits(parts), seed)


def check_replicates(replicates: int) -> None:
    """Refuse a number of replicates that is none.

    Raises
    ------
    UsageError
        With the range.
    """
    if not _FEWEST <= replicates <= _MOST:
        raise UsageError(f"--replicates {replicates}: choose from {_FEWEST} to {_MOST:,}.")


def solver_of(problem: Problem, found: LeastSquaresFit) -> Solver:
    """The first that has a way to the optimum of this problem's replicates."""
    together = BatchedSolver.of(problem, found) or SearchedSolver.of(problem, found)
    return together or SequentialSolver.of(problem, found)


def fit_lot(solver: Solver, scheme: Scheme, seeds: list[np.random.SeedSequence]) -> ReplicateFits:
    """Draw one replicate a seed, and fit them."""
    return solver.solve(draw_replicates(solver.problem, scheme, seeds))


def each(task: FitLot, lots: list[list[np.random.SeedSequence]], workers: int) -> Iterator[ReplicateFits]:
    """Fit the lots in order, here or in processes of their own."""
    if workers == 1 or len(lots) <= 1:
        yield from map(task, lots)
        return
    with worker_processes(min(workers, len(lots))) as pool:
        yield from pool.map(task, lots)


def _collect(problem: Problem, chosen: Scheme, solved: ReplicateFits, seed: int) -> BootstrapDraws:
    """Keep the draws of the replicates that have an answer, and count the others."""
    answered = np.array([not reason for reason in solved.reason])
    theta = solved.theta[answered]
    if only_kappa_is_seen(problem):
        theta = _spread_e_n(problem, theta, seed)
    draws = dict(zip(problem.parameters.free_names, theta.T[problem.parameters.free], strict=True))
    if chosen.informs_noise:
        noises = zip(problem.noise_groups(), solved.noise[answered].T, strict=True)
        draws |= {noise_name(group): column for group, column in noises}
    is_undetermined: dict[str, Counter[str]] = {}
    for number in np.flatnonzero(~answered):
        for place in np.flatnonzero(solved.undetermined[number]):
            is_undetermined.setdefault(problem.parameters.names[place], Counter())[solved.reason[number]] += 1
    return BootstrapDraws(
        problem,
        chosen,
        draws,
        answered.size,
        Counter(reason for reason in solved.reason if reason),
        is_undetermined,
        int(solved.certified[answered].sum()),
    )


def _spread_e_n(problem: Problem, theta: Array, seed: int) -> Array:
    """Draw e_n from its default prior where the data know kappa only, and give mu what kappa leaves of it."""
    theta = theta.copy()
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(_MOST,)))  # no replicate has that key
    places, entries = problem.parameters.positions, problem.parameters.entries
    pairs = {(int(e), int(m)) for e, m in zip(places["e_n"], places["mu"], strict=True)}
    kappas = {pair: theta[:, pair[1]] * (1.0 + theta[:, pair[0]]) for pair in pairs}
    for place in sorted({e for e, _ in pairs}):
        theta[:, place] = rng.uniform(entries[place].lower, entries[place].prior_upper, theta.shape[0])
    for (e, m), kappa in kappas.items():
        theta[:, m] = kappa / (1.0 + theta[:, e])
    return theta
