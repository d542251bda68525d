"""Least squares and the exact posterior of more impacts than one would hold in memory, beside others' ways.

    python benchmarks/scale.py 1e6 1e7

Writes Parquet (and CSV of the first size) and measures in one run, each in a process of its own: reading the
columns with pyarrow; what is done with rows from memory; the whole fit; the sums alone, by ourselves, by
DuckDB and by Polars, none of them with its start; pandas and lmfit; scipy on the full arrays; two worker
processes. The fit, and that by pandas and lmfit, are also measured when they run again in the same process.
CPU seconds (of the process itself), seconds, and its peak memory, as a table in Markdown; ratios are what it
is about. Of sizes up to 1e7 each is the least of several rounds, taken in turns (but for lmfit's intervals by
profile, two minutes long); of larger ones so is the fit that runs again in the same process, by which the
last lines tell what one impact more costs.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import subprocess
import sys
import tempfile
import textwrap
from importlib.util import find_spec
from pathlib import Path

_ONE_THREAD = {"OMP_NUM_THREADS": "1", "POLARS_MAX_THREADS": "1"}
_READ = """
import pyarrow.parquet as pq
pq.read_table(PATH, columns=["gamma_deg", "beta", "e_n", "sigma_beta", "sigma_e_n"], use_threads=False)
"""
_KERNEL = """
from pathlib import Path
import numpy as np, pyarrow as pa
from ifrfit.data.conventions import Conventions
from ifrfit.data.selection import Selection
from ifrfit.data.stream import impact_stream
from ifrfit.data.stream.portions import Piece
from ifrfit.data.stream.used_columns import UsedColumns
from ifrfit.inference.sufficient_statistics.accumulated import BINS, Accumulated
from ifrfit.inference.sufficient_statistics.tau_intervals import Intervals
n, size = 2_000_000, 1 << 17
rng = np.random.default_rng(0)
columns = {"gamma_deg": rng.uniform(1.0, 85.0, n), "beta": rng.normal(0.5, 0.1, n),
    "e_n": rng.normal(0.9, 0.03, n), "sigma_beta": rng.uniform(0.02, 0.04, n),
    "sigma_e_n": rng.uniform(0.02, 0.04, n)}
if METHOD:
    columns["spin_y"] = 0.3 * rng.standard_normal(n)
batches = pa.table(columns).to_batches(size)
names, path = ("beta", "e_n"), Path(PATH)
piece = Piece(path, 0, 0, n, (), 0, 0)
stream = impact_stream.ImpactStream(
    path, ((piece,),), Conventions(), Selection(), 0.4, UsedColumns(
        names, True, ("beta", "e_n", "sigma:beta", "sigma:e_n", *(("spin_y",) if METHOD else ()))
    )
)
part = Accumulated.nothing(stream, True, Intervals(BINS), np.arange(BINS) % 1000 == 0)
impact_stream._reading = lambda piece: iter(batches)
Piece.check_unchanged = lambda piece: None
def read():
    for batch in stream.batches((piece,), part.tally, part.sample):
        part.add(batch)
whole, batches = batches, batches[:2]
read()
batches = whole
STARTED()
read()
"""
_PROPER = """
import numpy as np
from ifrfit.inference.sufficient_statistics.accumulated import BINS
from ifrfit.inference.sufficient_statistics.moments import Moments
from ifrfit.inference.sufficient_statistics.tau_intervals import Intervals
from ifrfit.physics.compiled_incidence import incidence_of
from ifrfit.physics.observables import OBSERVABLES
n, size = 2_000_000, 1 << 15
rng = np.random.default_rng(0)
gamma, value = rng.uniform(1.0, 85.0, n), rng.normal(0.5, 0.1, n)
sigma, spin, none = rng.uniform(0.02, 0.04, n), 0.3 * rng.standard_normal(n), np.zeros(n)
intervals = Intervals(BINS)
def summed(count):
    sums = Moments.nothing(1, BINS)
    for first in range(0, count, size):
        rows = slice(first, first + size)
        state = incidence_of(gamma[rows], none[rows], spin[rows]) if METHOD else incidence_of(gamma[rows])
        place, x = intervals.places(state)
        offset, slope = OBSERVABLES["beta"].linear(state, 0.4)
        sums.add_values(0, place, sigma[rows], slope, value[rows], offset, x)
summed(size)
STARTED()
summed(n)
"""
_FIT = """
import ifrfit
STARTED()
found = ifrfit.fit(PATH, method=METHOD)
"""
_FIT_AGAIN = _FIT + "STARTED()\nfound = ifrfit.fit(PATH, method=METHOD)\n"
_SUMMARY = _FIT + "found.summary()\n"
_SUMS = """
from pathlib import Path
import numpy as np, pyarrow.parquet as pq
from ifrfit.data.conventions import Conventions
from ifrfit.data.selection import Selection
from ifrfit.data.stream.impact_stream import ImpactStream
from ifrfit.inference.sufficient_statistics.accumulated import BINS
from ifrfit.inference.sufficient_statistics.tau_intervals import Intervals
from ifrfit.inference.sufficient_statistics.passes import Reader
def summed(path):
    stream = ImpactStream.of(path, Conventions(), Selection(), 0.4)
    expected = np.abs(np.arange(BINS) - 900) < 5
    def focus(found, coming):
        found.window.narrow(expected)
        return found
    return Reader(stream).accumulate(True, Intervals(BINS), focus)
small = Path(PATH).with_name("small.parquet")
pq.write_table(pq.ParquetFile(PATH).read_row_group(0).slice(0, 1000), small)
summed(small)
STARTED()
summed(Path(PATH))
"""
_COMPARE = """
import ifrfit
STARTED()
ifrfit.compare(PATH, loo=False)
"""
_LMFIT = """
import lmfit, numpy as np, pandas as pd
from ifrfit.physics import OBSERVABLES, rebound
start = lmfit.create_params(e_n=dict(value=0.8, min=0, max=1), e_t=dict(value=-0.6, min=-1, max=-0.4), mu=0.2)
def fitted():
    table = pd.read_parquet(PATH)
    gamma = table["gamma_deg"].to_numpy()
    def residual(p):
        state = rebound(gamma, degrees=True, e_n=p["e_n"].value, e_t=p["e_t"].value, mu=p["mu"].value)
        beta = OBSERVABLES["beta"].value(state, np.asarray(p["mu"].value))
        beta = (table["beta"] - beta) / table["sigma_beta"]
        return np.concatenate((beta, (table["e_n"] - p["e_n"].value) / table["sigma_e_n"]))
    question = lmfit.Minimizer(residual, start)
    found = question.minimize()
    if METHOD:
        lmfit.conf_interval(question, found, sigmas=[1, 2])
fitted()
"""
_LMFIT_AGAIN = _LMFIT + "STARTED()\nfitted()\n"
_SCIPY = """
import numpy as np, pyarrow.parquet as pq
from scipy.optimize import least_squares
t = pq.read_table(PATH)
gamma, beta, e, sb, se = (t[c].to_numpy() for c in ("gamma_deg", "beta", "e_n", "sigma_beta", "sigma_e_n"))
tau = np.tan(np.radians(gamma))
def residual(p):
    stick, slide = -p[1], 3.5 * p[2] * (1 + p[0]) / tau - 1
    return np.concatenate(((beta - np.minimum(stick, slide)) / sb, (e - p[0]) / se))
least_squares(residual, (0.8, -0.6, 0.2))
"""
_MADE = """
import numpy as np, pandas as pd
from ifrfit.physics import OBSERVABLES, rebound
rng = np.random.default_rng(0)
import pyarrow as pa, pyarrow.parquet as pq
writer = None
for first in range(0, N, 1_000_000):
    n = min(1_000_000, N - first)
    gamma = rng.uniform(1.0, 85.0, n)
    state = rebound(gamma, degrees=True, e_n=0.9, e_t=-0.7, mu=0.15)
    table = pa.table({
        "gamma_deg": gamma,
        "beta": OBSERVABLES["beta"].value(state, np.asarray(0.15)) + 0.03 * rng.standard_normal(n),
        "e_n": 0.9 + 0.03 * rng.standard_normal(n),
        "sigma_beta": np.full(n, 0.03), "sigma_e_n": np.full(n, 0.03)})
    writer = writer or pq.ParquetWriter(PATH, table.schema)
    writer.write_table(table)
writer.close()
"""
_DUCKDB = """
import duckdb
connection = duckdb.connect()
connection.execute("set threads to 1")
STARTED()
of_beta = '''select least(cast(floor(t / (1 + t) * 2048) as int), 2047) as place, count(*), sum(w * 12.25),
    sum(w * 12.25 / t), sum(w * 12.25 / t / t), sum(w * 3.5 * r), sum(w * 3.5 * r / t), sum(w * r * r)
    from (select tan(radians(gamma_deg)) as t, beta + 1 as r, 1 / sigma_beta ** 2 as w from read_parquet(?))
    group by place'''
of_e_n = '''select count(*), sum(w), sum(w * e_n), sum(w * e_n * e_n)
    from (select e_n, 1 / sigma_e_n ** 2 as w from read_parquet(?))'''
connection.execute(of_beta, [PATH]).fetchnumpy()
connection.execute(of_e_n, [PATH]).fetchnumpy()
"""
_POLARS = """
import polars as pl
STARTED()
c = pl.col
t, r, w = c("gamma_deg").radians().tan(), c("beta") + 1.0, c("sigma_beta") ** -2.0
rows = pl.scan_parquet(PATH).with_columns(t=t, r=r, w=w, v=c("sigma_e_n") ** -2.0)
place = (c("t") / (c("t") + 1.0) * 2048).cast(pl.Int32).clip(0, 2047)
rows = rows.with_columns(place=place, ws=c("w") * 12.25)
rows.group_by("place").agg(
    pl.len(), c("ws").sum().alias("s1"), (c("ws") / c("t")).sum().alias("sx"),
    (c("ws") / c("t") ** 2).sum().alias("sxx"), (c("w") * 3.5 * c("r")).sum().alias("sz"),
    (c("w") * 3.5 * c("r") / c("t")).sum().alias("szx"), (c("w") * c("r") ** 2).sum().alias("szz"),
    c("v").sum().alias("v1"), (c("v") * c("e_n")).sum().alias("vz"),
    (c("v") * c("e_n") ** 2).sum().alias("vzz"),
).collect(engine="streaming")
"""
_WORKERS = """
import ifrfit
from ifrfit.inference.estimators import LeastSquares
ifrfit.fit(PATH, method=LeastSquares(workers=int(METHOD)))
"""
_FRAME = """
import json, resource, sys, time
N, PATH, METHOD = json.loads(sys.argv[1])
begun = [0.0, time.perf_counter()]
def STARTED():
    begun[:] = [time.process_time(), time.perf_counter()]
def measure():
{body}
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(json.dumps([time.process_time() - begun[0], time.perf_counter() - begun[1], peak]))
if __name__ == "__main__":  # worker processes read this file, too
    measure()
"""


_CSV = """
import pyarrow.csv, pyarrow.parquet as pq
pyarrow.csv.write_csv(pq.read_table(PATH), METHOD)
"""
_BY_PROFILE = "pandas and lmfit with its intervals by profile, file included"  # two minutes
_AGAIN = (
    "whole fit, least squares, again in the same process",
    "pandas and lmfit, again in the same process",
)
Measured = tuple[float, float, float]
_ROUNDS = 3


def least(rows: list[tuple[str, str, str]], n: int, path: Path) -> list[Measured]:
    """The least CPU seconds and seconds, and the largest memory, of rounds taken in turns."""
    found: list[list[Measured]] = [[] for _ in rows]
    for number in range(_ROUNDS):
        for each, (what, body, method) in zip(found, rows, strict=True):
            if number == 0 or (n <= 10_000_000 and what != _BY_PROFILE) or what in _AGAIN:
                each.append(run(body, n, path, method))
    return [(min(m[0] for m in each), min(m[1] for m in each), max(m[2] for m in each)) for each in found]


def run(body: str, n: int, path: Path, method: str = "") -> Measured:
    """CPU seconds and seconds, from `STARTED` on where it is called, and peak memory in GiB."""
    script = path.with_name("measured.py")
    script.write_text(_FRAME.format(body=textwrap.indent(body, "    ")), encoding="utf-8")
    # bytecode is kept, as of an installed package
    environment = {name: of for name, of in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    done = subprocess.run(
        [sys.executable, str(script), json.dumps([n, str(path), method])],
        check=True,
        capture_output=True,
        text=True,
        env=environment | _ONE_THREAD,
    )
    seconds, elapsed, memory = json.loads(done.stdout.splitlines()[-1])
    return seconds, elapsed, memory


def main() -> None:
    """Measure, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sizes", nargs="*", default=["1e6", "1e7"])
    given = parser.parse_args()
    print("| impacts | | CPU s | s | peak GiB |\n|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        kernels = [
            (f"{says}, from memory, {spin}", body, method)
            for says, body in (
                ("the sums of one observable", _PROPER),
                ("all that is done with rows", _KERNEL),
            )
            for spin, method in (("without spin", ""), ("with spin", "spin"))
        ]
        for (what, *_), (seconds, elapsed, _) in zip(
            kernels, least(kernels, 0, Path(folder) / "none"), strict=True
        ):
            says = f"{what}: {2.0 / seconds:.0f} million a second"
            print(f"| 2e6 | {says} | {seconds:.3f} | {elapsed:.3f} | |", flush=True)
        sums = (("DuckDB", "duckdb", _DUCKDB), ("Polars", "polars", _POLARS))
        peers = [(f"the same sums by {name}", body, "") for name, module, body in sums if find_spec(module)]
        for name, module, _ in sums:
            if not find_spec(module):
                print(f"{name} is left out: pip install {module}.", file=sys.stderr)
        cost_again: list[tuple[str, float]] = []
        for number, size in enumerate(given.sizes):
            n, path = int(float(size)), Path(folder) / f"{size}.parquet"
            run(_MADE, n, path)
            rows = [
                ("reading the columns with pyarrow, start included", _READ, ""),
                ("whole fit, least squares", _FIT, "lsq"),
                ("whole fit, exact", _FIT, "exact"),
                (_AGAIN[0], _FIT_AGAIN, "lsq"),
                ("the same with all facts and the summary", _SUMMARY, "exact"),
                ("closures compared", _COMPARE, ""),
                ("the sums of one pass alone, with checks, sample and window", _SUMS, ""),
                *peers,
            ]
            if n > 10_000_000:
                rows.append(("whole fit, least squares, two workers", _WORKERS, "2"))
            if n <= 1_000_000:
                rows += [
                    ("pandas and lmfit, file included", _LMFIT, ""),
                    (_AGAIN[1], _LMFIT_AGAIN, ""),
                    (_BY_PROFILE, _LMFIT, "intervals"),
                    ("scipy, file included", _SCIPY, ""),
                ]
            if number == 0:
                run(_FIT, n, path, "exact")  # what numba keeps is kept
            found = least(rows, n, path)
            again = {what: taken[:2] for (what, *_), taken in zip(rows, found, strict=True)}
            cost_again.append((size, again[_AGAIN[0]][0]))
            for (what, *_), (seconds, elapsed, memory) in zip(rows, found, strict=True):
                says = what
                if what == _AGAIN[1]:
                    ours = again[_AGAIN[0]]
                    ratios = (
                        f"{seconds / ours[0]:.1f} times the CPU, {elapsed / ours[1]:.1f} times the seconds"
                    )
                    says = f"{what}: {ratios} of the whole fit again"
                print(f"| {size} | {says} | {seconds:.3f} | {elapsed:.3f} | {memory:.2f} |", flush=True)
            if number == 0:
                text = path.with_suffix(".csv")
                # in a process of its own: those that follow begin with the memory of this one
                run(_CSV, n, path, str(text))
                says = "whole fit, exact, from CSV"
                ((seconds, elapsed, memory),) = least([(says, _FIT, "exact")], n, text)
                print(f"| {size} | {says} | {seconds:.2f} | {elapsed:.2f} | {memory:.2f} |", flush=True)
            path.unlink()
        for (size, seconds), (larger, more) in itertools.pairwise(cost_again):
            each = 1e6 * (more - seconds) / (float(larger) - float(size))
            print(f"\nfrom {size} to {larger} in one process an impact more costs {each:.4f} us", flush=True)


if __name__ == "__main__":
    main()
