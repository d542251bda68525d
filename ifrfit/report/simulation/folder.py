"""The folder that holds a simulation: it appears whole or not at all."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ifrfit.inference.io import json_text
from ifrfit.report.atomic_folder import Contents, deliver
from ifrfit.report.simulation.figure import drawable, plot
from ifrfit.report.simulation.supplement import Supplement
from ifrfit.report.style import save_svg_and_png

if TYPE_CHECKING:
    from ifrfit.simulation.result import Simulation

TABLES = ("rebounds.csv", "impacts.csv")
FIGURES = ("simulation.svg", "simulation.png")
SUPPLEMENTS = ("cost.csv", "cost.svg", "cost.png")  # of an earlier run: they go with what they belong to
SIMULATION = Contents("simulation.json", (*TABLES, *FIGURES, *SUPPLEMENTS), "simulation")


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
