"""Rows that share one set of constants, and the part of them that e_n alone decides."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.parameters import Parameter
from ifrfit.inference.model.rows import Rows
from ifrfit.physics.closure import Closure
from ifrfit.physics.impulse_laws import Coefficients

Array = NDArray[np.float64]
Bool = NDArray[np.bool_]
Constants = tuple[float, float, float]  # e_n, c, mu


@dataclass(frozen=True)
class ParameterGroup:
    """Rows that share one set of constants, with their standard uncertainties."""

    rows: Rows
    sigma: Array
    closure: Closure
    inertia_factor: float
    e_n: Parameter
    c: Parameter
    mu: Parameter

    @property
    def coefficients(self) -> Coefficients:
        """(a, b) of the closure."""
        return self.closure.coefficients(self.inertia_factor)

    @cached_property
    def weight(self) -> Array:
        """1/sigma, (n,); of parts of the rows it is made anew, which takes less time than memory does."""
        return 1.0 / self.sigma


@dataclass(frozen=True)
class GroupOptimum:
    """Best constants (e_n, c, mu) of a group, and what is proven; see `Optimum`."""

    constants: Constants
    objective: float
    gap: float | None
    minima: tuple[tuple[float, Constants], ...]
    extremes: tuple[Constants, ...] = ()
    method: str = "all partitions"
    is_local: bool = False


def is_separable(group: ParameterGroup) -> bool:
    """Whether e_n can be found apart: nothing ties it to the tangential constants but kappa itself."""
    tied = (
        group.rows.measures_scale("impulse")
        or group.rows.measures_scale("rebound")
        or group.rows.measures("friction")
    )
    free_mu = group.mu.fixed is None and group.mu.prior is None
    return not tied and free_mu and group.mu.lower == 0.0 and math.isinf(group.mu.upper)


def restitution_sums(group: ParameterGroup) -> tuple[float, float, float]:
    """Sums (w, w y, w y^2) of everything that measures e_n directly: rows of e_n and v_n, and its prior."""
    at = group.rows.of_kind("normal")
    factor = group.rows.normal_factor(at) * group.weight[at]
    value = group.rows.value[at] * group.weight[at]
    return direct_sums(group.e_n, factor, value)


def direct_sums(constant: Parameter, factor: Array, value: Array) -> tuple[float, float, float]:
    """Sums (w, w y, w y^2) of what measures a constant directly: weighted rows, and its prior."""
    if constant.prior is not None:
        mean, sd = constant.prior
        factor, value = np.append(factor, 1.0 / sd), np.append(value, mean / sd)
    return float(factor @ factor), float(factor @ value), float(value @ value)


def restitution_optimum(group: ParameterGroup) -> tuple[float, float]:
    """Best e_n from the rows and the prior that measure it, and its share of the objective.

    The value at which it is fixed; the middle of the domain where nothing measures it.
    """
    e_n = group.e_n.fixed
    if e_n is not None and group.e_n.prior is None and not group.rows.measures("normal"):
        return e_n, 0.0
    at = group.rows.of_kind("normal")
    weight, product, _ = restitution_sums(group)
    if e_n is None and weight == 0.0:
        return 0.5 * (group.e_n.lower + group.e_n.upper), 0.0
    if e_n is None:
        e_n = min(max(product / weight, group.e_n.lower), group.e_n.upper)
    residual = (group.rows.value[at] - group.rows.normal_factor(at) * e_n) * group.weight[at]
    objective = float(residual @ residual)
    if group.e_n.prior is not None:
        objective += ((e_n - group.e_n.prior[0]) / group.e_n.prior[1]) ** 2
    return e_n, objective


def without_normal_rows(group: ParameterGroup, e_n: float) -> ParameterGroup:
    """The group less what measures e_n, with e_n held."""
    rest = np.flatnonzero(~group.rows.of_kind("normal"))
    held = replace(group.e_n, fixed=e_n, prior=None)
    return replace(group, rows=group.rows.take(rest), sigma=group.sigma[rest], e_n=held)


def kappa_range(groups: Sequence[ParameterGroup]) -> tuple[float, float]:
    """Domain of kappa at fixed e_n; without an upper bound of mu it ends where every row sticks."""
    first = groups[0]
    unit = 1.0 + (first.e_n.fixed or 0.0)
    low = first.mu.lower * unit
    if math.isfinite(first.mu.upper):
        return low, first.mu.upper * unit
    linear = first.coefficients
    bound = max(linear.b0 + linear.b1 * c for c in (first.c.lower, first.c.upper))
    highest = max(float(g.rows.tau[np.isfinite(g.rows.tau)].max(initial=0.0)) for g in groups)
    return low, max(bound * highest * 1.01, low + 1.0)
