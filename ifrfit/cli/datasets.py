"""`ifrfit datasets`: list, show, validate, install, remove."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ifrfit.cli.completion import complete_dataset, completer
from ifrfit.cli.grouped_help import DATA, GroupedCommand
from ifrfit.cli.options import Repeated, offered_conventions
from ifrfit.cli.output import command, fitting

Name = Annotated[
    str,
    typer.Argument(metavar="NAME", help="One of 'ifrfit datasets list'.", autocompletion=complete_dataset),
]
Convention = Annotated[
    Repeated,
    typer.Option(
        metavar="NAME=CHOICE",
        help="How a column is meant; 'ifrfit conventions' lists all.  [repeatable; default: none]",
        show_default=False,
        rich_help_panel=DATA,
        autocompletion=completer(offered_conventions),
    ),
]

datasets = typer.Typer(
    help="Bundled datasets, and your digitisations in their place.",
    no_args_is_help=True,
    rich_markup_mode=None,
)


@datasets.command("list", cls=GroupedCommand)
@command
def datasets_list() -> None:
    """Every dataset with its provenance."""
    from ifrfit.data.catalogue import listing
    from ifrfit.data.description import WIDTH, listing_lines

    for line in listing_lines(listing(), fitting(WIDTH)):
        typer.echo(line)


@datasets.command("show", cls=GroupedCommand)
@command
def datasets_show(name: Name) -> None:
    """What is known about a dataset: conditions, source, licence, rows, defaults, assumptions."""
    from ifrfit.data.description import WIDTH, describe

    for line in describe(name, fitting(WIDTH)):
        typer.echo(line)


@datasets.command("validate", cls=GroupedCommand)
@command
def datasets_validate(
    path: Annotated[str, typer.Argument(metavar="PATH", help="A CSV file or a dataset folder.")],
    convention: Convention = [],  # noqa: B006
) -> None:
    """Read a file or a dataset folder, and say what is in it."""
    from ifrfit.data import read
    from ifrfit.data.catalogue import load_folder

    folder = Path(path)
    found = load_folder(folder) if folder.is_dir() and not convention else read(path, convention=convention)
    table = found.table
    typer.echo(f"{path}: fine, {len(table)} rows")
    counts = table.value_counts(["series", "observable"], sort=False).reset_index(name="rows")
    for row in counts.itertuples():
        typer.echo(f"  {row.series}  {row.observable}  {row.rows}")
    for note in found.notes:
        typer.echo(f"  note  {note}")


@datasets.command("install", cls=GroupedCommand)
@command
def datasets_install(
    name: Name,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Your table.")],
    provenance: Annotated[
        str,
        typer.Option(
            metavar="WORD",
            help="Where rows do not say it: digitised, published or measured.",
            rich_help_panel=DATA,
        ),
    ] = "digitised",
    convention: Convention = [],  # noqa: B006
) -> None:
    """Put your own digitisation in the place of a bundled dataset."""
    from ifrfit.data.catalogue import install

    place = install(name, file, provenance=provenance, convention=convention)
    typer.echo(
        f"{name}: {file} is used from now on, kept in {place}. 'ifrfit datasets remove {name}' undoes it."
    )


@datasets.command("remove", cls=GroupedCommand)
@command
def datasets_remove(name: Name) -> None:
    """Take your digitisation away; the bundled dataset is back."""
    from ifrfit.data.catalogue import remove

    remove(name)
    typer.echo(f"{name}: the bundled dataset is used again.")
