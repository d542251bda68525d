"""What each effect of a scene buys and costs: its change of the observables against its nanoseconds."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ifrfit.cost.timing import Cost, Timing, seconds_of
from ifrfit.physics.closures import get_closure
from ifrfit.physics.effects import Contact, Impacts, Plan, PlanLine, compose
from ifrfit.physics.effects.compose import with_effect
from ifrfit.physics.observables import OBSERVABLES

FEWEST, MOST = 10_000, 200_000  # impacts a call: less is overhead; arrays beyond the cache cost more
REPEATS, QUICK_REPEATS = 5, 2
_EVALUATIONS, _LEAST_PAIRS = 250_000, 3  # impacts behind the median difference of a repeat, about


@dataclass(frozen=True)
class EffectCosts:
    """What was measured on one scene.

    Attributes
    ----------
    plain : Timing
        Seconds an impact without any effect: the planar kernel with a closure.
    planned : Timing
        Seconds an impact with the effects that the plan has on.
    costs : tuple of Cost
        One an effect that can be computed, in the order of the plan. Kind ``physics``; method: the effect;
        setting: its state in the plan; quantity: the observable that it changes most; error: that change,
        which is the error of doing without it (infinite where it decides whether the observable exists, nan
        where there is nothing to compare with, or where a law would only take the place of a constant that is
        given without acting); error unit ``rad`` for angles, else ``1``; time: seconds an
        impact that it adds.
    impacts : int
        A call.
    """

    plain: Timing
    planned: Timing
    costs: tuple[Cost, ...]
    impacts: int


def effect_costs(contact: Contact, impacts: Impacts, plan: Plan, *, quick: bool = False) -> EffectCosts:
    """Measure on this scene what each effect adds to the time of an impact.

    Parameters
    ----------
    contact : Contact
    impacts : Impacts
        With one dimension. A call takes as many as there are, but at least 10,000, over and over, and at most
        200,000, evenly through the scene.
    plan : Plan
        Of the same impacts.
    quick : bool
        Fewer repeats.

    Returns
    -------
    EffectCosts

    Notes
    -----
    The scene is computed without the effect and with it, beside those that the plan has on, in turns: numpy
    on one thread. A repeat is the median of several differences. A law of e_n or of the tangential impulse
    takes the place of another one; where the closure lacks its constant, compliance is held against F.
    """
    count = impacts.speed.size
    number = min(max(count, FEWEST), MOST)
    rows = np.resize(np.arange(count), number)
    if count > number:
        rows = np.linspace(0, count - 1, number).astype(np.intp)
    many = _complete(impacts.take(rows))
    repeats = QUICK_REPEATS if quick else REPEATS

    def run(on: Sequence[str]) -> Callable[[], object]:
        return lambda: compose(contact, many, on)

    costs = []
    for line in plan.lines:
        if line.criterion is not None:
            more = with_effect(plan.on, line.effect)
            less = [name for name in more if name != line.effect]
            costs.append(_cost(line, _added(run(less), run(more), number, repeats)))
    plain, planned = (_added(lambda: None, run(on), number, repeats) for on in ((), plan.on))
    return EffectCosts(plain, planned, tuple(costs), number)


def _complete(impacts: Impacts) -> Impacts:
    """Impacts that can be computed without compliance as well."""
    if impacts.constant is not None:
        return impacts
    return replace(impacts, closure=get_closure("f"), constant=np.zeros_like(impacts.speed))


def _added(less: Callable[[], object], more: Callable[[], object], number: int, repeats: int) -> Timing:
    """How much longer an impact takes; they take turns, so that a busy machine meets both alike."""
    for call in (less, more):
        call()  # tables and caches are not what is measured
    found = []
    for _ in range(repeats):
        pairs = range(max(_EVALUATIONS // number, _LEAST_PAIRS))
        found.append(statistics.median(seconds_of(more) - seconds_of(less) for _ in pairs))
    return _timing(found).per(number)


def _timing(seconds: Sequence[float]) -> Timing:
    """Never below zero: a difference that is lost in the noise is no gain of time."""
    return Timing.of([max(0.0, each) for each in seconds])


def _cost(line: PlanLine, added: Timing) -> Cost:
    unit = "rad" if line.observable and OBSERVABLES[line.observable].unit == "deg" else "1"
    acts = line.state != "constant" or (line.criterion is not None and line.criterion.met)
    change = line.change if line.change is not None and acts else math.nan
    return Cost("physics", line.effect, line.state, line.observable, added, change, unit)
