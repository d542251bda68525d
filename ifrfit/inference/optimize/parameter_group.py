"""Rows that share one set of constants, and the part of them that e_n alone decides."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.parameters import Parameter
from ifrfit.inference.model.rows import Rows
from ifrfit.physics.closures import Closure, Coefficients
from ifrfit.physics.observables import OBSERVABLES

Array = NDArray[np.float64]
Bool = NDArray[np.bool_]
Constants = tuple[float, float, float]  # e_n, c, mu


@dataclass(frozen=True)
class Block:
    """Rows that share one set of constants, with the weights (1/sigma) they have in the sum of squares."""

    rows: Rows
    weight: Array
    closure: Closure
    inertia_factor: float
    e_n: Parameter
    c: Parameter
    mu: Parameter

    def of_kind(self, *kinds: str) -> Bool:
        """Rows whose observable is of one of these kinds."""
        wanted = np.array([OBSERVABLES[n].kind in kinds for n in self.rows.names])
        return np.asarray(wanted[self.rows.which])

    def of_scale(self, scale: str) -> Bool:
        """Tangential rows of this scale."""
        wanted = np.array(
            [OBSERVABLES[n].kind == "tangential" and OBSERVABLES[n].scale == scale for n in self.rows.names]
        )
        return np.asarray(wanted[self.rows.which])

    @property
    def coefficients(self) -> Coefficients:
        """(a, b) of the closure."""
        return self.closure.coefficients(self.inertia_factor)

    def linear_parts(self) -> tuple[Array, Array]:
        """Offset and slope in k of the tangential rows (zero for the others)."""
        offset, slope = np.zeros(self.rows.tau.size), np.zeros(self.rows.tau.size)
        for name in self.rows.names:
            linear = OBSERVABLES[name].linear
            if linear is not None:
                at = self.rows.rows_of(name)
                offset[at], slope[at] = linear(self.rows.take(at).incidence, self.inertia_factor)
        return offset, slope


@dataclass(frozen=True)
class BlockOptimum:
    """Best constants (e_n, c, mu) of a block, and what is proven; see `Optimum`."""

    constants: Constants
    objective: float
    gap: float | None
    minima: tuple[tuple[float, Constants], ...]
    extremes: tuple[Constants, ...] = ()
    road: str = "all partitions"


def is_separable(block: Block) -> bool:
    """Whether e_n can be found apart: nothing ties it to the tangential constants but kappa itself."""
    tied = (
        block.of_scale("impulse").any() or block.of_scale("rebound").any() or block.of_kind("friction").any()
    )
    free_mu = block.mu.fixed is None and block.mu.prior is None
    return not tied and free_mu and block.mu.lower == 0.0 and math.isinf(block.mu.upper)


def normal_sums(block: Block) -> tuple[float, float, float]:
    """Sums (w, w y, w y^2) of everything that measures e_n directly: rows of e_n and v_n, and its prior."""
    at = block.of_kind("normal")
    factor = block.rows.normal_factor(at) * block.weight[at]
    value = block.rows.value[at] * block.weight[at]
    if block.e_n.prior is not None:
        mean, sd = block.e_n.prior
        factor, value = np.append(factor, 1.0 / sd), np.append(value, mean / sd)
    return float(factor @ factor), float(factor @ value), float(value @ value)


def normal_part(block: Block) -> tuple[float, float]:
    """Best e_n from the rows and the prior that measure it, and its share of the objective.

    The middle of the domain where nothing measures it.
    """
    at = block.of_kind("normal")
    weight, product, _ = normal_sums(block)
    if weight == 0.0:
        return 0.5 * (block.e_n.lower + block.e_n.upper), 0.0
    e_n = min(max(product / weight, block.e_n.lower), block.e_n.upper)
    residual = (block.rows.value[at] - block.rows.normal_factor(at) * e_n) * block.weight[at]
    objective = float(residual @ residual)
    if block.e_n.prior is not None:
        objective += ((e_n - block.e_n.prior[0]) / block.e_n.prior[1]) ** 2
    return e_n, objective


def without_normal(block: Block, e_n: float) -> Block:
    """The block less what measures e_n, with e_n held."""
    rest = np.flatnonzero(~block.of_kind("normal"))
    held = replace(block.e_n, fixed=e_n, prior=None)
    return replace(block, rows=block.rows.take(rest), weight=block.weight[rest], e_n=held)
