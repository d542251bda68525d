"""Readings that the closure cannot give, whatever its constants: no further impact mends that."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ifrfit.inference.diagnostics.thresholds import FACTS, REFUTED
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.result.types import Fact
from ifrfit.physics.impulse_laws import Coefficients
from ifrfit.physics.observables import OBSERVABLES
from ifrfit.text import p_text

_SHARE = 0.25  # of an observable's rows: fewer are outliers
_ROUNDING = 1e-9
_FEWEST_DIFFERENCES = 5  # of neighbours, from which their scatter is taken


def beyond_closure(problem: Problem, found: LeastSquaresFit) -> Fact | None:
    """Hold each row against all that its closure can give between the ends of its constants' domains.

    Every passive closure k = a + min(b, kappa/tau) keeps the impulse factor between the least a and the
    greatest a + b of its domain, and a tangential observable that is linear in k between their images.

    Returns
    -------
    Fact or None
        None unless a quarter of the rows of an observable, or more, lie beyond, one of them decisively.
    """
    law = problem.closure.law(problem.inertia_factor)
    if not isinstance(law, Coefficients) or not problem.error_model.is_plain:
        return None
    own = problem.closure.own
    ends = np.array([0.0] if own is None else own.domain(problem.inertia_factor))
    low = float((law.a0 + law.a1 * ends).min())
    high = float((law.a0 + law.b0 + (law.a1 + law.b1) * ends).max())
    for name in problem.rows.names:
        observable, rows = OBSERVABLES[name], problem.rows.rows_of(name)
        if observable.linear is None or observable.scale != "one":
            continue
        offset, slope = observable.linear(problem.rows.incidence, problem.inertia_factor)
        at = offset[:, None] + slope[:, None] * np.array([low, high])
        fact = _fact(problem, found, rows, at[rows], slope[rows], name, high)
        if fact is not None:
            return fact
    return None


def _fact(
    problem: Problem,
    found: LeastSquaresFit,
    rows: NDArray[np.intp],
    at: Array,
    slope: Array,
    name: str,
    high: float,
) -> Fact | None:
    """Of one observable: `at` holds its values at the least and the greatest impulse factor, (n, 2)."""
    value = problem.rows.value[rows]
    sigma, dof = _scatter(problem, found, rows)
    way = np.sign(slope)
    above, below = way * (value - at[:, 1]) / sigma, way * (at[:, 0] - value) / sigma
    z = np.maximum(above, below)
    tail = special.stdtr(dof, -z)
    p = min(1.0, float(z.size * tail.min()))
    beyond = tail < 0.025
    if p >= REFUTED or beyond.mean() < _SHARE:
        return None
    worst = int(np.argmax(z))
    gripped = bool(above[worst] > below[worst])
    end = at[worst, 1 if gripped else 0]
    gamma = float(problem.observations.table["gamma_deg"].to_numpy(dtype=float)[rows[worst]])
    says = (
        f"{int(beyond.sum())} of {z.size} readings of {name} lie beyond all that closure "
        f"{problem.closure.title} gives (p = {p_text(p)}): {value[worst]:.3g} at {gamma:.3g} degrees, where "
        f"it ends at {end:.3g}. {_reason(problem, high, gripped)}"
    )
    figures = {"p": p, "n_beyond": int(beyond.sum()), "observable": name}
    return Fact(False, says, figures, FACTS["beyond_closure"])


def _scatter(problem: Problem, found: LeastSquaresFit, rows: NDArray[np.intp]) -> tuple[Array, Array]:
    """Noise of rows of one observable and its degrees of freedom; an unknown one apart from the closure.

    A closure that misses readings by far takes the misfit for noise. So the scatter of neighbours along tau
    counts where it is smaller: differences tell it as well as two thirds as many degrees of freedom.

    References
    ----------
    von Neumann (1941), Ann. Math. Stat. 12, 367; Rice (1984), Ann. Stat. 12, 1215.
    """
    sigma, dof = found.sigma[rows].copy(), np.full(rows.size, max(found.noise_dof, 1.0))
    dof[problem.noise.is_given[rows]] = math.inf
    value, tau, series = problem.rows.value, problem.rows.tau, problem.rows.series
    for group in problem.noise_groups().values():
        place = np.flatnonzero(np.isin(rows, group))
        order = rows[place][np.lexsort((tau[rows[place]], series[rows[place]]))]
        near = np.flatnonzero(series[order[1:]] == series[order[:-1]])
        if near.size < _FEWEST_DIFFERENCES:
            continue
        first, second = order[near], order[near + 1]
        size = float(
            (
                (value[first] - value[second]) ** 2 / (found.sigma[first] ** 2 + found.sigma[second] ** 2)
            ).mean()
        )
        if 0.0 < size < 1.0:
            sigma[place] *= math.sqrt(size)
            dof[place] = 2.0 / 3.0 * near.size
    return sigma, dof


def _reason(problem: Problem, high: float, gripped: bool) -> str:
    """What impacts do that the closure does not let them do."""
    if not gripped:
        return "Friction would have driven the contact point on: look at signs and at the angle's origin"
    reversal = high * (1.0 + 1.0 / problem.inertia_factor) - 1.0
    if reversal < _ROUNDING:
        return (
            "In it the contact point at most stops, and here it springs back, as a superball's does: a "
            "closure with tangential restitution, --closure fr or ifr, lets it"
        )
    if reversal < 1.0 - _ROUNDING:
        return f"In it the contact point springs back with {reversal:.3g} of its speed at most"
    return (
        "A contact point that leaves faster than it came gains energy, which no closure of a rigid sphere "
        "gives: look at signs, units and the inertia factor"
    )
