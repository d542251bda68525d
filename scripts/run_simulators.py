"""Exports read and run by the simulators that are here, beside the fitted curves: docs/simulators.

``make simulators`` installs LAMMPS, MuJoCo and PyBullet from the Python index and calls this. One sphere
without spin is shot at a wall over angles and speeds, the rebounds are read in the common schema (provenance
simulated), and fitted again.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import matplotlib as mpl
import numpy as np

import ifrfit
from ifrfit.exporters import mujoco as target_mujoco
from ifrfit.exporters import pybullet as target_pybullet
from ifrfit.exporters.exported_constants import ExportedConstants
from ifrfit.exporters.protocol import Conditions
from ifrfit.exporters.registry import EXPORTERS
from ifrfit.physics.angles import Incidence
from ifrfit.physics.closures import get_closure

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests"))
from lammps_impacts import lammps_here, shoot  # noqa: E402

FOLDER = ROOT / "docs" / "simulators"
ANGLES = np.array([5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0])
SPEEDS = (0.5, 2.0, 5.0)


@dataclass(frozen=True)
class Run:
    """Rebounds by one simulator: rows angle, speed, v_x/u, v_n/u, beta."""

    pair: str
    target: str
    engine: str
    constants: ExportedConstants
    rows: np.ndarray
    seconds: float


def pairs() -> dict[str, ExportedConstants]:
    """A fit of measured impacts, and published constants of a billiard-like pair and of a superball."""
    fit = ifrfit.fit("cornell-glass", closure="fr")
    measured = {name: fit.constants[name].value for name in ("e_n", "beta0", "mu")}
    # Cross (2010), Table I: a superball rebounds with e 0.81 from the disc and beta 0.55; no mu is printed
    given = {"glass on glass (cornell-glass)": measured} | {
        "golf ball on a superball's disc (Cross 2010; mu = 0.5 named)": {
            "e_n": 0.81,
            "beta0": 0.55,
            "mu": 0.5,
        },
        "steel on Zerodur (Joseph & Hunt 2004)": {"e_n": 0.97, "beta0": 0.34, "mu": 0.110},
    }
    return {name: ExportedConstants(get_closure("fr"), 0.4, values) for name, values in given.items()}


def run_lammps(name: str, constants: ExportedConstants) -> Run | None:
    """By LAMMPS, if it runs."""
    engine = lammps_here()
    if engine is None:
        return None
    lines = EXPORTERS["lammps"].translate(constants, Conditions()).lines
    begin = time.perf_counter()
    rows = [(a, s, *shoot(engine, lines, a, s)) for s in SPEEDS for a in ANGLES]
    seconds = time.perf_counter() - begin
    return Run(name, "lammps", f"LAMMPS {version('lammps')}", constants, np.array(rows), seconds)


def run_mujoco(name: str, constants: ExportedConstants) -> Run | None:
    """By MuJoCo, at the normal speed of the inversion and at others."""
    try:
        import mujoco
    except ImportError:
        return None
    lines = EXPORTERS["mujoco"].translate(constants, Conditions(speed=2.0)).lines
    contact = lines[2].split('geom2="sphere" ')[1].removesuffix("/>")
    begin = time.perf_counter()
    rows = []
    for speed in SPEEDS:
        for angle in ANGLES:
            tangent = np.tan(np.radians(angle))
            along, away, slip = target_mujoco.shoot(mujoco, contact, speed * tangent, speed)
            scale = np.cos(np.radians(angle)) / speed
            rows.append((angle, speed, along * scale, away * scale, -slip / (speed * tangent)))
    seconds = time.perf_counter() - begin
    return Run(name, "mujoco", f"MuJoCo {mujoco.__version__}", constants, np.array(rows), seconds)


def run_pybullet(name: str, constants: ExportedConstants) -> Run | None:
    """By PyBullet."""
    try:
        import pybullet
    except ImportError:
        return None
    begin = time.perf_counter()
    rows = []
    for speed in SPEEDS:
        for angle in ANGLES:
            tangent = np.tan(np.radians(angle))
            along, away, slip = target_pybullet.shoot(pybullet, constants, speed * tangent, speed)
            scale = np.cos(np.radians(angle)) / speed
            rows.append((angle, speed, along * scale, away * scale, -slip / (speed * tangent)))
    seconds = time.perf_counter() - begin
    return Run(name, "pybullet", f"PyBullet {version('pybullet')}", constants, np.array(rows), seconds)


def table_row(run: Run) -> str:
    """Largest deviations from the fitted curve, and the constants of the rebounds when fitted again."""
    angle, _, v_x, v_n, beta = run.rows.T
    incidence = Incidence.of(angle, degrees=True)
    fitted = run.constants.rebound(incidence)
    parts = []
    for found, wanted in (
        (v_n / incidence.cosine, fitted.v_n / incidence.cosine),
        (v_x, fitted.v_x),
        (beta, fitted.beta),
    ):
        at = int(np.argmax(np.abs(found - wanted)))
        parts.append(f"{found[at] - wanted[at]:+.3f} ({angle[at]:g}°)")
    again = ifrfit.fit(
        {
            "gamma_deg": angle,
            "speed_m_s": run.rows[:, 1],
            "beta": beta,
            "e_n": v_n / incidence.cosine,
            "sigma_beta": 1e-3,  # without noise of their own they could not be fitted
            "sigma_e_n": 1e-3,
            "provenance": ["simulated"] * angle.size,
        },
        closure="fr",
        method="lsq",
    )
    constants = ", ".join(f"{name} {again.constants[name].value:.3f}" for name in ("e_n", "beta0", "mu"))
    asked = ", ".join(f"{name} {value:.3f}" for name, value in run.constants.values.items())
    return f"| {run.pair} | {run.engine} | {asked} | {' | '.join(parts)} | {constants} | {run.seconds:.1f} |"


def draw(runs: list[Run]) -> None:
    """Fitted curve and the codes' own rebounds, beta against the angle, a panel a pair."""
    mpl.use("svg")
    mpl.rcParams["svg.hashsalt"] = "ifrfit"
    import matplotlib.pyplot as plt

    names = list(dict.fromkeys(run.pair for run in runs))
    figure, axes = plt.subplots(1, len(names), figsize=(4.2 * len(names), 3.6), sharey=True, squeeze=False)
    fine = np.linspace(1.0, 89.0, 200)
    for ax, name in zip(axes[0], names, strict=True):
        own = [run for run in runs if run.pair == name]
        ax.plot(
            fine, own[0].constants.rebound(Incidence.of(fine, degrees=True)).beta, "k-", label="fitted curve"
        )
        for run, mark in zip(own, "os^", strict=False):
            ax.plot(run.rows[:, 0], run.rows[:, 4], mark, fillstyle="none", label=run.engine)
        ax.set_title(name.partition(" (")[0], fontsize=9)
        ax.set_xlabel("incidence angle, degrees")
    axes[0][0].set_ylabel("beta of the contact point")
    axes[0][0].legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(FOLDER / "beta.svg", metadata={"Date": None})


def main() -> None:
    """Run what is here and write the page."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    found = [
        make(name, each) for name, each in pairs().items() for make in (run_lammps, run_mujoco, run_pybullet)
    ]
    runs = [run for run in found if run is not None]
    if not runs:
        raise SystemExit("No simulator runs here: make simulators installs them.")
    ran = {run.target for run in runs}
    draw(runs)
    others = [name for name in EXPORTERS if name not in {*ran, "python", "c", "json", "csv"}]
    text = (ROOT / "scripts" / "pages" / "simulators.md").read_text(encoding="utf-8")
    text += "\n".join(table_row(run) for run in runs)
    text += "\n\n![beta against the angle: fitted curve and the codes' rebounds](beta.svg)\n\n## Not run\n\n"
    text += "\n".join(
        f"- {EXPORTERS[name].title}: not run; checked against its documented form." for name in others
    )
    text += "\n- Drake, Chrono: no exporter.\n"
    (FOLDER / "README.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
