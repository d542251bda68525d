"""How each effect would move the fitted values, to first order or at the size that its theory says.

A direction is taken at the fit, from the effect's own physics, and never fitted: so whether the residuals
lie along it is a test of one degree of freedom, see `score_tests`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from typing import cast

import numpy as np

from ifrfit.inference.diagnostics.thresholds import RANGE_OF_SPEEDS
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import OBLIQUE, Array, Index
from ifrfit.physics.closures import get_closure
from ifrfit.physics.compliance import chi_of
from ifrfit.physics.compliance.law import HIGHEST_CHI, LOWEST_CHI, chi_range
from ifrfit.physics.effects import Contact, Impacts, compose, plane_effects
from ifrfit.physics.effects.contact import SOLID
from ifrfit.physics.effects.plasticity import restitution as after_yield
from ifrfit.physics.effects.viscoelastic import restitution as after_dissipation
from ifrfit.physics.impulse_laws import Coefficients

_PLACES = 4000  # places of a law's number, to invert it to 1e-6
_BINS = 64  # of log speed, for the mean
_HALVINGS = 40

LawOfSpeed = Callable[[Array], Array]
# no effects of the registry, but what a misfit may be instead
RIVALS = (
    "sticking-law",
    "sliding-law",
    "sticking-by-angle",
    "restitution-by-angle",
    "friction-by-speed",
    "friction-by-load",
    "inertia-factor",
)

_POISSON = (0.1, 0.3, 0.45)  # where the materials are not known
_MOST_FRICTION = 10.0  # of mu that depends on the load, over its mean
_KAPPA = (0.5, 2.0)  # that a step may reach, over the fitted one
_STEP = 1e-6
_SMALL_COUPLE = 1e-6  # mu_r of the difference that stands for the derivative
_COUPLES = (0.01, 0.02, 0.04, 0.06, 0.1, 0.2)  # mu_r from which one is looked for that stops spins
_PARTS = (1 / 3, 0.5, 2 / 3)  # of the range of angles, from which the closure's own constant may be another
_GRAZING = 1e-3  # cosine of the angle below which a tangent is cut off
_LOWEST = 0.02  # e_n below which nothing is left to fall
_SHAPE = (0.1, 0.95)  # e_n from which a law takes its shape where the data do not tell e_n


def impacts_of(problem: Problem, theta: Array, speed: Array, radius: Array) -> Impacts:
    """The rows' impacts with the fitted constants.

    Parameters
    ----------
    problem : Problem
    theta : ndarray
    speed, radius : ndarray, (n,)
        m/s and m; nan where not known.
    """
    e_n, c, mu = problem.per_row(theta)
    return Impacts(problem.rows.incidence, speed, radius, problem.closure, e_n, c, mu)


def computed(problem: Problem, contact: Contact, impacts: Impacts, on: tuple[str, ...]) -> Array:
    """Value of each row with these effects, (..., n); nan where an effect leaves none.

    Every fit is in three dimensions.
    """
    outcome, mu = compose(contact, impacts, (*on, *plane_effects())), impacts.mu
    out = np.empty(mu.shape)
    for observable, at, _ in problem.rows.by_observable:
        out[..., at] = np.broadcast_to(observable.value(outcome, mu), mu.shape)[..., at]
    return out


def dissipating(e_n: float) -> LawOfSpeed:
    """Viscoelastic e_n by V/V_0, through e_n at 1."""
    x = _inverse(after_dissipation, np.geomspace(1e4, 1e-8, _PLACES), e_n)
    return lambda ratio: after_dissipation(x * ratio**0.2)


def yielding(e_n: float) -> LawOfSpeed:
    """Elastic-plastic e_n by V/V_0, through e_n at 1."""
    r = _inverse(after_yield, np.geomspace(1e-8, 1.0, _PLACES), e_n)
    return lambda ratio: after_yield(r / ratio)


LAWS = {"viscoelastic": dissipating, "plasticity": yielding}


def _inverse(law: LawOfSpeed, number: Array, e_n: float) -> float:
    """Number at which a law gives e_n; numbers in the order of rising e_n."""
    return float(np.exp(np.interp(e_n, law(number), np.log(number))))


def reference_speed(law: LawOfSpeed, e_n: float, speed: Array, weight: Array) -> float:
    """V_0 at which the law has the mean e_n: the constant that would be fitted to it.

    Parameters
    ----------
    law : callable
        Of V/V_0, through e_n at 1, falling.
    e_n : float
    speed, weight : ndarray, (n,)
        Normal speeds, positive; how much each row says of e_n.
    """
    logs = np.log(speed)
    low, high = float(logs.min()), float(logs.max())
    if low == high or not weight.any():
        return float(np.exp(logs.mean()))
    mass, edges = np.histogram(logs, _BINS, weights=weight)
    middle = 0.5 * (edges[1:] + edges[:-1])
    for _ in range(_HALVINGS):
        half = 0.5 * (low + high)
        if float(mass @ (law(np.exp(middle - half)) - e_n)) < 0.0:
            low = half
        else:
            high = half
    return float(np.exp(0.5 * (low + high)))


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
    values : callable, optional
        From theta, (m, p), and strengths, (m,), to the value of each row, (m, n), where these are cheap to
        know beyond first order.
    likely : tuple of float
        Strengths at which these are no line: the score test may see nothing of them.
    of_rows : callable, optional
        From rows to `values` of these alone.
    constant : str
        The closure's own one, where that changes.
    figures : mapping
        What the words need: chi, e_n over a tenfold of speed.
    """

    name: str
    change: Array
    two_sided: bool = False
    whole: bool = False
    by_kappa: bool = False
    values: Callable[[Array, Array], Array] | None = None
    likely: tuple[float, ...] = ()
    of_rows: Callable[[Index], Callable[[Array, Array], Array]] | None = None
    constant: str = ""
    figures: dict[str, float] = field(default_factory=dict)


def directions(
    problem: Problem,
    theta: Array,
    jacobian: Array,
    sigma: Array,
    *,
    chi: float | None = None,
    speed: float = 0.0,
    e_n_known: bool = True,
) -> Iterator[Direction]:
    """Every direction that these rows can show, one at a time.

    Parameters
    ----------
    problem : Problem
    theta : ndarray
        The optimum.
    jacobian : ndarray, (n, p)
        `Problem.jacobian` there.
    sigma : ndarray, (n,)
        Standard uncertainty of each row.
    chi : float, optional
        Compliance number of the materials; by default those of Poisson ratios of 0.1, 0.3 and 0.45 are tried.
    speed : float
        Of rows that state none, m/s; 0 where it is not known.
    e_n_known : bool
        Whether e_n is determined or fixed: else a law e_n(v) has a shape, but no size of its own.
    """
    yield from _tangential(problem, theta, jacobian, sigma, chi)
    of_rows = np.where(np.isfinite(problem.speeds), problem.speeds, speed)
    yield from _of_speed(problem, theta, jacobian, sigma, of_rows, e_n_known)
    yield from _rolling(problem, theta)
    yield from _inertia(problem, theta)


def _tangential(
    problem: Problem, theta: Array, jacobian: Array, sigma: Array, chi: float | None
) -> Iterator[Direction]:
    """Compliance, and the other constant laws of sticking and sliding, which may look like it."""
    if not problem.closure.bilinear or not problem.has_oblique:
        return
    e_n, c, mu = problem.per_row(theta)
    k, sticks = problem.impulse(e_n, c, mu)
    j = problem.inertia_factor
    law = problem.closure.law(j)
    up = problem.values_with(k + _STEP, e_n, mu)
    by_k = (up - problem.values_with(k - _STEP, e_n, mu)) / (2.0 * _STEP)
    # k = a + min(b, kappa/tau): closures differ in which of a and b is free
    assert isinstance(law, Coefficients)
    free = {}
    if law.b1 == 0.0:
        free["sticking-law"] = np.where(sticks, by_k, 0.0)
    if law.a1 == 0.0:
        free["sliding-law"] = by_k
    factor = _kappa_factor(problem, theta, np.column_stack((jacobian, *free.values())), sigma)
    compliance, low_high = get_closure("maw").law(j), chi_range(j)
    for number in [float(chi_of(nu, j)) for nu in _POISSON] if chi is None else [chi]:
        # a small inertia factor lies beyond the table, and nothing is known of its compliance
        if max(low_high[0], LOWEST_CHI) <= number <= min(low_high[1], HIGHEST_CHI):
            kappa = factor * mu * (1.0 + e_n)
            compliant, _ = compliance.impulse(problem.rows.incidence, np.array(number), kappa)
            change = problem.values_with(compliant, e_n, mu) - problem.values_with(k, e_n, mu)
            yield Direction("compliance", change, whole=True, figures={"chi": number})
    for name, change in free.items():
        yield Direction(name, change, two_sided=True)
    yield from _own_by_angle(problem, jacobian)


def _own_by_angle(problem: Problem, jacobian: Array) -> Iterator[Direction]:
    """A closure's own constant that changes evenly with the angle, over the impacts that know it."""
    own = problem.closure.own
    if own is None:
        return
    by_own = jacobian[
        np.arange(len(problem.rows)), problem.parameters.positions[own.name][problem.rows.series]
    ]
    gamma, known = problem.rows.gamma_deg, by_own != 0.0
    if not known.any() or not np.ptp(gamma[known]) > 0.0:
        return
    even = np.clip((gamma - gamma[known].min()) / np.ptp(gamma[known]), 0.0, 1.0)
    for rise in (even, *((even > part).astype(float) for part in _PARTS)):
        bent = partial(_with_own_by_angle, problem, rise)
        yield Direction("sticking-by-angle", by_own * rise, two_sided=True, values=bent, constant=own.name)


def _with_own_by_angle(problem: Problem, rise: Array, theta: Array, strength: Array) -> Array:
    """Value of each row with the closure's own constant larger by strengths times a rise, (m, n)."""
    e_n, c, mu = problem.per_row(theta)
    c = np.clip(c + strength[:, None] * rise, *problem.closure.domain(problem.inertia_factor))
    k, _ = problem.impulse(e_n, c, mu)
    return problem.values_with(k, e_n, mu)


def _kappa_factor(problem: Problem, theta: Array, columns: Array, sigma: Array) -> Array:
    """kappa over that of the fit, for each row, by a step in which no tie of the closure holds it back.

    Where the contact is compliant, a closure that ties sticking to sliding finds a kappa that lies off.
    """
    residual = problem.residual(theta) / sigma
    step = np.linalg.lstsq(columns / sigma[:, None], residual, rcond=_STEP)[0]
    places, series = problem.parameters.positions, problem.rows.series
    at_e, at_mu = places["e_n"][series], places["mu"][series]
    e_n, _, mu = problem.per_row(theta)
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = 1.0 + step[at_mu] / mu + step[at_e] / (1.0 + e_n)
    return np.clip(np.nan_to_num(factor, nan=1.0), *_KAPPA)


def _of_speed(
    problem: Problem, theta: Array, jacobian: Array, sigma: Array, speed: Array, e_n_known: bool
) -> Iterator[Direction]:
    """Laws e_n(v), adhesion, and friction that depends on the speed of sliding."""
    i = problem.rows.incidence
    normal, sliding = speed * i.cosine, speed * i.slip
    places = problem.parameters.positions
    row = np.arange(normal.size)
    e_n, c, mu = problem.per_row(theta)
    coming, slipping = normal > 0.0, (sliding > 0.0) & problem.rows.is_oblique
    by_e_n = jacobian[row, places["e_n"][problem.rows.series]]
    if problem.rows.of_kind("normal").any():
        # a face that stands oblique sends a part of the tangential velocity away from the wall
        for shape in (i.sine / np.maximum(i.cosine, _GRAZING), np.arctan2(i.sine, i.cosine)):
            rise = (shape - shape.min()) / max(float(np.ptp(shape)), _GRAZING)
            bent = partial(_by_angle, problem, rise)
            yield Direction("restitution-by-angle", by_e_n * rise, two_sided=True, values=bent)
    # of one normal speed the errors are in e_n, too, where both are made of the same velocities
    if coming.any() and float(normal[coming].max()) >= RANGE_OF_SPEEDS * float(normal[coming].min()):
        for name in LAWS:
            weight = (by_e_n / sigma) ** 2
            direction = _restitution_law(problem, (e_n, c, mu), normal, weight, name, e_n_known)
            if direction is not None:
                yield direction
        # e_n^2 falls by (V_s/V)^2: per V_s^2
        towards = np.where(coming, normal, np.inf)
        less = -0.5 / (np.maximum(e_n, _LOWEST) * towards**2)
        yield Direction("adhesion", by_e_n * less, values=partial(_adhering, problem, towards))
    by_mu = jacobian[row, places["mu"][problem.rows.series]]
    # the normal speed of impacts of one speed is as the cosine of the angle
    load = normal if coming.all() else i.cosine
    if problem.rows.is_oblique.any() and load.any():
        load = load / load.mean()
        yield Direction(
            "friction-by-load",
            by_mu * mu * load,
            two_sided=True,
            values=lambda theta, strength: _by_load(problem, theta, 1.0 + strength[:, None] * load),
        )
    if slipping.any():
        log = np.log(np.where(slipping, sliding, 1.0))
        yield Direction("friction-by-speed", by_mu * mu * log, two_sided=True)


def _by_angle(problem: Problem, rise: Array, theta: Array, strength: Array) -> Array:
    """Value of each row with e_n larger by strengths times a rise, (m, n)."""
    e_n, c, mu = problem.per_row(theta)
    e_n = np.maximum(e_n + strength[:, None] * rise, 0.0)
    k, _ = problem.impulse(e_n, c, mu)
    return problem.values_with(k, e_n, mu)


def _adhering(problem: Problem, normal: Array, theta: Array, strength: Array) -> Array:
    """Value of each row with e_n^2 smaller by strengths over the squares of normal speeds, (m, n)."""
    e_n, c, mu = problem.per_row(theta)
    e_n = np.sqrt(np.maximum(e_n**2 - strength[:, None] / normal**2, 0.0))
    k, _ = problem.impulse(e_n, c, mu)
    return problem.values_with(k, e_n, mu)


def _by_load(problem: Problem, theta: Array, factor: Array) -> Array:
    """Value of each row with mu times a factor, (m, n)."""
    e_n, c, mu = problem.per_row(theta)
    mu = mu * np.clip(factor, 0.0, _MOST_FRICTION)
    k, _ = problem.impulse(e_n, c, mu)
    return problem.values_with(k, e_n, mu)


def _restitution_law(
    problem: Problem,
    constants: tuple[Array, Array, Array],
    normal: Array,
    weight: Array,
    name: str,
    e_n_known: bool,
) -> Direction | None:
    """Change from a constant e_n to a law e_n(v) with that mean."""
    e_n, c, mu = constants
    shape = e_n if e_n_known else np.clip(e_n, *_SHAPE)
    if ((shape <= _LOWEST) | (shape >= 1.0)).any():
        return None
    coming = normal > 0.0
    changed = e_n.copy()
    fall = 0.0
    for value in np.unique(shape[coming]):
        at = coming & (shape == value)
        law = LAWS[name](float(value))
        through = reference_speed(law, float(value), normal[at], weight[at])
        changed[at] += law(normal[at] / through) - value
        tenth = law(np.sqrt(np.array([0.1, 10.0])))
        fall += float(tenth[0] - tenth[1]) * float(at.sum()) / float(coming.sum())
    changed = np.clip(changed, 0.0, 1.0)
    (k, _), (old, _) = problem.impulse(changed, c, mu), problem.impulse(e_n, c, mu)
    change = problem.values_with(k, changed, mu) - problem.values_with(old, e_n, mu)
    return Direction(
        name,
        change,
        whole=e_n_known and problem.inertia_factor == SOLID,  # both are laws of a Hertz contact
        by_kappa=not e_n_known,
        figures={"fall": fall},
    )


def _rolling(problem: Problem, theta: Array) -> Iterator[Direction]:
    """Derivative by the coefficient of rolling friction."""
    free, slowed = _with_rolling(problem, np.stack((theta, theta)), np.array([0.0, _SMALL_COUPLE]))
    change = np.nan_to_num((slowed - free) / _SMALL_COUPLE)

    def of_rows(rows: Index) -> Callable[[Array, Array], Array]:
        return partial(_with_rolling, replace(problem, rows=problem.rows.take(rows)))

    values = partial(_with_rolling, problem)
    yield Direction("rolling", change, values=values, likely=_COUPLES, of_rows=of_rows)


def _with_rolling(problem: Problem, theta: Array, size: Array) -> Array:
    """Value of each row with coefficients of rolling friction, (m, n)."""
    of_each = cast("float", size[:, None])  # theta in the place of one for all
    contact = Contact(inertia_factor=problem.inertia_factor).with_numbers(rolling_friction=of_each)

    def of_part(part: Problem) -> Array:
        nowhere = np.full(len(part.rows), np.nan)
        return computed(part, contact, impacts_of(part, theta, nowhere, nowhere), ("rolling",))

    return problem.by_parts(of_part)


def _inertia(problem: Problem, theta: Array) -> Iterator[Direction]:
    """Relative derivative by the inertia factor; spins beside velocities show it as they do rolling."""
    of_spin = {each.numerator == "spin" for each in problem.rows.observables if each.kind in OBLIQUE}
    if of_spin == {True, False}:
        other = replace(problem, inertia_factor=problem.inertia_factor * (1.0 + _STEP))
        change = (other.predict(theta) - problem.predict(theta)) / _STEP
        yield Direction("inertia-factor", change, two_sided=True)
