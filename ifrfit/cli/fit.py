"""`ifrfit fit`: one set of constants from tables of impacts."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ifrfit.cli.options import Data, Repeated, command_line, ends, pairs
from ifrfit.cli.progress import working
from ifrfit.errors import UsageError

if TYPE_CHECKING:
    from ifrfit.inference import FitResult

NOT_DETERMINED = 4


def fit(
    data: Data,
    closure: Annotated[str, typer.Option(help="ifr, fr, f, ifr-contact or maw.")] = "ifr",
    method: Annotated[
        str | None,
        typer.Option(
            show_default=False,
            help="exact (the default): the posterior; lsq: least squares; profile: profile likelihood; "
            "mcmc: Markov chains; bootstrap: fits of experiments drawn anew.",
        ),
    ] = None,
    fix: Annotated[Repeated, typer.Option(metavar="NAME=VALUE", help="A constant that you know.")] = [],  # noqa: B006
    prior: Annotated[
        Repeated, typer.Option(metavar="NAME=MEAN,SD", help="A constant that you measured before.")
    ] = [],  # noqa: B006
    bounds: Annotated[
        Repeated, typer.Option(metavar="NAME=LO,HI", help="Bounds in the place of the physical ones.")
    ] = [],  # noqa: B006
    separate: Annotated[
        Repeated, typer.Option(metavar="NAME", help="This constant has a value of its own in each series.")
    ] = [],  # noqa: B006
    noise: Annotated[
        str | None, typer.Option(help="What sigma means: known, scaled or unknown.", show_default=False)
    ] = None,
    observable: Annotated[Repeated, typer.Option(metavar="NAME", help="Use only this observable.")] = [],  # noqa: B006
    series: Annotated[Repeated, typer.Option(metavar="NAME", help="Use only this series.")] = [],  # noqa: B006
    gamma_min: Annotated[
        float | None, typer.Option(metavar="DEG", help="Use only impacts at this angle or more.")
    ] = None,
    gamma_max: Annotated[
        float | None, typer.Option(metavar="DEG", help="Use only impacts at this angle or less.")
    ] = None,
    speed_min: Annotated[
        float | None, typer.Option(metavar="M_S", help="Use only impacts at this speed or more.")
    ] = None,
    speed_max: Annotated[
        float | None, typer.Option(metavar="M_S", help="Use only impacts at this speed or less.")
    ] = None,
    exclude: Annotated[
        Repeated,
        typer.Option(metavar="ROW|ID", help="Leave out a line of the file, FILE:LINE, or an impact."),
    ] = [],  # noqa: B006
    independent: Annotated[
        bool, typer.Option("--independent", help="Count faces of the same impacts as independent.")
    ] = False,
    tails: Annotated[
        str, typer.Option(help="Law of the errors: gaussian, or student-t where outliers occur.")
    ] = "gaussian",
    dof: Annotated[
        float | None,
        typer.Option(metavar="NU", help="Degrees of freedom of student-t (4).", show_default=False),
    ] = None,
    angle_errors: Annotated[
        str,
        typer.Option(help="Errors of angle and spin: none, effective, set (Berkson), measured (classical)."),
    ] = "none",
    angle_population: Annotated[
        str | None, typer.Option(metavar="LO,HI", help="Degrees between which measured angles truly lie.")
    ] = None,
    sigma_gamma: Annotated[
        float | None, typer.Option(metavar="DEG", help="Uncertainty of angles whose row states none.")
    ] = None,
    sigma_velocity: Annotated[
        float | None,
        typer.Option(metavar="S", help="Propagate all errors from that of velocities, over incoming speed,"),
    ] = None,
    sigma_spin: Annotated[
        float | None, typer.Option(metavar="S", help="and from that of R Omega, over incoming speed.")
    ] = None,
    inertia_factor: Annotated[
        float | None,
        typer.Option(metavar="J", help="I/(m R^2): 2/5 solid (default), 2/3 hollow ball, 1/2 disc."),
    ] = None,
    convention: Annotated[
        Repeated,
        typer.Option(metavar="NAME=CHOICE", help="How a column is meant, as angle=alpha_deg:from-wall."),
    ] = [],  # noqa: B006
    scene: Annotated[
        Path | None,
        typer.Option(metavar="SCENE.toml", help="What hit what, to see which effects that calls for."),
    ] = None,
    intervals: Annotated[
        bool,
        typer.Option("--intervals", help="Compare intervals by covariance, profile and exact posterior."),
    ] = False,
    accuracy: Annotated[
        float | None,
        typer.Option(
            metavar="SD",
            help="Largest error of mean, sd and interval, in posterior sd: picks method and settings.",
        ),
    ] = None,
    budget: Annotated[
        str | None,
        typer.Option(metavar="TIME", help="As exact as this time allows, as 2s, 500ms or 3min."),
    ] = None,
    max_steps: Annotated[
        int | None, typer.Option(metavar="N", help="mcmc: most steps, 10000 by default.", show_default=False)
    ] = None,
    resume: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="mcmc: walk on with the chains in DIR, and replace its result."),
    ] = None,
    resample: Annotated[
        str | None,
        typer.Option(
            metavar="SCHEME",
            help="bootstrap: what is drawn anew: cases (impacts; default), residual, wild or wild-mammen.",
        ),
    ] = None,
    replicates: Annotated[
        int | None,
        typer.Option(metavar="N", help="bootstrap: experiments drawn, 1000 by default.", show_default=False),
    ] = None,
    workers: Annotated[
        int, typer.Option(metavar="N", help="mcmc, bootstrap: processes; the draws are the same.")
    ] = 1,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write result.json, figures and report.html there.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an earlier result in DIR.")] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="result.json on standard output, nothing else.")
    ] = False,
    seed: Annotated[int, typer.Option(help="Seed of the random draws behind the bands.", min=0)] = 0,
    quiet: Annotated[bool, typer.Option("--quiet", help="Say nothing but errors.")] = False,
    strict: Annotated[
        bool,
        typer.Option("--strict", help="Exit with 4 if a constant is not determined or nothing converged."),
    ] = False,
) -> None:
    """Constants from tables of impacts, with uncertainties."""
    from ifrfit.inference.fit import fit as run

    if intervals and (as_json or quiet):
        raise UsageError(f"--intervals prints a table, {'--json' if as_json else '--quiet'} none: keep one.")
    if resume is not None and out is None:
        out, force = resume, True
    if out is not None and not force:
        from ifrfit.report.folder import check_free

        check_free(out, force=False)
    with working(quiet or as_json) as progress:
        result = run(
            data,
            closure=closure,
            method=method,
            fix=pairs("--fix", fix, "NAME=VALUE"),
            prior=pairs("--prior", prior, "NAME=MEAN,SD"),
            bounds=pairs("--bounds", bounds, "NAME=LO,HI"),
            separate=separate,
            noise=noise,
            observable=observable,
            series=series,
            gamma_min=gamma_min,
            gamma_max=gamma_max,
            speed_min=speed_min,
            speed_max=speed_max,
            exclude=exclude,
            independent=independent,
            tails=tails,
            dof=dof,
            angle_errors=angle_errors,
            angle_population=ends("--angle-population", angle_population),
            sigma_gamma=sigma_gamma,
            sigma_velocity=sigma_velocity,
            sigma_spin=sigma_spin,
            inertia_factor=inertia_factor,
            convention=convention,
            accuracy=accuracy,
            budget=budget,
            scene=scene,
            max_steps=max_steps,
            resume=resume,
            resample=resample,
            replicates=replicates,
            workers=workers,
            progress=progress,
            seed=seed,
            command=command_line(),
        )
        table = result.intervals() if intervals else None
        written = _write(result, out, force)
    if as_json:
        from ifrfit.inference.io.json_text import dumps

        typer.echo(dumps(result.to_dict()), nl=False)
    elif not quiet:
        typer.echo(result.summary())
        if table is not None:
            from ifrfit.report import side_by_side

            typer.echo(f"\n{side_by_side(table)}")
        if written:
            typer.echo(f"\nwritten: {out}/  {'  '.join(written)}")
    if strict:
        _insist(result)


def _write(result: FitResult, out: Path | None, force: bool) -> list[str]:
    if out is None:
        return []
    from ifrfit.inference.appraise import appraise
    from ifrfit.report import write_folder

    return write_folder(result, appraise(result), out, force=force)


def _insist(result: FitResult) -> None:
    """Leave with status 4, saying why, unless everything asked for was determined."""
    open_ones = [name for name, found in result.flat_constants().items() if found.value is None]
    reasons = [f"{', '.join(open_ones)} not determined by the data"] if open_ones else []
    if not result.facts["converged"].ok:
        reasons.append(result.facts["converged"].says)
    if reasons:
        typer.echo(f"ifrfit: --strict: {'; '.join(reasons)}.", err=True)
        raise typer.Exit(NOT_DETERMINED)
