"""All replicates of a problem in one search, where its optimum is searched and not certified."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.bootstrap.replicate_fits import NO_NOISE, NOISE_NOT_CONVERGED, ReplicateFits
from ifrfit.inference.bootstrap.schemes import ReplicateData, without_noise
from ifrfit.inference.bootstrap.sequential_solver import (
    SequentialSolver,
    drawn_rows,
    loose_entries,
    replicate,
    why_open,
)
from ifrfit.inference.diagnostics.thresholds import AT_REST, RANK
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Index
from ifrfit.inference.optimize.batched_search import BatchedSearch
from ifrfit.inference.optimize.laplace import gaussian_approximation
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.optimize.multistart import starts

Array = NDArray[np.float64]

_OTHERS = 16  # places beside the optima of the fit, the lowest for the data as they are
_TRIED = 3  # of them that a replicate is searched from, those where it is lowest
_ITERATIONS = 50
_LAST_CHANGE = 1e-9


@dataclass(frozen=True)
class ReplicateSearch(BatchedSearch):
    """Searches for the optima of replicates: the last entry of theta is the number of its replicate."""

    replicates: ReplicateData = field(kw_only=True)

    @classmethod
    def of_all(cls, problem: Problem, replicates: ReplicateData) -> ReplicateSearch:
        """Over all free constants and unknown noises."""
        free, (lower, upper) = problem.parameters.free, problem.parameters.bounds()
        groups = tuple(problem.noise_groups().values())
        wider = np.append(free, False), np.append(lower, 0.0), np.append(upper, replicates.size)
        return cls(problem, problem.noise.base, groups, *wider, replicates=replicates)

    def residuals(self, theta: Array) -> Array:
        """Residuals of the replicates, times the root of how often each row occurs."""
        number = theta[:, -1].astype(np.intp)
        shift = 0.0 if self.replicates.shift is None else self.replicates.shift[number] / self.base
        return np.asarray((super().residuals(theta[:, :-1]) + shift) * self._root(number))

    def slopes(self, theta: Array) -> Array:
        """Derivatives of the values, times the same."""
        found = super().slopes(theta[:, :-1]) * self._root(theta[:, -1].astype(np.intp))[..., None]
        return np.concatenate((found, np.zeros((*found.shape[:2], 1))), axis=2)

    def prior_residuals(self, theta: Array) -> Array:
        """Distance from the means that were drawn anew."""
        parameters = self.problem.parameters
        place, _, sd = parameters.priors
        column = [
            i for each in place for i, c in enumerate(parameters) if each in parameters.positions[c.name]
        ]
        mean = self.replicates.prior[theta[:, -1].astype(np.intp)][:, column]
        return np.asarray((theta[:, place] - mean) / sd)

    def _root(self, number: NDArray[np.intp]) -> Array:
        counts = self.replicates.counts
        return np.ones((number.size, 1)) if counts is None else np.sqrt(counts[number])


@dataclass(frozen=True)
class SearchedSolver:
    """A problem whose replicates are searched together.

    Attributes
    ----------
    problem : Problem
    alone : SequentialSolver
        What the data themselves know.
    optima : ndarray, (k, p)
        Of the fit: every replicate is searched from each.
    others : ndarray, (k, p)
        Places of which every replicate is searched from the lowest.
    """

    problem: Problem
    alone: SequentialSolver
    optima: Array = field(repr=False)
    others: Array = field(repr=False)

    @classmethod
    def of(cls, problem: Problem, found: LeastSquaresFit) -> SearchedSolver | None:
        """From the fit to the data; None where its optimum has a proof, or is more than one of constants."""
        plain = problem.error_model.is_plain and problem.offset is None
        if found.optimum.gap is not None or not plain or problem.parameters.differ_by_series:
            return None
        known = {tuple(theta) for _, theta in (*found.optimum.minima, *found.rivals)}
        optima = np.array(sorted({tuple(found.optimum.theta), *known}))
        search = BatchedSearch.of(problem, found.sigma)
        others = search.lowest(starts(problem), np.empty(0), _OTHERS)
        return cls(problem, SequentialSolver.of(problem, found), optima, others)

    def solve(self, replicates: ReplicateData) -> ReplicateFits:
        """Fit every replicate of a set; noise that is not known is looked for until it comes to rest."""
        m, p = replicates.size, self.optima.shape[1]
        search = ReplicateSearch.of_all(self.problem, replicates)
        every = m, self.problem.rows.value.size
        counts = np.ones(every) if replicates.counts is None else replicates.counts
        number = np.zeros((m, len(search.groups)))
        for i, rows in enumerate(search.groups):
            number[:, i] = counts[:, rows].sum(axis=1)
        refused = without_noise(self.problem, replicates)
        theta, left = np.zeros((m, p + 1)), np.flatnonzero(~refused)
        theta[left] = self._best(search, left, number[left])
        noise, dof, change = np.ones(number.shape), number.copy(), np.zeros(m)
        for _ in range(_ITERATIONS if search.groups else 0):
            new, dof[left] = _noise(search, theta[left], dof[left], number[left])
            tells = np.isfinite(new).all(axis=1)
            change[left] = np.abs(new / noise[left] - 1.0).max(axis=1)
            noise[left], refused[left] = new, ~tells
            left = left[tells & (change[left] > _LAST_CHANGE)]
            if not left.size:
                break
            theta[left] = search.polish(search.run(theta[left], dof[left]), dof[left]).theta
        not_at_rest = np.where(change > AT_REST, NOISE_NOT_CONVERGED, "")
        reason = np.where(refused, NO_NOISE, not_at_rest).astype(object)
        is_undetermined = (reason != "")[:, None] & self.problem.parameters.free
        for i in np.flatnonzero(reason == "").tolist():
            drawn, rows = replicate(self.problem, replicates, i), drawn_rows(self.problem, replicates, i)
            sigma = (self.problem.noise.base * np.append(noise[i], 1.0)[self.problem.noise_numbers])[rows]
            local = gaussian_approximation(drawn, sigma, theta[i, :p])
            is_undetermined[i] = self.alone.seen & loose_entries(drawn, local)
            if is_undetermined[i].any():
                reason[i] = why_open(drawn, theta[i, :p])
        return ReplicateFits(theta[:, :p], noise, tuple(reason), is_undetermined, np.zeros(m, dtype=bool))

    def _best(self, search: ReplicateSearch, which: Index, number: Array) -> Array:
        """The lowest optimum of some replicates, with their number in the last entry, (m, p + 1)."""
        known = len(self.optima)
        places = np.concatenate((self.optima, self.others))
        numbered = np.repeat(which.astype(float), len(places))[:, None]
        every = np.concatenate((np.tile(places, (which.size, 1)), numbered), axis=1)
        dof = np.repeat(number, len(places), axis=0)
        value = np.concatenate([search.objective(every[at], dof[at])[0] for at in search.blocks(len(every))])
        value = np.nan_to_num(value, nan=np.inf).reshape(which.size, -1)
        lowest = np.argsort(value[:, known:], axis=1, kind="stable")[:, :_TRIED] + known
        tried = np.concatenate((np.tile(np.arange(known), (which.size, 1)), lowest), axis=1)
        at = (np.arange(which.size)[:, None] * len(places) + tried).ravel()
        found = search.run(every[at], dof[at])
        value = np.nan_to_num(found.value, nan=np.inf).reshape(tried.shape)
        best = found.take(np.arange(which.size) * tried.shape[1] + value.argmin(axis=1))
        return search.polish(best, number).theta


def _noise(search: ReplicateSearch, theta: Array, dof: Array, number: Array) -> tuple[Array, Array]:
    """Noise of each group from its misfit, nan where that does not tell it; and its degrees of freedom."""
    squares = search.squares(search.residuals(theta))
    columns = search.slopes(theta)[:, :, search.free]
    for i, rows in enumerate(search.groups):
        columns[:, rows] *= np.sqrt(dof[:, i] / squares[:, i])[:, None, None]
    parameters, n = search.problem.parameters, columns.shape[1]
    place, _, sd = parameters.priors
    of_priors = np.zeros((place.size, theta.shape[1]))
    of_priors[np.arange(place.size), place] = 1.0 / sd
    of_priors = np.broadcast_to(of_priors[:, search.free], (len(theta), place.size, columns.shape[2]))
    scaled = np.concatenate((columns, of_priors), axis=1) * parameters.prior_sd[parameters.free]
    fitted, singular, _ = np.linalg.svd(scaled, full_matrices=False)
    seen = singular > RANK * singular.max(axis=1, initial=0.0, keepdims=True)
    leverage = ((fitted[:, :n] * seen[:, None, :]) ** 2).sum(axis=2)
    noise, left = np.zeros(number.shape), np.zeros(number.shape)
    for i, rows in enumerate(search.groups):
        left[:, i] = number[:, i] - leverage[:, rows].sum(axis=1)
        # a misfit of nothing but rounding says nothing of the noise
        tells = (left[:, i] >= 0.5) & (squares[:, i] > search.problem.rounding_variance(rows) * rows.size)
        noise[:, i] = np.sqrt(np.where(tells, squares[:, i], np.nan) / np.maximum(left[:, i], 0.5))
    return noise, left
