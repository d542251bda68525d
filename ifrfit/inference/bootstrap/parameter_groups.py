"""Rows that share one set of constants, restated so that all replicates are solved together."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.bootstrap.batched_minima import Minima, Replicated, minimise_all
from ifrfit.inference.model.rows import Index
from ifrfit.inference.optimize.design import LinearForm
from ifrfit.inference.optimize.group_optimum import middle_of_loose
from ifrfit.inference.optimize.linear_families import linear_form
from ifrfit.inference.optimize.parameter_group import Block, is_separable, without_normal
from ifrfit.inference.optimize.piecewise import PiecewiseProblem, about, minimise

Array = NDArray[np.float64]
Bool = NDArray[np.bool_]

_SMALL = 1e-12  # eigenvalue of a scaled Gram matrix that is nothing but rounding


@dataclass(frozen=True)
class Part:
    """A block, and where its rows stand in the linear form.

    Attributes
    ----------
    block : Block
        With rows of weight 1.
    rows : ndarray of int
        The problem's row behind each row of the block.
    form : LinearForm
        Of the block, less what measures e_n where e_n is found apart.
    piecewise : PiecewiseProblem
        That of the form, sorted, about `center`: sums of squares there keep their digits.
    center : ndarray
        Optimum of the data as they are.
    switching, always : ndarray of int
        The problem's row behind each row of `piecewise`; -1, -2, -3 for the priors of e_n, c and mu.
    held : float or None
        e_n in the form where it is found apart.
    rank : int
        Unknowns of the form that the data know.
    """

    block: Block
    rows: Index
    form: LinearForm
    piecewise: PiecewiseProblem
    center: Array
    switching: Index
    always: Index
    held: float | None
    rank: int

    @property
    def normal(self) -> Index:
        """The problem's rows that measure e_n, where e_n is found apart."""
        return self.rows[self.block.of_kind("normal")] if self.held is not None else self.rows[:0]


@dataclass(frozen=True)
class PartSolved:
    """Constants (e_n, c, mu) of each replicate, (m, 3); its minimum; whether it lost all of e_n."""

    constants: Array
    minima: Minima
    without_e_n: Bool


def make_part(block: Block, rows: Index, sigma: Array) -> Part | None:
    """Restate a block; None where it is not linear once the regimes are known.

    Parameters
    ----------
    block : Block
        Its weights are not used.
    rows : ndarray of int
        The problem's rows of the block.
    sigma : ndarray
        Of each row of the problem, as the data have it.
    """
    block = replace(block, weight=np.ones(rows.size))
    if block.of_kind("curved").any():
        return None
    held, rest, own = None, block, rows
    if block.e_n.fixed is None and is_separable(block):
        held = 0.5 * (block.e_n.lower + block.e_n.upper)
        rest, own = without_normal(block, held), rows[~block.of_kind("normal")]
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
    weight = _with_priors(1.0 / sigma[None] ** 2)
    data = Replicated(piecewise, weight[:, switching], weight[:, always])
    center = minimise(data.alone(0)).t
    piecewise = about(piecewise, center)
    rank = int(minimise_all(replace(data, problem=piecewise)).rank[0])
    return Part(block, rows, form, piecewise, center, switching, always, held, rank)


def _with_priors(weight: Array, fill: float | Array = 1.0) -> Array:
    """Columns of the rows, then of the priors of mu, c and e_n: found from the end by -3, -2 and -1."""
    last = np.broadcast_to(fill, (weight.shape[0], 3))
    return np.concatenate((weight, last), axis=1)


def solve_part(part: Part, weight: Array, shift: Array | None, prior: Array) -> PartSolved:
    """Certified optimum of every replicate.

    Parameters
    ----------
    part : Part
    weight : ndarray, (m, n)
        Of every row of the problem in the sum of squares.
    shift : ndarray, (m, n), or None
        Added to the values.
    prior : ndarray, (m, 3)
        Means of the priors of (e_n, c, mu); nan where there is none.
    """
    constants = (part.block.e_n, part.block.c, part.block.mu)
    off = np.column_stack(
        [
            np.zeros(prior.shape[0]) if c.prior is None else (mean - c.prior[0]) / c.prior[1]
            for c, mean in zip(constants, prior.T, strict=True)
        ]
    )[:, ::-1]
    moved = shift is not None or bool(off.any())
    wide = _with_priors(weight)
    shifts = _with_priors(np.zeros_like(weight) if shift is None else shift, off) if moved else None
    many = Replicated(
        part.piecewise,
        wide[:, part.switching],
        wide[:, part.always],
        None if shift is None or shifts is None else shifts[:, part.switching],
        None if shifts is None else shifts[:, part.always],
    )
    minima = minimise_all(many)
    found = np.array([part.form.to_constants(part.center + u) for u in minima.points]).reshape(-1, 3)
    without = np.zeros(found.shape[0], dtype=bool)
    if part.held is not None:
        e_n, without = _normal(part, weight, shift, prior[:, 0])
        found[:, 2] *= (1.0 + part.held) / (1.0 + e_n)
        found[:, 0] = e_n
    else:
        found = np.array([middle_of_loose(part.block, (e, c, mu)) for e, c, mu in found]).reshape(-1, 3)
    low, high = (np.array([getattr(c, end) for c in constants]) for end in ("lower", "upper"))
    return PartSolved(np.clip(found, low, high), minima, without)


def _normal(part: Part, weight: Array, shift: Array | None, mean: Array) -> tuple[Array, Bool]:
    """e_n from the rows and the prior that measure it; and which replicates have none of them left."""
    block = part.block
    at = part.normal
    factor = _normal_factor(part)
    value = block.rows.value[block.of_kind("normal")] + (0.0 if shift is None else shift[:, at])
    total, product = weight[:, at] @ factor**2, (weight[:, at] * value) @ factor
    if block.e_n.prior is not None:
        total, product = total + block.e_n.prior[1] ** -2, product + mean * block.e_n.prior[1] ** -2
    known = total > 0.0
    middle = 0.5 * (block.e_n.lower + block.e_n.upper)
    e_n = np.where(known, product / np.where(known, total, 1.0), middle)
    measured = at.size > 0 or block.e_n.prior is not None
    return np.clip(e_n, block.e_n.lower, block.e_n.upper), ~known & measured


def _normal_factor(part: Part) -> Array:
    """What e_n is multiplied with in each row that measures it."""
    return part.block.rows.normal_factor(part.block.of_kind("normal"))


def leverage_of(part: Part, weight: Array, solved: PartSolved) -> Array:
    """How much of its own value each row fits, times how often it occurs, (m, n); 0 in other parts."""
    found = np.zeros(weight.shape)
    p, u = part.piecewise, solved.minima.points
    if u.shape[1]:
        sticks = p.tau * (u @ p.bound + p.bound0)[:, None] <= (u @ p.kappa + p.kappa0)[:, None]
        design = np.where(sticks[:, :, None], p.stick.design, p.slide.design)
        wide = _with_priors(weight)
        own, rest = wide[:, part.switching], wide[:, part.always]
        gram = np.einsum("mn,mni,mnj->mij", own, design, design)
        gram += np.einsum("mn,ni,nj->mij", rest, p.always.design, p.always.design)
        inverse = _inverse(gram)
        found[:, part.switching] = own * np.einsum("mni,mij,mnj->mn", design, inverse, design)
        data = part.always >= 0
        a = p.always.design[data]
        found[:, part.always[data]] = rest[:, data] * np.einsum("ni,mij,nj->mn", a, inverse, a)
    if part.normal.size:
        share = weight[:, part.normal] * _normal_factor(part) ** 2
        prior = part.block.e_n.prior
        total = share.sum(axis=1, keepdims=True) + (0.0 if prior is None else prior[1] ** -2)
        found[:, part.normal] = share / np.where(total > 0.0, total, 1.0)
    return found


def _inverse(gram: Array) -> Array:
    """Inverses of stacked Gram matrices, without the directions that no row knows."""
    diagonal = np.einsum("mii->mi", gram)
    size = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    value, vector = np.linalg.eigh(gram / (size[:, :, None] * size[:, None, :]))
    inverse = np.where(value > _SMALL, 1.0 / np.where(value > _SMALL, value, 1.0), 0.0)
    vector = vector / size[:, :, None]
    return np.asarray(np.einsum("mik,mk,mjk->mij", vector, inverse, vector))
