"""Readings that the closure cannot give, whatever its constants: no further impact mends that."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ifrfit.inference.diagnostics.thresholds import FACTS, REFUTED
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.optimize.optimum import Array
from ifrfit.inference.result.types import Fact
from ifrfit.physics.impulse_laws import Coefficients
from ifrfit.physics.observables import OBSERVABLES
from ifrfit.text import p_text

_SHARE = 0.25  # of an observable's rows: fewer are outliers
_ROUNDING = 1e-9


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
    value, sigma = problem.rows.value[rows], found.sigma[rows]
    way = np.sign(slope)
    above, below = way * (value - at[:, 1]) / sigma, way * (at[:, 0] - value) / sigma
    z = np.maximum(above, below)
    dof = found.noise_dof
    tail = special.ndtr(-z)
    if not math.isinf(dof):
        tail = np.where(problem.noise.is_given[rows], tail, special.stdtr(max(dof, 1.0), -z))
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
