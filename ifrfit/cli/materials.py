"""`ifrfit materials`: published constants of pairs of materials."""

from __future__ import annotations

import click

from ifrfit.cli.grouped_help import Group
from ifrfit.cli.output import command
from ifrfit.cli.parameters import argument

materials = Group(
    "materials",
    help="Published constants of pairs of materials, for --prior-from.",
    no_args_is_help=True,
)


@materials.command("list")
@command
def materials_list() -> None:
    """Every pair with its printed constants."""
    from ifrfit.data.materials import all_pairs

    pairs = all_pairs()
    width = max(len(each.name) for each in pairs)
    for each in pairs:
        click.echo(f"{each.name:{width}}  {each.geometry:13}  {each.words}")


@materials.command("show")
@argument("name", metavar="BODY/OTHER", help="Bodies in either order.")
@command
def materials_show(name: str) -> None:
    """One pair: geometry, size, constants with printed errors, source."""
    from ifrfit.data.materials import find_pair

    pair = find_pair(name)
    click.echo(f"{pair.name}: {pair.geometry}, {pair.diameter_mm:g} mm, provenance {pair.provenance}")
    for constant, (value, error) in pair.values.items():
        none = "  (a printed error of 0 is no prior)" if error == 0.0 else ""
        click.echo(f"  {constant:5}  {value:g} +- {error:g}{none}")
    click.echo(f"  source: {pair.source}")
