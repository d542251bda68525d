"""What of a result is frozen: numbers and words as JSON, without dates, versions and bulk."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from oracle.problems import Problem
from oracle.tables import write_table

import ifrfit
from ifrfit.inference.estimators import make_estimator, method_options
from ifrfit.inference.option_fields import build, options_of
from ifrfit.inference.options import Noise

if TYPE_CHECKING:
    import pandas as pd

ROOT = Path(__file__).parents[2]

_PASSING = ("created", "versions", "command", "ifrfit")  # of the run, not of the question
_ROWS = 5  # of draws and of other long tables

# a scene whose constants are a fit's posterior
_SCENE = """
observables = ["beta", "e_n"]
[sphere]
diameter_mm = 10
[impact]
gamma_deg = { from = 5, to = 85, count = 9 }
speed_m_s = 2
[constants]
result = "result.json"
series = "b"
"""


def run(problem: Problem, folder: Path) -> dict[str, Any]:
    """Solve one problem.

    Parameters
    ----------
    problem : Problem
    folder : Path
        Empty, for files.

    Returns
    -------
    dict
        Only str, int, float, bool, None, list and dict.
    """
    if problem.call == "rebound":
        return _rebound(problem)
    if problem.call == "simulate":
        scene = ROOT / "docs" / "scenes" / f"{problem.data}.toml"
        return _simulation(ifrfit.simulate(scene, **problem.options))
    names = (problem.data,) if isinstance(problem.data, str) else problem.data
    data = [_data(name, folder) for name in names]
    if problem.call == "compare":
        return _comparison(ifrfit.compare(data, **_with_objects(problem.options)))
    if problem.call == "simulate-fit":
        ifrfit.fit(data, separate="mu").save(folder / "result.json")
        (folder / "scene.toml").write_text(_SCENE, encoding="utf-8")
        return _simulation(ifrfit.simulate(folder / "scene.toml", **problem.options))
    options = dict(problem.options)
    if "scene" in options:
        options["scene"] = ROOT / options["scene"]
    return _fit(ifrfit.fit(data, **_with_objects(options, method=True)), problem)


def _with_objects(options: Mapping[str, Any], *, method: bool = False) -> dict[str, Any]:
    """The same with objects for the noise and the method, made as the command line makes them."""
    objects = options_of(Noise) | method_options()
    found: dict[str, Any] = {key: value for key, value in options.items() if key not in objects}
    found["noise"] = build(Noise, options)
    return found | {"method": make_estimator(options.get("method"), options)} if method else found


def _data(name: str, folder: Path) -> str | Path:
    return write_table(name.removeprefix("table:"), folder) if name.startswith("table:") else name


def _fit(result: ifrfit.FitResult, problem: Problem) -> dict[str, Any]:
    content = _without(result.to_dict(), *_PASSING)
    points = content.pop("points")
    content["points"] = {name: points[name] for name in ("sigma_used", "fitted", "sticking")}
    sample = content["state"].pop("sample", None)
    if sample is not None:
        content["state"]["sample"] = {name: column[:_ROWS] for name, column in sample.items()}
    for source in content["input"]:
        source.pop("descriptor", None)
        source.pop("sha256")
    if "effort" in content:
        content["effort"].pop("seconds")
    content["draws"] = _table(result.draws(_ROWS, np.random.default_rng(11)))
    content["predictions"] = [_table(result.predict(**asked)) for asked in problem.predict]
    if problem.intervals:
        content["intervals"] = _table(result.intervals())
    # the time that a fit took is of the machine
    # in the words of a shell, as the command line has it
    summary = replace(result, command="ifrfit fit").summary()
    content["summary"] = [line for line in summary.splitlines() if " effort: " not in line]
    return content


def _comparison(comparison: ifrfit.Comparison) -> dict[str, Any]:
    content = _without(comparison.to_dict(), *_PASSING)
    content["summary"] = comparison.summary().splitlines()
    for source in content["input"]:
        source.pop("descriptor", None)
        source.pop("sha256")
    return content


def _simulation(simulation: ifrfit.Simulation) -> dict[str, Any]:
    content = _without(simulation.to_dict(), *_PASSING)
    content["curves"] = _table(_some(simulation.curves()))
    content["impacts"] = _table(_some(simulation.table()))
    content["rebounds"] = _table(_some(simulation.rebounds()))
    content["summary"] = simulation.summary().splitlines()
    return content


def _rebound(problem: Problem) -> dict[str, Any]:
    gamma = np.array([0.0, 5.0, 15.0, 30.0, 45.0, 60.0, 75.0, 85.0, 90.0])
    spins = {"none": (0.0, 0.0), "back": (0.0, 0.4), "lateral": (0.3, -0.2)}
    names = (
        "v_x",
        "v_y",
        "v_n",
        "spin_x",
        "spin_y",
        "contact_x",
        "contact_y",
        "sticking",
        "beta",
        "beta_cm",
        "beta_tot",
        "mu_app",
        "delta",
        "lambda_",
        "tan_psi_after",
        "mu_app_magnitude",
        "energy_change",
    )
    found = {}
    for name, (spin_x, spin_y) in spins.items():
        r = ifrfit.rebound(gamma, spin_x, spin_y, degrees=True, **problem.options)
        found[name] = {field: _cells(np.broadcast_to(getattr(r, field), gamma.shape)) for field in names}
    return found


def _some(table: pd.DataFrame) -> pd.DataFrame:
    """At most 60 rows, spread evenly."""
    return table.iloc[:: max(1, math.ceil(len(table) / 60))]


def _table(table: pd.DataFrame) -> dict[str, list[Any]]:
    return {str(name): _cells(table[name].to_numpy()) for name in table.columns}


def _cells(column: np.ndarray) -> list[Any]:
    """Plain values; nan and infinity as text, which JSON has no numbers for."""
    return [str(x) if isinstance(x, float) and not math.isfinite(x) else x for x in column.tolist()]


def _without(content: dict[str, Any], *names: str) -> dict[str, Any]:
    return {key: value for key, value in content.items() if key not in names}
