"""`ifrfit simulate`: rebounds of a scene, with only the effects that it calls for."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ifrfit.cli.grouped_help import METHOD
from ifrfit.cli.output import Quiet, command, of_width, say, working

if TYPE_CHECKING:
    from ifrfit.report.simulation.figure import Supplement


@command
def simulate(
    scene: Annotated[Path, typer.Argument(metavar="SCENE.toml", help="See docs/scenes/README.md.")],
    samples: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help="Impacts at each grid point.  [default: 200 where anything is drawn, else 1]",
            rich_help_panel=METHOD,
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Write simulation.json, rebounds.csv, impacts.csv and the figure there."
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an earlier simulation in DIR.")] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="simulation.json on standard output, nothing else.")
    ] = False,
    cost: Annotated[
        bool, typer.Option("--cost", help="Measure what each effect adds to the time of an impact.")
    ] = False,
    seed: Annotated[
        int,
        typer.Option(metavar="N", help="Seed of everything that is drawn.", min=0, rich_help_panel=METHOD),
    ] = 0,
    quiet: Quiet = False,
) -> None:
    """Rebounds of a scene, with only the effects that it calls for."""
    from ifrfit.simulation.simulate import simulate as run

    before = ""
    if out is not None:
        from ifrfit.report.atomic_folder import check_free, standing
        from ifrfit.report.simulation.figure import SIMULATION

        check_free(out, force=force, of=SIMULATION)
        before = standing(out, SIMULATION)
    costs: Supplement | None = None
    written: list[str] = []
    with working(quiet or as_json, "simulating"):
        found = run(scene, samples=samples, seed=seed)
        if cost:
            from ifrfit.cost.effect_costs import effect_costs, supplement

            costs = supplement(effect_costs(found.contact, found.impacts, found.plan), found)
        if out is not None:
            from ifrfit.report.simulation.figure import write_simulation

            written = write_simulation(found, out, force=force, supplement=costs)
    if as_json:
        from ifrfit.report.simulation.figure import dumps

        typer.echo(dumps(found, costs), nl=False)
    elif not quiet:
        from ifrfit.report.simulation.text import summary

        say(of_width(lambda: summary(found, costs)), out, written, before)
