"""`ifrfit datasets`: list, show, validate, install, remove."""

from __future__ import annotations

from pathlib import Path

import click

from ifrfit.cli.completion import complete_dataset, completer
from ifrfit.cli.grouped_help import Group, GroupedCommand
from ifrfit.cli.options import offered_conventions
from ifrfit.cli.output import command, fitting
from ifrfit.cli.parameters import DATA, PATH, argument, option

name_argument = argument(
    "name", metavar="NAME", help="One of 'ifrfit datasets list'.", complete=complete_dataset
)
convention_option = option(
    "--convention",
    metavar="NAME=CHOICE",
    multiple=True,
    help="How a column is meant; 'ifrfit conventions' lists all.  [repeatable; default: none]",
    show_default=False,
    group=DATA,
    complete=completer(offered_conventions),
)

datasets = Group(
    "datasets",
    help="Bundled datasets, and your digitisations in their place.",
    no_args_is_help=True,
)


@datasets.command("list", cls=GroupedCommand)
@command
def datasets_list() -> None:
    """Every dataset with its provenance."""
    from ifrfit.data.catalogue import listing
    from ifrfit.data.description import WIDTH, listing_lines

    for line in listing_lines(listing(), fitting(WIDTH)):
        click.echo(line)


@datasets.command("show", cls=GroupedCommand)
@name_argument
@command
def datasets_show(name: str) -> None:
    """What is known about a dataset: conditions, source, licence, rows, defaults, assumptions."""
    from ifrfit.data.description import WIDTH, describe

    for line in describe(name, fitting(WIDTH)):
        click.echo(line)


@datasets.command("validate", cls=GroupedCommand)
@argument("path", metavar="PATH", help="A CSV file or a dataset folder.")
@convention_option
@command
def datasets_validate(path: str, convention: list[str]) -> None:
    """Read a file or a dataset folder, and say what is in it."""
    from ifrfit.data import read
    from ifrfit.data.catalogue import load_folder

    folder = Path(path)
    found = load_folder(folder) if folder.is_dir() and not convention else read(path, convention=convention)
    table = found.table
    click.echo(f"{path}: fine, {len(table)} rows")
    counts = table.value_counts(["series", "observable"], sort=False).reset_index(name="rows")
    for row in counts.itertuples():
        click.echo(f"  {row.series}  {row.observable}  {row.rows}")
    for note in found.notes:
        click.echo(f"  note  {note}")


@datasets.command("install", cls=GroupedCommand)
@name_argument
@argument("file", type=PATH, metavar="FILE", help="Your table.")
@option(
    "--provenance",
    metavar="WORD",
    default="digitised",
    help="Where rows do not say it: digitised, published or measured.",
    group=DATA,
)
@convention_option
@command
def datasets_install(name: str, file: Path, provenance: str, convention: list[str]) -> None:
    """Put your own digitisation in the place of a bundled dataset."""
    from ifrfit.data.catalogue import install

    place = install(name, file, provenance=provenance, convention=convention)
    click.echo(
        f"{name}: {file} is used from now on, kept in {place}. 'ifrfit datasets remove {name}' undoes it."
    )


@datasets.command("remove", cls=GroupedCommand)
@name_argument
@command
def datasets_remove(name: str) -> None:
    """Take your digitisation away; the bundled dataset is back."""
    from ifrfit.data.catalogue import remove

    remove(name)
    click.echo(f"{name}: the bundled dataset is used again.")
