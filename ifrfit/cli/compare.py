"""`ifrfit compare`: closures side by side on the same impacts."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ifrfit.cli.options import Repeated, choices_of, command_line, with_options_of
from ifrfit.cli.progress import working

if TYPE_CHECKING:
    from ifrfit.inference import Comparison

NOT_CONVERGED = 4
# declared with `fit`, which means the same by them
SCATTER = (
    "tails",
    "dof",
    "angle_errors",
    "angle_population",
    "sigma_gamma",
    "sigma_velocity",
    "sigma_spin",
)
SHARED = (
    "data",
    "fix",
    "prior",
    "bounds",
    "separate",
    "noise",
    "observable",
    "series",
    "gamma_min",
    "gamma_max",
    "speed_min",
    "speed_max",
    "exclude",
    "independent",
    *SCATTER,
    "inertia_factor",
    "convention",
    "scene",
    "seed",
)


def comparing(fit: Callable[..., None]) -> Callable[..., None]:
    """The command, with the options of `fit` that choose data and constants.

    Parameters
    ----------
    fit : callable
        The command `fit`.
    """

    def compare(
        closure: Annotated[
            Repeated, typer.Option(metavar="NAME", help="A closure to compare; by default all there are.")
        ] = [],  # noqa: B006
        loo: Annotated[
            bool, typer.Option("--loo/--no-loo", help="Cross-validate by leaving impacts out; slower.")
        ] = True,
        out: Annotated[
            Path | None, typer.Option(metavar="DIR", help="Write compare.json, .svg and .png there.")
        ] = None,
        force: Annotated[bool, typer.Option("--force", help="Replace an earlier comparison in DIR.")] = False,
        as_json: Annotated[
            bool, typer.Option("--json", help="compare.json on standard output, nothing else.")
        ] = False,
        quiet: Annotated[bool, typer.Option("--quiet", help="Say nothing but errors.")] = False,
        strict: Annotated[
            bool, typer.Option("--strict", help="Exit with 4 if an evidence did not converge.")
        ] = False,
        **chosen: Any,
    ) -> None:
        """Closures side by side: which of them the data prefer."""
        from ifrfit.inference.comparison.compare import compare as run
        from ifrfit.report.comparison.folder import COMPARISON, write_comparison
        from ifrfit.report.folder import check_free

        if out is not None:
            check_free(out, force=force, of=COMPARISON)
        choices = choices_of(chosen)
        with working(quiet or as_json, "comparing"):
            found = run(choices.pop("data"), closure or None, loo=loo, command=command_line(), **choices)
            written = write_comparison(found, out, force=force) if out is not None else []
        if as_json:
            typer.echo(_json(found), nl=False)
        elif not quiet:
            typer.echo(found.summary())
            if written:
                typer.echo(f"\nwritten: {out}/  {'  '.join(written)}")
        if strict:
            _insist(found)

    return with_options_of(fit, SHARED, compare)


def _json(comparison: Comparison) -> str:
    from ifrfit.inference.io.json_text import dumps

    return dumps(comparison.to_dict())


def _insist(comparison: Comparison) -> None:
    """Leave with status 4, saying why, unless the evidence of every closure converged."""
    facts = {name: entry.fit.facts["converged"] for name, entry in comparison.entries.items()}
    bad = [f"{name}: {fact.says}" for name, fact in facts.items() if not fact.ok]
    if bad:
        typer.echo(f"ifrfit: --strict: {'; '.join(bad)}.", err=True)
        raise typer.Exit(NOT_CONVERGED)
