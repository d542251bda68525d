"""A profile with its intervals, its shape, and the status that follows."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ifrfit.inference.optimize.optimum import Array
from ifrfit.inference.profile.objective import limit
from ifrfit.inference.result.types import Estimate, Interval, Status
from ifrfit.inference.summary.status import AT_BOUND

Shape = Literal["bounded", "one_sided", "flat", "multimodal"]


@dataclass(frozen=True)
class ProfileLikelihood:
    """Least rise of the objective with one quantity held, over the values it may have.

    The shape is a rule on the region R(p), all values whose rise stays below the cut of a central interval of
    level p (`ifrfit.inference.profile.objective.limit`):

    ==========  ====================================================================================
    multimodal  R(68 %) or R(95 %) falls into several pieces; the intervals are their hulls
    flat        R(95 %) is one piece and reaches both ends of the domain
    one_sided   R(95 %) is one piece and reaches one end
    bounded     R(95 %) is one piece inside the domain
    ==========  ====================================================================================

    Attributes
    ----------
    name : str
        As in `Problem.names`; kappa, beta_sticking, transition_angle_deg[SERIES].
    value : float
        The optimum.
    stderr : float or None
        Half the 95 % interval over the half width of a normal (or t) distribution: the sd if the profile were
        a parabola.
    interval68, interval95 : tuple of float
        As reported: central, or from the bound to the quantile of one tail where the status is one_sided.
    central68, central95 : tuple of float
        Hulls of R(68 %) and R(95 %).
    pieces68, pieces : tuple of tuple of float
        Pieces of R(68 %) and R(95 %).
    shape : {"bounded", "one_sided", "flat", "multimodal"}
    status, reason : str
        By the table of statuses.
    has_value : bool
        Whether an estimate has the value; not where the status is not_determined, nor with a mere limit.
    lower, upper : float
        Domain.
    dof : float
        Degrees of freedom of the noise behind the cut; infinite where sigma is known.
    x, rise : ndarray
        The curve over the 99.7 % region, denser where it bends.
    n_evaluations : int
        Places at which everything else was brought to its best.
    stopped : str
        What a budget cut short, in words; empty where the profile closes or reaches the end of its domain.
    """

    name: str
    value: float
    stderr: float | None
    interval68: Interval
    interval95: Interval
    central68: Interval
    central95: Interval
    pieces68: tuple[Interval, ...]
    pieces: tuple[Interval, ...]
    shape: Shape
    status: Status
    reason: str
    has_value: bool
    lower: float
    upper: float
    dof: float
    x: Array
    rise: Array
    n_evaluations: int
    stopped: str = ""

    def __post_init__(self) -> None:
        for name in ("x", "rise"):
            array = np.array(getattr(self, name), dtype=float)
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    def cut(self, level: float) -> float:
        """Rise at the ends of the central interval of this level."""
        return limit(level, self.dof)

    def estimate(self) -> Estimate:
        """The same as an `Estimate`, for results."""
        value, stderr = (self.value, self.stderr) if self.has_value else (None, None)
        return Estimate(value, stderr, self.interval68, self.interval95, self.status, self.reason)

    def mapped(self, name: str, function: Callable[[float], float]) -> ProfileLikelihood:
        """Profile of a monotone function of the quantity; the rise is the same at the same place."""

        def ends(interval: Interval) -> Interval:
            first, second = function(interval[0]), function(interval[1])
            return min(first, second), max(first, second)

        def each(pieces: tuple[Interval, ...]) -> tuple[Interval, ...]:
            return tuple(sorted(ends(piece) for piece in pieces))

        interval68, interval95 = ends(self.interval68), ends(self.interval95)
        ratio = 0.0
        if self.interval95[0] < self.interval95[1] < math.inf:
            ratio = (interval95[1] - interval95[0]) / (self.interval95[1] - self.interval95[0])
        # where the function is level, the least rise counts
        x, rise = np.array([function(place) for place in self.x.tolist()]), self.rise
        order = np.lexsort((rise, x))
        x, rise = x[order], rise[order]
        kept = np.concatenate(([True], np.diff(x) > 0.0))
        lower, upper = ends((self.lower, self.upper))
        return replace(
            self,
            name=name,
            value=function(self.value),
            stderr=None if self.stderr is None else self.stderr * ratio,
            interval68=interval68,
            interval95=interval95,
            central68=ends(self.central68),
            central95=ends(self.central95),
            pieces68=each(self.pieces68),
            pieces=each(self.pieces),
            lower=lower,
            upper=upper,
            x=x[kept],
            rise=rise[kept],
        )


def hull(pieces: tuple[Interval, ...]) -> Interval:
    """From the lowest end to the highest."""
    return min(low for low, _ in pieces), max(high for _, high in pieces)


def closed(interval: Interval, lower: float, upper: float) -> tuple[bool, bool]:
    """Whether the interval ends before the domain does, below and above."""

    def differs(end: float, bound: float) -> bool:
        return math.isinf(bound) or abs(end - bound) > AT_BOUND * max(1.0, abs(bound))

    return differs(interval[0], lower) and not math.isinf(interval[0]), (
        differs(interval[1], upper) and not math.isinf(interval[1])
    )


def shape_of(
    pieces68: tuple[Interval, ...], pieces: tuple[Interval, ...], lower: float, upper: float
) -> Shape:
    """The shape by the rule in `ProfileLikelihood`."""
    if len(pieces68) > 1 or len(pieces) > 1:
        return "multimodal"
    ends = closed(pieces[0], lower, upper)
    if all(ends):
        return "bounded"
    return "one_sided" if any(ends) else "flat"
