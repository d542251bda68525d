"""CPU time of importing projects of digitisers, in fresh processes, beside commands that import nothing.

``python benchmarks/figure_import.py [--repeats 9] [--out DIR] [--readme]``
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from _common import benchmark_parser, cells, machine, publish, verdict

# isort: split

import numpy as np

N_POINTS = 1000
GOAL = 0.2  # seconds beyond the start
_START = "import numpy, pandas"
CLICKS = ((100.0, 500.0), (700.0, 500.0), (90.0, 480.0), (90.0, 80.0))
TEXTS = (("0", "-1"), ("90", "-1"), ("0", "-1"), ("90", "1"))


def points(count: int) -> list[tuple[float, float]]:
    """Pixels of angles from 2 to 88 degrees and of values between -0.9 and 0.9."""
    rng = np.random.default_rng(20230101)
    gamma, value = np.linspace(2.0, 88.0, count), rng.uniform(-0.9, 0.9, count)
    pixels = np.column_stack([100.0 + 600.0 * gamma / 90.0, 280.0 - 200.0 * value])
    return [(float(x), float(y)) for x, y in pixels]


def webplotdigitizer(count: int) -> str:
    """A project of version 4."""
    given = [
        {"px": px, "py": py, "dx": dx, "dy": dy, "dz": None}
        for (px, py), (dx, dy) in zip(CLICKS, TEXTS, strict=True)
    ]
    axes = {"name": "XY", "type": "XYAxes", "isLogX": False, "isLogY": False, "calibrationPoints": given}
    data = [{"x": x, "y": y, "value": [x, y]} for x, y in points(count)]
    dataset = {"name": "glass", "axesName": "XY", "metadataKeys": [], "data": data}
    return json.dumps(
        {"version": [4, 2], "axesColl": [axes], "datasetColl": [dataset], "measurementColl": []}
    )


def engauge(count: int) -> str:
    """A document of version 12."""
    corners = ((100.0, 480.0, 0, -1), (700.0, 480.0, 90, -1), (700.0, 80.0, 90, 1))
    axes = "".join(
        f'<Point Identifier="Axes&#9;point&#9;{i}"><PositionScreen X="{x}" Y="{y}"/>'
        f'<PositionGraph X="{a}" Y="{b}"/></Point>'
        for i, (x, y, a, b) in enumerate(corners)
    )
    read = "".join(
        f'<Point Identifier="glass&#9;point&#9;{i}"><PositionScreen X="{x}" Y="{y}"/></Point>'
        for i, (x, y) in enumerate(points(count))
    )
    return (
        '<?xml version="1.0" encoding="UTF-8"?><!DOCTYPE engauge><Document VersionNumber="12.1"><CoordSystem>'
        '<Coords TypeString="Cartesian" ScaleXThetaString="Linear" ScaleYRadiusString="Linear"/>'
        f'<Curve CurveName="Axes"><CurvePoints>{axes}</CurvePoints></Curve><CurvesGraphs>'
        f'<Curve CurveName="glass"><CurvePoints>{read}</CurvePoints></Curve>'
        "</CurvesGraphs></CoordSystem></Document>"
    )


def runner(arguments: list[str]) -> Callable[[], float]:
    """A command that must succeed, and the CPU seconds that it took."""

    def run() -> float:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run(arguments, check=False, capture_output=True, text=True, timeout=120)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        if done.returncode:
            sys.exit(f"{' '.join(arguments[-5:])}: exit status {done.returncode}\n{done.stderr}")
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    return run


def main() -> None:
    parser = benchmark_parser(__doc__)
    parser.add_argument("--repeats", type=int, default=9)
    options = parser.parse_args()
    script = Path(sys.executable).with_name("ifrfit")
    ifr = [str(script)] if script.exists() else [sys.executable, "-m", "ifrfit"]
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        cases = {
            _START: runner([sys.executable, "-c", "import numpy, pandas"]),
            "ifrfit import --help": runner([*ifr, "import", "--help"]),
        }
        for name, write, ending in (
            ("WebPlotDigitizer", webplotdigitizer, "json"),
            ("Engauge", engauge, "dig"),
        ):
            for count in (3, N_POINTS):
                file = folder / f"figure{count}.{ending}"
                file.write_text(write(count), encoding="utf-8")
                given = ["import", str(file), "--x", "gamma_deg", "--y", "beta"]
                cases[f"ifrfit import, {count} points of {name}"] = runner([*ifr, *given])
        times: dict[str, list[float]] = {name: [] for name in cases}
        for number in range(options.repeats + 1):
            for name, run in cases.items():
                seconds = run()
                if number:  # the first round only fills the disk cache
                    times[name].append(seconds)
    print(machine())
    print(f"least of {options.repeats} rounds in turns, CPU time of fresh processes\n")
    start = min(times[_START])
    rows = []
    for name, seconds in times.items():
        few = min(times.get(name.replace(f"{N_POINTS} points", "3 points"), seconds))
        is_goal = f"{N_POINTS} points" in name
        rows.append(
            {
                "command": name,
                "time_s": min(seconds),
                "over_start_s": min(seconds) - start,
                "over_few_s": min(seconds) - few,
                "goal": f"{GOAL:g} s over the start" if is_goal else "",
                "verdict": verdict(min(seconds) - start <= GOAL) if is_goal else "",
            }
        )
    columns = {
        "command": "{command}",
        "CPU time": "{time_s:.3f} s",
        "over the start": "{over_start_s:.3f} s",
        "over 3 points": "{over_few_s:.3f} s",
        "goal": "{goal}",
        "verdict": "{verdict}",
    }
    publish(options, "figure import", rows, cells(rows, columns))


if __name__ == "__main__":
    main()
