"""What each effect of a scene buys and costs: its change of the observables against its nanoseconds."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ifrfit.cost.report.figure import draw_choice
from ifrfit.cost.timing import Cost, Timing, seconds_of, table_of
from ifrfit.physics.closures import get_closure
from ifrfit.physics.effects import EFFECTS, Contact, Impacts, Plan, PlanLine, compose
from ifrfit.physics.effects.plan import with_effect
from ifrfit.physics.observables import OBSERVABLES
from ifrfit.report import style
from ifrfit.report.simulation.figure import SUPPLEMENTS, Supplement
from ifrfit.report.terminal import aligned

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ifrfit.simulation.simulate import Simulation

FEWEST, MOST = 10_000, 200_000  # impacts a call: less is overhead; arrays beyond the cache cost more
REPEATS, QUICK_REPEATS = 5, 2
_EVALUATIONS, _LEAST_PAIRS = 250_000, 3  # impacts behind the median difference of a repeat, about
WIDTH_MM = 110.0
_NS = 1e9
_SHOWN = {"on": "on", "off": "off", "constant": "off", "refused": "off"}
_LEAST_NS = 0.5  # a cost below this is drawn there: it was not seen beside the noise
_LEAST = 1e-12  # a smaller change is rounding


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


def supplement(measured: EffectCosts, simulation: Simulation) -> Supplement:
    """What the costs of its effects add to the report of a simulation.

    Returns
    -------
    Supplement
        A table for the terminal, ``cost`` in simulation.json, and cost.csv with its figure.
    """

    def write(folder: Path) -> list[str]:
        table = table_of(measured.costs)
        table.to_csv(folder / SUPPLEMENTS[0], index=False, lineterminator="\n", float_format="%.6g")
        title = f"{simulation.scene.title}: what each effect changes and costs"
        figure = plot_costs(measured, simulation.plan.accuracy, title)
        return [SUPPLEMENTS[0], *style.save_svg_and_png(figure, folder, "cost")]

    return Supplement(cost_lines(measured), {"cost": cost_dict(measured)}, write)


def cost_lines(measured: EffectCosts) -> list[str]:
    """Table for a terminal: what each effect changes, and the nanoseconds it adds to an impact."""
    rows = [("", "closure alone, planar", "", measured.plain)]
    rows += [(_SHOWN[c.setting], EFFECTS[c.method].title, change_text(c), c.time) for c in measured.costs]
    rows.append(("", "as planned", "", measured.planned))
    head = ("", "changes", "ns an impact", "")
    cells = [
        (f"{state:<5} {title}", change, _ns(time.median), f" ({_ns(time.low)} to {_ns(time.high)})")
        for state, title, change, time in rows
    ]
    return [
        "  what an effect changes, and what it adds to an impact: measured now, numpy on one thread,",
        f"  {measured.impacts:,} impacts of this scene a call",
        *aligned([head, *cells], "<<><"),
    ]


def change_text(cost: Cost) -> str:
    """What an effect changes most, in a few words."""
    if math.isnan(cost.error):
        return "takes the closure's place" if cost.setting == "on" else "does not act here"
    if math.isinf(cost.error):
        return f"whether {cost.quantity} exists"
    return f"{cost.quantity} by {cost.error:.2g}" if cost.error > 0.0 else "nothing"


def cost_dict(measured: EffectCosts) -> dict[str, Any]:
    """For simulation.json: nanoseconds an impact, measured; the changes stand in the plan."""
    return {
        "impacts": measured.impacts,
        "closure_ns": _numbers(measured.plain),
        "planned_ns": _numbers(measured.planned),
        "effects_ns": {cost.method: _numbers(cost.time) for cost in measured.costs},
    }


def _numbers(time: Timing) -> dict[str, float]:
    return {"median": _NS * time.median, "low": _NS * time.low, "high": _NS * time.high}


def plot_costs(measured: EffectCosts, accuracy: float, title: str) -> Figure:
    """Change of the observables over the nanoseconds that each effect adds, both logarithmic.

    Parameters
    ----------
    measured : EffectCosts
    accuracy : float
        Of the plan: a dashed line.
    title : str

    Returns
    -------
    matplotlib.figure.Figure
        110 mm wide, not known to pyplot. Filled markers are on, hollow ones off; an effect that decides
        whether an observable exists lies on the upper edge, one that changes nothing on the lower one.
    """
    from matplotlib.ticker import FormatStrFormatter, LogLocator, NullLocator

    shown = [cost for cost in measured.costs if not math.isnan(cost.error)]
    finite = [cost.error for cost in shown if 0.0 < cost.error < math.inf] + [accuracy]
    low, high = 0.1 * max(min(finite), _LEAST), 10.0 * max(finite)
    with style.drawing():
        text = style.filled(title, WIDTH_MM)
        figure = style.new_figure(WIDTH_MM, 2.9 + 0.15 * text.count("\n"), "constrained")
        axes = figure.add_subplot()
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.axhline(accuracy, color=style.GREY, ls=style.RESIDUAL_DASHES, lw=0.8, zorder=1)
        axes.annotate(
            "accuracy asked for", (0.01, accuracy), xycoords=("axes fraction", "data"), xytext=(0, 2),
            textcoords="offset points", fontsize=6.0, color=style.GREY,
        )  # fmt: skip
        for cost, own in zip(shown, style.series_styles([c.method for c in shown]).values(), strict=True):
            median, least, most = (
                max(_NS * t, _LEAST_NS) for t in (cost.time.median, cost.time.low, cost.time.high)
            )
            label = f"{EFFECTS[cost.method].title}, {_SHOWN[cost.setting]}: {change_text(cost)}"
            y = min(max(cost.error, low), high)
            draw_choice(axes, (median, least, most), y, own, filled=cost.setting == "on", label=label)
        axes.set_ylim(0.4 * low, 2.5 * high)
        axes.margins(x=0.1)
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter(FormatStrFormatter("%g"))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.set_xlabel("added to an impact (ns)")
        axes.set_ylabel("largest change of an observable\n(angles in radians)")
        figure.suptitle(text, fontsize=7.5)
        figure.legend(loc="outside lower center", ncols=2, fontsize=6.6)
        style.fix_layout(figure)
    return figure


def _ns(seconds: float) -> str:
    """Nanoseconds, whole ones from ten on."""
    number = _NS * seconds
    return "< 1" if number < 1.0 else f"{number:.0f}" if number >= 9.95 else f"{number:.1f}"
