"""A soak: a campaign over corrupt files and pathological groups while its workers are killed.

Then the same is run serially and undisturbed, and the tables are compared.

    python benchmarks/campaign_soak.py 20000

Prints a table in Markdown: what was lost (nothing may be), what was named, memory, and time.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
import pandas as pd

from ifrfit.physics import OBSERVABLES, rebound

IMPACTS, SIGMA, PER_FILE = 50, 0.03, 40
CORRUPT, PATHOLOGICAL = 0.01, 0.01
KINDS = ("one angle", "all sticking", "NaN", "constant", "text", "one row")
HEADER = "run,gamma_deg,beta,e_n,sigma_beta,sigma_e_n"


def group_lines(name: str, kind: str, rng: np.random.Generator) -> list[str]:
    """Rows of one group, drawn over the whole space of constants."""
    own = {"e_n": rng.uniform(0.3, 0.98), "e_t": rng.uniform(-0.99, -0.45), "mu": np.exp(rng.uniform(-3, 0))}
    gamma = rng.uniform(2.0, 85.0, IMPACTS)
    if kind == "one angle":
        gamma[:] = 30.0
    if kind == "all sticking":
        gamma = rng.uniform(1.0, 3.0, IMPACTS)
    state = rebound(gamma, degrees=True, **own)
    beta = OBSERVABLES["beta"].value(state, np.asarray(own["mu"])) + SIGMA * rng.standard_normal(IMPACTS)
    e_n = own["e_n"] + SIGMA * rng.standard_normal(IMPACTS)
    if kind == "NaN":
        beta[:], e_n[:] = np.nan, np.nan
    if kind == "constant":
        beta[:], e_n[:] = beta[0], e_n[0]
    cells = [[f"{g:.6f}", f"{b:.6f}", f"{e:.6f}"] for g, b, e in zip(gamma, beta, e_n, strict=True)]
    if kind == "text":
        cells[7][1] = "broken"
    if kind == "one row":
        cells = cells[:1]
    return [f"{name},{','.join(each)},{SIGMA},{SIGMA}" for each in cells]


def write_files(folder: Path, groups: int, seed: int) -> tuple[set[str], set[str], set[str]]:
    """Files of groups; names of the good groups, of the pathological ones, and of the corrupt files."""
    rng = np.random.default_rng(seed)
    good, odd, corrupt = set(), set(), set()
    for first in range(0, groups, PER_FILE):
        path = folder / f"part-{first // PER_FILE:05d}.csv"
        names = [f"g{number:06d}" for number in range(first, min(first + PER_FILE, groups))]
        if rng.random() < CORRUPT:
            path = path.with_suffix(".parquet")
            path.write_bytes(b"PAR1" + rng.bytes(2000))
            corrupt.add(path.name)
            continue
        lines = [HEADER]
        for name in names:
            kind = str(rng.choice(KINDS)) if rng.random() < PATHOLOGICAL else ""
            (odd if kind else good).add(name)
            lines += group_lines(name, kind, rng)
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return good, odd, corrupt


def children(pid: int) -> list[int]:
    """Worker processes of a process, and the one that they are forked from."""
    found = []
    for child, command in _listed(pid):
        if "forkserver" in command:
            found += [child, *(worker for worker, _ in _listed(child))]
        elif "spawn_main" in command:
            found.append(child)
    return found


def _listed(pid: int) -> list[tuple[int, str]]:
    """Children of a process, and their commands."""
    listed = subprocess.run(["ps", "-o", "pid=,args=", "--ppid", str(pid)], capture_output=True, text=True)
    rows = (line.split(None, 1) for line in listed.stdout.splitlines())
    return [(int(row[0]), row[1]) for row in rows if len(row) == 2]


class Killer(threading.Thread):
    """Kills a worker of a process, or what they are forked from, at random times."""

    def __init__(self, pid: int, every: float) -> None:
        super().__init__(daemon=True)
        self.pid, self.every, self.killed, self.ended = pid, every, 0, threading.Event()

    def run(self) -> None:
        """Until told to end."""
        chance = random.Random(1)
        while not self.ended.wait(chance.expovariate(1.0 / self.every)):
            found = children(self.pid)
            if found:
                try:
                    os.kill(chance.choice(found), signal.SIGKILL)
                    self.killed += 1
                except ProcessLookupError:
                    continue


def peak(pid: int) -> float:
    """Peak memory of a running process, GiB."""
    try:
        text = Path(f"/proc/{pid}/status").read_text(encoding="utf-8")
    except OSError:
        return 0.0
    return next(
        (float(line.split()[1]) / 2**20 for line in text.splitlines() if line.startswith("VmHWM")), 0.0
    )


def run(folder: Path, out: Path, workers: int, every: float) -> tuple[float, int, float, float]:
    """Seconds, kills, and peak memory of the process that holds it all and of any of its workers."""
    command = [sys.executable, "-m", "ifrfit", "campaign", str(folder), "--by", "run", "--out", str(out)]
    started = time.perf_counter()
    process = subprocess.Popen([*command, "--no-facts", "--quiet", "--workers", str(workers)])
    killer = Killer(process.pid, every)
    if every:
        killer.start()
    most = most_of_workers = 0.0
    while process.poll() is None:
        most = max(most, peak(process.pid))
        most_of_workers = max([most_of_workers, *map(peak, children(process.pid))])
        time.sleep(0.5)
    killer.ended.set()
    if process.returncode:
        raise SystemExit(f"the campaign ended with {process.returncode}")
    return time.perf_counter() - started, killer.killed, most, most_of_workers


def main() -> None:
    """Run both, compare, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("groups", type=int, nargs="?", default=20_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kill-every", type=float, default=8.0, metavar="SECONDS")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "runs"
        folder.mkdir()
        good, odd, corrupt = write_files(folder, given.groups, given.seed)
        soaked = run(folder, Path(place) / "soaked", 2, given.kill_every)
        clean = run(folder, Path(place) / "clean", 1, 0.0)
        tables = [pd.read_parquet(Path(place) / name / "results.parquet") for name in ("soaked", "clean")]
        record = pd.read_json(Path(place) / "soaked" / "campaign.json", typ="series")
    found, reference = tables
    failed = set(found.loc[found["failure"] != "", "run"])
    refused = {each["file"] for each in record["refused_files"]}
    rows = [
        ("groups: good, pathological; corrupt files", f"{len(good)}, {len(odd)}; {len(corrupt)}"),
        ("kills of worker processes", f"{soaked[1]}"),
        ("good groups without constants", f"{len(good & failed)}"),
        ("groups that are missing", f"{len((good | odd) - set(found['run']))}"),
        ("pathological groups that failed, each with its reason", f"{len(odd & failed)} of {len(odd)}"),
        ("corrupt files named", f"{len(corrupt & refused)} of {len(corrupt)}"),
        ("table equal to the serial one, every number", "yes" if found.equals(reference) else "NO"),
        ("seconds: 2 workers with kills, serial", f"{soaked[0]:.0f}, {clean[0]:.0f}"),
        ("peak memory of the parent, GiB: 2 workers, serial", f"{soaked[2]:.2f}, {clean[2]:.2f}"),
        ("peak of any worker, GiB", f"{soaked[3]:.2f}"),
    ]
    print("| | |\n|---|---|")
    for what, value in rows:
        print(f"| {what} | {value} |")


if __name__ == "__main__":
    main()
