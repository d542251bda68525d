"""Rows that share one set of constants, restated so that all replicates are solved together."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.rows import Index
from ifrfit.inference.optimize.branch_and_bound import BatchOptima, minimise, minimise_batch
from ifrfit.inference.optimize.design import LinearForm
from ifrfit.inference.optimize.linear_families import linear_form
from ifrfit.inference.optimize.parameter_group import ParameterGroup, is_separable, without_normal_rows
from ifrfit.inference.optimize.piecewise import PiecewiseBatch, PiecewiseProblem
from ifrfit.inference.optimize.solve import center_free_e_n

Array = NDArray[np.float64]
Bool = NDArray[np.bool_]

_SMALL = 1e-12  # eigenvalue of a scaled Gram matrix that is nothing but rounding


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
        Its weights are not used.
    rows : ndarray of int
        The problem's rows of the group.
    sigma : ndarray
        Of each row of the problem, as the data have it.
    """
    group = replace(group, weight=np.ones(rows.size))
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
    piecewise = replace(
        form.problem,
        tau=form.problem.tau[order],
        stick=form.problem.stick.take(order),
        slide=form.problem.slide.take(order),
    )
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
        found = np.array([center_free_e_n(batched.group, (e, c, mu)) for e, c, mu in found]).reshape(-1, 3)
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
