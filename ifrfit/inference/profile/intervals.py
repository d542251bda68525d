"""From a trace to a profile: intervals by the cut, status by the table."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ifrfit.inference.diagnostics.thresholds import HALF
from ifrfit.inference.distributions.truncated_normal import half_width
from ifrfit.inference.profile.curve import Trace
from ifrfit.inference.profile.objective import limit
from ifrfit.inference.profile.quantities import Quantity
from ifrfit.inference.profile.types import AT_BOUND, Profile, closed, hull, shape_of
from ifrfit.inference.result.types import Interval, Status

_COVERED = 0.997
_WIDE = 0.9  # of the domain that the default prior covers: then an upper limit says nothing


@dataclass(frozen=True)
class Known:
    """What else is known of a quantity.

    Attributes
    ----------
    seen : bool
        Whether the data see every direction that it leans on.
    unique : bool
        Whether no second optimum is as good.
    leans : str
        The reason if a user's prior narrows it, else nothing.
    plain, loose : str
        Reason to give where it is determined, and where it is not.
    """

    seen: bool = True
    unique: bool = True
    leans: str = ""
    plain: str = ""
    loose: str = "the data do not fix a value"


@dataclass(frozen=True)
class _Verdict:
    status: Status
    reason: str
    stderr: float | None
    interval68: Interval
    interval95: Interval


def judged(
    quantity: Quantity, trace: Trace, value: float, dof: float, known: Known, *, curves: bool = True
) -> Profile:
    """The profile of a quantity from its trace.

    Parameters
    ----------
    quantity : Quantity
    trace : Trace
        Explored, see `ifrfit.inference.profile.quantities.follow`.
    value : float
        The optimum.
    dof : float
        Degrees of freedom behind the cut.
    known : Known
    curves : bool
        Whether to add places until the curve can be drawn.
    """
    pieces68, pieces = trace.pieces(limit(0.68, dof)), trace.pieces(limit(0.95, dof))
    verdict = _verdict(quantity, trace, value, dof, known, pieces68, pieces)
    x, rise = trace.window(limit(_COVERED, dof), fill=curves)
    return Profile(
        name=quantity.name,
        value=value,
        stderr=verdict.stderr,
        interval68=verdict.interval68,
        interval95=verdict.interval95,
        central68=hull(pieces68),
        central95=hull(pieces),
        pieces68=pieces68,
        pieces=pieces,
        shape=shape_of(pieces68, pieces, trace.lower, trace.upper),
        status=verdict.status,
        reason=verdict.reason,
        stated=verdict.stderr is not None,
        lower=trace.lower,
        upper=trace.upper,
        dof=dof,
        x=x,
        rise=rise,
        n_evaluations=trace.n_evaluations,
        stopped=trace.stopped,
    )


def _verdict(
    quantity: Quantity,
    trace: Trace,
    value: float,
    dof: float,
    known: Known,
    pieces68: tuple[Interval, ...],
    pieces: tuple[Interval, ...],
) -> _Verdict:
    prior_sd = quantity.domain.prior_sd
    central = hull(pieces68), hull(pieces)
    low, high = central[1]
    ends = closed(central[1], trace.lower, trace.upper)
    spread = (high - low) / (2.0 * half_width(0.95, dof))
    settled = known.seen and known.unique
    if all(ends) and settled and spread < HALF * prior_sd:
        reason = "several optima describe the data" if len(pieces) > 1 else known.plain
        return _Verdict("prior" if known.leans else "determined", known.leans or reason, spread, *central)
    wide = high - low > _WIDE * math.sqrt(12.0) * prior_sd
    if ends[0] != ends[1] and not (wide and ends[1]):
        return _one_sided(quantity, trace, value, dof, settled, ends[0])
    reason = "two optima are equally good" if known.seen and not known.unique else known.loose
    return _Verdict("not_determined", reason, None, *central)


def _one_sided(
    quantity: Quantity, trace: Trace, value: float, dof: float, settled: bool, from_below: bool
) -> _Verdict:
    """From the bound to the quantile of one tail; the optimum is stated if it lies near that bound."""
    bound = trace.upper if from_below else trace.lower
    found = [hull(trace.pieces(limit(level, dof, one_sided=True))) for level in (0.68, 0.95)]
    ends = [(pair[0], bound) if from_below else (bound, pair[1]) for pair in found]
    reach = abs((ends[1][0] if from_below else ends[1][1]) - value)
    sd = reach / half_width(0.90, dof)
    if settled and abs(bound - value) <= 1.5 * reach and 0.0 < sd < HALF * quantity.domain.prior_sd:
        on_it = abs(value - bound) <= AT_BOUND * max(1.0, abs(bound))
        reason = f"{'lies on' if on_it else 'not told from'} its bound {bound:g}"
        return _Verdict("one_sided", reason, sd, ends[0], ends[1])
    reason = f"only {'a lower' if from_below else 'an upper'} limit"
    return _Verdict("one_sided", reason, None, ends[0], ends[1])
