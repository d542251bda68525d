"""All replicates of a problem at once, where its rows are linear in the constants once regimes are known.

That holds for series that share all their constants or none, with tangential observables (beta, beta_cm,
tan_psi_after, spins, velocities) beside rows of e_n; with others where
`ifrfit.inference.optimize.linear_families` has a family for them. Each replicate gets the same optimum as
`ifrfit.inference.optimize.least_squares` would give it, with a certificate of its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.bootstrap.replicate_fits import (
    NO_E_N,
    NO_NOISE,
    NO_SLIDING,
    NO_STICKING,
    NOISE_NOT_CONVERGED,
    TOO_FEW,
    ReplicateFits,
)
from ifrfit.inference.bootstrap.schemes import ReplicateData, without_noise
from ifrfit.inference.diagnostics.thresholds import AT_REST
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Index
from ifrfit.inference.optimize.branch_and_bound import BatchOptima, minimise, minimise_batch
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.optimize.linear_families import LinearForm, linear_form
from ifrfit.inference.optimize.parameter_group import ParameterGroup, is_separable, without_normal_rows
from ifrfit.inference.optimize.piecewise import PiecewiseBatch, PiecewiseProblem
from ifrfit.inference.optimize.solve import center_unmeasured, independent_groups

Array = NDArray[np.float64]
Bool = NDArray[np.bool_]

_SMALL = 1e-12  # eigenvalue of a scaled Gram matrix that is nothing but rounding

_ITERATIONS = 100
_CONVERGED = 1e-10


@dataclass(frozen=True)
class BatchedGroup:
    """A parameter group, and where its rows stand in the linear form.

    Attributes
    ----------
    group : ParameterGroup
        With rows of weight 1.
    rows : ndarray of int
        The problem's row behind each row of the group.
    form : LinearForm
        Of the group, less what measures e_n where e_n is found on its own.
    piecewise : PiecewiseProblem
        That of the form, sorted, about `center`: sums of squares there keep their digits.
    center : ndarray
        Optimum of the data as they are.
    switching, always : ndarray of int
        The problem's row behind each row of `piecewise`; -1, -2, -3 for the priors of e_n, c and mu.
    fixed_e_n : float or None
        e_n in the form where it is found on its own.
    rank : int
        Unknowns of the form that the data know.
    """

    group: ParameterGroup
    rows: Index
    form: LinearForm
    piecewise: PiecewiseProblem
    center: Array
    switching: Index
    always: Index
    fixed_e_n: float | None
    rank: int

    @property
    def normal(self) -> Index:
        """The problem's rows that measure e_n, where e_n is found on its own."""
        return self.rows[self.group.rows.of_kind("normal")] if self.fixed_e_n is not None else self.rows[:0]


@dataclass(frozen=True)
class GroupFits:
    """Constants (e_n, c, mu) of each replicate, (m, 3); its minimum; whether it lost all of e_n."""

    constants: Array
    minima: BatchOptima
    without_e_n: Bool


def make_batched_group(group: ParameterGroup, rows: Index, sigma: Array) -> BatchedGroup | None:
    """Restate a parameter group; None where it is not linear once the regimes are known.

    Parameters
    ----------
    group : ParameterGroup
        Its standard uncertainties are not used.
    rows : ndarray of int
        The problem's rows of the group.
    sigma : ndarray
        Of each row of the problem, as the data have it.
    """
    group = replace(group, sigma=np.ones(rows.size))
    if group.rows.of_kind("curved").any():
        return None
    fixed_e_n, rest, own = None, group, rows
    if group.e_n.fixed is None and is_separable(group):
        fixed_e_n = 0.5 * (group.e_n.lower + group.e_n.upper)
        rest, own = without_normal_rows(group, fixed_e_n), rows[~group.rows.of_kind("normal")]
    form = linear_form(rest)
    if form is None:
        return None
    order = np.argsort(form.problem.tau, kind="stable")
    piecewise = form.problem.take(order)
    switching = own[form.switching[order]]
    always = np.where(form.always < 0, form.always, own[np.maximum(form.always, 0)] if own.size else -1)
    weight = _with_prior_columns(1.0 / sigma[None] ** 2)
    data = PiecewiseBatch(piecewise, weight[:, switching], weight[:, always])
    center = minimise(data.member(0)).t
    piecewise = piecewise.about(center)
    rank = int(minimise_batch(replace(data, problem=piecewise)).rank[0])
    return BatchedGroup(group, rows, form, piecewise, center, switching, always, fixed_e_n, rank)


def _with_prior_columns(weight: Array, fill: float | Array = 1.0) -> Array:
    """Columns of the rows, then of the priors of mu, c and e_n: found from the end by -3, -2 and -1."""
    last = np.broadcast_to(fill, (weight.shape[0], 3))
    return np.concatenate((weight, last), axis=1)


def solve_batched_group(batched: BatchedGroup, weight: Array, shift: Array | None, prior: Array) -> GroupFits:
    """Certified optimum of every replicate.

    Parameters
    ----------
    batched : BatchedGroup
    weight : ndarray, (m, n)
        Of every row of the problem in the sum of squares.
    shift : ndarray, (m, n), or None
        Added to the values.
    prior : ndarray, (m, 3)
        Means of the priors of (e_n, c, mu); nan where there is none.
    """
    constants = (batched.group.e_n, batched.group.c, batched.group.mu)
    off = np.column_stack(
        [
            np.zeros(prior.shape[0]) if c.prior is None else (mean - c.prior[0]) / c.prior[1]
            for c, mean in zip(constants, prior.T, strict=True)
        ]
    )[:, ::-1]
    moved = shift is not None or bool(off.any())
    wide = _with_prior_columns(weight)
    shifts = _with_prior_columns(np.zeros_like(weight) if shift is None else shift, off) if moved else None
    many = PiecewiseBatch(
        batched.piecewise,
        wide[:, batched.switching],
        wide[:, batched.always],
        None if shift is None or shifts is None else shifts[:, batched.switching],
        None if shifts is None else shifts[:, batched.always],
    )
    minima = minimise_batch(many)
    found = np.array([batched.form.to_constants(batched.center + u) for u in minima.points]).reshape(-1, 3)
    without = np.zeros(found.shape[0], dtype=bool)
    if batched.fixed_e_n is not None:
        e_n, without = _restitution(batched, weight, shift, prior[:, 0])
        found[:, 2] *= (1.0 + batched.fixed_e_n) / (1.0 + e_n)
        found[:, 0] = e_n
    else:
        found = np.array([center_unmeasured(batched.group, (e, c, mu)) for e, c, mu in found]).reshape(-1, 3)
    low, high = (np.array([getattr(c, end) for c in constants]) for end in ("lower", "upper"))
    return GroupFits(np.clip(found, low, high), minima, without)


def _restitution(
    batched: BatchedGroup, weight: Array, shift: Array | None, mean: Array
) -> tuple[Array, Bool]:
    """e_n from the rows and the prior that measure it; and which replicates have none of them left."""
    group = batched.group
    at = batched.normal
    factor = _restitution_factor(batched)
    value = group.rows.value[group.rows.of_kind("normal")] + (0.0 if shift is None else shift[:, at])
    total, product = weight[:, at] @ factor**2, (weight[:, at] * value) @ factor
    if group.e_n.prior is not None:
        total, product = total + group.e_n.prior[1] ** -2, product + mean * group.e_n.prior[1] ** -2
    known = total > 0.0
    middle = 0.5 * (group.e_n.lower + group.e_n.upper)
    e_n = np.where(known, product / np.where(known, total, 1.0), middle)
    measured = at.size > 0 or group.e_n.prior is not None
    return np.clip(e_n, group.e_n.lower, group.e_n.upper), ~known & measured


def _restitution_factor(batched: BatchedGroup) -> Array:
    """What e_n is multiplied with in each row that measures it."""
    return batched.group.rows.normal_factor(batched.group.rows.of_kind("normal"))


def leverage_of(batched: BatchedGroup, weight: Array, solved: GroupFits) -> Array:
    """How much of its own value each row fits, times how often it occurs, (m, n); 0 in other parts."""
    found = np.zeros(weight.shape)
    p, u = batched.piecewise, solved.minima.points
    if u.shape[1]:
        sticks = p.tau * (u @ p.bound + p.bound0)[:, None] <= (u @ p.kappa + p.kappa0)[:, None]
        design = np.where(sticks[:, :, None], p.stick.design, p.slide.design)
        wide = _with_prior_columns(weight)
        own, rest = wide[:, batched.switching], wide[:, batched.always]
        gram = np.einsum("mn,mni,mnj->mij", own, design, design)
        gram += np.einsum("mn,ni,nj->mij", rest, p.always.design, p.always.design)
        inverse = _inverse(gram)
        found[:, batched.switching] = own * np.einsum("mni,mij,mnj->mn", design, inverse, design)
        data = batched.always >= 0
        a = p.always.design[data]
        found[:, batched.always[data]] = rest[:, data] * np.einsum("ni,mij,nj->mn", a, inverse, a)
    if batched.normal.size:
        share = weight[:, batched.normal] * _restitution_factor(batched) ** 2
        prior = batched.group.e_n.prior
        total = share.sum(axis=1, keepdims=True) + (0.0 if prior is None else prior[1] ** -2)
        found[:, batched.normal] = share / np.where(total > 0.0, total, 1.0)
    return found


def _inverse(gram: Array) -> Array:
    """Inverses of stacked Gram matrices, without the directions that no row knows."""
    diagonal = np.einsum("mii->mi", gram)
    size = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    value, vector = np.linalg.eigh(gram / (size[:, :, None] * size[:, None, :]))
    inverse = np.where(value > _SMALL, 1.0 / np.where(value > _SMALL, value, 1.0), 0.0)
    vector = vector / size[:, :, None]
    return np.asarray(np.einsum("mik,mk,mjk->mij", vector, inverse, vector))


@dataclass(frozen=True)
class BatchedSolver:
    """A problem whose replicates are solved together.

    Attributes
    ----------
    problem : Problem
    parameter_groups : tuple of BatchedGroup
        One for each group of rows that share constants.
    places : tuple of ndarray of int
        Of each group's (e_n, c, mu) in theta; -1 for the constant that the closure has not.
    groups : mapping of str to ndarray of int
        Rows of each noise that is not known.
    """

    problem: Problem
    parameter_groups: tuple[BatchedGroup, ...]
    places: tuple[Index, ...]
    groups: Mapping[str, Index]

    @classmethod
    def of(cls, problem: Problem, found: LeastSquaresFit) -> BatchedSolver | None:
        """Restate a problem; None if its replicates have to be fitted one by one."""
        if not problem.closure.bilinear:
            return None
        groups = independent_groups(problem, found.sigma)
        if groups is None:
            return None
        parameter_groups = []
        for group, rows in groups:
            batched = make_batched_group(group, rows, found.sigma)
            if batched is None:
                return None
            parameter_groups.append(batched)
        at = problem.parameters.positions
        own = problem.closure.constant
        places = tuple(
            np.array([at["e_n"][i], at[own][i] if own else -1, at["mu"][i]])
            for i in range(len(parameter_groups))
        )
        return cls(problem, tuple(parameter_groups), places, problem.noise_groups())

    def solve(self, replicates: ReplicateData) -> ReplicateFits:
        """Fit every replicate of a set; noise that is not known is looked for until it comes to rest."""
        m, p = replicates.size, len(self.problem.parameters.names)
        theta, noise = np.zeros((m, p)), self._first_noise(replicates)
        reason, is_undetermined = np.full(m, "", dtype=object), np.zeros((m, p), dtype=bool)
        certified = np.zeros(m, dtype=bool)
        refused, left = without_noise(self.problem, replicates), np.arange(m)
        for _ in range(_ITERATIONS):
            now = replicates.take(left)
            solved = self._solve_groups(now, noise[left])
            theta[left] = self._theta(solved)
            certified[left] = np.all([batched.minima.certified for batched in solved], axis=0)
            reason[left], is_undetermined[left] = self._undetermined(now, solved)
            if not self.groups:
                break
            new, tells = self._noise(now, noise[left], solved, theta[left])
            change = np.abs(new / noise[left] - 1.0).max(axis=1)
            noise[left], refused[left] = new, refused[left] | ~tells
            if not self.noise_matters:
                left = left[:0]
                break
            not_converged = left[tells & (change > AT_REST)]
            left = left[tells & (change > _CONVERGED)]
            if not left.size:
                break
        else:
            reason[not_converged] = NOISE_NOT_CONVERGED
        reason[refused] = NO_NOISE
        is_undetermined[np.isin(reason, (NO_NOISE, NOISE_NOT_CONVERGED))] = self.problem.parameters.free
        return ReplicateFits(theta, noise, tuple(reason), is_undetermined, certified)

    @cached_property
    def noise_matters(self) -> bool:
        """Whether the optimum depends on the unknown noise: where rows of several, or a prior, meet."""
        code = self.problem.noise_numbers
        for batched in self.parameter_groups:
            for rows, prior in (
                (np.concatenate((batched.switching, batched.always)), bool((batched.always < 0).any())),
                (batched.normal, batched.fixed_e_n is not None and batched.group.e_n.prior is not None),
            ):
                if np.unique(code[rows[rows >= 0]]).size + prior > 1:
                    return True
        return False

    def _first_noise(self, replicates: ReplicateData) -> Array:
        """Where the search for the noise begins, as in least squares: at the scatter of the values."""
        noise = np.ones((replicates.size, len(self.groups)))
        if self.problem.noise.has_unknown:
            value = self.problem.rows.value + (0.0 if replicates.shift is None else replicates.shift)
            counts = np.ones_like(value) if replicates.counts is None else replicates.counts
            for i, rows in enumerate(self.groups.values()):
                own = np.broadcast_to(value, (replicates.size, value.shape[-1]))[:, rows]
                share = counts[..., rows] / np.maximum(counts[..., rows].sum(axis=-1, keepdims=True), 1.0)
                mean = (share * own).sum(axis=1, keepdims=True)
                noise[:, i] = np.maximum(np.sqrt((share * (own - mean) ** 2).sum(axis=1)), 1e-6)
        return noise

    def _sigma(self, noise: Array) -> Array:
        """Noise of each row, (m, n) or (1, n)."""
        base = self.problem.noise.base
        if not self.groups:
            return base[None]
        factor = np.column_stack((noise, np.ones(noise.shape[0])))  # 1 on a sigma that is given
        return np.asarray(base * factor[:, self.problem.noise_numbers])

    def _solve_groups(self, replicates: ReplicateData, noise: Array) -> list[GroupFits]:
        """Solve every group at the given noise."""
        weight = 1.0 / self._sigma(noise) ** 2
        weight = (
            np.broadcast_to(weight, (replicates.size, weight.shape[1]))
            if replicates.counts is None
            else weight * replicates.counts
        )
        index = {c.name: i for i, c in enumerate(self.problem.parameters)}
        own = [index["e_n"], index.get(self.problem.closure.constant or "", -1), index["mu"]]
        prior = np.column_stack((replicates.prior, np.full(replicates.size, np.nan)))[:, own]
        return [
            solve_batched_group(batched, weight, replicates.shift, prior) for batched in self.parameter_groups
        ]

    def _theta(self, solved: Sequence[GroupFits]) -> Array:
        """The constants of all groups in one vector each."""
        theta = np.zeros((solved[0].constants.shape[0], len(self.problem.parameters.names)))
        for places, batched in zip(self.places, solved, strict=True):
            for place, column in zip(places, batched.constants.T, strict=True):
                if place >= 0:
                    theta[:, place] = column
        return theta

    def _noise(
        self, replicates: ReplicateData, noise: Array, solved: Sequence[GroupFits], theta: Array
    ) -> tuple[Array, Bool]:
        """Noise from each group's misfit over its degrees of freedom; and whether the misfit tells it."""
        n = self.problem.rows.value.size
        counts = np.ones((replicates.size, n)) if replicates.counts is None else replicates.counts
        value = self.problem.rows.value + (0.0 if replicates.shift is None else replicates.shift)
        base = self.problem.noise.base
        square = counts * ((value - self.problem.predict(theta)) / base) ** 2
        weight = counts / self._sigma(noise) ** 2
        leverage = np.zeros_like(weight)
        for batched, one in zip(self.parameter_groups, solved, strict=True):
            leverage += leverage_of(batched, weight, one)
        new, tells = noise.copy(), np.ones(replicates.size, dtype=bool)
        stands_for = np.ones(n) if self.problem.noise.counts is None else self.problem.noise.counts
        for i, rows in enumerate(self.groups.values()):
            total, number = square[:, rows].sum(axis=1), counts[:, rows] @ stands_for[rows]
            dof = number - leverage[:, rows].sum(axis=1)
            # a misfit of nothing but rounding says nothing of the noise
            fine = (dof >= 0.5) & (total > self.problem.rounding_variance(rows) * number)
            new[fine, i] = np.sqrt(total[fine] / dof[fine])
            tells &= fine
        return new, tells

    def _undetermined(
        self, replicates: ReplicateData, solved: Sequence[GroupFits]
    ) -> tuple[NDArray[np.object_], Bool]:
        """What replicates leave open that the data do not, and why."""
        reason = np.full(replicates.size, "", dtype=object)
        is_undetermined = np.zeros((replicates.size, len(self.problem.parameters.names)), dtype=bool)
        for batched, places, one in zip(self.parameter_groups, self.places, solved, strict=True):
            for number in np.flatnonzero((one.minima.rank < batched.rank) | one.without_e_n):
                if one.minima.rank[number] < batched.rank:
                    slides, sticks = self._regimes(replicates, batched, one, int(number))
                    why, which = (
                        (NO_SLIDING, places[2:])
                        if not slides
                        else (NO_STICKING, places[1:2])
                        if not sticks and batched.group.coefficients.a1 == 0.0
                        else (TOO_FEW, places if batched.fixed_e_n is None else places[1:])
                    )
                else:
                    why, which = NO_E_N, places[[0, 2]]
                reason[number] = reason[number] or why
                is_undetermined[number, which[which >= 0]] = True
        return reason, is_undetermined & self.problem.parameters.free

    def _regimes(
        self, replicates: ReplicateData, batched: BatchedGroup, solved: GroupFits, number: int
    ) -> tuple[bool, bool]:
        """Whether a row that is left slides, and whether one sticks."""
        n_stick = int(solved.minima.n_stick[number])
        left = (
            np.ones(self.problem.rows.value.size) if replicates.counts is None else replicates.counts[number]
        )
        grazing = batched.always[(batched.always >= 0) & np.isinf(self.problem.rows.tau[batched.always])]
        slides = bool(left[batched.switching[n_stick:]].any() or left[grazing].any())
        return slides, bool(left[batched.switching[:n_stick]].any())
