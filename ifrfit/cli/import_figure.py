"""`ifrfit import`: points of a digitised figure, or tracks of a camera, as a table in the common schema."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ifrfit.cli.completion import completer
from ifrfit.cli.options import command_line, offered_conventions
from ifrfit.cli.output import command
from ifrfit.cli.parameters import PATH, argument, flag, option
from ifrfit.cli.track_options import given_of_tracks, refuse_given, track_options
from ifrfit.errors import UsageError

if TYPE_CHECKING:
    from ifrfit.data import Observations


@argument(
    "file",
    type=PATH,
    metavar="FILE",
    help="A project of WebPlotDigitizer (.json, .tar) or Engauge Digitizer (.dig), points as CSV, or tracks.",
)
@option("--x", metavar="HEADER", help="What the x axis is, as gamma_deg.")
@option("--y", metavar="HEADER", help="What the y axis is, as beta.")
@option("--axes", metavar="NAME", help="Which axes, where several have points.")
@option(
    "--dataset",
    multiple=True,
    metavar="NAME",
    help="Which dataset or curve; repeatable, by default all.",
)
@option(
    "--series",
    multiple=True,
    metavar="NAME",
    help="The series that each dataset is; repeatable, by default as the dataset.",
)
@option(
    "--pixels", type=float, metavar="N", help="Standard error of a click in each direction, by default 1."
)
@option(
    "--bars",
    metavar="sigma|2sigma|95%",
    help="What half an error bar is; by default bars are left out.",
)
@option(
    "--convention",
    multiple=True,
    metavar="NAME=CHOICE",
    help="How an axis is meant, as angle=from-wall; 'ifrfit conventions' lists all.",
    complete=completer(offered_conventions),
)
@track_options
@option("--out", type=PATH, metavar="FILE.csv", help="Write there; by default on standard output.")
@flag("--force", help="Replace FILE.csv.")
@command
def import_figure(
    file: Path,
    x: str | None,
    y: str | None,
    axes: str | None,
    dataset: list[str],
    series: list[str],
    pixels: float | None,
    bars: str | None,
    convention: list[str],
    tracks: bool,
    out: Path | None,
    force: bool,
    **about_tracks: Any,
) -> None:
    """Points of a figure, or tracks of a camera, as a table.

    See docs/how-to/digitise.md and docs/how-to/tracks.md.
    """
    from ifrfit.data.table_text import table_text, write_text

    of_figure = {
        "x": x,
        "y": y,
        "axes": axes,
        "dataset": dataset,
        "series": series,
        "pixels": pixels,
        "bars": bars,
    }
    of_tracks = given_of_tracks(tracks, **about_tracks)
    found = _read(file, of_figure, of_tracks, convention)
    source = found.sources[0]
    text = table_text(found, [f"made by {command_line()}", f"from {source.name}, SHA-256 {source.sha256}"])
    if out is None:
        click.echo(text, nl=False)
        return
    write_text(text, out, force=force)
    counts = found.table.groupby("series", sort=False)["impact_id"].agg(["size", "nunique"])
    words = [
        f"{impacts} impacts of {name}" if tracks else f"{size} points of {name}"
        for name, size, impacts in counts.itertuples()
    ]
    click.echo(f"{out}: {', '.join(words)}")
    for note in found.notes:
        click.echo(f"  note  {note}")
    if tracks:
        # a velocity that is wrong by chance turns the angle and the spin before impact, too
        click.echo(f"go on with: {shlex.join(['ifrfit', 'fit', str(out), '--angle-errors', 'effective'])}")


def _read(
    file: Path, of_figure: Mapping[str, Any], of_tracks: Mapping[str, Any] | None, convention: Sequence[str]
) -> Observations:
    """What a figure or a table of tracks says; options of the other are refused."""
    if of_tracks is None:
        from ifrfit.data.read_figure import read_figure

        lacking = next((key for key in ("x", "y") if of_figure[key] is None), None)
        if lacking is not None:
            raise UsageError(
                f"--{lacking}: say what the axes of the figure are, as --x gamma_deg --y beta; or, of "
                f"positions frame "
                "by frame, --tracks."
            )
        return read_figure(file, **of_figure, convention=convention)
    from ifrfit.data.read_tracks import read_tracks

    refuse_given(of_figure, "is about a figure, not about tracks. Leave it away")
    return read_tracks(file, **of_tracks, convention=convention)
