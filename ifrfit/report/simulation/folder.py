"""The folder that holds a simulation: it appears whole or not at all."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

from ifrfit.cost.report.effect_costs import cost_dict, cost_table, plot_costs
from ifrfit.report.folder import Contents, check_free, deliver
from ifrfit.report.simulation.figure import drawable, plot
from ifrfit.report.style import save_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ifrfit.cost.effect_costs import EffectCosts
    from ifrfit.simulation.simulate import Simulation

TABLES = ("rebounds.csv", "impacts.csv")
FIGURES = ("simulation.svg", "simulation.png")
COST_TABLE = "cost.csv"
COST_FIGURES = ("cost.svg", "cost.png")
SIMULATION = Contents("simulation.json", (*TABLES, *FIGURES, COST_TABLE, *COST_FIGURES), "simulation")


def check_simulation_folder(out: Path) -> None:
    """Refuse a folder that holds an earlier simulation, before anything is computed.

    Raises
    ------
    UsageError
        As `ifrfit.report.folder.check_free`.
    """
    check_free(out, force=False, of=SIMULATION)


def write_simulation(
    simulation: Simulation, out: Path, *, force: bool, measured: EffectCosts | None = None
) -> list[str]:
    """Write simulation.json, rebounds.csv, impacts.csv and the figure.

    Parameters
    ----------
    simulation : Simulation
    out : Path
    force : bool
        Replace an earlier simulation.
    measured : EffectCosts, optional
        What its effects cost: cost.csv and its figure are written as well.

    Returns
    -------
    list of str
        Names of the files written.

    Raises
    ------
    UsageError
        If the folder holds an earlier one and `force` is not given, or nothing can be written there.
    """
    return deliver(lambda folder: _fill(simulation, folder, measured), Path(out), SIMULATION, force=force)


def dumps(simulation: Simulation, measured: EffectCosts | None = None) -> str:
    """simulation.json as text; what its effects cost is in it where that was measured."""
    content = simulation.to_dict() | ({} if measured is None else {"cost": cost_dict(measured)})
    return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _fill(simulation: Simulation, folder: Path, measured: EffectCosts | None) -> list[str]:
    text = dumps(simulation, measured)
    (folder / SIMULATION.record).write_text(text, encoding="utf-8", newline="\n")
    for name, table in zip(TABLES, (simulation.rebounds(), simulation.table()), strict=True):
        table.to_csv(folder / name, index=False, lineterminator="\n")
    names = [SIMULATION.record, *TABLES]
    if drawable(simulation):
        names += _save(plot(simulation), folder, FIGURES)
    if measured is not None:
        cost_table(measured).to_csv(
            folder / COST_TABLE, index=False, lineterminator="\n", float_format="%.6g"
        )
        title = f"{simulation.scene.title}: what each effect changes and costs"
        figure = plot_costs(measured, simulation.plan.accuracy, title)
        names += [COST_TABLE, *_save(figure, folder, COST_FIGURES)]
    return names


def _save(figure: Figure, folder: Path, names: tuple[str, ...]) -> tuple[str, ...]:
    for name in names:
        save_figure(figure, folder / name)
    return names
