"""Wall time of the command line in fresh processes, beside an interpreter that does nothing.

Goals are seconds on a machine that imports numpy, scipy.optimize and pandas in 0.96 s; on another one the
ratio to that import, in the same run, is held against them.

``python benchmarks/cli_start.py [--repeats 7] [--out DIR] [--readme]``
"""

from __future__ import annotations

import shutil
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from _common import benchmark_parser, cells, machine, publish, seconds_of, verdict

# isort: split

import numpy as np

import ifrfit

N_ROWS = 100
IMPORTS, IMPORTS_S = "import numpy, scipy.optimize, pandas", 0.96


def write_impacts(path: Path) -> None:
    """Write 100 rows of beta with sigma."""
    rng = np.random.default_rng(20230101)
    gamma = np.linspace(5.0, 85.0, N_ROWS)
    beta = ifrfit.rebound(gamma, e_n=0.9, e_t=-0.75, mu=0.2, degrees=True).beta + rng.normal(0, 0.03, N_ROWS)
    lines = [f"{g:.3f},beta,{b:.5f},0.03" for g, b in zip(gamma, beta, strict=True)]
    path.write_text("\n".join(["gamma_deg,observable,value,sigma", *lines, ""]), encoding="utf-8")


def runner(arguments: list[str], folder: Path | None = None) -> Callable[[], None]:
    """Run a command that must succeed, after removing what an earlier run wrote."""

    def run() -> None:
        done = subprocess.run(arguments, check=False, capture_output=True, text=True, timeout=120)
        if done.returncode:
            sys.exit(f"{' '.join(arguments[-5:])}: exit status {done.returncode}\n{done.stderr}")

    if folder is None:
        return run

    def run_afresh() -> None:
        shutil.rmtree(folder, ignore_errors=True)
        run()

    return run_afresh


def main() -> None:
    parser = benchmark_parser(__doc__)
    parser.add_argument("--repeats", type=int, default=7)
    options = parser.parse_args()
    script = Path(sys.executable).with_name("ifrfit")
    ifr = [str(script)] if script.exists() else [sys.executable, "-m", "ifrfit"]
    with tempfile.TemporaryDirectory() as temporary:
        data, folder = Path(temporary) / "impacts.csv", Path(temporary) / "out"
        write_impacts(data)
        fit = [*ifr, "fit", str(data), "--fix", "e_n=0.9"]
        cases = [
            ("python -c pass", runner([sys.executable, "-c", "pass"]), None),
            (IMPORTS, runner([sys.executable, "-c", IMPORTS]), None),
            ("ifrfit --help", runner([*ifr, "--help"]), 0.12),
            (f"ifrfit fit CSV({N_ROWS} rows) --json", runner([*fit, "--json"]), 1.0),
            (f"ifrfit fit CSV({N_ROWS} rows) --out DIR", runner([*fit, "--out", str(folder)], folder), 3.0),
        ]
        times: dict[str, list[float]] = {name: [] for name, _, _ in cases}
        for number in range(options.repeats + 1):
            for name, run, _ in cases:
                seconds = seconds_of(run)
                if number:  # the first round only fills the disk cache
                    times[name].append(seconds)
    medians = {name: statistics.median(seconds) for name, seconds in times.items()}
    print(machine())
    print(f"median of {options.repeats}, fresh processes\n")
    rows = [
        {
            "command": name,
            "time_s": medians[name],
            "ratio": medians[name] / medians[cases[0][0]],
            "of_imports": medians[name] / medians[IMPORTS],
            "goal": "" if goal is None else f"{goal / IMPORTS_S:.2f} ({goal:g} s)",
            "verdict": "" if goal is None else verdict(medians[name] / medians[IMPORTS] <= goal / IMPORTS_S),
        }
        for name, _, goal in cases
    ]
    columns = {
        "command": "{command}",
        "time": "{time_s:.3f} s",
        "over bare python": "{ratio:.1f}",
        "over the imports": "{of_imports:.2f}",
        "goal": "{goal}",
        "verdict": "{verdict}",
    }
    publish(options, "command line", rows, cells(rows, columns))


if __name__ == "__main__":
    main()
