"""`ifrfit simulate`: rebounds of a scene, with only the effects that it calls for."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from ifrfit.cli.output import command, of_width, quiet_option, say, working
from ifrfit.cli.parameters import METHOD, NOT_NEGATIVE, PATH, argument, flag, option

if TYPE_CHECKING:
    from ifrfit.report.simulation.figure import Supplement


@argument("scene", type=PATH, metavar="SCENE.toml", help="See docs/scenes/README.md.")
@option(
    "--samples",
    type=int,
    metavar="N",
    help="Impacts at each grid point.  [default: 200 where anything is drawn, else 1]",
    group=METHOD,
)
@option(
    "--out",
    type=PATH,
    metavar="DIR",
    help="Write simulation.json, rebounds.csv, impacts.csv and the figure there.",
)
@flag("--force", help="Replace an earlier simulation in DIR.")
@flag("--json", "as_json", help="simulation.json on standard output, nothing else.")
@flag("--cost", help="Measure what each effect adds to the time of an impact.")
@option(
    "--seed",
    type=NOT_NEGATIVE,
    default=0,
    metavar="N",
    help="Seed of everything that is drawn.",
    group=METHOD,
)
@quiet_option
@command
def simulate(
    scene: Path,
    samples: int | None,
    out: Path | None,
    force: bool,
    as_json: bool,
    cost: bool,
    seed: int,
    quiet: bool,
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

        click.echo(dumps(found, costs), nl=False)
    elif not quiet:
        from ifrfit.report.simulation.text import summary

        say(of_width(lambda: summary(found, costs)), out, written, before)
