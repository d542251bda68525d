"""`ifrfit export`: constants of a result as a simulator takes them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ifrfit.cli.options import Repeated, pairs
from ifrfit.cli.output import command


@command
def export(
    result: Annotated[Path, typer.Argument(metavar="RESULT.json")],
    to: Annotated[
        str, typer.Option(metavar="TARGET", help="Which simulator or language; any other word lists all.")
    ],
    draws: Annotated[
        int, typer.Option(metavar="N", min=0, help="Append a table of so many posterior draws.")
    ] = 0,
    angle: Annotated[
        float | None,
        typer.Option(metavar="DEG", help="Incidence angle at which openfoam and dynamo match."),
    ] = None,
    speed: Annotated[
        float | None,
        typer.Option(metavar="M_S", help="Normal speed at which mujoco, pybullet and drake match."),
    ] = None,
    fix: Annotated[
        Repeated,
        typer.Option(metavar="NAME=VALUE", help="Your value of a constant that is not determined."),
    ] = [],  # noqa: B006
    series: Annotated[str | None, typer.Option(metavar="NAME", help="Whose constants, if separate.")] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write there instead of to standard output.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an earlier export in FILE.")] = False,
    seed: Annotated[int, typer.Option(help="Seed of the draws.", min=0)] = 0,
) -> None:
    """Constants of a result as a simulator takes them, with what is lost on the way."""
    from ifrfit.exporters.export import export as run
    from ifrfit.exporters.export import write_export
    from ifrfit.exporters.registry import EXPORTERS
    from ifrfit.inference import load_result

    EXPORTERS[to]  # an unknown target is refused before the result is read
    own = pairs("--fix", fix, "NAME=VALUE")
    text = run(
        load_result(result), to, draws=draws, angle=angle, speed=speed, series=series, fix=own, seed=seed
    )
    if out is None:
        typer.echo(text, nl=False)
        return
    write_export(text, out, force=force)
    typer.echo(f"written: {out}")
