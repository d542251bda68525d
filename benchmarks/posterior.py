"""The exact posterior against samplers: time and error, in one run.

``python benchmarks/posterior.py [--only i,ii] [--quick] [--out DIR] [--readme]``
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

# first: it sets the number of threads
from _common import (
    Curve,
    cells,
    draw,
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
from posterior_goals import Row, goals_of, said_of
from posterior_peers import NUTS_COLD, PEERS, Run, all_runs
from posterior_reference import Reference, reference_of
from posterior_scenes import TITLES, Scene, make_scene, scene_options

import ifrfit
from ifrfit.inference.distributions.protocol import LEVELS
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, least_squares
from ifrfit.inference.posterior import ExactPosterior, exact_posterior, integrate

TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-6)
N_DRAWS = 100_000
DRAWS, FIT = f"{N_DRAWS:,} draws", "ifrfit.fit"
ONCE_S = 1.5
WITH_QUANTILES = ("i", "ii")
SEEDS, SEEDS_SLOW = 9, 3
TARGET = 1e-2
PACKAGES = ("emcee", "dynesty", "ultranest", "numpyro", "jax")


def ours(scene: Scene, reference: Reference, budget: float) -> list[Row]:
    """The kernel at several tolerances, draws from it, and the whole fit."""
    start = least_squares(scene.problem)
    rng = np.random.default_rng
    calls: dict[str, Callable[[], Any]] = {}
    for t in TOLERANCES:
        calls[f"exact {t:g}"] = lambda t=t: exact_posterior(scene.problem, t, start)
        calls[f"exact {t:g} whole"] = lambda t=t: exact_posterior(scene.problem, t)
        if scene.key in WITH_QUANTILES:
            calls[f"exact {t:g} quantiles"] = lambda t=t: quantiles_of(
                exact_posterior(scene.problem, t, start)
            )
    default = exact_posterior(scene.problem)
    calls[DRAWS] = lambda: default.draws(N_DRAWS, rng(1))
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
    if scene.key in WITH_QUANTILES:
        rows += with_quantiles(scene, start, reference, times, gave)
    got = [gave[DRAWS][name] for name in scene.constants]
    of_draws = reference.error_of([x.mean() for x in got], [x.std() for x in got])
    for name, kind, error in ((DRAWS, "draws", of_draws), (FIT, "fit", None)):
        seconds = times[name]
        rows.append(Row(scene.key, kind, name, statistics.median(seconds), None, error, repeats=len(seconds)))
    return rows


def quantiles_of(posterior: ExactPosterior) -> np.ndarray:
    """Five quantiles of each constant and of kappa: in a plain fit twenty."""
    names = [name for name in posterior.names if not name.startswith("noise")]
    return np.array([posterior.quantile(name, LEVELS) for name in names])


def with_quantiles(
    scene: Scene,
    start: LeastSquaresFit,
    reference: Reference,
    times: Mapping[str, Sequence[float]],
    gave: Mapping[str, Any],
) -> list[Row]:
    """The kernel with its quantiles; their error against the general integral, which shares no code."""
    general = integrate(scene.problem, 1e-8, start)
    truth = quantiles_of(general)
    sds = np.array([general.sd(name) for name in general.names if not name.startswith("noise")])
    rows = []
    for t in TOLERANCES:
        seconds, post = times[f"exact {t:g} quantiles"], gave[f"exact {t:g}"]
        means, spreads = ([one(name) for name in scene.constants] for one in (post.mean, post.sd))
        apart = np.abs(gave[f"exact {t:g} quantiles"] - truth) / sds[:, None]
        error = max(float(apart.max()), reference.error_of(means, spreads))
        name = f"exact, tolerance {t:g}, with {truth.size} quantiles"
        rows.append(
            Row(scene.key, "quantiles", name, statistics.median(seconds), None, error, repeats=len(seconds))
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


def _remarks(row: Mapping[str, Any]) -> str:
    stated = "" if row["stated"] is None else f"states {row['stated']:.1e}; "
    return stated + "; ".join(part for part in (row["spread"], row["note"]) if part)


COLUMNS = {
    "method": "{method}",
    "time": lambda row: _time(row["time_s"]),
    "with least squares": lambda row: _time(row["with_start_s"]),
    "error": lambda row: "" if row["error"] is None else f"{row['error']:.1e}",
    "to 1e-2": lambda row: _time(row["to_target_s"]),
    "of it": lambda row: f"{row['repeats']} {'seeds' if row['kind'] == 'sampler' else 'rounds'}",
    "remarks": _remarks,
}


def _time(seconds: float | None) -> str:
    if seconds is None:
        return ""
    return f"{1e3 * seconds:.2f} ms" if seconds < 0.1 else f"{seconds:.2f} s"


def curves_of(rows: Sequence[Row]) -> list[Curve]:
    """Error against time of every method on one scene; each has a marker of its own."""
    exact = [row for row in rows if row.kind == "exact"]
    errors = [row.error or math.nan for row in exact]
    ours_too = {"color": "C0", "marker": "o", "markersize": 5}
    found = [
        Curve("exact", [row.time_s for row in exact], errors, ours_too),
        Curve(
            "exact, least squares included",
            [row.with_start_s or math.nan for row in exact],
            errors,
            ours_too | {"linestyle": "--", "markerfacecolor": "white"},
        ),
    ]
    places = {name: i for i, name in enumerate((*PEERS, NUTS_COLD))}
    for row in rows:
        if row.kind == "sampler":
            i = places[row.method]
            style = {
                "linestyle": "",
                "color": f"C{i + 1}",
                "marker": "os^DvPX"[i],
                "markeredgecolor": "black",
            }
            found.append(Curve(row.method, [row.time_s], [row.error or math.nan], style))
    return found


def main() -> None:
    options = scene_options(__doc__, "of the samplers only emcee; fewer rounds")
    print(machine(*PACKAGES))
    print("one thread; errors are the largest of a mean or sd of a constant, in posterior sd\n")
    found: dict[str, list[Row]] = {}
    lines: list[str] = []
    for key in options.only:
        found[key], said = measure(key, options.quick)
        table = cells([asdict(row) for row in found[key]], COLUMNS)
        lines += [f"{said}:", "", *markdown_table(table), ""]
        print()
        print_table(table)
        print(flush=True)
    rows = [row for of_scene in found.values() for row in of_scene]
    goals = said_of(goals_of(rows))
    print(*(f"goal: {goal}" for goal in goals), sep="\n")
    write_csv(options.out / "posterior.csv", [asdict(row) for row in rows])
    panels = {f"({key}) {TITLES[key]}": curves_of(of_scene) for key, of_scene in found.items()}
    draw(options.out / "posterior.svg", panels, "time (s)", "error (posterior sd)")
    if options.readme:
        listed = [f"- {goal}" for goal in goals]
        put_into_readme("posterior", [machine(*PACKAGES), "", *lines, *listed])


if __name__ == "__main__":
    main()
