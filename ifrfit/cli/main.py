"""The command line: one thin function a command, each a call of the library.

Imports of the library stand inside the commands, so that ``--help`` answers at once.
"""

from __future__ import annotations

import contextlib
import ctypes
import sys
from pathlib import Path
from typing import Any

import click

from ifrfit._version import __version__
from ifrfit.cli.campaign import campaign
from ifrfit.cli.check import check
from ifrfit.cli.compare import compare
from ifrfit.cli.completion_script import completion_options
from ifrfit.cli.cost import cost
from ifrfit.cli.datasets import datasets
from ifrfit.cli.export import export
from ifrfit.cli.fit import fit
from ifrfit.cli.grouped_help import WIDEST, Command, Group, GroupedCommand
from ifrfit.cli.import_figure import import_figure
from ifrfit.cli.materials import materials
from ifrfit.cli.options import SharedCommand, numbers
from ifrfit.cli.output import command, said_of, status, text_width
from ifrfit.cli.parameters import DATA, MODEL, PATH, argument, flag, option
from ifrfit.cli.report import report
from ifrfit.cli.simulate import simulate
from ifrfit.cli.stop_signals import heed_termination, status_of_interrupt
from ifrfit.errors import UsageError

_SHARED: dict[str, SharedCommand] = {"fit": fit, "compare": compare, "campaign": campaign, "cost": cost}


class _Commands(Group):
    """Commands, of which those that put a question to data look their options up when they are asked for.

    The options come from the registries, which import a good part of the library and the packages that plug
    in: `ifrfit --help` lists the commands without them.
    """

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        """The command that is asked for, with its options."""
        name, found, rest = super().resolve_command(ctx, args)
        return name, _SHARED[name].made(name) if name in _SHARED else found, rest

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command that is asked for; stopped where nothing is kept, it leaves as stopped, too."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:  # of which click would make an error
            raise click.exceptions.Exit(status_of_interrupt()) from None

    def list_shared(self, name: str) -> None:
        """List one of them; `resolve_command` makes it."""
        self.add_command(Command(name, help=_SHARED[name].__doc__))


@click.group(
    cls=_Commands,
    no_args_is_help=True,
    context_settings=WIDEST,
)
@click.version_option(
    __version__, prog_name="ifrfit", message="%(prog)s %(version)s", help="Show the version."
)
@completion_options
def app() -> None:
    """Fit restitution and friction constants to measured impacts of spheres on walls."""


app.list_shared("fit")
app.list_shared("compare")
app.list_shared("campaign")


@app.command(cls=GroupedCommand)
@argument("result", type=PATH, metavar="RESULT.json", help="Of ifrfit fit.")
@option(
    "--gamma", required=True, metavar="DEG,...|FROM:TO:STEP", help="Incidence angles, degrees.", group=DATA
)
@option("--spin-x", type=float, default=0.0, metavar="S", help="R omega_x/u before.", group=DATA)
@option(
    "--spin-y",
    type=float,
    default=0.0,
    metavar="S",
    help="R omega_y/u before; back-spin is positive.",
    group=DATA,
)
@option(
    "--observable",
    multiple=True,
    metavar="NAME",
    help="What to predict.  [repeatable; default: what was fitted]",
)
@option(
    "--series",
    metavar="NAME",
    help="Whose constants and noise.  [default: those that all share]",
    group=MODEL,
)
@command
def predict(
    result: Path, gamma: str, spin_x: float, spin_y: float, observable: list[str], series: str | None
) -> None:
    """Values with credible and predictive intervals, as CSV."""
    import pandas as pd

    from ifrfit.inference import load_result

    angles = numbers("--gamma", gamma)
    if any(not 0.0 <= angle <= 90.0 for angle in angles):
        raise UsageError(f"--gamma {gamma}: incidence angles lie between 0 and 90 degrees from the normal.")
    found = load_result(result)
    requested = observable or list(dict.fromkeys(found.points["observable"])) or ["beta"]
    tables = []
    for name in requested:
        table = found.predict(angles, spin_x, spin_y, observable=name, series=series)
        table.insert(0, "observable", name)
        tables.append(table)
    for warning in dict.fromkeys(text for table in tables for text in table.attrs["warnings"]):
        click.echo(f"ifrfit: {warning}", err=True)
    click.echo(pd.concat(tables).to_csv(index=False, float_format="%.10g", lineterminator="\n"), nl=False)


app.command(cls=GroupedCommand)(report)
app.command()(export)


@app.command()
@flag("--raw", help="For velocities before and after.")
@command
def template(raw: bool) -> None:
    """A commented CSV to fill in."""
    from ifrfit.data import template_text

    click.echo(template_text(raw), nl=False)


@app.command()
@command
def conventions() -> None:
    """How tables may be written, and how to say it: --convention, with an example of each."""
    from ifrfit.data.convention_meanings import convention_lines

    for line in convention_lines(text_width()):
        click.echo(line)


@app.command()
@option("--out", type=PATH, default="figures", metavar="DIR", help="Where figures and table go.")
@option("--figure", multiple=True, metavar="NAME", help="Only this figure, as 5, 4a, A2.1 or kharaz.")
@flag("--digitised-only", help="Leave out what rests on stand-ins or on no data.")
@command
def reproduce(out: Path, figure: list[str], digitised_only: bool) -> None:
    """Redraw the paper's figures, and recover its constants."""
    from ifrfit.paper.reproduce import reproduce as run

    with status(False, "fitting and drawing") as shown:
        more = {} if shown is None else {"progress": shown.console.print}
        text = run(out, figures=figure, digitised_only=digitised_only, **more)
    click.echo(text, nl=False)


app.command(cls=GroupedCommand)(simulate)
app.list_shared("cost")
app.command("import")(import_figure)
app.command()(check)
app.add_command(datasets)
app.add_command(materials)


_TRIM, _MMAP = -1, -3  # M_TRIM_THRESHOLD and M_MMAP_THRESHOLD of glibc's malloc.h
_KEPT, _FROM_HEAP = 64 * 2**20, 4 * 2**20  # bytes


def keep_freed_memory() -> None:
    """Let the process keep memory that arrays leave: given back, each next one has its pages made anew.

    That is up to a quarter of the seconds of a fit. Of glibc alone; elsewhere nothing happens.
    """
    with contextlib.suppress(OSError, AttributeError):
        libc = ctypes.CDLL("libc.so.6")
        libc.mallopt(_TRIM, _KEPT)
        libc.mallopt(_MMAP, _FROM_HEAP)


def main() -> None:
    """Entry point."""
    keep_freed_memory()
    heed_termination()
    try:
        app()
    except OSError as error:  # of what click itself prints: help, the version
        if not (said := said_of(error)):
            raise
        sys.exit(said)
