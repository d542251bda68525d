"""What a transition within an interval costs at least: a proof from the sums alone.

A transition in interval j leaves the impacts below it sticking and those above it sliding. Their misfit is a
quadratic in c and kappa, which has a least value over all constants whose transition kappa/b lies within
tau_lo and tau_hi. The impacts of the interval itself have an impulse factor that differs from that of
sticking by b (1 - tau_lo/tau_hi) at most, where b is the largest difference between sticking and sliding that
the closure's domain allows. With e = b (1 - tau_lo/tau_hi) sqrt(W_j) and W_j the sum of w s^2 there, the
triangle inequality and (sqrt(q) - e)^2 >= (1 - t) q - e^2 (1 - t)/t give, for every t between 0 and 1,

    Q >= min (Q_stick(below) + Q_slide(above) + (1 - t) Q_stick(j)) - e^2 (1 - t)/t

with one and the same c for all (docs/theory/sufficient-statistics.md, eq. 3).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.optimize.piecewise_quadratic import FLAT
from ifrfit.inference.optimize.transition_cells import CC, CK, KK, SIZE, TransitionCells, quadratic_matrix
from ifrfit.inference.sufficient_statistics.moments import (
    S_1,
    S_X,
    S_XX,
    S_Z,
    S_ZX,
    S_ZZ,
    N,
    about_zero,
)
from ifrfit.inference.sufficient_statistics.tau_intervals import Intervals
from ifrfit.physics.impulse_laws import Coefficients

Array = NDArray[np.float64]

_ROUNDING = 1e-12  # relative, of what sums cancel to
_CANCELLED = 1e-15  # of sums, by which their difference may be wrong


def least_misfit(
    sums: Array, intervals: Intervals, law: Coefficients, domain: tuple[float, float], spread: float = 1.0
) -> Array:
    """Lower bound of the misfit of one group's impacts with the transition in each interval, (bins,).

    Parameters
    ----------
    sums : ndarray, (bins, 7)
        Of all impacts of the group.
    intervals : Intervals
    law : Coefficients
    domain : (float, float)
        Of the closure constant; equal where it is fixed.
    spread : float
        Part of b that is allowed for; with less than all this is no bound but an estimate.
    """
    sums = about_zero(sums, intervals.middles)
    upto = np.vstack((np.zeros(sums.shape[1]), np.cumsum(sums, axis=0)))
    below, above = upto[:-1], upto[-1] - upto[1:]
    b = spread * float(np.max(np.abs(law.b0 + law.b1 * np.array(domain))))
    tau = intervals.edges
    with np.errstate(invalid="ignore"):
        width = np.where(np.isfinite(tau[1:]), 1.0 - tau[:-1] / tau[1:], 1.0)
    apart = b * width * np.sqrt(sums[:, S_1])
    ends = tau[:-1], tau[1:]
    # t is best at e/sqrt(Q_stick(j)): by the least of it first, then by the c that this leads to
    own, best = _sticking(sums, law, domain), np.full(len(sums), -np.inf)
    for _ in range(2 if b > 0.0 else 1):
        t = np.minimum(np.divide(apart, np.sqrt(own), out=np.ones_like(own), where=own > 0.0), 1.0)
        t = np.where(apart > 0.0, t, 0.0)
        lost = np.divide(apart**2 * (1.0 - t), t, out=np.zeros_like(t), where=t > 0.0)
        value, c = _least_with(below + (1.0 - t[:, None]) * sums, above, ends, law, domain)
        best = np.maximum(best, value - lost)
        own = np.maximum(own, _sticking_at(c, sums, law))
    return np.asarray(np.maximum(best, 0.0))


def least_without(sums: Array, intervals: Intervals, law: Coefficients, domain: tuple[float, float]) -> Array:
    """Lower bound of the misfit of all other impacts of a group than those of each interval, (bins,).

    The transition lies in the interval whose impacts are not counted; else as `least_misfit`.
    """
    sums = about_zero(sums, intervals.middles)
    upto = np.vstack((np.zeros(sums.shape[1]), np.cumsum(sums, axis=0)))
    tau = intervals.edges
    value, _ = _least_with(upto[:-1], upto[-1] - upto[1:], (tau[:-1], tau[1:]), law, domain)
    return np.asarray(np.maximum(value, 0.0))


def kink_sizes(sums: Array, intervals: Intervals, law: Coefficients, domain: tuple[float, float]) -> Array:
    """How far a kink within each interval is from a line there, at most, squared and weighted, (bins,).

    The sums decide every line in 1/tau. From a constant min(b, kappa/tau) differs by half of
    b (1 - tau_lo/tau_hi) at most, and from a line of half the slope by half of kappa times the distance in
    1/tau from the mean (docs/theory/sufficient-statistics.md, eq. 5).
    """
    b = float(np.max(np.abs(law.b0 + law.b1 * np.array(domain))))
    tau = intervals.edges
    total = sums[:, S_1]
    spread = np.maximum(sums[:, S_XX] - _over(sums[:, S_X] ** 2, total), 0.0)
    spread += _CANCELLED * sums[:, S_XX]
    with np.errstate(invalid="ignore"):
        width = np.where(np.isfinite(tau[1:]), 1.0 - tau[:-1] / tau[1:], 1.0)
        by_spread = np.where(spread > 0.0, (b * tau[1:]) ** 2 * spread, 0.0)
    return np.asarray(0.25 * np.minimum(by_spread, (b * width) ** 2 * total))


def _least_with(
    below: Array, above: Array, ends: tuple[Array, Array], law: Coefficients, domain: tuple[float, float]
) -> tuple[Array, Array]:
    """Least misfit of impacts that stick and others that slide, the transition between two ends; with c."""
    stick, slide = below[:, [S_1, S_Z, S_ZZ]], above[:, [S_1, S_Z, S_ZZ, S_X, S_XX, S_ZX]]
    made = quadratic_matrix(law) @ np.concatenate((stick, slide), axis=1).T
    form, size = made[:SIZE], made[SIZE]
    numbers = np.arange(below.shape[0])
    cells = TransitionCells(form, size, numbers, *ends, law, domain, _ROUNDING, 0.0)
    found = cells.minima(numbers)
    # where c and kappa are hardly told apart, rounding decides where in the strip the least value lies
    flat = form[CC] * form[KK] - form[CK] ** 2 < FLAT * form[CC] * form[KK]
    apart = _sticking(below, law, domain) + _sliding(above, law, domain)
    return np.where(flat, apart, np.maximum(found.values - found.errors, apart)), found.points[:, 0]


def least_direct(sums: Array) -> float:
    """Least misfit of values that are one constant times their slope."""
    total = sums.sum(axis=0)
    if not total[S_1] > 0.0:
        return float(total[S_ZZ])
    return float(max(total[S_ZZ] - total[S_Z] ** 2 / total[S_1], 0.0))


def _sticking(sums: Array, law: Coefficients, domain: tuple[float, float]) -> Array:
    """Least misfit where all stick: z = A + B c."""
    if law.a1 + law.b1 == 0.0 or domain[0] == domain[1]:
        k = law.a0 + law.b0 + (law.a1 + law.b1) * domain[0]
        left = sums[:, S_ZZ] - 2.0 * k * sums[:, S_Z] + k * k * sums[:, S_1]
    else:
        left = sums[:, S_ZZ] - _over(sums[:, S_Z] ** 2, sums[:, S_1])
    return _kept(left, sums)


def _sticking_at(c: Array, sums: Array, law: Coefficients) -> Array:
    """Misfit where all stick with these c, (bins,)."""
    k = law.a0 + law.b0 + (law.a1 + law.b1) * c
    return _kept(sums[:, S_ZZ] - 2.0 * k * sums[:, S_Z] + k * k * sums[:, S_1], sums)


def _sliding(sums: Array, law: Coefficients, domain: tuple[float, float]) -> Array:
    """Least misfit where all slide: z = a0 + a1 c + kappa x, kappa free."""
    if law.a1 == 0.0 or domain[0] == domain[1]:
        k = law.a0 + law.a1 * domain[0]
        left = sums[:, S_ZZ] - 2.0 * k * sums[:, S_Z] + k * k * sums[:, S_1]
        along = sums[:, S_ZX] - k * sums[:, S_X]
        return _kept(left - _over(along**2, sums[:, S_XX]), sums)
    spread = sums[:, S_XX] - _over(sums[:, S_X] ** 2, sums[:, S_1])
    along = sums[:, S_ZX] - _over(sums[:, S_X] * sums[:, S_Z], sums[:, S_1])
    left = sums[:, S_ZZ] - _over(sums[:, S_Z] ** 2, sums[:, S_1])
    return _kept(left - np.where(spread > 1e-12 * sums[:, S_XX], _over(along**2, spread), left), sums)


def _over(a: Array, b: Array) -> Array:
    return np.asarray(np.divide(a, b, out=np.zeros_like(a), where=b > 0.0))


def _kept(left: Array, sums: Array) -> Array:
    """What cancellation may leave is not counted: a bound from below."""
    rounding = _ROUNDING * sums[:, S_ZZ]
    return np.where(sums[:, N] > 0.0, np.maximum(left - rounding, 0.0), 0.0)
