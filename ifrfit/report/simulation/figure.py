"""The figure of a simulation, and the folder that holds it, with what a layer above adds to it.

Curves with bands, a map, or the spread of single impacts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ifrfit.errors import UsageError
from ifrfit.inference.io import json_text
from ifrfit.report import style
from ifrfit.report.atomic_folder import Contents, deliver
from ifrfit.report.figures import MOST_COLUMNS
from ifrfit.report.panels import Band, Curve, Pen, axis_label, draw_curve, numbers
from ifrfit.report.style import save_svg_and_png
from ifrfit.simulation.simulate import conditions, observed

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ifrfit.simulation.simulate import Simulation

STAND_IN = "STAND-IN"
MOST_CURVES = 5  # more values of a second condition make a map
_LABELS = {
    "gamma_deg": "incidence angle γ (deg)",
    "speed_m_s": "incoming speed (m/s)",
    "spin_x": "$R\\omega_x/u$",
    "spin_y": "$R\\omega_y/u$",
    "diameter_m": "diameter (m)",
}
_RATES = {"spin_x": "$\\omega_x$ (rad/s)", "spin_y": "$\\omega_y$ (rad/s)"}
TABLES = ("rebounds.csv", "impacts.csv")
FIGURES = ("simulation.svg", "simulation.png")
SUPPLEMENTS = ("cost.csv", "cost.svg", "cost.png")  # of an earlier run: they go with what they belong to
SIMULATION = Contents("simulation.json", (*TABLES, *FIGURES, *SUPPLEMENTS), "simulation")


def drawable(simulation: Simulation) -> bool:
    """Whether there is more than one impact."""
    return simulation.points * simulation.samples > 1


def plot(simulation: Simulation) -> Figure:
    """Figure of a simulation; one panel an observable.

    Parameters
    ----------
    simulation : Simulation

    Returns
    -------
    matplotlib.figure.Figure
        85 mm wide a panel, not known to pyplot. One condition over a grid gives curves with 68 and 95 %
        bands, two give several curves or maps, none gives points over the angle or histograms.

    Raises
    ------
    UsageError
        If the simulation is of a single impact.
    """
    if not drawable(simulation):
        raise UsageError("One impact makes no figure: give a condition a range or a distribution.")
    names = simulation.scene.observables
    columns = min(len(names), MOST_COLUMNS)
    rows = math.ceil(len(names) / columns)
    width_mm = columns * style.PANEL_WIDTH_MM
    with style.drawing():
        title = _title(simulation, width_mm)
        height = 2.5 * rows + 0.17 * (title.count("\n") + 1)
        figure = style.new_figure(width_mm, height, "constrained")
        for number, name in enumerate(names):
            axes = figure.add_subplot(rows, columns, number + 1)
            _panel(figure, axes, simulation, name)
        figure.suptitle(title, fontsize=8.0)
        style.fix_layout(figure)
    return figure


def _title(simulation: Simulation, width_mm: float) -> str:
    on = [line.title for line in simulation.plan.lines if line.state == "on"]
    effects = f"with {', '.join(on)}" if on else "constant coefficients only"
    missed = [line.title for line in simulation.plan.lines if line.alarm]
    sentences = [f"{simulation.scene.title}: simulated, {effects}"]
    sentences += [note for note in simulation.notes if STAND_IN in note]
    sentences += [f"LOOK: {', '.join(missed)} would matter, but is not computed"] if missed else []
    return "\n".join(style.filled(sentence, width_mm) for sentence in sentences)


def _panel(figure: Figure, axes: Axes, simulation: Simulation, name: str) -> None:
    grid = simulation.scene.axes
    if not grid:
        _spread(axes, simulation, name)
        return
    table = simulation.curves()
    table = table[table["observable"] == name]
    if len(grid) == 1:
        _curve(axes, table, grid[0], style.series_styles([""])[""], "")
    else:
        few = sorted(grid, key=lambda axis: table[axis].nunique())
        x, other = (few[1], few[0]) if table[few[0]].nunique() <= MOST_CURVES else (grid[0], grid[1])
        if table[other].nunique() <= MOST_CURVES:
            values = sorted(table[other].unique())
            series_styles = style.series_styles([f"{value:.4g}" for value in values])
            for value in values:
                label = f"{value:.4g}"
                _curve(axes, table[table[other] == value], x, series_styles[label], label)
            axes.legend(title=_label(simulation, other), fontsize=6.5, title_fontsize=6.5)
        else:
            _map(figure, axes, simulation, table, x, other, name)
            return
        grid = (x,)
    _x_axis(axes, simulation, grid[0], table[grid[0]].to_numpy())
    axes.set_ylabel(axis_label(name))


def _label(simulation: Simulation, axis: str) -> str:
    rates = _RATES if simulation.scene.spin_unit else {}
    return rates.get(axis, _LABELS[axis])


def _x_axis(axes: Axes, simulation: Simulation, axis: str, x: np.ndarray) -> None:
    axes.set_xlabel(_label(simulation, axis))
    if axis == "gamma_deg" and np.max(x) > 45.0:
        axes.set_xlim(0.0, 90.0)
        axes.set_xticks(range(0, 91, 15))
    elif axis in ("speed_m_s", "diameter_m") and np.max(x) > 20.0 * np.min(x):
        axes.set_xscale("log")


def _curve(axes: Axes, table: pd.DataFrame, x: str, series_style: style.SeriesStyle, label: str) -> None:
    at, value = numbers(table, x, "value")
    pen = Pen(series_style.colour, series_style.line)
    bands = Band.of(table) if table["lo95"].notna().any() else None
    draw_curve(axes, Curve("simulated", label, at, value, pen, bands))
    if at.size <= 40:
        axes.plot(at, value, series_style.marker, color=series_style.colour, markersize=2.5)
    mostly = table["captured"].to_numpy() > 0.5
    if mostly.any() and not label:
        low, high = at[mostly].min(), at[mostly].max()
        axes.axvspan(low, high, color=style.GREY, alpha=0.12, linewidth=0.0)
        axes.text(
            0.5 * (low + high),
            0.97,
            "captured",
            transform=axes.get_xaxis_transform(),
            ha="center",
            va="top",
            rotation=90 if mostly.sum() < 0.3 * at.size else 0,
            fontsize=6.5,
            color=style.GREY,
        )


def _map(
    figure: Figure, axes: Axes, simulation: Simulation, table: pd.DataFrame, x: str, y: str, name: str
) -> None:
    wide = table.pivot(index=y, columns=x, values="value")
    mesh = axes.pcolormesh(wide.columns, wide.index, wide.to_numpy(), shading="nearest", cmap="cividis")
    figure.colorbar(mesh, ax=axes, label=axis_label(name))
    axes.set_xlabel(_label(simulation, x))
    axes.set_ylabel(_label(simulation, y))


def _spread(axes: Axes, simulation: Simulation, name: str) -> None:
    value = observed(simulation, name)
    there = np.isfinite(value)
    gamma = conditions(simulation)["gamma_deg"]
    if np.ptp(gamma) > 0.0:
        axes.plot(gamma[there], value[there], ".", markersize=2.0, color=style.COLOURS[0], alpha=0.5)
        _x_axis(axes, simulation, "gamma_deg", gamma)
        axes.set_ylabel(axis_label(name))
        return
    axes.hist(value[there], bins="sqrt", color=style.COLOURS[0])
    axes.set_xlabel(axis_label(name))
    axes.set_ylabel("impacts")


@dataclass(frozen=True)
class Supplement:
    """Lines, content and files beside those of the simulation itself.

    Attributes
    ----------
    lines : sequence of str
        For the terminal, after the plan of the effects.
    content : mapping
        Further keys of simulation.json.
    write : callable
        Writes its files into a folder and returns their names.
    """

    lines: Sequence[str]
    content: Mapping[str, Any]
    write: Callable[[Path], list[str]]


def write_simulation(
    simulation: Simulation, out: Path, *, force: bool, supplement: Supplement | None = None
) -> list[str]:
    """Write simulation.json, rebounds.csv, impacts.csv and the figure.

    Parameters
    ----------
    simulation : Simulation
    out : Path
    force : bool
        Replace an earlier simulation.
    supplement : Supplement, optional
        Its content and files are written as well.

    Returns
    -------
    list of str
        Names of the files written.

    Raises
    ------
    UsageError
        If the folder holds an earlier one and `force` is not given, or nothing can be written there.
    """
    return deliver(lambda folder: _fill(simulation, folder, supplement), Path(out), SIMULATION, force=force)


def dumps(simulation: Simulation, supplement: Supplement | None = None) -> str:
    """simulation.json as text, with the content of the supplement."""
    content = simulation.to_dict() | dict({} if supplement is None else supplement.content)
    return json_text.dumps(content)


def _fill(simulation: Simulation, folder: Path, supplement: Supplement | None) -> list[str]:
    text = dumps(simulation, supplement)
    (folder / SIMULATION.record).write_text(text, encoding="utf-8", newline="\n")
    for name, table in zip(TABLES, (simulation.rebounds(), simulation.table()), strict=True):
        table.to_csv(folder / name, index=False, lineterminator="\n")
    names = [SIMULATION.record, *TABLES]
    if drawable(simulation):
        names += save_svg_and_png(plot(simulation), folder, "simulation")
    return names if supplement is None else [*names, *supplement.write(folder)]
