"""The parts of a comparison: cross-validation, priors, slopes of the psi plane, verdict; frozen values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.result.types import Interval

Array = NDArray[np.float64]
Kind = Literal["stand_in", "refuted", "undecided", "preferred"]

# Log evidence below the best closure's: no impact is left out in earnest there, no prior integrated anew
HOPELESS = 50.0


@dataclass(frozen=True)
class Loo:
    """Leave-one-impact-out cross-validation of one closure.

    Attributes
    ----------
    elpd, se : float
        Sum over impacts of the log density that the others predict for it, and its standard error.
    p_loo : float
        Effective number of constants.
    difference, se_difference : float
        elpd less that of the closure with the largest, at most 0, and the standard error of that, impact by
        impact.
    n_draws : int
    threshold : float
        Of k.
    refitted, doubtful : tuple of str
        Impacts whose k is over the threshold, or whose weights could not be smoothed: left out in an exact
        refit instead; or neither.
    impacts : tuple of str
        Line of the file, or impact_id.
    pointwise, pareto_k : ndarray, (n_impacts,)
        Of each impact, in the order of `impacts`. The k are those before any refit; -inf where the weights
        are bounded, nan where their tail has too few values.
    """

    elpd: float
    se: float
    p_loo: float
    difference: float
    se_difference: float
    n_draws: int
    threshold: float
    refitted: tuple[str, ...]
    doubtful: tuple[str, ...]
    impacts: tuple[str, ...]
    pointwise: Array
    pareto_k: Array

    @property
    def largest_k(self) -> float:
        """Largest Pareto k; nan if any is."""
        return float(self.pareto_k.max())


@dataclass(frozen=True)
class PriorRow:
    """Log evidences under one choice of the priors' widths.

    Attributes
    ----------
    varied : str
        What differs from the stated priors, in words; empty for these themselves.
    log_evidence : mapping
        Closure to its log evidence; None where that prior has no meaning for it, or it no hope.
    """

    varied: str
    log_evidence: Mapping[str, float | None]

    def log_bayes_factor(self, one: str, other: str) -> float | None:
        """Log Bayes factor of `one` over `other`; None where either has no evidence here."""
        first, second = self.log_evidence[one], self.log_evidence[other]
        return None if first is None or second is None else first - second


@dataclass(frozen=True)
class Slope:
    """A slope in the psi plane, or a difference of two.

    Attributes
    ----------
    value : float
    stderr : float or None
        With the regimes held; None where the data do not tell the slope there.
    interval95 : tuple of float
        Of the profile; an end is infinite where it does not close.
    expected : mapping
        Closure to what it allows, (lowest, highest); None for a closure that has no straight line there.
    """

    value: float
    stderr: float | None
    interval95: Interval
    expected: Mapping[str, Interval | None]

    @property
    def determined(self) -> bool:
        """Whether the profile closes on both sides."""
        return bool(np.isfinite(self.interval95).all())

    @property
    def contradicts(self) -> tuple[str, ...]:
        """Closures of which no constant gives a slope inside the interval."""
        low, high = self.interval95
        return tuple(
            name
            for name, ends in self.expected.items()
            if ends is not None and (ends[1] < low - 1e-9 or ends[0] > high + 1e-9)
        )


@dataclass(frozen=True)
class PsiPlane:
    """Slopes of V_t/U_n against U_t/U_n, free in both regimes.

    Attributes
    ----------
    reason : str
        Why there are none; empty where there are.
    n, n_sticking, n_sliding : int
        Rows that can be restated in the plane, and how they divide at the optimum.
    sliding : Slope or None
        Slope of sliding: 1 in FR, -e_t in IFR.
    difference : Slope or None
        Slope of sliding minus slope of sticking: 7/5 in IFR, 1 in IFR-contact, 1 + beta0 in FR.
    left_out : mapping
        Observable to the reason why its rows are not in the plane.
    """

    reason: str = ""
    n: int = 0
    n_sticking: int = 0
    n_sliding: int = 0
    sliding: Slope | None = field(default=None, metadata={"key": "sliding_slope"})
    difference: Slope | None = field(default=None, metadata={"key": "sliding_minus_sticking"})
    left_out: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Verdict:
    """Which closure the data prefer, in one sentence.

    Attributes
    ----------
    kind : {"stand_in", "refuted", "undecided", "preferred"}
    says : str
    tied : tuple of str
        Closures that the data do not tell apart from the best, which is the first; one alone if it is
        preferred; empty on stand-ins.
    next : str or None
        The best of the others.
    log_bayes_factor : float or None
        Of the best over `next`.
    strength : str
        positive, strong or very strong; empty where nothing is preferred.
    over_priors : tuple of float or None
        Smallest and largest value of that factor over the table of priors.
    """

    kind: Kind
    says: str
    tied: tuple[str, ...] = ()
    next: str | None = None
    log_bayes_factor: float | None = None
    strength: str = ""
    over_priors: Interval | None = None
