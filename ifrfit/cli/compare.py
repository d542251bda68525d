"""`ifrfit compare`: closures side by side on the same impacts."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ifrfit.cli.options import Repeated, SharedCommand, command_line
from ifrfit.cli.progress import working

if TYPE_CHECKING:
    from ifrfit.inference import Comparison

NOT_CONVERGED = 4


@partial(SharedCommand, closure=False)
def compare(
    question: dict[str, Any],
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
) -> None:
    """Closures side by side: which of them the data prefer."""
    from ifrfit.inference.comparison.compare import compare as run
    from ifrfit.report.comparison.folder import COMPARISON, write_comparison
    from ifrfit.report.folder import check_free

    if out is not None:
        check_free(out, force=force, of=COMPARISON)
    with working(quiet or as_json, "comparing"):
        found = run(closures=closure or None, loo=loo, command=command_line(), **question)
        written = write_comparison(found, out, force=force) if out is not None else []
    if as_json:
        typer.echo(_json(found), nl=False)
    elif not quiet:
        typer.echo(found.summary())
        if written:
            typer.echo(f"\nwritten: {out}/  {'  '.join(written)}")
    if strict:
        _insist(found)


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
