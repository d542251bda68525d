"""What the transition stands for in the integral of one series: mu, e_n, the closure constant, or nothing.

The frictional parameter of a series is always integrated as the transition x, the tau at which sticking
ends, because the kinks of the data stand still in it: x b(c) = mu (1 + e_n). Which parameter follows from x,
and with which Jacobian, depends on which ones are known: eq. (1) and (2) of ``docs/theory/posterior.md``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.physics.impulse_laws import Coefficients

Array = NDArray[np.float64]

_LEAST_MU = 1e-12  # mu below which e_n does not follow from the transition
_LEAST_KAPPA = 1e-9  # kappa below which the closure constant does not follow from the transition
_BEYOND = 0.2  # share of 1 + e_n at the ends of its domain by which it is followed beyond them
_TINY = 1e-300


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
