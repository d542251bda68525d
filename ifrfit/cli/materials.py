"""`ifrfit materials`: published constants of pairs of materials."""

from __future__ import annotations

from typing import Annotated

import typer

from ifrfit.cli.output import command

materials = typer.Typer(
    help="Published constants of pairs of materials, for --prior-from.",
    no_args_is_help=True,
    rich_markup_mode=None,
)


@materials.command("list")
@command
def materials_list() -> None:
    """Every pair with its printed constants."""
    from ifrfit.data.materials import all_pairs

    pairs = all_pairs()
    width = max(len(each.name) for each in pairs)
    for each in pairs:
        typer.echo(f"{each.name:{width}}  {each.geometry:13}  {each.words}")


@materials.command("show")
@command
def materials_show(
    name: Annotated[str, typer.Argument(metavar="BODY/OTHER", help="Bodies in either order.")],
) -> None:
    """One pair: geometry, size, constants with printed errors, source."""
    from ifrfit.data.materials import find_pair

    pair = find_pair(name)
    typer.echo(f"{pair.name}: {pair.geometry}, {pair.diameter_mm:g} mm, provenance {pair.provenance}")
    for constant, (value, error) in pair.values.items():
        none = "  (a printed error of 0 is no prior)" if error == 0.0 else ""
        typer.echo(f"  {constant:5}  {value:g} +- {error:g}{none}")
    typer.echo(f"  source: {pair.source}")
