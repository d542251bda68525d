"""A simulation as text for a terminal: what was simulated, the effect plan, the curves."""

from __future__ import annotations

import math
from dataclasses import replace
from html import escape
from typing import TYPE_CHECKING

from ifrfit.physics.closures import get_closure
from ifrfit.physics.effects import PlanLine
from ifrfit.physics.scenes import Quantity
from ifrfit.report.simulation.figure import Supplement
from ifrfit.report.terminal import aligned, wrapped

if TYPE_CHECKING:
    import pandas as pd

    from ifrfit.simulation.simulate import Simulation

MOST_ROWS = 30


def summary(simulation: Simulation, supplement: Supplement | None = None) -> str:
    """What was simulated, with the effect plan and a table of the curves.

    Parameters
    ----------
    simulation : Simulation
    supplement : Supplement, optional
        Its lines stand after the plan.

    Returns
    -------
    str
        At most 100 columns; ends without a line feed.
    """
    alarms = [line for line in simulation.plan.lines if line.alarm]
    lines = []
    if alarms:
        names = ", ".join(line.title for line in alarms)
        them = "it matters" if len(alarms) == 1 else "they matter"
        lines += [*wrapped(f"LOOK  {names}: not computed, though {them} here. Details below.", 6), ""]
    lines += _head(simulation)
    accuracy = simulation.plan.accuracy
    lines += [
        "",
        f"  effects, for {', '.join(simulation.scene.observables)} to {accuracy:g} (angles in radians)",
    ]
    for line in simulation.plan.lines:
        lines += plan_text(line)
    lines += [f"  what is dropped as too small changes {_amount(simulation.plan.dropped)} together", ""]
    if supplement is not None:
        lines += [*supplement.lines, ""]
    lines += _curves(simulation)
    lines += [part for note in simulation.notes for part in wrapped(note, 8, "  note  ")]
    return "\n".join(line.rstrip() for line in lines).rstrip("\n")


def html(simulation: Simulation) -> str:
    """The summary as an HTML fragment for notebooks; what comes from data is escaped."""
    return f"<pre>{escape(summary(simulation))}</pre>"


def plan_text(line: PlanLine) -> list[str]:
    """One effect of the plan, wrapped.

    Returns
    -------
    list of str
        Such as ``off  adhesion  V_s/V = 0.0005 (above 0.045), would change e_n by 1e-07: too small``.
    """
    state = {"on": "on", "off": "off", "constant": "off", "refused": "off", "unknown": "-"}[line.state]
    start = f"  {'LOOK' if line.alarm else state:<5} {line.title:<16}"
    return wrapped(_finding(line), len(start), start)


def _finding(line: PlanLine) -> str:
    if line.criterion is None:
        return line.reason
    number = line.criterion
    side = "above" if number.above else "below"
    says = f"{number.symbol} = {_amount(number.value)} (acts {side} {_amount(number.threshold)}), "
    verb = "" if line.state == "on" else "would "
    if line.change is None or (line.state == "constant" and not line.alarm):
        return says + "; ".join(part for part in (line.reason, line.remark) if part)
    if line.change == 0.0:
        says += "changes nothing"
    elif math.isinf(line.change):
        says += f"{verb}{'decide' if verb else 'decides'} whether {line.observable} exists"
    else:
        says += f"{verb}{'change' if verb else 'changes'} {line.observable} by {_amount(line.change)}"
    # how good a law is matters where it is used, or missed
    remark = line.remark if line.state == "on" or line.alarm else ""
    parts = [part for part in (line.reason, remark) if part]
    return f"{says}: {'; '.join(parts)}" if parts else says


def _head(simulation: Simulation) -> list[str]:
    scene, outcome = simulation.scene, simulation.outcome
    count, captured = outcome.captured.size, int(outcome.captured.sum())
    sticking = int((outcome.sticking & ~outcome.captured).sum())
    what = f"{scene.name}   {scene.title}"
    bodies = " on ".join(part for part in (scene.body, scene.wall) if part)
    diameter = scene.conditions["diameter_m"]
    size = _length(diameter)
    speed = f"{quantity_text(scene.conditions['speed_m_s'])} m/s"
    lines = wrapped(what, 4)
    lines += wrapped(", ".join(part for part in (bodies, size, speed) if part), 4, "  ")
    constants = [f"{name} = {quantity_text(q)}" for name, q in scene.constants.items()]
    if scene.result is not None:
        constants = [f"posterior draws of {scene.result.name}"]
    law = f"closure {get_closure(simulation.closure).title}"
    if "compliance" in simulation.plan.on:
        law = "tangential compliance"
    lines += wrapped(f"{law}: {', '.join(constants)}", 4, "  ")
    counts = f"{sticking} stick, {count - sticking - captured} slide"
    if captured:
        counts += f", {captured} {'is' if captured == 1 else 'are'} captured"
    return [*lines, *wrapped(f"{count} impacts, simulated: {counts}", 4, "  ")]


def _length(diameter: Quantity) -> str:
    """A diameter in the unit that people would use."""
    size = diameter.numbers[0]
    divisor, unit = next(
        ((d, u) for d, u in ((1.0, "m"), (1e-3, "mm"), (1e-6, "um")) if size >= d), (1e-9, "nm")
    )
    spread = diameter.kind == "lognormal"
    numbers = tuple(n if spread and i else n / divisor for i, n in enumerate(diameter.numbers))
    return f"{quantity_text(replace(diameter, numbers=numbers))} {unit}"


def quantity_text(quantity: Quantity) -> str:
    """A value, a range or a distribution in a few characters."""
    numbers = [f"{number:.4g}" for number in quantity.numbers]
    if quantity.kind == "value":
        return numbers[0]
    if quantity.kind == "grid":
        return f"{numbers[0]} to {numbers[-1]}"
    first, second = numbers
    forms = {
        "normal": f"{first} +- {second}",
        "uniform": f"{first} to {second} (uniform)",
        "lognormal": f"{first} */ {second}",
    }
    return forms[quantity.kind]


def _curves(simulation: Simulation) -> list[str]:
    scene, table = simulation.scene, simulation.curves()
    if len(scene.axes) > 1 or simulation.points > MOST_ROWS:
        return [f"  {simulation.points} grid points: --out writes their tables and figure", ""]
    names = list(scene.observables)
    wide = {name: table[table["observable"] == name].reset_index(drop=True) for name in names}
    first = wide[names[0]]
    columns = [(axis, [f"{x:.6g}" for x in first[axis]]) for axis in scene.axes]
    columns += [(name, _column(wide[name])) for name in names]
    if first["captured"].any():
        columns.append(("captured", [f"{share:.0%}" for share in first["captured"]]))
    rows = zip(*([title, *cells] for title, cells in columns), strict=True)
    lines = aligned(list(rows), ">" * len(columns))
    bands = "  medians +- half of the 68 % band" if simulation.samples > 1 else ""
    return [*lines, *([bands] if bands else []), ""]


def _column(table: pd.DataFrame) -> list[str]:
    cells = []
    for value, low, high in table[["value", "lo68", "hi68"]].itertuples(index=False):
        half = 0.5 * (high - low)
        text = "-" if math.isnan(value) else f"{value:.4g}"
        cells.append(f"{text} +- {half:.2g}" if half > 0.0 and not math.isnan(value) else text)
    return cells


def _amount(number: float) -> str:
    return "infinite" if math.isinf(number) else f"{number:.2g}"
