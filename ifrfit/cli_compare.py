"""`ifrfit compare`: closures side by side on the same impacts."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from ifrfit.cli_options import Repeated, command_line, ends, pairs
from ifrfit.cli_progress import working

if TYPE_CHECKING:
    from ifrfit.inference import Comparison

NOT_CONVERGED = 4
# declared with `fit`, which means the same by them
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
    "tails",
    "dof",
    "angle_errors",
    "angle_population",
    "sigma_gamma",
    "sigma_velocity",
    "sigma_spin",
    "inertia_factor",
    "convention",
    "scene",
    "seed",
)
_PAIRS = {"fix": "NAME=VALUE", "prior": "NAME=MEAN,SD", "bounds": "NAME=LO,HI"}


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
        from ifrfit.inference import compare as run
        from ifrfit.report.comparison_folder import COMPARISON, write_comparison
        from ifrfit.report.folder import check_free

        if out is not None:
            check_free(out, force=force, of=COMPARISON)
        choices: dict[str, Any] = {
            name: pairs(f"--{name}", value, _PAIRS[name]) if name in _PAIRS else value
            for name, value in chosen.items()
        }
        choices["angle_population"] = ends("--angle-population", choices["angle_population"])
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

    return _with_options_of(fit, compare)


def _json(comparison: Comparison) -> str:
    from ifrfit.inference.comparison.serialise import dumps

    return dumps(comparison)


def _insist(comparison: Comparison) -> None:
    """Leave with status 4, saying why, unless the evidence of every closure converged."""
    facts = {name: entry.fit.facts["converged"] for name, entry in comparison.entries.items()}
    bad = [f"{name}: {fact.says}" for name, fact in facts.items() if not fact.ok]
    if bad:
        typer.echo(f"ifrfit: --strict: {'; '.join(bad)}.", err=True)
        raise typer.Exit(NOT_CONVERGED)


def _with_options_of(model: Callable[..., None], own: Callable[..., None]) -> Callable[..., None]:
    """Put the shared options of one command before another's own, in the place of its keywords."""
    found = []
    for function, names in ((model, SHARED), (own, None)):
        hints = get_type_hints(inspect.unwrap(function), include_extras=True)
        parameters = inspect.signature(function).parameters
        for name in names or parameters:
            if parameters[name].kind is not inspect.Parameter.VAR_KEYWORD:
                kind = inspect.Parameter.KEYWORD_ONLY
                found.append(parameters[name].replace(annotation=hints[name], kind=kind))
    own.__signature__ = inspect.Signature(found)  # type: ignore[attr-defined]
    own.__annotations__ = {parameter.name: parameter.annotation for parameter in found}
    return own
