"""The command line: one thin function a command, each a call of the library.

Imports of the library stand inside the commands, so that ``--help`` answers at once.
"""

from __future__ import annotations

import contextlib
import ctypes
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup
from typer.main import get_command

from ifrfit._version import __version__
from ifrfit.cli.campaign import campaign
from ifrfit.cli.check import check
from ifrfit.cli.compare import compare
from ifrfit.cli.cost import cost
from ifrfit.cli.datasets import datasets
from ifrfit.cli.export import export
from ifrfit.cli.fit import fit
from ifrfit.cli.grouped_help import DATA, MODEL, WIDEST, GroupedCommand
from ifrfit.cli.import_figure import import_figure
from ifrfit.cli.materials import materials
from ifrfit.cli.options import Repeated, SharedCommand, numbers
from ifrfit.cli.output import command, status, text_width
from ifrfit.cli.report import report
from ifrfit.cli.simulate import simulate
from ifrfit.cli.stop_signals import heed_termination
from ifrfit.errors import UsageError

_SHARED: dict[str, SharedCommand] = {"fit": fit, "compare": compare, "campaign": campaign, "cost": cost}


class _Commands(TyperGroup):
    """Commands, of which those that put a question to data look their options up when they are asked for.

    The options come from the registries, which import a good part of the library and the packages that plug
    in: `ifrfit --help` lists the commands without them.
    """

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command that is asked for, with its options."""
        name, found, rest = super().resolve_command(ctx, args)
        if name in _SHARED:
            found = get_command(_alone(_SHARED[name]))
            found.name = name
        return name, found, rest


def _alone(shared: SharedCommand) -> typer.Typer:
    """One command as an application of its own."""
    made = typer.Typer(rich_markup_mode=None, pretty_exceptions_enable=False, add_completion=False)
    run: Any = command(shared)
    run.__signature__ = shared.__signature__  # once: typer would make it of all registries four times
    made.command(cls=GroupedCommand, context_settings=WIDEST)(run)
    return made


def _listed() -> None:
    """A command that is only listed; `_Commands` puts the real one in its place."""


app = typer.Typer(
    name="ifrfit",
    cls=_Commands,
    help="Fit restitution and friction constants to measured impacts of spheres on walls.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings=WIDEST,
)
app.add_typer(datasets, name="datasets")
app.add_typer(materials, name="materials")

app.command("fit", help=fit.__doc__)(_listed)
app.command("compare", help=compare.__doc__)(_listed)
app.command("campaign", help=campaign.__doc__)(_listed)


@app.command(cls=GroupedCommand)
@command
def predict(
    result: Annotated[Path, typer.Argument(metavar="RESULT.json", help="Of ifrfit fit.")],
    gamma: Annotated[
        str,
        typer.Option(metavar="DEG,...|FROM:TO:STEP", help="Incidence angles, degrees.", rich_help_panel=DATA),
    ],
    spin_x: Annotated[
        float, typer.Option(metavar="S", help="R omega_x/u before.", rich_help_panel=DATA)
    ] = 0.0,
    spin_y: Annotated[
        float,
        typer.Option(metavar="S", help="R omega_y/u before; back-spin is positive.", rich_help_panel=DATA),
    ] = 0.0,
    observable: Annotated[
        Repeated,
        typer.Option(
            metavar="NAME",
            help="What to predict.  [repeatable; default: what was fitted]",
            show_default=False,
        ),
    ] = [],  # noqa: B006
    series: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Whose constants and noise.  [default: those that all share]",
            rich_help_panel=MODEL,
        ),
    ] = None,
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
        typer.echo(f"ifrfit: {warning}", err=True)
    typer.echo(pd.concat(tables).to_csv(index=False, float_format="%.10g", lineterminator="\n"), nl=False)


app.command(cls=GroupedCommand)(command(report))
app.command()(export)


@app.command()
@command
def template(
    raw: Annotated[bool, typer.Option("--raw", help="For velocities before and after.")] = False,
) -> None:
    """A commented CSV to fill in."""
    from ifrfit.data import template_text

    typer.echo(template_text(raw), nl=False)


@app.command()
@command
def conventions() -> None:
    """How tables may be written, and how to say it: --convention, with an example of each."""
    from ifrfit.data.convention_meanings import convention_lines

    for line in convention_lines(text_width()):
        typer.echo(line)


@app.command()
@command
def reproduce(
    out: Annotated[Path, typer.Option(metavar="DIR", help="Where figures and table go.")] = Path("figures"),
    figure: Annotated[
        Repeated, typer.Option(metavar="NAME", help="Only this figure, as 5, 4a, A2.1 or kharaz.")
    ] = [],  # noqa: B006
    digitised_only: Annotated[
        bool, typer.Option("--digitised-only", help="Leave out what rests on stand-ins or on no data.")
    ] = False,
) -> None:
    """Redraw the paper's figures, and recover its constants."""
    from ifrfit.paper.reproduce import reproduce as run

    with status(False, "fitting and drawing") as shown:
        more = {} if shown is None else {"progress": shown.console.print}
        text = run(out, figures=figure, digitised_only=digitised_only, **more)
    typer.echo(text, nl=False)


app.command(cls=GroupedCommand)(simulate)
app.command("cost", help=cost.__doc__)(_listed)
app.command("import")(import_figure)
app.command()(check)


def _version(requested: bool) -> None:
    if requested:
        typer.echo(f"ifrfit {__version__}")
        raise typer.Exit


@app.callback()
def _main(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    pass


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
    app()
