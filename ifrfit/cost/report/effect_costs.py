"""What each effect of a scene buys and costs, as text, as a table and as a figure."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ifrfit.cost.effect_costs import EffectCosts
from ifrfit.cost.report.figure import draw_choice
from ifrfit.cost.timing import Cost, Timing, table_of
from ifrfit.physics.effects import EFFECTS
from ifrfit.report import style
from ifrfit.report.simulation.folder import SUPPLEMENTS
from ifrfit.report.simulation.supplement import Supplement
from ifrfit.report.terminal import aligned

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ifrfit.simulation.result import Simulation

WIDTH_MM = 110.0
_NS = 1e9
_SHOWN = {"on": "on", "off": "off", "constant": "off", "refused": "off"}
_LEAST_NS = 0.5  # a cost below this is drawn there: it was not seen beside the noise
_LEAST = 1e-12  # a smaller change is rounding


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
