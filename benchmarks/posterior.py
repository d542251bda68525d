"""The exact posterior against samplers: time and error, in one run.

``python benchmarks/posterior.py [--only i,ii] [--quick] [--ess] [--out DIR] [--readme]``
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

# first: it sets the number of threads
from _common import (
    benchmark_parser,
    machine,
    markdown_table,
    print_table,
    put_into_readme,
    rounds_of,
    seconds_of,
    write_csv,
)

# isort: split
import numpy as np
import posterior_ess
from posterior_goals import goals_of, said_of
from posterior_peers import NUTS_COLD, Run, all_runs
from posterior_plot import draw
from posterior_reference import Reference, reference_of
from posterior_scenes import TITLES, Scene, make_scene

import ifrfit
from ifrfit.errors import UsageError
from ifrfit.inference.optimize.least_squares import least_squares

TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-6)
N_DRAWS = 100_000
DRAWS, FIT = f"{N_DRAWS:,} draws", "ifrfit.fit"
ONCE_S = 1.5
SEEDS, SEEDS_SLOW = 9, 3
TARGET = 1e-2
PACKAGES = ("emcee", "dynesty", "ultranest", "numpyro", "jax")


@dataclass(frozen=True)
class Row:
    """One method on one scene.

    `time_s` of the exact kernel is from given least squares, `with_start_s` includes them. `stated` is the
    error that the kernel itself reports. `spread` is the range of the errors over the seeds of a sampler.
    """

    scene: str
    kind: str  # exact, fit, draws or sampler
    method: str
    time_s: float
    with_start_s: float | None
    error: float | None
    stated: float | None = None
    spread: str = ""
    to_target_s: float | None = None
    repeats: int = 1
    note: str = ""


def ours(scene: Scene, reference: Reference, budget: float) -> list[Row]:
    """The kernel at several tolerances, draws from it, and the whole fit."""
    try:
        from ifrfit.inference.posterior import integrate
    except ImportError:
        print("This version has no exact posterior: samplers only.")
        return []
    start = least_squares(scene.problem)
    rng = np.random.default_rng
    calls: dict[str, Callable[[], Any]] = {}
    for t in TOLERANCES:
        calls[f"exact {t:g}"] = lambda t=t: integrate(scene.problem, tolerance=t, start=start)
        calls[f"exact {t:g} whole"] = lambda t=t: integrate(scene.problem, tolerance=t)
    default = integrate(scene.problem)
    calls[DRAWS] = lambda: default.draws(N_DRAWS, rng(1))
    try:
        ifrfit.fit(scene.observations, method="exact", **scene.fit_options)
    except UsageError as error:
        print(f"ifrfit.fit is left out: {error}")
    else:
        calls[FIT] = lambda: ifrfit.fit(scene.observations, method="exact", **scene.fit_options)
    times, gave = timed(calls, budget)
    rows = []
    for t in TOLERANCES:
        post, seconds = gave[f"exact {t:g}"], times[f"exact {t:g}"]
        apart = abs(post.log_evidence - reference.log_evidence)
        rows.append(
            Row(
                scene.key,
                "exact",
                f"exact, tolerance {t:g}",
                statistics.median(seconds),
                statistics.median(times[f"exact {t:g} whole"]),
                reference.error_of(
                    [post.mean(name) for name in scene.constants], [post.sd(name) for name in scene.constants]
                ),
                post.error,
                repeats=len(seconds),
                note=f"log evidence off by {apart:.1e}" + ("" if post.converged else ", not converged"),
            )
        )
    got = [gave[DRAWS][name] for name in scene.constants]
    of_draws = reference.error_of([x.mean() for x in got], [x.std() for x in got])
    for name, kind, error in ((DRAWS, "draws", of_draws), (FIT, "fit", None)):
        if name in times:
            seconds = times[name]
            rows.append(
                Row(scene.key, kind, name, statistics.median(seconds), None, error, repeats=len(seconds))
            )
    return rows


def timed(
    calls: Mapping[str, Callable[[], Any]], budget: float
) -> tuple[dict[str, list[float]], dict[str, Any]]:
    """Seconds of each round, and what each call gives; what takes very long is called once."""
    gave: dict[str, Any] = {}
    once = {}
    for name, call in calls.items():
        once[name] = [seconds_of(lambda name=name, call=call: gave.update({name: call()}))]
    quick = {name: call for name, call in calls.items() if once[name][0] < ONCE_S}
    return once | rounds_of(quick, budget), gave


def sampler_row(scene: Scene, reference: Reference, name: str, runs: Sequence[Run]) -> Row:
    """Medians over the seeds of time and error."""
    errors = [reference.error_of(run.mean, run.sd) for run in runs]
    seconds, error = statistics.median(run.seconds for run in runs), statistics.median(errors)
    return Row(
        scene.key,
        "sampler",
        name,
        seconds,
        None,
        error,
        spread=f"{min(errors):.2g} to {max(errors):.2g}" if len(errors) > 1 else "",
        # compiling is not repeated for more samples
        to_target_s=None if name == NUTS_COLD else seconds * (error / TARGET) ** 2,
        repeats=len(runs),
        note=runs[0].note,
    )


def measure(key: str, quick: bool) -> tuple[list[Row], str]:
    """All methods on one scene, and what is to be said of the reference."""
    scene = make_scene(key)
    reference = reference_of(scene)
    said = (
        f"({key}) {scene.title}; reference by quadrature, from half the nodes to all of them it moves by "
        f"{reference.change:.0e} sd, its log evidence by {reference.change_evidence:.0e}"
    )
    print(said, flush=True)
    rows = ours(scene, reference, 1.0 if quick else 8.0)
    for name, runs in all_runs(scene, (SEEDS, SEEDS_SLOW), quick).items():
        rows.append(sampler_row(scene, reference, name, runs))
    return rows, said


def table_of(rows: Sequence[Row]) -> list[list[str]]:
    """What is shown of one scene, the head first."""
    shown = [["method", "time", "with least squares", "error", "to 1e-2", "of it", "remarks"]]
    for row in rows:
        stated = "" if row.stated is None else f"states {row.stated:.1e}; "
        shown.append(
            [
                row.method,
                _time(row.time_s),
                _time(row.with_start_s),
                "" if row.error is None else f"{row.error:.1e}",
                _time(row.to_target_s),
                f"{row.repeats} {'seeds' if row.kind == 'sampler' else 'rounds'}",
                stated + "; ".join(part for part in (row.spread, row.note) if part),
            ]
        )
    return shown


def _time(seconds: float | None) -> str:
    if seconds is None:
        return ""
    return f"{1e3 * seconds:.2f} ms" if seconds < 0.1 else f"{seconds:.2f} s"


def main() -> None:
    parser = benchmark_parser(__doc__, "of the samplers only emcee; fewer rounds")
    parser.add_argument("--only", default=",".join(TITLES), help="scenes, as in i,ii")
    parser.add_argument("--ess", action="store_true", help="only effective draws a second of chains")
    options = parser.parse_args()
    keys = options.only.split(",")
    if unknown := [key for key in keys if key not in TITLES]:
        parser.error(f"no scene {', '.join(unknown)}; there are {', '.join(TITLES)}")
    print(machine(*PACKAGES))
    if options.ess:
        effective_draws(keys, options.out, readme=options.readme)
        return
    print("one thread; errors are the largest of a mean or sd of a constant, in posterior sd\n")
    rows: list[Row] = []
    lines: list[str] = []
    for key in keys:
        of_scene, said = measure(key, options.quick)
        rows += of_scene
        lines += [f"{said}:", "", *markdown_table(table_of(of_scene)), ""]
        print()
        print_table(table_of(of_scene))
        print(flush=True)
    goals = said_of(goals_of(rows))
    print(*(f"goal: {goal}" for goal in goals), sep="\n")
    write_csv(options.out / "posterior.csv", [_plain(row) for row in rows])
    draw(rows, options.out / "posterior.svg")
    if options.readme:
        listed = [f"- {goal}" for goal in goals]
        put_into_readme("posterior", [machine(*PACKAGES), "", *lines, *listed])


def effective_draws(keys: Sequence[str], out: Path, *, readme: bool) -> None:
    """The part on effective draws a second: its table, its CSV, its place in the README."""
    speeds, goal = posterior_ess.measure(list(keys))
    write_csv(out / "posterior_ess.csv", [asdict(speed) for speed in speeds])
    if readme:
        table = markdown_table(posterior_ess.table_of(speeds))
        put_into_readme("effective draws", [machine(*PACKAGES), "", *table, "", f"- {goal}"])


def _plain(row: Row) -> dict[str, object]:
    """For the CSV."""
    return {
        name: "" if value is None else f"{value:.6g}" if isinstance(value, float) else value
        for name, value in asdict(row).items()
    }


if __name__ == "__main__":
    main()
