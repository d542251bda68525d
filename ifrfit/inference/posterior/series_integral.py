"""The integral over the parameters of one series: its rows, what is known of each of these, its nodes."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.model.row_likelihood import RowLaw
from ifrfit.inference.posterior.noise_scale import Scale
from ifrfit.inference.posterior.quadrature_axis import QuadratureAxis
from ifrfit.inference.posterior.sum_of_squares import SumOfSquares
from ifrfit.inference.posterior.transition_roles import (
    ClosureConstantFree,
    RestitutionFree,
    TransitionRole,
    transition_role,
)

Array = NDArray[np.float64]

# Cost of a value of the density, measured: a noise that is integrated out, curved rows under a bilinear law,
# each row under another law, each node of a true angle or row with heavy tails
_PER_NOISE, _CURVED, _PER_ROW, _PER_NODE = 0.5, 1.5, 0.2, 0.05
_LAST_T = 1.0 - 1e-12  # end of the scale of an unbounded transition


@dataclass
class SeriesIntegral:
    """Rows that share one set of parameters, and the nodes at which their density is taken.

    Attributes
    ----------
    squares : SumOfSquares
        Of the rows; where `row_law` is given, no more than what says where to look.
    noise : tuple of NoiseScale or KnownScale, or None
        One a noise group: integrated out, or known beside such; None where the weights hold all sigma.
    e_n, c, mu : FreeParameter, float or None
        A free parameter of this series, a fixed value, or None for one that series share.
    sigma : ndarray, (groups,)
        Likely noise of each group, relative to the weights.
    friction_count : int
        Power of 1/(1 + e_n) in the measure of a separated e_n: how many mu are restated as kappa, eq. (8).
    unit : float
        u of the coordinate t = x/(x + u) of an unbounded transition, eq. (3).
    e_axis, x_axis : QuadratureAxis or None
        Panels of e_n and of the transition's coordinate, where these are integrated over.
    c_order : int
        Order of the rules on either side of the conditional mode of c.
    tail : float
        Fall of the log density beyond which c is not followed.
    c_places : tuple of float
        c at further modes of the noises that are known.
    row_law : RowLaw or None
        Likelihood of the rows where errors are not independent and Gaussian in the values alone.
    c_independent_axes : tuple of int
        Axes of (outer nodes, e_n, transition) on which the density of c does not depend.
    role : TransitionRole
        Which parameter the transition stands for.
    log_norm : float
        Log of the constant factor of the likelihood.
    """

    squares: SumOfSquares
    noise: tuple[Scale, ...] | None
    e_n: FreeParameter | float | None
    c: FreeParameter | float | None
    mu: FreeParameter | float | None
    sigma: Array
    friction_count: int = 0
    unit: float = 1.0
    e_axis: QuadratureAxis | None = None
    x_axis: QuadratureAxis | None = None
    c_order: int = 16
    tail: float = 40.0
    c_places: tuple[float, ...] = ()
    row_law: RowLaw | None = None
    c_independent_axes: tuple[int, ...] = ()
    role: TransitionRole = field(init=False)
    log_norm: float = field(init=False)

    def __post_init__(self) -> None:
        self.role = transition_role(self.squares.coefficients, self.e_n, self.c, self.mu)
        weight = self.squares.weight
        self.log_norm = 0.0 if self.row_law is not None else float(np.log(weight).sum())
        if self.noise is None and self.row_law is None:
            self.log_norm -= 0.5 * weight.size * math.log(2.0 * math.pi)

    @property
    def integrates_e_n(self) -> bool:
        """Whether e_n has panels of its own."""
        return isinstance(self.e_n, FreeParameter) and not isinstance(self.role, RestitutionFree)

    @property
    def integrates_c(self) -> bool:
        """Whether the closure constant is integrated about its conditional mode."""
        return isinstance(self.c, FreeParameter) and not isinstance(self.role, ClosureConstantFree)

    @property
    def cost(self) -> float:
        """Of a value of the density, where 1 is that of rows which are summed up beforehand (some 0.3 us)."""
        noises = 0.0 if self.noise is None else _PER_NOISE * len(self.noise)
        if self.row_law is not None:
            law = self.row_law
            nodes = float(law.latent.order[law.unit].sum()) if law.error_model.integrates else law.value.size
            return 1.0 + noises + _PER_NODE * nodes
        if self.squares.is_quadratic:
            return 1.0 + noises
        if self.squares.law is None:
            return 1.0 + noises + _CURVED
        rows = sum(rows.size for rows in self.squares.curved_rows)
        # marginals of noises take the sums of squares once more
        return 1.0 + noises + _PER_ROW * rows * (1.0 if self.noise is None else 2.0)

    @property
    def axes(self) -> list[QuadratureAxis]:
        """Panels of e_n and of the transition, as far as there are any."""
        return [axis for axis in (self.e_axis, self.x_axis) if axis is not None]

    @property
    def is_unbounded(self) -> bool:
        """Whether b depends on c, so that the transition has no end and t = x/(x + unit) takes its place."""
        return self.squares.coefficients.b1 != 0.0

    def to_x(self, t: Array) -> Array:
        """The transition from its coordinate."""
        return np.asarray(self.unit * t / (1.0 - t)) if self.is_unbounded else t

    def to_t(self, x: Array) -> Array:
        """The coordinate of a transition."""
        if not self.is_unbounded:
            return x
        with np.errstate(invalid="ignore"):
            t = np.where(np.isinf(x), 1.0, x / (x + self.unit))
        return np.asarray(np.minimum(t, _LAST_T))
