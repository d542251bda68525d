"""All replicates of a problem at once, where its rows are linear in the constants once regimes are known.

That holds for series that share all their constants or none, with tangential observables (beta, beta_cm,
tan_psi_after, spins, velocities) beside rows of e_n; with others where
`ifrfit.inference.optimize.linear_families` has a family for them. Each replicate gets the same optimum as
`ifrfit.inference.optimize.least_squares` would give it, with a certificate of its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.bootstrap.parameter_groups import Part, PartSolved, leverage_of, make_part, solve_part
from ifrfit.inference.bootstrap.replicate_fits import (
    NO_E_N,
    NO_NOISE,
    NO_SLIDING,
    NO_STICKING,
    RESTLESS,
    TOO_FEW,
    Solved,
)
from ifrfit.inference.bootstrap.schemes import Lot
from ifrfit.inference.diagnostics.thresholds import AT_REST
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Index
from ifrfit.inference.optimize.least_squares import LeastSquares, inputs_of, n_taken
from ifrfit.inference.optimize.solve import series_blocks, whole_block

Array = NDArray[np.float64]
Bool = NDArray[np.bool_]

_ITERATIONS = 100
_CONVERGED = 1e-10


@dataclass(frozen=True)
class Together:
    """A problem whose replicates are solved together.

    Attributes
    ----------
    problem : Problem
    parts : tuple of Part
        One a block of rows that share constants.
    places : tuple of ndarray of int
        Of each part's (e_n, c, mu) in theta; -1 for the constant that the closure has not.
    groups : mapping of str to ndarray of int
        Rows of each noise that is not known.
    """

    problem: Problem
    parts: tuple[Part, ...]
    places: tuple[Index, ...]
    groups: Mapping[str, Index]

    @classmethod
    def of(cls, problem: Problem, found: LeastSquares) -> Together | None:
        """Restate a problem; None if its replicates have to be fitted one by one."""
        if not problem.closure.bilinear:
            return None
        whole = len(problem.series) == 1 or not any(c.separate for c in problem.parameters)
        if not whole and not all(c.separate or c.fixed is not None for c in problem.parameters):
            return None
        every = np.arange(problem.rows.value.size)
        series = (
            [every]
            if whole
            else [np.flatnonzero(problem.rows.series == i) for i in range(len(problem.series))]
        )
        blocks = [whole_block(problem, found.sigma)] if whole else series_blocks(problem, found.sigma)
        parts = []
        for block, rows in zip(blocks, series, strict=True):
            part = make_part(block, rows, found.sigma)
            if part is None:
                return None
            parts.append(part)
        at = problem.parameters.positions
        own = problem.closure.constant
        places = tuple(
            np.array([at["e_n"][i], at[own][i] if own else -1, at["mu"][i]]) for i in range(len(parts))
        )
        return cls(problem, tuple(parts), places, problem.noise_groups())

    def solve(self, lot: Lot) -> Solved:
        """Fit every replicate of a lot; noise that is not known is looked for until it comes to rest."""
        m, p = lot.size, len(self.problem.parameters.names)
        theta, noise = np.zeros((m, p)), self._first_noise(lot)
        reason, is_open = np.full(m, "", dtype=object), np.zeros((m, p), dtype=bool)
        certified = np.zeros(m, dtype=bool)
        refused, left = self._refused(lot), np.arange(m)
        for _ in range(_ITERATIONS):
            now = lot.take(left)
            solved = self._solve_parts(now, noise[left])
            theta[left] = self._theta(solved)
            certified[left] = np.all([part.minima.certified for part in solved], axis=0)
            reason[left], is_open[left] = self._lost(now, solved)
            if not self.groups:
                break
            new, tells = self._noise(now, noise[left], solved, theta[left])
            change = np.abs(new / noise[left] - 1.0).max(axis=1)
            noise[left], refused[left] = new, refused[left] | ~tells
            if not self.weighs:
                left = left[:0]
                break
            restless = left[tells & (change > AT_REST)]
            left = left[tells & (change > _CONVERGED)]
            if not left.size:
                break
        else:
            reason[restless] = RESTLESS
        reason[refused] = NO_NOISE
        is_open[np.isin(reason, (NO_NOISE, RESTLESS))] = self.problem.parameters.free
        return Solved(theta, noise, tuple(reason), is_open, certified)

    @cached_property
    def weighs(self) -> bool:
        """Whether the optimum depends on the unknown noise: where rows of several, or a prior, meet."""
        code = _codes(self.groups, self.problem.rows.value.size)
        for part in self.parts:
            for rows, prior in (
                (np.concatenate((part.switching, part.always)), bool((part.always < 0).any())),
                (part.normal, part.held is not None and part.block.e_n.prior is not None),
            ):
                if np.unique(code[rows[rows >= 0]]).size + prior > 1:
                    return True
        return False

    def _first_noise(self, lot: Lot) -> Array:
        """Where the search for the noise begins, as in least squares: at the scatter of the values."""
        noise = np.ones((lot.size, len(self.groups)))
        if self.problem.noise.is_unknown:
            value = self.problem.rows.value + (0.0 if lot.shift is None else lot.shift)
            counts = np.ones_like(value) if lot.counts is None else lot.counts
            for i, rows in enumerate(self.groups.values()):
                own = np.broadcast_to(value, (lot.size, value.shape[-1]))[:, rows]
                share = counts[..., rows] / np.maximum(counts[..., rows].sum(axis=-1, keepdims=True), 1.0)
                mean = (share * own).sum(axis=1, keepdims=True)
                noise[:, i] = np.maximum(np.sqrt((share * (own - mean) ** 2).sum(axis=1)), 1e-6)
        return noise

    def _sigma(self, noise: Array) -> Array:
        """Noise of each row, (m, n) or (1, n)."""
        base = self.problem.noise.base
        if not self.groups:
            return base[None]
        return np.asarray(base * noise[:, _codes(self.groups, base.size)])

    def _solve_parts(self, lot: Lot, noise: Array) -> list[PartSolved]:
        """Solve every part at the given noise."""
        weight = 1.0 / self._sigma(noise) ** 2
        weight = (
            np.broadcast_to(weight, (lot.size, weight.shape[1]))
            if lot.counts is None
            else weight * lot.counts
        )
        index = {c.name: i for i, c in enumerate(self.problem.parameters)}
        own = [index["e_n"], index.get(self.problem.closure.constant or "", -1), index["mu"]]
        prior = np.column_stack((lot.prior, np.full(lot.size, np.nan)))[:, own]
        return [solve_part(part, weight, lot.shift, prior) for part in self.parts]

    def _theta(self, solved: Sequence[PartSolved]) -> Array:
        """The constants of all parts in one vector each."""
        theta = np.zeros((solved[0].constants.shape[0], len(self.problem.parameters.names)))
        for places, part in zip(self.places, solved, strict=True):
            for place, column in zip(places, part.constants.T, strict=True):
                if place >= 0:
                    theta[:, place] = column
        return theta

    def _noise(
        self, lot: Lot, noise: Array, solved: Sequence[PartSolved], theta: Array
    ) -> tuple[Array, Bool]:
        """Noise from each group's misfit over its degrees of freedom; and whether the misfit tells it."""
        n = self.problem.rows.value.size
        counts = np.ones((lot.size, n)) if lot.counts is None else lot.counts
        value = self.problem.rows.value + (0.0 if lot.shift is None else lot.shift)
        base = self.problem.noise.base
        square = counts * ((value - self.problem.predict(theta)) / base) ** 2
        weight = counts / self._sigma(noise) ** 2
        leverage = np.zeros_like(weight)
        for part, one in zip(self.parts, solved, strict=True):
            leverage += leverage_of(part, weight, one)
        new, tells = noise.copy(), np.ones(lot.size, dtype=bool)
        for i, rows in enumerate(self.groups.values()):
            total, number = square[:, rows].sum(axis=1), counts[:, rows].sum(axis=1)
            dof = number - leverage[:, rows].sum(axis=1)
            # a misfit of nothing but rounding says nothing of the noise
            size = float(np.abs(self.problem.rows.value[rows] / base[rows]).max()) + 1.0
            fine = (dof >= 0.5) & (total > (1e-13 * size) ** 2 * number)
            new[fine, i] = np.sqrt(total[fine] / dof[fine])
            tells &= fine
        return new, tells

    def _refused(self, lot: Lot) -> Bool:
        """Which replicates have a noise that their rows cannot tell, as least squares would refuse them."""
        refused = np.zeros(lot.size, dtype=bool)
        if lot.counts is None:
            return refused
        for rows in self.groups.values():
            inputs = inputs_of(self.problem, rows)
            points = _different(inputs, lot.counts[:, rows])
            few = points <= n_taken(self.problem, rows)
            if few.any():
                values = np.column_stack((inputs, self.problem.rows.value[rows]))
                refused |= few & (_different(values, lot.counts[:, rows]) <= points)
        return refused

    def _lost(self, lot: Lot, solved: Sequence[PartSolved]) -> tuple[NDArray[np.object_], Bool]:
        """What replicates leave open that the data do not, and why."""
        reason = np.full(lot.size, "", dtype=object)
        is_open = np.zeros((lot.size, len(self.problem.parameters.names)), dtype=bool)
        for part, places, one in zip(self.parts, self.places, solved, strict=True):
            for number in np.flatnonzero((one.minima.rank < part.rank) | one.without_e_n):
                if one.minima.rank[number] < part.rank:
                    slides, sticks = self._regimes(lot, part, one, int(number))
                    why, which = (
                        (NO_SLIDING, places[2:])
                        if not slides
                        else (NO_STICKING, places[1:2])
                        if not sticks and part.block.coefficients.a1 == 0.0
                        else (TOO_FEW, places if part.held is None else places[1:])
                    )
                else:
                    why, which = NO_E_N, places[[0, 2]]
                reason[number] = reason[number] or why
                is_open[number, which[which >= 0]] = True
        return reason, is_open & self.problem.parameters.free

    def _regimes(self, lot: Lot, part: Part, solved: PartSolved, number: int) -> tuple[bool, bool]:
        """Whether a row that is left slides, and whether one sticks."""
        n_stick = int(solved.minima.n_stick[number])
        left = np.ones(self.problem.rows.value.size) if lot.counts is None else lot.counts[number]
        grazing = part.always[(part.always >= 0) & np.isinf(self.problem.rows.tau[part.always])]
        slides = bool(left[part.switching[n_stick:]].any() or left[grazing].any())
        return slides, bool(left[part.switching[:n_stick]].any())


def _codes(groups: Mapping[str, Index], n: int) -> Index:
    """Number of the group of each row."""
    code = np.zeros(n, dtype=np.intp)
    for i, rows in enumerate(groups.values()):
        code[rows] = i
    return code


def _different(columns: Array, counts: Array) -> Index:
    """How many different rows there are among those that occur, in each replicate."""
    _, code = np.unique(columns, axis=0, return_inverse=True)
    code = code.reshape(-1)
    order = np.argsort(code, kind="stable")
    starts = np.flatnonzero(np.diff(code[order], prepend=-1))
    return np.asarray((np.add.reduceat(counts[:, order], starts, axis=1) > 0.0).sum(axis=1))
