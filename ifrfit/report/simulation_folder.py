"""The folder that holds a simulation: it appears whole or not at all."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

from ifrfit.report.folder import Contents, check_free, deliver
from ifrfit.report.simulation_figure import drawable, plot
from ifrfit.report.style import save_figure

if TYPE_CHECKING:
    from ifrfit.inference.simulation import Simulation

TABLES = ("rebounds.csv", "impacts.csv")
FIGURES = ("simulation.svg", "simulation.png")
SIMULATION = Contents("simulation.json", (*TABLES, *FIGURES), "simulation")


def check_simulation_folder(out: Path) -> None:
    """Refuse a folder that holds an earlier simulation, before anything is computed.

    Raises
    ------
    UsageError
        As `ifrfit.report.folder.check_free`.
    """
    check_free(out, force=False, of=SIMULATION)


def write_simulation(simulation: Simulation, out: Path, *, force: bool) -> list[str]:
    """Write simulation.json, rebounds.csv, impacts.csv and the figure.

    Parameters
    ----------
    simulation : Simulation
    out : Path
    force : bool
        Replace an earlier simulation.

    Returns
    -------
    list of str
        Names of the files written.

    Raises
    ------
    UsageError
        If the folder holds an earlier one and `force` is not given, or nothing can be written there.
    """
    return deliver(lambda folder: _fill(simulation, folder), Path(out), SIMULATION, force=force)


def dumps(simulation: Simulation) -> str:
    """simulation.json as text."""
    return json.dumps(simulation.to_dict(), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _fill(simulation: Simulation, folder: Path) -> list[str]:
    (folder / SIMULATION.record).write_text(dumps(simulation), encoding="utf-8", newline="\n")
    for name, table in zip(TABLES, (simulation.rebounds(), simulation.table()), strict=True):
        table.to_csv(folder / name, index=False, lineterminator="\n")
    names = [SIMULATION.record, *TABLES]
    if drawable(simulation):
        figure = plot(simulation)
        for name in FIGURES:
            save_figure(figure, folder / name)
            names.append(name)
    return names
