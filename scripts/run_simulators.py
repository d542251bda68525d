"""Exports read and run by the simulators that are here, beside the fitted curves: docs/simulators.

``make simulators`` installs those of the Python index and calls this. One sphere is shot at a wall over
angles, speeds and spins with the exported text as it is; the rebounds are read in the common schema
(provenance simulated), fitted, and drawn.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import numpy as np

import ifrfit
from ifrfit.exporters.exported_constants import ExportedConstants
from ifrfit.exporters.protocol import Conditions, Translation
from ifrfit.exporters.registry import EXPORTERS
from ifrfit.physics.angles import Incidence
from ifrfit.physics.closure import rotational_share
from ifrfit.physics.closures import get_closure

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests"))
from simulators import drake  # noqa: E402
from simulators.registry import SIMULATORS  # noqa: E402
from simulators.shots import Rebounds, Shots  # noqa: E402

FOLDER = ROOT / "docs" / "simulators"
ANGLES = np.array([5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0])
SPEEDS = np.array([0.5, 2.0, 5.0])  # of approach, m/s
SPINS = np.array([-0.55, 0.0, 0.55])  # the slip vanishes at none of the angles
LATERALS = np.array([-0.4, 0.4])
TWIST = 0.55
ASKED_SPEED, ASKED_ANGLE = 2.0, 40.0
SIGMA = 1e-3  # of velocities over the incoming speed: without noise of their own they could not be fitted
ONLY_CONSTANTS = {"python", "c", "json", "csv"}
WHY_NOT = {
    "mercurydpm": "no package of Debian or of the Python index",
    "mfix": "no package of Debian or of the Python index",
    "dynamo": "no package of Debian or of the Python index",
    "chrono": "no package of Debian; of the Python index `pychrono` is another project, `projectchrono` a "
    "reserved name without files",
}


@dataclass(frozen=True)
class Run:
    """Rebounds by one simulator, and one head-on at the asked speed.

    At that speed also with spins along the motion (`sideways`), and about the normal (`twisted`).
    """

    pair: str
    target: str
    engine: str
    constants: ExportedConstants
    translation: Translation
    found: Rebounds
    head_on: float
    seconds: float
    sideways: Rebounds | None
    twisted: Rebounds | None


def pairs() -> dict[str, ExportedConstants]:
    """A fit of measured impacts, and published constants of a superball and of a hard polymer ball."""
    fit = ifrfit.fit("cornell-glass", closure="fr")
    given = {
        "glass on glass (fit of cornell-glass)": {
            name: fit.constants[name].value for name in ("e_n", "beta0", "mu")
        },
        # Cross (2010), Table I, 25 degrees from the normal; it sticks there, and no mu is printed
        "superball on granite (Cross 2010; mu = 0.5 is named)": {"e_n": 0.78, "beta0": 0.49, "mu": 0.5},
        # no pair of billiard balls is among the published constants: the nearest hard polymer
        "delrin on delrin (Cornell chart 1999)": {"e_n": 0.97, "beta0": 0.54, "mu": 0.14},
    }
    return {name: ExportedConstants(get_closure("fr"), 0.4, values) for name, values in given.items()}


def run(pair: str, constants: ExportedConstants, target: str) -> Run:
    """Export, and shoot."""
    exporter, simulator = EXPORTERS[target], SIMULATORS[target]
    at = Conditions(
        ASKED_ANGLE if "angle" in exporter.takes else None, ASKED_SPEED if "speed" in exporter.takes else None
    )
    translation = exporter.translate(constants, at)
    spinning = target != "openfoam"
    shots = Shots.over(ANGLES, SPEEDS, SPINS if spinning else SPINS[1:2])
    begin = time.perf_counter()
    found = simulator.shoot(translation.lines, shots)
    seconds = time.perf_counter() - begin
    head_on = simulator.shoot(translation.lines, Shots.over([0.0], [ASKED_SPEED], [0.0])).v_n[0]
    engine = f"{exporter.title} {simulator.version()}"
    sideways = twisted = None
    if spinning:
        sideways = simulator.shoot(
            translation.lines, Shots.over(ANGLES, [ASKED_SPEED], SPINS, laterals=LATERALS)
        )
        twisted = simulator.shoot(translation.lines, Shots.over(ANGLES, [ASKED_SPEED], SPINS, twists=[TWIST]))
    return Run(
        pair, target, engine, constants, translation, found, float(head_on), seconds, sideways, twisted
    )


def fitted_again(run: Run) -> str:
    """Constants of closure FR that least squares finds in the rebounds."""
    found, shots = run.found, run.found.shots
    incidence = shots.incidence
    table = {
        "gamma_deg": shots.angle,
        "speed_m_s": shots.speed,
        "spin_y": shots.spin,
        "e_n": found.e_n,
        "sigma_e_n": SIGMA / incidence.cosine,
        "provenance": ["simulated"] * shots.angle.size,
    }
    if run.target == "openfoam":  # no spin, so no contact point
        table |= {"beta_cm": -found.v_x / incidence.sine, "sigma_beta_cm": SIGMA / incidence.sine}
    else:
        table |= {"beta": found.beta, "sigma_beta": SIGMA / np.abs(incidence.slip_x)}
    again = ifrfit.fit(table, closure="fr", method="lsq")
    values = ((name, again.constants[name].value) for name in ("e_n", "beta0", "mu"))
    # z: no minus before a zero
    return ", ".join(f"{name} {'not determined' if x is None else f'{x:z.3f}'}" for name, x in values)


def worst(deviation: np.ndarray, shots: Shots, *, speed: bool = True) -> str:
    """The largest deviation, and where; with the speed, where there are several."""
    at = int(np.argmax(np.round(np.abs(deviation), 4)))  # of equal ones the first
    if abs(deviation[at]) < 5e-5:
        return "below 0.0001"
    spin = f", spin {shots.spin[at]:+g}" if shots.spin[at] else ""
    fast = f", {shots.approach[at]:g} m/s" if speed else ""
    return f"{deviation[at]:+.4f} ({shots.angle[at]:g}°{fast}{spin})"


def deviations(run: Run) -> dict[str, str]:
    """From the fitted curve: e_n at the asked speed and at all, v_x/u, spin; and from the stated law."""
    found, shots = run.found, run.found.shots
    fitted = run.constants.rebound(shots.incidence)
    asked = shots.approach == ASKED_SPEED
    at_asked = shots.take(asked)
    off = found.e_n - run.constants.e_n
    words = {
        "head on": f"{run.head_on - run.constants.e_n:+z.4f}",
        "asked": worst(off[asked], at_asked),
        "all": worst(off, shots),
        "v_x": worst(found.v_x - fitted.v_x, shots),
        "spin": "no spin" if run.target == "openfoam" else worst(found.spin - fitted.spin_y, shots),
    }
    if run.translation.how == "run":
        words["law"] = "the code is the law"
    else:
        law = run.translation.response(at_asked.incidence)
        words["law"] = worst(
            np.maximum(np.abs(found.v_x[asked] - law.v_x), np.abs(found.v_n[asked] - law.v_n)), at_asked
        )
    return words


def table(runs: Sequence[Run]) -> str:
    """A table a pair."""
    text = ""
    for pair in dict.fromkeys(run.pair for run in runs):
        own = [run for run in runs if run.pair == pair]
        asked = ", ".join(f"{name} {value:.3f}" for name, value in own[0].constants.values.items())
        text += (
            f"## {pair[0].upper()}{pair[1:]}\n\nExported: {asked}.\n\n"
            "| code | e_n head-on | e_n at 2 m/s | e_n at all speeds | v_x/u | R Omega/u | from the stated "
            "law, at 2 m/s | fitted again | s |\n|---|---|---|---|---|---|---|---|---|\n"
        )
        for run in own:
            said = deviations(run)
            cells = (
                run.engine, said["head on"], said["asked"], said["all"], said["v_x"], said["spin"],
                said["law"], fitted_again(run), f"{run.seconds:.1f}",
            )  # fmt: skip
            text += f"| {' | '.join(cells)} |\n"
        text += "\n"
    return text


def spins_across(runs: Sequence[Run]) -> str:
    """What spins along the motion and about the normal do, of every code that has spins."""
    text = (
        "## Spins about the other axes\n\n"
        f"At {ASKED_SPEED:g} m/s, with spins of {' and '.join(f'{x:g}' for x in LATERALS)} along the motion "
        "beside those above: the largest deviations from the fitted curve, and of v_y/u from the law that "
        f"the export states. The last two: by how much a spin of {TWIST:g} about the normal changes v_x/u, "
        "v_y/u or v_n/u, and what the impact takes from it.\n\n"
        "| pair | code | v_x/u | v_y/u | R Omega_x/u | v_y/u, stated law | by the spin about the normal | of "
        "that spin |\n|---|---|---|---|---|---|---|---|\n"
    )
    for run in runs:
        found, twisted = run.sideways, run.twisted
        if found is None or twisted is None:
            continue
        shots = found.shots
        fitted = run.constants.rebound(shots.incidence)
        off = [found.v_x - fitted.v_x, found.v_y - fitted.v_y, found.lateral - fitted.spin_x]
        words = [worst(each, shots, speed=False) for each in off]
        if run.translation.how == "run":
            words.append("the code is the law")
        else:
            beta = run.translation.response(shots.incidence).beta
            push = rotational_share(run.constants.inertia_factor) * (1.0 + beta) * shots.incidence.slip_y
            words.append(worst(found.v_y + push, shots, speed=False))
        rows = run.found.shots.approach == ASKED_SPEED
        changes = [getattr(twisted, name) - getattr(run.found, name)[rows] for name in ("v_x", "v_y", "v_n")]
        words.append(worst(max(changes, key=lambda x: np.abs(x).max()), twisted.shots, speed=False))
        words.append(worst(twisted.twist - TWIST, twisted.shots, speed=False))
        text += f"| {run.pair.partition(' (')[0]} | {run.engine} | {' | '.join(words)} |\n"
    return text + "\n"


def time_steps(constants: ExportedConstants) -> str:
    """What a discrete time step of Drake takes from the restitution."""
    lines = EXPORTERS["drake"].translate(constants, Conditions(speed=ASKED_SPEED)).lines
    shot = Shots.over([0.0], [ASKED_SPEED], [0.0])
    parts = []
    for steps in (30, 100, 300, 1000, 3000):
        back = drake.shoot(lines, shot, time_step=drake.DURATION / steps).v_n[0]
        parts.append(f"{back - constants.e_n:+.4f} with {steps}")
    return (
        "A discrete time step of Drake damps, too. Of a contact that lasts pi sqrt(m/k), e_n = "
        f"{constants.e_n:.3f} is off head-on by {', '.join(parts)} steps.\n\n"
    )


def draw(runs: Sequence[Run]) -> None:
    """Fitted curves and the codes' own rebounds, beta against the angle: a row a code, a column a pair."""
    mpl.use("svg")
    mpl.rcParams["svg.hashsalt"] = "ifrfit"
    import matplotlib.pyplot as plt

    names = list(dict.fromkeys(run.pair for run in runs))
    engines = list(dict.fromkeys(run.engine for run in runs if run.target != "openfoam"))
    size = (3.3 * len(names), 1.9 * len(engines))
    figure, axes = plt.subplots(
        len(engines), len(names), figsize=size, sharex=True, sharey=True, squeeze=False
    )
    fine = np.linspace(1.0, 89.0, 400)
    for run in runs:
        if run.target == "openfoam":
            continue
        ax = axes[engines.index(run.engine)][names.index(run.pair)]
        shots = run.found.shots
        for spin, colour, mark in zip(SPINS, ("#0072b2", "#000000", "#d55e00"), ["v", "o", "^"], strict=True):
            incidence = Incidence.of(fine, 0.0, spin, degrees=True)
            ax.plot(fine, run.constants.rebound(incidence).beta, "-", color=colour, linewidth=1.0)
            rows = (shots.spin == spin) & (shots.approach == ASKED_SPEED)
            label = f"spin {spin:+g}" if spin else "no spin"
            ax.plot(
                shots.angle[rows], run.found.beta[rows], mark, color=colour, fillstyle="none", markersize=4,
                label=label, linestyle="none",
            )  # fmt: skip
        ax.set_ylim(-1.1, 1.1)
    for ax, name in zip(axes[0], names, strict=True):
        ax.set_title(name.partition(" (")[0], fontsize=9)
    for row, engine in zip(axes, engines, strict=True):
        row[0].set_ylabel(f"{engine}\nbeta", fontsize=8)
    for ax in axes[-1]:
        ax.set_xlabel("incidence angle, degrees", fontsize=8)
    axes[0][0].legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(FOLDER / "beta.svg", metadata={"Date": None})


def main() -> None:
    """Run what is here and write the page."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    here = [name for name in SIMULATORS if SIMULATORS[name].version()]
    if not here:
        raise SystemExit("No simulator runs here: make simulators installs them.")
    given = pairs()
    runs = [run(pair, constants, target) for pair, constants in given.items() for target in here]
    draw(runs)
    text = (
        (ROOT / "scripts" / "pages" / "simulators.md").read_text(encoding="utf-8")
        + table(runs)
        + spins_across(runs)
    )
    if "drake" in here:
        text += time_steps(next(iter(given.values())))
    text += (
        "![beta against the angle: fitted curves and the codes' rebounds](beta.svg)\n\n"
        f"Lines: the fitted curve. Marks: the codes' own rebounds at {ASKED_SPEED:g} m/s of approach.\n\n## "
        "Not run\n\n"
    )
    others = [name for name in EXPORTERS if name not in {*here, *ONLY_CONSTANTS}]
    text += "\n".join(
        f"- {EXPORTERS[name].title}: not run ({WHY_NOT.get(name, 'not installed')}); checked against its "
        "documented form."
        for name in others
    )
    (FOLDER / "README.md").write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
