"""Long checks of the statistics, for machines that have the time.

``python scripts/calibrate.py [--problems 3000] [--starts 200] [--workers N] [--seed S] [--only NUMBER]``

Certified least squares against many local starts: on random problems no local search may end below what is
certified to be the least. The local searches share nothing with the certified solver: MINPACK's
Levenberg-Marquardt on the model as it stands in the paper, from random starts inside the domain.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from local_search import Array, Local
from random_problems import random_problem
from studies import in_order, study_parser

from ifrfit.inference.model.parameters import Parameter
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.optimum import Optimum, objective_at
from ifrfit.inference.optimize.solve import solve

Solver = Callable[[Problem, Array], Optimum]

TOLERANCE = 1e-9  # of a certificate, relative to max(1, chi2)
MISSED = 1e-6  # a local start this far above the best, relative to max(1, chi2), missed it


@dataclass(frozen=True)
class Comparison:
    """One problem: the claim beside the best of the local starts.

    Attributes
    ----------
    label : str
        Number, closure, rows and road.
    certified : bool
        Whether the optimum was claimed to be global.
    objective, claimed : float
        The sum of squares at the claimed constants, from the model itself, and as claimed.
    bound : float
        Below which nothing lies, as claimed; minus infinity where nothing is claimed.
    best : float
        Of the local starts.
    missed, starts : int
        Local starts that ended above the best known value, of how many.
    """

    label: str
    certified: bool
    objective: float
    claimed: float
    bound: float
    best: float
    missed: int
    starts: int

    @property
    def slack(self) -> float:
        """What the claim itself allows: the tolerance of the certificate."""
        return TOLERANCE * max(1.0, abs(self.best))

    @property
    def worse(self) -> bool:
        """Whether a local start ended below what was certified, or below the proven bound."""
        beaten = self.certified and not self.objective <= self.best + self.slack  # nan is beaten
        return beaten or self.bound > self.best + self.slack

    @property
    def misstated(self) -> bool:
        """Whether the claimed sum of squares is not that of the claimed constants."""
        return not abs(self.claimed - self.objective) <= 1e-8 * max(1.0, abs(self.objective))

    @property
    def lost(self) -> bool:
        """Whether a local start ended below an optimum that was not certified."""
        return not self.certified and not self.objective <= self.best + self.slack


def compare(problem: Problem, n_starts: int, rng: np.random.Generator, solver: Solver = solve) -> Comparison:
    """Hold the solver's answer against the best of random local starts."""
    optimum = solver(problem, problem.noise.sigma)
    local = Local(problem)
    ends = [local.search(local.start(rng)) for _ in range(n_starts)]
    reached = np.array([value for value, _ in ends])
    objective = objective_at(problem, problem.noise.sigma, optimum.theta)
    best = objective_at(problem, problem.noise.sigma, ends[int(reached.argmin())][1])
    least = min(best, objective)
    return Comparison(
        f"{problem.closure.name}, {problem.rows.value.size} rows of {', '.join(problem.rows.names)}, "
        f"{_choices(problem.parameters)}: {optimum.method}",
        optimum.certified,
        objective,
        optimum.objective,
        -math.inf if optimum.gap is None else optimum.objective - optimum.gap,
        best,
        int((reached > least + MISSED * max(1.0, least)).sum()),
        n_starts,
    )


def _choices(constants: Sequence[Parameter]) -> str:
    said = [f"{c.name} fixed" for c in constants if c.fixed is not None]
    said += [f"{c.name} with a prior" for c in constants if c.prior is not None]
    said += [f"{c.name} separate" for c in constants if c.separate]
    return ", ".join(said) or "all free"


def compare_seeded(task: tuple[np.random.SeedSequence, int]) -> Comparison:
    """One random problem from one seed, whatever worker it lands on."""
    seed, n_starts = task
    for_starts = np.random.SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, 1))
    found = compare(problem_of(seed), n_starts, np.random.default_rng(for_starts))
    return replace(found, label=f"problem {seed.spawn_key[-1]}, {found.label}")


def problem_of(seed: np.random.SeedSequence) -> Problem:
    """Draw the random problem of one seed; it does not wear the seed out."""
    return random_problem(
        np.random.default_rng(np.random.SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, 0)))
    )


def compare_many(n_problems: int, n_starts: int, seed: int, workers: int) -> Iterator[Comparison]:
    """Compare on random problems, in order; the same for any number of workers."""
    tasks = [(np.random.SeedSequence(seed, spawn_key=(i,)), n_starts) for i in range(n_problems)]
    return in_order(compare_seeded, tasks, workers)


def summary(found: Sequence[Comparison]) -> tuple[list[str], bool]:
    """Lines to print, and whether everything held."""
    certified = [c for c in found if c.certified]
    worse = [c for c in found if c.worse]
    misstated = [c for c in found if c.misstated]
    lost = [c for c in found if c.lost]
    starts = sum(c.starts for c in certified)
    missed = sum(c.missed for c in certified)
    all_missed = sum(c.missed == c.starts for c in certified)
    lines = [
        f"problems: {len(found)}, certified: {len(certified)}",
        f"certified but worse than a local start, or bound broken: {len(worse)} (must be 0)",
        f"claimed chi2 is not that of the claimed constants: {len(misstated)} (must be 0)",
        f"local starts that missed the certified optimum: {missed} of {starts} "
        f"({100.0 * missed / max(1, starts):.1f} %); problems on which all of them missed: {all_missed}",
        f"not certified: {len(found) - len(certified)}, of these a local start was better on {len(lost)}",
    ]
    for title, cases in (("worse", worse), ("misstated", misstated), ("better local start", lost)):
        for c in cases[:10]:
            lines.append(
                f"  {title}: {c.label}; claimed {c.claimed:.12g}, found there {c.objective:.12g}, "
                f"bound {c.bound:.12g}, best local {c.best:.12g}"
            )
    return lines, not worse and not misstated


def main() -> int:
    """Run the check; exit status 1 if a certificate was broken."""
    parser = study_parser(__doc__, 20230101)
    parser.add_argument("--problems", type=int, default=3000)
    parser.add_argument("--starts", type=int, default=200)
    parser.add_argument("--only", type=int, metavar="NUMBER", help="one problem, by its number")
    options = parser.parse_args()
    if options.only is not None:
        task = (np.random.SeedSequence(options.seed, spawn_key=(options.only,)), options.starts)
        found = [compare_seeded(task)]
        print(found[0])
        return 0 if summary(found)[1] else 1
    found = []
    every = max(1, options.problems // 20)
    for comparison in compare_many(options.problems, options.starts, options.seed, options.workers):
        found.append(comparison)
        if len(found) % every == 0 and sys.stderr.isatty():
            print(f"\r{len(found)} of {options.problems}", end="", file=sys.stderr, flush=True)
    lines, held = summary(found)
    print("\n".join(lines))
    return 0 if held else 1


if __name__ == "__main__":
    sys.exit(main())
