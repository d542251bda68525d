"""The exact posterior as a distribution: marginals, covariance and draws from the quadrature's densities."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ifrfit.inference.distributions.protocol import LEVELS
from ifrfit.inference.distributions.quantity_names import NamedQuantities
from ifrfit.inference.model.entry_names import quantity_of, split_name
from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.posterior.integral_layout import IntegralLayout
from ifrfit.inference.posterior.joint_grid import JointDensity
from ifrfit.inference.posterior.layout_marginals import marginals_of
from ifrfit.inference.posterior.marginals import Marginal, covariance, whole_error
from ifrfit.inference.posterior.parameter_marginals import transition_marginal
from ifrfit.inference.posterior.sampling import draw

Array = NDArray[np.float64]

_LAST_SHARE = 1e-12  # the transition's scale is not followed beyond 1 less this
RESOLUTION = 0.02  # sd: from a bound to where the density is taken


class PosteriorByMarginals(NamedQuantities):
    """What a posterior says of each quantity by its `Marginal`, whatever the integral behind these."""

    if TYPE_CHECKING:
        marginals: Mapping[str, Marginal]
        tolerance: float
        error_evidence: float

        @property
        def error(self) -> float:
            """Largest error of a result, in posterior standard deviations."""

        @property
        def error_of_moments(self) -> float:
            """That of means and standard deviations."""

        def _transition(self, series: str, p: Array) -> Array: ...

        def _made_marginals(self) -> Mapping[str, Marginal]:
            """The marginals, made anew of what else is held."""

    def __getstate__(self) -> dict[str, object]:
        """Without the marginals, which are functions of functions: a copy makes its own, the same."""
        return {name: held for name, held in self.__dict__.items() if name != "marginals"}

    def __setstate__(self, state: dict[str, object]) -> None:
        """What was held, and the marginals of it."""
        self.__dict__.update(state)
        self.__dict__["marginals"] = self._made_marginals()

    @property
    def names(self) -> tuple[str, ...]:
        """Free entries of theta, kappa, and free noises."""
        return tuple(self.marginals)

    @property
    def resolution(self) -> float:
        """Width, in sd, over which a density is taken."""
        return RESOLUTION

    @property
    def n_draws(self) -> float:
        """There is no end to its draws."""
        return math.inf

    @property
    def converged(self) -> bool:
        """Whether the wanted tolerance was reached."""
        moved = max(self.error_of_moments, self.error_evidence)
        return moved <= self.tolerance and self.error <= self.tolerance

    def mean(self, name: str) -> float:
        """Posterior mean."""
        return self.marginals[name].moments(0)[0]

    def sd(self, name: str) -> float:
        """Posterior standard deviation."""
        return self.marginals[name].moments(0)[1]

    def quantile(self, name: str, p: ArrayLike) -> NDArray[np.float64] | float:
        """Posterior quantiles; p scalar or array, 0 to 1."""
        wanted = np.atleast_1d(np.asarray(p, dtype=float))
        if quantity_of(name) == "transition_tau":
            found = self._transition(split_name(name)[1], wanted)
        elif all(level in LEVELS for level in wanted.tolist()):
            known = self.marginals[name].at_levels(self.tolerance)
            found = known[[LEVELS.index(level) for level in wanted.tolist()]]
        else:
            found = self.marginals[name].quantiles(wanted, self.tolerance)
        return float(found[0]) if np.ndim(p) == 0 else found

    def cdf(self, name: str, value: ArrayLike) -> NDArray[np.float64] | float:
        """Posterior probability below a value."""
        found = self.marginals[name].below(np.atleast_1d(np.asarray(value, dtype=float)))
        return float(found[0]) if np.ndim(value) == 0 else found


@dataclass(frozen=True)
class QuadraturePosterior(PosteriorByMarginals):
    """What the data and the priors say of every constant, with the error that the quadrature reached.

    Attributes
    ----------
    problem : Problem
    log_evidence : float
        Log of the integral of the normalised likelihood times the normalised prior.
    error_evidence : float
        Last change of the log evidence.
    tolerance : float
    aim : float
        The tolerance that the grid was refined for, where another one is stated now.
    layout : IntegralLayout
    density : JointDensity
    marginals : mapping
        Name to `Marginal`: free entries of theta, kappa, and free noises.
    errors : tuple of float
        Largest change of a result, in posterior standard deviations, round by round: of means and standard
        deviations alone where these exceed the tolerance.
    """

    problem: Problem
    log_evidence: float
    error_evidence: float
    tolerance: float
    aim: float
    layout: IntegralLayout = field(repr=False)
    density: JointDensity = field(repr=False)
    marginals: Mapping[str, Marginal] = field(repr=False)
    errors: tuple[float, ...] = field(repr=False)

    @cached_property
    def error(self) -> float:
        """Largest last change of a mean, a standard deviation or a quantile at 2.5, 16, 50, 84 and 97.5 %.

        In posterior standard deviations; the quantiles of a grid that ended early take as long as the grid.
        """
        return self.errors[-1] if self.errors[-1] <= self.aim else whole_error(self.marginals, self.aim)

    @property
    def error_of_moments(self) -> float:
        """That of means and standard deviations, with the quantiles where it is within the tolerance."""
        return self.errors[-1]

    @property
    def is_falling(self) -> bool:
        """Whether the last round halved the error: a single difference may miss what no node sees."""
        return len(self.errors) > 1 and self.errors[-1] <= 0.5 * self.errors[-2]

    def _made_marginals(self) -> Mapping[str, Marginal]:
        return marginals_of(self.layout, self.density)

    def covariance(self, names: Sequence[str]) -> Array:
        """Posterior covariance of free entries of theta, (n, n)."""
        return covariance(self.density, [self.marginals[name] for name in names])

    def _transition(self, series: str, p: Array) -> Array:
        """Quantiles of the tau at which sticking ends in a series."""
        block = self.problem.series.index(series) if len(self.layout.blocks) > 1 else 0
        own = self.layout.integral.series[block]
        c = self.layout.parameters["c", block]
        if own.squares.law is not None or (own.is_unbounded and isinstance(c, FreeParameter)):
            scaled = transition_marginal(self.density, block)
            share = scaled.quantiles(p, self.tolerance)
            return np.asarray(own.unit * share / np.maximum(1.0 - share, _LAST_SHARE))
        b = float(own.squares.b(0.0 if isinstance(c, FreeParameter) else c))
        return np.asarray(self.quantile(self.layout.kappa_names[block], p)) / b

    def draws(self, n: int, rng: np.random.Generator, names: Sequence[str] | None = None) -> dict[str, Array]:
        """Independent draws of constants, kappa and free noises together, from the quadrature itself.

        All of them, or those of some names.
        """
        return draw(self.layout, self.density, self.names if names is None else names, n, rng)
