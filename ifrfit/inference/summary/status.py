"""The one rule that turns what is known of a quantity into an estimate with a status.

Whatever the method, a quantity comes as a `Marginal` (best value, standard deviation, intervals, and which
bounds its 95 % region reaches) with a `Domain` and what else is `Known` of it; `estimate_of` decides. The
table of statuses is in `ifrfit.inference.diagnostics.thresholds`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

from ifrfit.inference.diagnostics.thresholds import HALF
from ifrfit.inference.model.parameters import Domain
from ifrfit.inference.result.types import Estimate, Interval

AT_BOUND = 1e-9  # distance from a bound, relative where the bound is over 1, that counts as none
KAPPA = "mu (1 + e_n)"
ON_BOUNDS = "rests on your bounds"
_WIDE = 0.9  # of the domain that the default prior covers: then an upper limit says nothing

Intervals = tuple[Interval, Interval]  # of 68 and 95 %


class OneSided(NamedTuple):
    """Intervals from a bound to the quantile of one tail.

    `sd` is None where the best value lies too far from the bound for one number to stand for them.
    """

    interval68: Interval
    interval95: Interval
    sd: float | None


@dataclass(frozen=True)
class Marginal:
    """What a method says of one quantity.

    Attributes
    ----------
    value : float
        Best value: the optimum, or the median.
    sd : float
        Standard deviation; infinite where the data say nothing.
    central68, central95 : tuple of float
        Central intervals.
    reached : tuple of bool
        Whether the 95 % region reaches the lower, and the upper end of the domain.
    one_sided : callable
        From True for the lower bound, False for the upper one, to `OneSided`.
    mean : float or None
        Where the method has one.
    pieces : int
        Into how many the 95 % region falls.
    """

    value: float
    sd: float
    central68: Interval
    central95: Interval
    reached: tuple[bool, bool]
    one_sided: Callable[[bool], OneSided]
    mean: float | None = None
    pieces: int = 1


@dataclass(frozen=True)
class Known:
    """What else is known of a quantity, whatever the method.

    Attributes
    ----------
    seen : bool
        Whether the data see every direction that the quantity depends on, with more rows than unknowns.
    unique : bool
        Whether no second optimum is as good.
    prior : str
        The reason if a prior of the user narrows it, else nothing.
    plain, loose : str
        Reason to give where it is determined, and where it is not.
    optimum : float or None
        Its value at the optimum, where that is not the best value of the marginal.
    bounds : str
        The reason if bounds of the user confine it, else nothing.
    """

    seen: bool = True
    unique: bool = True
    prior: str = ""
    plain: str = ""
    loose: str = "the data do not fix a value"
    optimum: float | None = None
    bounds: str = ""


def fixed_estimate(value: float, reason: str = "fixed by you") -> Estimate:
    """A quantity that the user fixed."""
    return Estimate(value, None, (value, value), (value, value), "fixed", reason)


def estimate_of(domain: Domain, marginal: Marginal, known: Known) -> Estimate:
    """Status of a free quantity, and the estimate that goes with it.

    determined (or prior, where one of the user narrows it): the data see the quantity, no second optimum is
    as good, its sd is below half of that of the default prior, and the 95 % region reaches no bound.
    one_sided: the region reaches one bound; the value is kept where the rest of these conditions holds and it
    lies near that bound. not_determined: otherwise, also where the only limit is an upper one near the end of
    the default prior. Where bounds of the user leave less than half of the sd that the passive domain has,
    what the data leave open is prior, too.
    """
    certain = known.seen and known.unique
    enough = HALF * domain.prior_sd
    below, above = marginal.reached
    if certain and marginal.sd < enough and not (below or above):
        reason = known.prior or ("several optima describe the data" if marginal.pieces > 1 else known.plain)
        status = "prior" if known.prior else "determined"
        return _estimate(marginal, marginal.sd, (marginal.central68, marginal.central95), status, reason)
    low, high = marginal.central95
    wide = high - low > _WIDE * math.sqrt(12.0) * domain.prior_sd
    if below != above and not (wide and below):
        interval68, interval95, sd = marginal.one_sided(below)
        if certain and sd is not None and sd < enough:
            bound = domain.lower if below else min(domain.upper, domain.prior_upper)
            best = marginal.value if known.optimum is None else known.optimum
            reason = f"{'lies on' if on_bound(best, bound) else 'not told from'} its bound {bound:g}"
            return _estimate(marginal, sd, (interval68, interval95), "one_sided", reason)
        reason = f"only {'an upper' if below else 'a lower'} limit"
        return Estimate(None, None, interval68, interval95, "one_sided", reason, mean=marginal.mean)
    sd = min(marginal.sd, (high - low) / math.sqrt(12.0))
    if known.bounds and domain.passive_sd is not None and sd < HALF * domain.passive_sd:
        # flat between the user's bounds: its middle stands for it where there is no distribution
        value = marginal.value if marginal.mean is not None else 0.5 * (low + high)
        intervals = marginal.central68, marginal.central95
        return Estimate(value, sd, *intervals, "prior", known.bounds, mean=marginal.mean)
    reason = "two optima are equally good" if known.seen and not known.unique else known.loose
    intervals = marginal.central68, marginal.central95
    return Estimate(None, None, *intervals, "not_determined", reason, mean=marginal.mean)


def _estimate(marginal: Marginal, sd: float, intervals: Intervals, status: str, reason: str) -> Estimate:
    return Estimate(marginal.value, sd, *intervals, status, reason, mean=marginal.mean)  # type: ignore[arg-type]


def on_bound(value: float, bound: float) -> bool:
    """Whether a value lies on a bound."""
    return math.isfinite(bound) and abs(value - bound) <= AT_BOUND * max(1.0, abs(bound))


def linear(estimate: Estimate, offset: float, slope: float, domain: Domain, plain: str = "") -> Estimate:
    """The estimate of offset + slope times a quantity, slope >= 0, with the same status.

    Parameters
    ----------
    estimate : Estimate
    offset, slope : float
    domain : Domain
        Of the new quantity, whose bounds its reason names.
    plain : str
        The reason where it is determined.
    """

    def at(value: float) -> float:
        return offset + slope * value if slope else offset

    def ends(interval: Interval) -> Interval:
        return at(interval[0]), at(interval[1])

    reason = estimate.reason
    if estimate.status == "determined":
        reason = reason or plain
    elif estimate.status == "one_sided" and " its bound " in reason:
        bound = domain.lower if math.isclose(ends(estimate.interval95)[0], domain.lower) else domain.upper
        reason = f"{reason.partition(' its bound ')[0]} its bound {bound:g}"
    return replace(
        estimate,
        value=None if estimate.value is None else at(estimate.value),
        stderr=None if estimate.stderr is None else slope * estimate.stderr,
        interval68=ends(estimate.interval68),
        interval95=ends(estimate.interval95),
        reason=reason,
        mean=None if estimate.mean is None else at(estimate.mean),
    )
