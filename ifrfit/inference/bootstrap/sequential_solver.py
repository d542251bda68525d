"""Replicates fitted one after the other by the certified solver, where they cannot be solved together."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ifrfit.errors import DataError
from ifrfit.inference.bootstrap.replicate_fits import (
    NO_NOISE,
    NO_SLIDING,
    NO_STICKING,
    NOISE_NOT_CONVERGED,
    TOO_FEW,
    ReplicateFits,
    concatenate_fits,
)
from ifrfit.inference.bootstrap.schemes import ReplicateData
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Index
from ifrfit.inference.optimize.laplace import GaussianApproximation
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, least_squares

Array = NDArray[np.float64]
Bool = NDArray[np.bool_]

_LOADED = 1e-6  # share of the prior sd from which on a constant takes part in a loose combination


@dataclass(frozen=True)
class SequentialSolver:
    """A problem whose replicates are fitted one by one.

    Attributes
    ----------
    problem : Problem
    seen : ndarray of bool, (p,)
        Entries of theta that the data themselves know, every one of them.
    """

    problem: Problem
    seen: Bool

    @classmethod
    def of(cls, problem: Problem, found: LeastSquaresFit) -> SequentialSolver:
        """From the fit to the data as they are."""
        return cls(problem, problem.parameters.free & ~loose_entries(problem, found.gaussian))

    def solve(self, replicates: ReplicateData) -> ReplicateFits:
        """Fit every replicate, one by one."""
        return concatenate_fits([self._fit(replicates, number) for number in range(replicates.size)])

    def _fit(self, replicates: ReplicateData, number: int) -> ReplicateFits:
        groups, base = self.problem.noise_groups(), self.problem.noise.base
        rows = drawn_rows(self.problem, replicates, number)
        drawn = replicate(self.problem, replicates, number)
        noise = np.ones(len(groups))
        try:
            found = least_squares(drawn)
            sigma = np.full(base.size, np.nan)
            sigma[rows] = found.sigma
            for i, own in enumerate(groups.values()):
                own = own[np.isfinite(sigma[own])]
                if not own.size:
                    raise DataError(NO_NOISE)
                noise[i] = sigma[own[0]] / base[own[0]]
        except DataError:
            theta, nothing = np.zeros((1, self.seen.size)), np.zeros(1, dtype=bool)
            return ReplicateFits(theta, noise[None], (NO_NOISE,), self.problem.parameters.free[None], nothing)
        is_undetermined = self.seen & loose_entries(drawn, found.gaussian)
        why = (
            NOISE_NOT_CONVERGED
            if not found.converged
            else why_open(drawn, found.optimum.theta)
            if is_undetermined.any()
            else ""
        )
        certified = np.array([found.optimum.certified])
        return ReplicateFits(found.optimum.theta[None], noise[None], (why,), is_undetermined[None], certified)


def drawn_rows(problem: Problem, replicates: ReplicateData, number: int) -> Index:
    """The problem's row behind each row of a replicate."""
    every = np.arange(problem.rows.value.size)
    return every if replicates.counts is None else np.repeat(every, replicates.counts[number].astype(np.intp))


def replicate(problem: Problem, replicates: ReplicateData, number: int) -> Problem:
    """One replicate as a problem of its own."""
    parameters = (
        c if c.prior is None else replace(c, prior=(float(mean), c.prior[1]))
        for c, mean in zip(problem.parameters, replicates.prior[number], strict=True)
    )
    problem = problem.with_parameters(parameters)
    if replicates.shift is not None:
        problem = replace(
            problem, rows=replace(problem.rows, value=problem.rows.value + replicates.shift[number])
        )
    return (
        problem if replicates.counts is None else problem.with_rows(drawn_rows(problem, replicates, number))
    )


def loose_entries(problem: Problem, local: GaussianApproximation) -> Bool:
    """Entries of theta that take part in a direction that the rows do not see."""
    share = np.abs(local.to_theta @ local.vectors[:, ~local.seen])
    return np.asarray((share > _LOADED * problem.parameters.prior_sd[:, None]).any(axis=1))


def why_open(drawn: Problem, theta: Array) -> str:
    """Why a replicate leaves a constant open."""
    oblique = drawn.rows.is_oblique
    _, sticks = drawn.impulse(*drawn.per_row(theta))
    if oblique.any() and sticks[oblique].all():
        return NO_SLIDING
    if (
        oblique.any()
        and not sticks[oblique].any()
        and drawn.closure.bilinear
        and drawn.closure.coefficients(drawn.inertia_factor).a1 == 0.0
    ):
        return NO_STICKING
    return TOO_FEW
