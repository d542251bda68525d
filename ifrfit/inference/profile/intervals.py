"""From an explored curve to a profile: intervals by the cut, status by the rule of all methods."""

from __future__ import annotations

from dataclasses import replace

from ifrfit.inference.distributions.truncated_normal import half_width
from ifrfit.inference.optimize.least_squares import dof_of_functional
from ifrfit.inference.profile.curve import FINE, ProfileCurve, Resolution
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
    marginal = _marginal(curve, value, dof, hull(pieces68), hull(pieces), len(pieces))
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


def _marginal(
    curve: ProfileCurve,
    value: float,
    dof: float,
    central68: tuple[float, float],
    central95: tuple[float, float],
    pieces: int,
) -> Marginal:
    """The profile read as a marginal: its sd is the one that a parabola of the same width would have."""
    closes_below, closes_above = closed(central95, curve.lower, curve.upper)

    def one_sided(below: bool) -> OneSided:
        bound = curve.lower if below else curve.upper
        found = [hull(curve.pieces(limit(level, dof, one_sided=True))) for level in (0.68, 0.95)]
        first, second = ((bound, high) if below else (low, bound) for low, high in found)
        reach = abs((second[1] if below else second[0]) - value)
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
