"""`ifrfit import`: the points of a digitised figure as a table in the common schema."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ifrfit.cli.completion import completer
from ifrfit.cli.options import Repeated, command_line, offered_conventions
from ifrfit.cli.output import command


@command
def import_figure(
    file: Annotated[
        Path,
        typer.Argument(
            help="A project of WebPlotDigitizer (.json, .tar) or Engauge Digitizer (.dig), or points as CSV."
        ),
    ],
    x: Annotated[str, typer.Option("--x", metavar="HEADER", help="What the x axis is, as gamma_deg.")],
    y: Annotated[str, typer.Option("--y", metavar="HEADER", help="What the y axis is, as beta.")],
    axes: Annotated[
        str | None, typer.Option(metavar="NAME", help="Which axes, where several have points.")
    ] = None,
    dataset: Annotated[
        Repeated, typer.Option(metavar="NAME", help="Which dataset or curve; repeatable, by default all.")
    ] = [],  # noqa: B006
    series: Annotated[
        Repeated,
        typer.Option(
            metavar="NAME", help="The series that each dataset is; repeatable, by default as the dataset."
        ),
    ] = [],  # noqa: B006
    pixels: Annotated[
        float | None,
        typer.Option(metavar="N", help="Standard error of a click in each direction, by default 1."),
    ] = None,
    convention: Annotated[
        Repeated,
        typer.Option(
            metavar="NAME=CHOICE",
            help="How an axis is meant, as angle=from-wall; 'ifrfit conventions' lists all.",
            autocompletion=completer(offered_conventions),
        ),
    ] = [],  # noqa: B006
    out: Annotated[
        Path | None, typer.Option(metavar="FILE.csv", help="Write there; by default on standard output.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace FILE.csv.")] = False,
) -> None:
    """The points of a digitised figure as a table, with the errors of reading (docs/how-to/digitise.md)."""
    from ifrfit.data.read_figure import read_figure
    from ifrfit.data.table_text import table_text, write_text

    found = read_figure(
        file, x=x, y=y, axes=axes, dataset=dataset, series=series, pixels=pixels, convention=convention
    )
    source = found.sources[0]
    text = table_text(found, [f"made by {command_line()}", f"from {source.name}, SHA-256 {source.sha256}"])
    if out is None:
        typer.echo(text, nl=False)
        return
    write_text(text, out, force=force)
    counts = found.table.groupby("series", sort=False).size()
    typer.echo(f"{out}: {', '.join(f'{n} points of {name}' for name, n in counts.items())}")
    for note in found.notes:
        typer.echo(f"  note  {note}")
