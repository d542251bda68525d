"""`ifrfit check`: what a file holds, before anything is fitted."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from ifrfit.cli.completion import completer
from ifrfit.cli.options import figure_conventions, offered_conventions
from ifrfit.cli.output import command, text_width
from ifrfit.cli.parameters import PATH, argument, option
from ifrfit.cli.track_options import given_of_tracks, refuse_given, track_options


@argument("file", type=PATH, metavar="FILE", help="A table, a sheet, a digitised figure, or tracks.")
@option("--x", metavar="HEADER", help="Of a figure: its x axis.")
@option("--y", metavar="HEADER", help="Of a figure: its y axis.")
@option("--axes", metavar="NAME", help="Of a figure: which axes.")
@option("--dataset", multiple=True, metavar="NAME", help="Of a figure: which dataset; repeatable.")
@option("--pixels", type=float, metavar="N", help="Of a figure: standard error of a click.")
@option("--bars", metavar="sigma|2sigma|95%", help="Of a figure: what half an error bar is.")
@option("--sheet", metavar="NAME", help="Of a spreadsheet: which sheet.")
@track_options
@option(
    "--convention",
    multiple=True,
    metavar="NAME=CHOICE",
    help="How a column is meant; 'ifrfit conventions' lists all.",
    complete=completer(offered_conventions),
)
@command
def check(
    file: Path,
    x: str | None,
    y: str | None,
    axes: str | None,
    dataset: list[str],
    pixels: float | None,
    bars: str | None,
    sheet: str | None,
    tracks: bool,
    convention: list[str],
    **about_tracks: Any,
) -> None:
    """What a file holds, how its columns are understood, what can be fitted from it, and what is missing."""
    from ifrfit.data.examination import examine

    of_figure = {"x": x, "y": y, "axes": axes, "dataset": dataset, "pixels": pixels, "bars": bars}
    of_tracks = given_of_tracks(tracks, **about_tracks)
    if of_tracks is not None:
        refuse_given(of_figure, "is about a figure, not about tracks. Leave it away")
    more = figure_conventions(**of_figure, sheet=sheet)
    found = examine(file, [*convention, *more], of_tracks)
    click.echo(found.file)
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
            click.echo(each)
