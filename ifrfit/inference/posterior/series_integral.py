"""The integral over the parameters of one series: its rows, what is known of each of these, its nodes.

The frictional parameter of a series is always integrated as the transition x, the tau at which sticking
ends, because the kinks of the data stand still in it: x b(c) = mu (1 + e_n). Which parameter follows from x,
and with which Jacobian, depends on which ones are known: eq. (1) and (2) of ``docs/theory/posterior.md``.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.model.row_likelihood import RowLaw
from ifrfit.inference.posterior.noise_scale import NoiseScale, Scale
from ifrfit.inference.posterior.quadrature_axis import QuadratureAxis
from ifrfit.inference.posterior.sum_of_squares import SumOfSquares
from ifrfit.physics.impulse_laws import Coefficients

Array = NDArray[np.float64]

_LEAST_MU = 1e-12  # mu below which e_n does not follow from the transition
_LEAST_KAPPA = 1e-9  # kappa below which the closure constant does not follow from the transition
_BEYOND = 0.2  # share of 1 + e_n at the ends of its domain by which it is followed beyond them
_TINY = 1e-300
# Cost of a value of the density, measured: a noise that is integrated out, curved rows under a bilinear law,
# each row under another law, each node of a true angle or row with heavy tails
_PER_NOISE, _CURVED, _PER_ROW, _PER_NODE = 0.5, 1.5, 0.2, 0.05
_LAST_T = 1.0 - 1e-12  # end of the scale of an unbounded transition


def sticking_bound(k: Coefficients, c: Array | float) -> Array | float:
    """b(c): the frictional part of the impulse factor in sticking."""
    return k.b0 + k.b1 * c


@dataclass(frozen=True)
class Values:
    """Parameters of a series at nodes, (m, n_e, n_x), broadcastable: outer nodes, e_n, transition.

    Attributes
    ----------
    e_n, c, mu : ndarray
        Without a meaning where the parameter follows from the transition; c is 0 where it is integrated about
        its conditional mode.
    """

    e_n: Array
    c: Array
    mu: Array


@dataclass(frozen=True)
class TransitionRole(ABC):
    """Which parameter of a series follows from the transition; as it stands, with mu fixed or shared."""

    k: Coefficients

    @property
    def has_axis(self) -> bool:
        """Whether the transition is integrated over."""
        return True

    def kappa_ends(self, known: Values) -> tuple[Array, Array]:
        """Least and largest kappa = mu (1 + e_n) in the domain, (m, n_e, 1)."""
        kappa = known.mu * (1.0 + known.e_n)
        return kappa, kappa

    @abstractmethod
    def solve(self, x: Array, known: Values) -> tuple[Values, Array, Array]:
        """The parameters at transitions, the transitions, and the log of the Jacobian, eq. (2)."""

    def friction(self, values: Values, x: Array, c: Array) -> Array:
        """mu at closure constants (m, n_e, n_x, n_c), broadcastable."""
        return values.mu[..., None]

    def log_prior(self, values: Values, x: Array, c: Array, mu: Array) -> tuple[Array | float, Array | float]:
        """Log prior of mu with its Jacobian: the part that varies with c (4 axes), and the rest (3 axes).

        None of a mu that is known; that of a shared one stands with the shared parameters.
        """
        return 0.0, 0.0

    @abstractmethod
    def complete(self, draws: Mapping[str, Array]) -> dict[str, Array]:
        """Draws of e_n, c, mu and x from those of the ones that are known or integrated."""


@dataclass(frozen=True)
class FrictionFree(TransitionRole):
    """mu is free and follows from the transition: mu = x b(c)/(1 + e_n)."""

    mu: FreeParameter

    def kappa_ends(self, known: Values) -> tuple[Array, Array]:
        """Least and largest kappa, from the domain of mu."""
        return self.mu.lower * (1.0 + known.e_n), self.mu.upper * (1.0 + known.e_n)

    def solve(self, x: Array, known: Values) -> tuple[Values, Array, Array]:
        """Nothing to solve for: the Jacobian depends on c and stands in `log_prior`."""
        return known, x, np.zeros((1, 1, 1))

    def friction(self, values: Values, x: Array, c: Array) -> Array:
        """mu at closure constants."""
        c = c if self.k.b1 else np.zeros((1, 1, 1, 1))
        return np.asarray(x[..., None] * sticking_bound(self.k, c) / (1.0 + values.e_n[..., None]))

    def log_prior(self, values: Values, x: Array, c: Array, mu: Array) -> tuple[Array | float, Array | float]:
        """Log prior of mu, with d mu/dx = b(c)/(1 + e_n)."""
        with np.errstate(divide="ignore"):
            with_c = np.log(np.maximum(sticking_bound(self.k, c if self.k.b1 else 0.0), 0.0))
        rest = -np.log1p(values.e_n)
        if self.k.b1 and self.mu.prior is not None:
            return with_c + self.mu.log_prior(mu), rest
        b = sticking_bound(self.k, c[..., 0])
        return with_c, rest + self.mu.log_prior(np.asarray(x * b / (1.0 + values.e_n)))

    def complete(self, draws: Mapping[str, Array]) -> dict[str, Array]:
        """mu from the transition."""
        mu = draws["x"] * sticking_bound(self.k, draws["c"]) / (1.0 + draws["e_n"])
        return {**draws, "mu": np.asarray(mu)}


@dataclass(frozen=True)
class RestitutionFree(TransitionRole):
    """mu is known and e_n free: e_n = x b(c)/mu - 1."""

    e_n: FreeParameter

    def kappa_ends(self, known: Values) -> tuple[Array, Array]:
        """Least and largest kappa, from the domain of e_n."""
        return known.mu * (1.0 + self.e_n.lower), known.mu * (1.0 + self.e_n.upper)

    def solve(self, x: Array, known: Values) -> tuple[Values, Array, Array]:
        """e_n at transitions, with d e_n/dx = b(c)/mu."""
        with np.errstate(divide="ignore", invalid="ignore"):
            per_x = sticking_bound(self.k, known.c) / np.maximum(known.mu, _LEAST_MU)
            # panels that the domain cuts are followed a little beyond it, where numbers are still tame
            ends = (1.0 - _BEYOND) * (1.0 + self.e_n.lower), (1.0 + _BEYOND) * (1.0 + self.e_n.upper)
            x = np.clip(x, ends[0] / per_x, ends[1] / per_x)
            e_n = np.maximum(x * per_x, _LEAST_MU) - 1.0
            return Values(e_n, known.c, known.mu), x, np.asarray(np.log(per_x + 0.0 * x))

    def complete(self, draws: Mapping[str, Array]) -> dict[str, Array]:
        """e_n from the transition."""
        e_n = draws["x"] * sticking_bound(self.k, draws["c"]) / draws["mu"] - 1.0
        return {**draws, "e_n": np.asarray(e_n)}


@dataclass(frozen=True)
class ClosureConstantFree(TransitionRole):
    """kappa is known or has nodes, and b depends on the closure constant: c = (kappa/x - b0)/b1."""

    c: FreeParameter

    def solve(self, x: Array, known: Values) -> tuple[Values, Array, Array]:
        """c at transitions, with |dc/dx| = kappa/(|b1| x^2)."""
        k, room = self.k, self.c.upper - self.c.lower
        with np.errstate(divide="ignore", invalid="ignore"):
            kappa = np.maximum(known.mu * (1.0 + known.e_n), _LEAST_KAPPA)
            # panels that the domain cuts are followed a little beyond it, where numbers are still tame
            beyond = self.c.upper + room if k.b1 > 0.0 else self.c.lower - room
            x = np.maximum(x, kappa / sticking_bound(k, beyond))
            c = (kappa / x - k.b0) / k.b1
            return Values(known.e_n, c, known.mu), x, np.asarray(np.log(kappa / abs(k.b1) / x**2))

    def complete(self, draws: Mapping[str, Array]) -> dict[str, Array]:
        """c from the transition."""
        c = (draws["mu"] * (1.0 + draws["e_n"]) / draws["x"] - self.k.b0) / self.k.b1
        return {**draws, "c": np.asarray(c)}


@dataclass(frozen=True)
class TransitionKnown(TransitionRole):
    """mu, e_n and b(c) are known, or mu = 0: the transition follows from them, and is not integrated over."""

    @property
    def has_axis(self) -> bool:
        """There is nothing to integrate over."""
        return False

    def solve(self, x: Array, known: Values) -> tuple[Values, Array, Array]:
        """The transition in place of x."""
        at = known.mu * (1.0 + known.e_n) / np.maximum(sticking_bound(self.k, known.c), _TINY)
        return known, np.asarray(at), np.zeros((1, 1, 1))

    def complete(self, draws: Mapping[str, Array]) -> dict[str, Array]:
        """The transition from the parameters."""
        x = draws["mu"] * (1.0 + draws["e_n"]) / np.maximum(sticking_bound(self.k, draws["c"]), _TINY)
        return {**draws, "x": np.asarray(x)}


def transition_role(
    k: Coefficients,
    e_n: FreeParameter | float | None,
    c: FreeParameter | float | None,
    mu: FreeParameter | float | None,
) -> TransitionRole:
    """The role that these parameters leave to the transition.

    Parameters
    ----------
    k : Coefficients
    e_n, c, mu : FreeParameter, float or None
        A free parameter of the series, a fixed value, or None for one that series share.
    """
    if isinstance(mu, FreeParameter):
        return FrictionFree(k, mu)
    if mu != 0.0 and k.b1 != 0.0 and isinstance(c, FreeParameter):
        return ClosureConstantFree(k, c)
    if mu != 0.0 and isinstance(e_n, FreeParameter):
        return RestitutionFree(k, e_n)
    return TransitionKnown(k)


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

    def noise_scale(self, group: int) -> NoiseScale:
        """The unknown noise of a group."""
        own = (self.noise or ())[group]
        assert isinstance(own, NoiseScale)
        return own

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
