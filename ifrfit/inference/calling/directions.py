"""How each effect would move the fitted values, to first order or at the size that its theory says.

A direction is taken at the fit, from the effect's own physics, and never fitted: so whether the residuals
lie along it is a test of one degree of freedom, see `score`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from ifrfit.inference.calling.measured import Array, computed, impacts_of, oblique, speeds
from ifrfit.inference.problem import Problem
from ifrfit.physics.closures import Coefficients, get_closure
from ifrfit.physics.compliance import chi_of
from ifrfit.physics.compliance.law import chi_range
from ifrfit.physics.effects import Contact
from ifrfit.physics.effects.contact import SOLID
from ifrfit.physics.effects.plasticity import restitution as after_yield
from ifrfit.physics.effects.viscoelastic import restitution as after_dissipation

# no effects of the registry, but what a misfit may be instead
RIVALS = ("sticking-law", "sliding-law", "friction-by-speed")

_POISSON = 0.3  # where the materials are not known; compliance depends little on it
_STEP = 1e-6
_SMALL_COUPLE = 1e-6  # mu_r of the difference that stands for the derivative
_GRID = 4000  # places of a law's number, to invert it to 1e-5
_SHAPE = (0.1, 0.95)  # e_n from which a law takes its shape where the data do not tell e_n


@dataclass(frozen=True)
class Direction:
    """Change of every row's value by an effect of strength 1.

    Attributes
    ----------
    name : str
        Effect, or what may be mistaken for one: `RIVALS`.
    change : ndarray, (n,)
        In the observable's unit.
    two_sided : bool
        Whether its strength may be negative.
    whole : bool
        Whether strength 1 is what the effect's theory says with the fitted constants, nothing free.
    by_kappa : bool
        Whether the rows know e_n in kappa = mu (1 + e_n) only, so that a law e_n(v) may be one of mu.
    figures : mapping
        What the words need: chi, e_n over a tenfold of speed.
    """

    name: str
    change: Array
    two_sided: bool = False
    whole: bool = False
    by_kappa: bool = False
    figures: dict[str, float] = field(default_factory=dict)


def directions(
    problem: Problem, theta: Array, jacobian: Array, *, chi: float | None = None, knows_e_n: bool = True
) -> list[Direction]:
    """Every direction that these rows can show.

    Parameters
    ----------
    problem : Problem
    theta : ndarray
        The optimum.
    jacobian : ndarray, (n, p)
        `Problem.jacobian` there.
    chi : float, optional
        Compliance number of the materials; by default that of a Poisson ratio of 0.3.
    knows_e_n : bool
        Whether e_n is determined or fixed: else a law e_n(v) has a shape, but no size of its own.
    """
    return [
        *_tangential(problem, theta, chi),
        *_of_speed(problem, theta, jacobian, knows_e_n),
        *_rolling(problem, theta),
    ]


def _tangential(problem: Problem, theta: Array, chi: float | None) -> Iterator[Direction]:
    """Compliance, and the other constant laws of sticking and sliding, which may look like it."""
    if not problem.closure.bilinear or not oblique(problem).any():
        return
    e_n, c, mu = problem.per_row(theta)
    k, sticks = problem.impulse(e_n, c, mu)
    j = problem.inertia_factor
    low, high = chi_range(j)
    number = float(chi_of(_POISSON, j)) if chi is None else chi
    if low <= number <= high:
        law = get_closure("maw").law(j)
        compliant, _ = law.impulse(problem.rows.incidence, np.array(number), mu * (1.0 + e_n))
        change = problem.values_with(compliant, e_n, mu) - problem.values_with(k, e_n, mu)
        yield Direction("compliance", change, whole=True, figures={"chi": number})
    law = problem.closure.law(j)
    up = problem.values_with(k + _STEP, e_n, mu)
    by_k = (up - problem.values_with(k - _STEP, e_n, mu)) / (2.0 * _STEP)
    # k = a + min(b, kappa/tau): closures differ in which of a and b is free
    assert isinstance(law, Coefficients)
    if law.b1 == 0.0:
        yield Direction("sticking-law", np.where(sticks, by_k, 0.0), two_sided=True)
    if law.a1 == 0.0:
        yield Direction("sliding-law", by_k, two_sided=True)


def _of_speed(problem: Problem, theta: Array, jacobian: Array, knows_e_n: bool) -> Iterator[Direction]:
    """Laws e_n(v), adhesion, and friction that depends on the speed of sliding."""
    i = problem.rows.incidence
    speed = speeds(problem)
    normal = speed * i.cosine
    with np.errstate(invalid="ignore"):
        coming = np.isfinite(normal) & (normal > 0.0)
        slipping = np.isfinite(speed) & (speed * i.slip > 0.0)
    places = problem.positions()
    row = np.arange(normal.size)
    e_n, c, mu = problem.per_row(theta)
    if coming.any():
        for name, law in (("viscoelastic", _dissipating), ("plasticity", _yielding)):
            direction = _restitution_law(problem, (e_n, c, mu), normal, coming, name, law, knows_e_n)
            if direction is not None:
                yield direction
        by_e_n = jacobian[row, places["e_n"][problem.rows.series]]
        # e_n^2 falls by (V_s/V)^2: per V_s^2
        less = np.where(coming, -0.5 / (np.maximum(e_n, _SHAPE[0]) * np.where(coming, normal, 1.0) ** 2), 0.0)
        yield Direction("adhesion", by_e_n * less)
    if slipping.any():
        by_mu = jacobian[row, places["mu"][problem.rows.series]]
        slip = np.log(np.where(slipping, speed * i.slip, 1.0))
        yield Direction(
            "friction-by-speed", np.where(slipping & oblique(problem), by_mu * mu * slip, 0.0), two_sided=True
        )


def _dissipating(e_n: float) -> Callable[[Array], Array]:
    """Viscoelastic e_n by V/V_0, through e_n at 1."""
    x = _inverse(after_dissipation, np.geomspace(1e4, 1e-8, _GRID), e_n)
    return lambda ratio: after_dissipation(x * ratio**0.2)


def _yielding(e_n: float) -> Callable[[Array], Array]:
    """Elastic-plastic e_n by V/V_0, through e_n at 1."""
    r = _inverse(after_yield, np.geomspace(1e-8, 1.0, _GRID), e_n)
    return lambda ratio: after_yield(r / ratio)


def _inverse(law: Callable[[Array], Array], number: Array, e_n: float) -> float:
    """Number at which a law gives e_n; numbers in the order of rising e_n."""
    return float(np.exp(np.interp(e_n, law(number), np.log(number))))


def _restitution_law(
    problem: Problem,
    constants: tuple[Array, Array, Array],
    normal: Array,
    coming: np.ndarray,
    name: str,
    law: Callable[[float], Callable[[Array], Array]],
    knows_e_n: bool,
) -> Direction | None:
    """Change from a constant e_n to e_n(v) with that value at the mean log speed."""
    e_n, c, mu = constants
    shape = e_n if knows_e_n else np.clip(e_n, *_SHAPE)
    if ((shape <= 0.02) | (shape >= 1.0)).any():
        return None
    ratio = np.where(coming, normal, 1.0)
    middle = float(np.exp(np.log(ratio[coming]).mean()))
    ratio = ratio / middle
    changed = e_n.copy()
    fall = 0.0
    for value in np.unique(shape):
        at = coming & (shape == value)
        through = law(float(value))
        changed[at] += through(ratio[at]) - value
        tenth = through(np.sqrt(np.array([0.1, 10.0])))
        fall += float(tenth[0] - tenth[1]) * float(at.sum()) / float(coming.sum())
    changed = np.clip(changed, 0.0, 1.0)
    (k, _), (old, _) = problem.impulse(changed, c, mu), problem.impulse(e_n, c, mu)
    change = problem.values_with(k, changed, mu) - problem.values_with(old, e_n, mu)
    return Direction(
        name,
        change,
        whole=knows_e_n and problem.inertia_factor == SOLID,  # both are laws of a Hertz contact
        by_kappa=not knows_e_n,
        figures={"fall": fall, "speed": middle},
    )


def _rolling(problem: Problem, theta: Array) -> Iterator[Direction]:
    """Derivative by the coefficient of rolling friction."""
    nowhere = np.full(problem.rows.value.size, np.nan)
    impacts = impacts_of(problem, theta, nowhere, nowhere)
    contact = Contact(inertia_factor=problem.inertia_factor, rolling_friction=_SMALL_COUPLE)
    slowed, free = (computed(problem, contact, impacts, on) for on in (("rolling",), ()))
    yield Direction("rolling", np.nan_to_num((slowed - free) / _SMALL_COUPLE))
