"""`ifrfit export`: constants of a result as a simulator takes them."""

from __future__ import annotations

from pathlib import Path

import click

from ifrfit.cli.options import pairs
from ifrfit.cli.output import command
from ifrfit.cli.parameters import NOT_NEGATIVE, PATH, argument, flag, option


@argument("result", type=PATH, metavar="RESULT.json", help="Of ifrfit fit.")
@option(
    "--to", required=True, metavar="TARGET", help="Which simulator or language; any other word lists all."
)
@option(
    "--draws", type=NOT_NEGATIVE, default=0, metavar="N", help="Append a table of so many posterior draws."
)
@option("--angle", type=float, metavar="DEG", help="Incidence angle at which openfoam and dynamo match.")
@option("--speed", type=float, metavar="M_S", help="Normal speed at which mujoco, pybullet and drake match.")
@option("--fix", multiple=True, metavar="NAME=VALUE", help="Your value of a constant that is not determined.")
@option("--series", metavar="NAME", help="Whose constants, if separate.")
@option("--out", type=PATH, metavar="FILE", help="Write there instead of to standard output.")
@flag("--force", help="Replace an earlier export in FILE.")
@option("--seed", type=NOT_NEGATIVE, default=0, metavar="N", help="Seed of the draws.")
@command
def export(
    result: Path,
    to: str,
    draws: int,
    angle: float | None,
    speed: float | None,
    fix: list[str],
    series: str | None,
    out: Path | None,
    force: bool,
    seed: int,
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
        click.echo(text, nl=False)
        return
    write_export(text, out, force=force)
    click.echo(f"written: {out}")
