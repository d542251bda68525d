"""The bootstrap against a loop over lmfit fits: the same replicates, time and what is found, in one run.

``python benchmarks/bootstrap.py [--quick] [--out DIR] [--readme]``
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass

# first: it sets the number of threads
from _common import benchmark_parser, cells, machine, publish, ratio_of, rounds_of, verdict

# isort: split
import least_squares as single
import lmfit
import numpy as np
from least_squares import MISSED, SEED, J, residual

from ifrfit.inference.bootstrap import bootstrap
from ifrfit.inference.bootstrap.schemes import Cases, draw_replicates
from ifrfit.inference.model.problem import Problem, make_problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, least_squares

N, REPLICATES = 80, 1000
GOAL_S = 1.0

OURS, OURS_MORE, LMFIT = "bootstrap, cases", "bootstrap, noise unknown", "loop over lmfit, 1 start"


@dataclass(frozen=True)
class Case:
    """Impacts as in the benchmark of least squares, also with unknown noise, and so many replicates."""

    problem: Problem
    unknown: Problem
    cot: np.ndarray
    beta: np.ndarray
    replicates: int

    def fits(self) -> tuple[LeastSquaresFit, LeastSquaresFit]:
        return least_squares(self.problem), least_squares(self.unknown)

    def counts(self) -> np.ndarray:
        """How often each row occurs in each replicate: the draws that `bootstrap` makes."""
        seeds = np.random.SeedSequence(SEED).spawn(self.replicates)
        counts = draw_replicates(self.problem, Cases.of(self.problem), seeds).counts
        assert counts is not None
        return counts

    def chi2(self, e_t: np.ndarray, mu: np.ndarray, counts: np.ndarray) -> np.ndarray:
        return (counts * residual(e_t[:, None], mu[:, None], self.cot, self.beta) ** 2).sum(axis=1)

    def lmfit_loop(self, counts: np.ndarray) -> np.ndarray:
        """(e_t, mu) of each replicate, each fit started at the fit of the data."""
        start = least_squares(self.problem).optimum.theta[1:]
        params = lmfit.Parameters()
        params.add("e_t", value=start[0], min=-1.0, max=-J)
        params.add("mu", value=start[1], min=0.0)
        found = np.empty((len(counts), 2))
        for number, count in enumerate(counts):
            rows = np.repeat(np.arange(N), count.astype(int))
            cot, beta = self.cot[rows], self.beta[rows]

            def weighed(p: lmfit.Parameters, cot: np.ndarray = cot, beta: np.ndarray = beta) -> np.ndarray:
                return residual(p["e_t"].value, p["mu"].value, cot, beta)

            best = lmfit.minimize(weighed, params, method="leastsq", calc_covar=False).params
            found[number] = best["e_t"].value, best["mu"].value
        return found


def make_case(replicates: int) -> Case:
    """80 values of beta over all angles; e_n fixed, e_t and mu sought."""
    case = single.make_case(N)
    known = case.problem
    unknown = make_problem(known.observations, known.closure, J, known.parameters.parameters, "unknown")
    return Case(known, unknown, case.cot, case.beta, replicates)


def measure(case: Case, budget: float) -> tuple[list[dict[str, object]], list[str]]:
    """Time all in turns; hold what lmfit found against ours."""
    fit, fit_unknown = case.fits()
    counts = case.counts()

    def ours() -> np.ndarray:
        draws = bootstrap(case.problem, fit, replicates=case.replicates, seed=SEED).draws
        return np.column_stack((draws["e_t"], draws["mu"]))

    calls: dict[str, Callable[[], object]] = {
        OURS: ours,
        OURS_MORE: lambda: bootstrap(case.unknown, fit_unknown, replicates=case.replicates, seed=SEED),
        LMFIT: lambda: case.lmfit_loop(counts),
    }
    times = rounds_of(calls, budget, least=3, most=11)
    start = time.process_time()
    best = case.chi2(*ours().T, counts)
    cpu = time.process_time() - start
    above = case.chi2(*case.lmfit_loop(counts).T, counts) - best
    missed, worst = int((above > MISSED).sum()), float(above.max())
    rows: list[dict[str, object]] = []
    for name, seconds in times.items():
        remark = f"{missed} of {case.replicates} above the certified optimum" if name == LMFIT else ""
        rows.append(
            {
                "method": name,
                "replicates": case.replicates,
                "time_s": statistics.median(seconds),
                "over_ours": ratio_of(seconds, times[OURS]),
                "remark": remark,
            }
        )
    seconds = statistics.median(times[OURS])
    goals = [
        f"{case.replicates:,} replicates of {N} values in {GOAL_S:g} s: {seconds:.3f} s "
        f"({cpu:.3f} s of the processor), {verdict(seconds <= GOAL_S)}",
        f"no replicate of lmfit lies below ours: least difference of chi2 {above.min():.1e}, largest "
        f"{worst:.1e}, {verdict(float(above.min()) > -1e-9)}",
    ]
    return rows, goals


COLUMNS = {
    "method": "{method}",
    "replicates": "{replicates:,}",
    "time": "{time_s:.3f} s",
    "over the bootstrap": "{over_ours:.1f}",
    "remarks": "{remark}",
}


def main() -> None:
    options = benchmark_parser(__doc__, "200 replicates, fewer rounds").parse_args()
    print(machine())
    rows, goals = measure(make_case(200 if options.quick else REPLICATES), 2.0 if options.quick else 20.0)
    publish(options, "bootstrap", rows, cells(rows, COLUMNS), goals)


if __name__ == "__main__":
    main()
