"""From an explored curve to a profile: intervals by the cut, status by the rule of all methods."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from ifrfit.inference.distributions.truncated_normal import half_width
from ifrfit.inference.optimize.least_squares import dof_of_functional
from ifrfit.inference.profile.curve import FINE, Interval, Resolution
from ifrfit.inference.profile.objective import Misfit, limit
from ifrfit.inference.profile.quantities import Quantity, profile_curve
from ifrfit.inference.profile.types import ProfileLikelihood, closed, hull, shape_of
from ifrfit.inference.summary.status import Known, Marginal, OneSided, estimate_of

_COVERED = 0.997
_NEAR = 1.5  # one-sided 95 % widths from the bound within which the optimum stands for the interval


def profile_of(
    misfit: Misfit, quantity: Quantity, known: Known, resolution: Resolution = FINE, *, fill: bool = True
) -> ProfileLikelihood:
    """Trace the profile of a quantity, and cut it.

    Parameters
    ----------
    misfit : Misfit
    quantity : Quantity
    known : Known
    resolution : Resolution
    fill : bool
        Whether to add places until the curve can be drawn.
    """
    dof = dof_of_functional(misfit.problem, misfit.fit, quantity.functional)
    curve = profile_curve(misfit, quantity, dof, resolution)
    value = curve.best_place(quantity.of(misfit.fit.optimum.theta))
    two_sided = [limit(level, dof) for level in (0.68, 0.95, *((_COVERED,) if fill else ()))]
    curve.cross([*two_sided, *(limit(level, dof, one_sided=True) for level in (0.68, 0.95))])
    pieces68, pieces = curve.pieces(limit(0.68, dof)), curve.pieces(limit(0.95, dof))
    ends = curve.lower, curve.upper
    marginal = marginal_of_profile(ends, value, dof, lambda rise: hull(curve.pieces(rise)), len(pieces))
    domain = replace(quantity.domain, lower=curve.lower, upper=curve.upper)
    estimate = estimate_of(domain, marginal, known)
    x, rise = curve.window(limit(_COVERED, dof), fill=fill)
    return ProfileLikelihood(
        name=quantity.name,
        value=value if estimate.value is None else estimate.value,
        stderr=estimate.stderr,
        interval68=estimate.interval68,
        interval95=estimate.interval95,
        central68=marginal.central68,
        central95=marginal.central95,
        pieces68=pieces68,
        pieces=pieces,
        shape=shape_of(pieces68, pieces, curve.lower, curve.upper),
        status=estimate.status,
        reason=estimate.reason,
        has_value=estimate.value is not None,
        lower=curve.lower,
        upper=curve.upper,
        dof=dof,
        x=x,
        rise=rise,
        n_evaluations=curve.n_evaluations,
        stopped=curve.stopped,
    )


def marginal_of_profile(
    ends: Interval, value: float, dof: float, below: Callable[[float], Interval], pieces: int = 1
) -> Marginal:
    """A profile read as a marginal: its sd is the one that a parabola of the same width would have.

    Parameters
    ----------
    ends : (float, float)
        Of the domain.
    value : float
        At the optimum.
    dof : float
        Of the noise; infinite where it is known.
    below : callable
        From a rise to the lowest and the highest value that have no more, see `limit`.
    pieces : int
        Into how many the 95 % region falls.
    """
    central68, central95 = below(limit(0.68, dof)), below(limit(0.95, dof))
    closes_below, closes_above = closed(central95, *ends)

    def one_sided(is_below: bool) -> OneSided:
        bound = ends[0] if is_below else ends[1]
        found = [below(limit(level, dof, one_sided=True)) for level in (0.68, 0.95)]
        first, second = ((bound, high) if is_below else (low, bound) for low, high in found)
        reach = abs((second[1] if is_below else second[0]) - value)
        near = abs(bound - value) <= _NEAR * reach and reach > 0.0
        return OneSided(first, second, reach / half_width(0.90, dof) if near else None)

    return Marginal(
        value,
        (central95[1] - central95[0]) / (2.0 * half_width(0.95, dof)),
        central68,
        central95,
        (not closes_below, not closes_above),
        one_sided,
        pieces=pieces,
    )
