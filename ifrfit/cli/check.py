"""`ifrfit check`: what a file holds, before anything is fitted."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from ifrfit.cli.completion import completer
from ifrfit.cli.options import Repeated, figure_conventions, offered_conventions
from ifrfit.cli.output import command, text_width
from ifrfit.cli.track_options import (
    Acceleration,
    Contact,
    Fps,
    Frames,
    IsTracks,
    PixelSize,
    Radius,
    given_of_tracks,
    refuse_given,
)


@command
def check(
    file: Annotated[Path, typer.Argument(help="A table, a sheet, a digitised figure, or tracks.")],
    x: Annotated[str | None, typer.Option("--x", metavar="HEADER", help="Of a figure: its x axis.")] = None,
    y: Annotated[str | None, typer.Option("--y", metavar="HEADER", help="Of a figure: its y axis.")] = None,
    axes: Annotated[str | None, typer.Option(metavar="NAME", help="Of a figure: which axes.")] = None,
    dataset: Annotated[
        Repeated, typer.Option(metavar="NAME", help="Of a figure: which dataset; repeatable.")
    ] = [],  # noqa: B006
    pixels: Annotated[
        float | None, typer.Option(metavar="N", help="Of a figure: standard error of a click.")
    ] = None,
    bars: Annotated[
        str | None, typer.Option(metavar="sigma|2sigma|95%", help="Of a figure: what half an error bar is.")
    ] = None,
    sheet: Annotated[str | None, typer.Option(metavar="NAME", help="Of a spreadsheet: which sheet.")] = None,
    tracks: IsTracks = False,
    fps: Fps = None,
    pixel: PixelSize = None,
    radius: Radius = None,
    contact: Contact = None,
    frames: Frames = None,
    acceleration: Acceleration = None,
    convention: Annotated[
        Repeated,
        typer.Option(
            metavar="NAME=CHOICE",
            help="How a column is meant; 'ifrfit conventions' lists all.",
            autocompletion=completer(offered_conventions),
        ),
    ] = [],  # noqa: B006
) -> None:
    """What a file holds, how its columns are understood, what can be fitted from it, and what is missing."""
    from ifrfit.data.examination import examine

    of_figure = {"x": x, "y": y, "axes": axes, "dataset": dataset, "pixels": pixels, "bars": bars}
    of_tracks = given_of_tracks(
        tracks,
        fps=fps,
        pixel=pixel,
        radius=radius,
        contact=contact,
        frames=frames,
        acceleration=acceleration,
    )
    if of_tracks is not None:
        refuse_given(of_figure, "is about a figure, not about tracks. Leave it away")
    more = figure_conventions(**of_figure, sheet=sheet)
    found = examine(file, [*convention, *more], of_tracks)
    typer.echo(found.file)
    for title, lines in (
        ("columns", found.columns),
        ("rows", found.rows),
        ("to fit", found.fits),
        ("missing", found.missing),
        ("notes", found.notes),
    ):
        _say(title, lines)


def _say(title: str, lines: Sequence[str]) -> None:
    for number, line in enumerate(lines):
        start = f"  {title if number == 0 else '':<9}"
        for each in textwrap.wrap(
            line, text_width(), initial_indent=start, subsequent_indent=" " * 13, break_long_words=False
        ):
            typer.echo(each)
