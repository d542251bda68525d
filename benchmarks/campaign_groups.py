"""Campaigns of 10,000 groups of 50 impacts each, over scenes drawn at random.

    python benchmarks/campaign_groups.py        # some minutes: 12 scenes; --quick: 3 scenes of 1,000 groups

A scene is what its groups have in common: the observable beside e_n, the range of angles, noise, spin, and
the ranges that the constants of the groups are drawn from, each anywhere in its domain. `ifrfit campaign` is
a process of its own with two workers: imports, reading, fits, population, table and page are on the clock.
Reading and fits are timed alone, too, by workers that stand ready, as from a program that has imported the
library. Some groups of each scene are fitted by the general code as well, to an accuracy of 1e-6, and all
numbers are compared; what it takes of CPU at its own accuracy, times the number of groups, is given over that
of the command.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from _common import Row, adopt_orphans, benchmark_parser, cells, cpu_of_children, publish

from ifrfit.campaign.group_fit import KAPPA, PARTS, GroupQuestion, fit_group
from ifrfit.campaign.many_groups.plain_groups import plain_rows
from ifrfit.campaign.run import run_campaign
from ifrfit.data.conventions import parse_conventions
from ifrfit.data.groups import GroupedFiles
from ifrfit.inference.estimators import Exact
from ifrfit.inference.options import Model, Noise
from ifrfit.inference.workers.crews import crew_of
from ifrfit.physics import OBSERVABLES, rebound

IMPACTS, WORKERS = 50, 2
GOAL = 10.0  # seconds of 10,000 groups
SEEN, COMPARED = 400, 30  # groups of which it is counted how they are fitted, and that are fitted twice
NAMES = ("beta", "v_x", "spin_y_after", "beta_cm")
E_N, E_T, MU = (0.3, 1.0), (-1.0, -0.4), (0.03, 1.0)
COLUMNS = {
    "scene": "{scene}",
    "measured": "{measured}",
    "angles": "{low:.0f} to {high:.0f}",
    "sigma": "{sigma:.3f}",
    "e_n": "{e_n}",
    "e_t": "{e_t}",
    "mu": "{mu}",
    "all three determined": "{determined:.0%}",
    "fitted together": "{together:.1%}",
    "fits s": "{fits:.1f}",
    "s": "{seconds:.1f}",
    "CPU s": "{cpu:.1f}",
    "CPU of one by one": "{ratio:.0f} times",
    "largest difference (sd)": "{difference:.0e}",
}


def span(rng: np.random.Generator, low: float, high: float) -> tuple[float, float]:
    """A range within another one."""
    first, second = np.sort(rng.uniform(low, high, 2)).tolist()
    return first, second


def scene(number: int, groups: int) -> tuple[dict[str, Any], pd.DataFrame]:
    """What the groups have in common, and the table of all of them."""
    rng = np.random.default_rng([number, 14])
    name, spin = str(rng.choice(NAMES)), float(rng.choice([0.0, rng.uniform(0.0, 0.5)]))
    low = float(rng.uniform(0.0, 40.0))
    high = float(rng.uniform(low + 20.0, 89.0))
    sigma = float(np.exp(rng.uniform(np.log(0.003), np.log(0.1))))
    ranges = {"e_n": span(rng, *E_N), "e_t": span(rng, *E_T)}
    ranges["mu"] = tuple(np.exp(span(rng, *np.log(MU))).tolist())
    truth = {key: np.repeat(rng.uniform(*ends, groups), IMPACTS) for key, ends in ranges.items()}
    size = groups * IMPACTS
    gamma, spin_y = rng.uniform(low, high, size), spin * rng.standard_normal(size)
    state = rebound(gamma, 0.0, spin_y, degrees=True, **truth)
    table = pd.DataFrame({"run": np.repeat(np.arange(groups).astype(str), IMPACTS), "gamma_deg": gamma})
    if spin:
        table["spin_y"] = spin_y
    table[name] = OBSERVABLES[name].value(state, truth["mu"]) + sigma * rng.standard_normal(size)
    table["e_n"] = truth["e_n"] + sigma * rng.standard_normal(size)
    table = table.assign(**{f"sigma_{name}": sigma, "sigma_e_n": sigma})
    said = {key: f"{ends[0]:.2f} to {ends[1]:.2f}" for key, ends in ranges.items()}
    measured = f"{name}{', spin' if spin else ''}"
    return {"scene": number, "measured": measured, "low": low, "high": high, "sigma": sigma} | said, table


def timed(path: Path, folder: Path) -> tuple[float, float]:
    """Seconds and CPU seconds of the command, workers included."""
    before, start = cpu_of_children(), time.perf_counter()
    command = [
        "campaign",
        str(path),
        "--by",
        "run",
        "--no-facts",
        "--workers",
        str(WORKERS),
        "--out",
        str(folder),
    ]
    subprocess.run([sys.executable, "-m", "ifrfit", *command, "--quiet"], check=True)
    seconds = time.perf_counter() - start
    return seconds, cpu_of_children() - before


def seconds_of_fits(path: Path) -> float:
    """From the file to the last fit, by workers that have imported what they need."""
    ends: list[float] = []
    with crew_of(WORKERS, None, plain_rows.__module__) as crew:
        assert crew is not None
        for each in [crew.submit(len, ()) for _ in range(WORKERS)]:
            crew.result(each)
        start = time.perf_counter()

        def progress(done: int, known: int) -> None:
            ends.append(time.perf_counter())

        out = path.with_name("fits")
        run_campaign([path], ["run"], out, lambda found: [], facts=False, crew=crew, progress=progress)
    return ends[-1] - start


def beside_the_general_code(path: Path, number: int) -> tuple[float, float, float]:
    """Share of groups that are fitted together, CPU seconds of one by the general code, largest difference.

    The last in sd; where a constant has none, a quarter of its 95 % interval stands for it.
    """
    files = GroupedFiles((path,), ("run",), parse_conventions(()))
    groups = [group for _, group in zip(range(SEEN), files.groups(), strict=False)]
    conventions = parse_conventions(())
    asked = GroupQuestion(conventions, Model(), Noise(), Exact(), facts=False)
    exact = GroupQuestion(conventions, Model(), Noise(), Exact(accuracy=1e-6), facts=False)
    together = plain_rows(asked, files, groups)
    chosen = np.random.default_rng(number).permutation(sorted(together))[:COMPARED].tolist()
    start = time.process_time()
    for place in chosen:
        fit_group(asked, files, groups[place])
    alone = (time.process_time() - start) / len(chosen)
    largest = max(difference(together[place], fit_group(exact, files, groups[place])) for place in chosen)
    return len(together) / len(groups), alone, largest


def difference(row: dict[str, Any], other: dict[str, Any]) -> float:
    """Largest of all numbers of the constants; infinite where a status is another one."""
    found = 0.0
    for name in ("e_n", "e_t", "mu", KAPPA):
        if row[f"{name}_status"] != other[f"{name}_status"]:
            return float("inf")
        sd = other[f"{name}_sd"] or (other[f"{name}_hi95"] - other[f"{name}_lo95"]) / 4.0
        for key in (name, *(f"{name}_{part}" for part in PARTS if part != "status")):
            if row[key] != other[key]:
                found = max(found, abs(row[key] - other[key]) / sd)
    return found


def measured(number: int, groups: int) -> Row:
    """One scene."""
    about, table = scene(number, groups)
    with tempfile.TemporaryDirectory() as folder:
        path, out = Path(folder) / "all.parquet", Path(folder) / "out"
        table.to_parquet(path, index=False)
        seconds, cpu = timed(path, out)
        # a process of its own, with which those end that it starts
        fits = subprocess.run([sys.executable, __file__, "--fits", path], check=True, stdout=subprocess.PIPE)
        found = pd.read_parquet(out / "results.parquet")
        statuses = found[["e_n_status", "e_t_status", "mu_status"]]
        determined = float((statuses == "determined").all(axis=1).mean())
        together, alone, largest = beside_the_general_code(path, number)
    figures = {
        "fits": float(fits.stdout),
        "seconds": seconds,
        "cpu": cpu,
        "determined": determined,
        "together": together,
    }
    figures["ratio"] = alone * groups / cpu
    return about | figures | {"difference": largest}


def main() -> None:
    """Draw, run, publish."""
    parser = benchmark_parser(__doc__, quick="3 scenes of 1,000 groups")
    parser.add_argument("--scenes", type=int, default=12, help="how many scenes are drawn")
    parser.add_argument("--first", type=int, default=0, help="number of the first one")
    parser.add_argument("--fits", type=Path, help="time reading and fits of a file alone, and print seconds")
    options = parser.parse_args()
    if options.fits is not None:
        print(seconds_of_fits(options.fits))
        return
    adopt_orphans()
    scenes, groups = (3, 1000) if options.quick else (options.scenes, 10_000)
    rows = [measured(number, groups) for number in range(options.first, options.first + scenes)]
    fitted, under = (sum(row[what] < GOAL for row in rows) for what in ("fits", "seconds"))
    goals = (
        f"{groups:,} groups in less than {GOAL:g} s on two cores: read and fitted in {fitted} of {scenes} "
        f"scenes, the whole command in {under}",
        f"largest difference below 1e-4 sd: {max(row['difference'] for row in rows):.1e}",
    )
    publish(options, "campaign groups", rows, cells(rows, COLUMNS), goals)


if __name__ == "__main__":
    main()
