"""Weighted rows in three unknowns, the unknowns that are free, and their domain."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ifrfit.inference.model.parameters import Parameter
from ifrfit.inference.model.rows import Index
from ifrfit.inference.optimize.parameter_group import Array, Bool, Constants, ParameterGroup
from ifrfit.inference.optimize.piecewise import LinearRows, PiecewiseProblem

_PRIORS = {"e_n": -1, "mu": -3}  # in `LinearForm.always`; the closure constant has -2


@dataclass(frozen=True)
class LinearForm:
    """A group restated.

    Attributes
    ----------
    problem : PiecewiseProblem
        In the free unknowns.
    to_constants : callable
        The way back to the constants.
    switching, always : ndarray of int
        The group's row behind each row of the problem, of those with two forms and of the rest; -1, -2 and -3
        stand for the prior of e_n, of the closure constant and of mu.
    """

    problem: PiecewiseProblem
    to_constants: Callable[[Array], Constants]
    switching: Index
    always: Index


def _weighted(columns: list[Array | None], mix: Array, weight: Array) -> Array | None:
    """A combination of columns times the weight; None where it is empty."""
    mixed: Array | None = None
    for column, x in zip(columns, mix, strict=True):
        if column is not None and x != 0.0:
            part = column if x == 1.0 else x * column
            mixed = part if mixed is None else mixed + part
    return None if mixed is None else weight * mixed


class Frame:
    """The affine map from free unknowns t to all three: full = base + columns @ t."""

    def __init__(self, *constants: Parameter | None) -> None:
        # fixed constants stay as they are; None stands for an unknown that is no constant
        fixed = [None if c is None else c.fixed for c in constants]
        self.base = np.array([0.0 if value is None else value for value in fixed])
        self.columns = np.eye(3)
        self.free = [value is None for value in fixed]

    def tie(self, unknown: int, constant: float, factor: float) -> None:
        """Make one unknown a function of the first: constant + factor * first."""
        self.free[unknown] = False
        self.base[unknown] = constant + (0.0 if self.free[0] else factor * self.base[0])
        if self.free[0]:
            self.columns[unknown, 0] = factor

    def matrix(self) -> Array:
        """Columns of the free unknowns, (3, q)."""
        return self.columns[:, self.free]


class Domain:
    """Collects constraints: normal @ full <= limit."""

    def __init__(self) -> None:
        self.constraints: list[list[float]] = []
        self.limits: list[float] = []

    def constraint(self, normal: list[float], limit: float) -> None:
        """Add normal @ full <= limit."""
        self.constraints.append(normal)
        self.limits.append(limit)

    def between(self, unknown: int, constant: Parameter) -> None:
        """Add the constant's own bounds, unless it is fixed."""
        if constant.fixed is not None:
            return
        unit = [0.0, 0.0, 0.0]
        unit[unknown] = -1.0
        self.constraint(list(unit), -constant.lower)
        if math.isfinite(constant.upper):
            unit[unknown] = 1.0
            self.constraint(list(unit), constant.upper)


class Forms:
    """Collects the weighted rows of a group in three unknowns, then reduces them to the free ones."""

    def __init__(self, group: ParameterGroup, switching: Bool) -> None:
        self.group = group
        self.switching = switching
        self.all = bool(switching.all())
        self.stick: list[Array | None] = [None, None, None]
        self.slide: list[Array | None] = [None, None, None]
        self.stick0: Array | float = 0.0
        self.slide0: Array | float = 0.0
        self.rest: list[Array] = []  # design rows, weighted
        self.rest_target: list[Array] = []
        self.rest_of: list[Index] = []

    def of(self, values: Array) -> Array:
        """Values of the rows that switch."""
        return values if self.all else values[self.switching]

    def add_normal(self) -> None:
        """Rows of the normal kind, such as e_n and v_n = e_n cos gamma; e_n is the first unknown."""
        at = self.group.rows.of_kind("normal")
        if not at.any():
            return
        self._add(0, self.group.rows.normal_factor(at), np.flatnonzero(at))

    def add_friction(self, unknown: int, factor: float) -> None:
        """LinearRows of mu."""
        at = self.group.rows.of_kind("friction")
        if at.any():
            self._add(unknown, np.full(int(at.sum()), factor), np.flatnonzero(at))

    def add_prior(self, constant: Parameter, unknown: int, factor: float = 1.0) -> None:
        """Add an auxiliary measurement."""
        if constant.prior is not None and constant.fixed is None:
            mean, sd = constant.prior
            code = np.array([_PRIORS.get(constant.name, -2)])
            self._put(unknown, np.array([factor]), np.array([mean]), np.array([1.0 / sd]), code)

    def _add(self, unknown: int, factor: Array, at: Index) -> None:
        self._put(unknown, factor, self.group.rows.value[at], self.group.weight[at], at)

    def _put(self, unknown: int, factor: Array, value: Array, weight: Array, of: Index) -> None:
        design = np.zeros((value.size, 3))
        design[:, unknown] = factor * weight
        self.rest.append(design)
        self.rest_target.append(value * weight)
        self.rest_of.append(of)

    def finish(
        self,
        frame: Frame,
        domain: Domain,
        bound: list[float],
        bound0: float,
        back: Callable[[Array], Constants],
    ) -> LinearForm:
        """Reduce to the free unknowns; the last one is kappa, or what stands for it."""
        matrix, base = frame.matrix(), frame.base
        weight, value = self.of(self.group.weight), self.of(self.group.rows.value)
        tau = self.of(self.group.rows.tau)

        def rows(columns: list[Array | None], constant: Array | float) -> LinearRows:
            target = value - constant
            for column, x in zip(columns, base, strict=True):
                if column is not None and x != 0.0:
                    target = target - x * column
            return LinearRows(tuple(_weighted(columns, m, weight) for m in matrix.T), weight * target)

        stick, slide = rows(self.stick, self.stick0), rows(self.slide, self.slide0)
        rest = np.concatenate([np.zeros((0, 3)), *self.rest])
        rest_target = np.concatenate([np.zeros(0), *self.rest_target])
        always = LinearRows.of(rest @ matrix, rest_target - rest @ base)
        switching = np.flatnonzero(self.switching)
        always_of = np.concatenate([np.zeros(0, dtype=np.intp), *self.rest_of])
        grazing = np.isinf(tau)  # no transition can reach them: they slide whatever the constants
        if grazing.any():
            lost = slide.take(grazing)
            always = LinearRows.of(
                np.concatenate((always.design, lost.design)), np.concatenate((always.target, lost.target))
            )
            stick, slide, tau = stick.take(~grazing), slide.take(~grazing), tau[~grazing]
            always_of, switching = np.concatenate((always_of, switching[grazing])), switching[~grazing]
        constraints = np.array(domain.constraints).reshape(-1, 3)
        limits = np.array(domain.limits) - constraints @ base
        reduced = constraints @ matrix
        real = np.abs(reduced).max(axis=1, initial=0.0) > 0.0
        problem = PiecewiseProblem(
            tau,
            stick,
            slide,
            always,
            matrix[-1],
            float(base[-1]),
            np.array(bound) @ matrix,
            bound0 + float(np.array(bound) @ base),
            reduced[real],
            limits[real],
        )
        return LinearForm(problem, lambda t: back(base + matrix @ t), switching, always_of)
