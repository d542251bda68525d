"""What each effect of a scene buys and costs: its change of the observables against its nanoseconds."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ifrfit.cost.measured import Cost, Timing, timed
from ifrfit.physics.closures import get_closure
from ifrfit.physics.effects import EFFECTS, Contact, Impacts, Plan, PlanLine, compose
from ifrfit.physics.observables import OBSERVABLES

MANY = 50_000  # impacts a call
REPEATS, QUICK_REPEATS = 5, 2
PAIRS = 5  # differences behind each repeat


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
        where there is nothing to compare with); error unit ``rad`` for angles, else ``1``; time: seconds an
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
        With one dimension. 50,000 of them make a call: evenly through the scene, or over and over.
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
    on one thread. A repeat is the median of five differences. A law of e_n or of the tangential impulse takes
    the place of another one; where the closure lacks its constant, compliance is held against closure F.
    """
    count = impacts.speed.size
    rows = (
        np.linspace(0, count - 1, MANY).astype(np.intp) if count > MANY else np.resize(np.arange(count), MANY)
    )
    many = _complete(impacts.take(rows))
    repeats = QUICK_REPEATS if quick else REPEATS

    def run(on: Sequence[str]) -> Callable[[], object]:
        return lambda: compose(contact, many, on)

    costs = []
    for line in plan.lines:
        if line.criterion is not None:
            more = _with(plan.on, line.effect)
            less = [name for name in more if name != line.effect]
            costs.append(_cost(line, _added(run(less), run(more), repeats).per(MANY)))
    plain, planned = (timed(run(on), repeats=repeats, enough=0.02).per(MANY) for on in ((), plan.on))
    return EffectCosts(plain, planned, tuple(costs), MANY)


def _complete(impacts: Impacts) -> Impacts:
    """Impacts that can be computed without compliance as well."""
    if impacts.constant is not None:
        return impacts
    return replace(impacts, closure=get_closure("f"), constant=np.zeros_like(impacts.speed))


def _with(on: Sequence[str], name: str) -> list[str]:
    """These effects and this one, which takes the place of any that replaces the same constant."""
    same = EFFECTS[name].replaces
    return [n for n in on if n != name and (not same or EFFECTS[n].replaces != same)] + [name]


def _added(less: Callable[[], object], more: Callable[[], object], repeats: int) -> Timing:
    """How much longer the one takes; they take turns, so that a busy machine meets both alike."""
    for call in (less, more):
        call()  # tables and caches are not what is measured
    found = []
    for _ in range(repeats):
        seconds = [(_seconds(less), _seconds(more)) for _ in range(PAIRS)]
        found.append(statistics.median(two - one for one, two in seconds))
    return _timing(found)


def _seconds(call: Callable[[], object]) -> float:
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def _timing(seconds: Sequence[float]) -> Timing:
    """Never below zero: a difference that is lost in the noise is no gain of time."""
    low, middle, high = (max(0.0, x) for x in (min(seconds), statistics.median(seconds), max(seconds)))
    return Timing(middle, low, high, len(seconds))


def _cost(line: PlanLine, added: Timing) -> Cost:
    unit = "rad" if line.observable and OBSERVABLES[line.observable].unit == "deg" else "1"
    change = float("nan") if line.change is None else line.change
    return Cost("physics", line.effect, line.state, line.observable, added, change, unit)
