"""Hard cases of simulated scenes."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from hard_cases.case import HardCase, Told, command, put

from ifrfit import Simulation, simulate

SCENE = "scene.toml"
_BASE = {
    "sphere": 'diameter_um = 5\nmaterial = "soda-lime-glass"',
    "wall": 'material = "soda-lime-glass"',
    "impact": "gamma_deg = [0, 45, 90]\nspeed_m_s = 1",
    "constants": "e_n = 0.97\ne_t = -0.95\nmu = 0.1",
    "contact": "interface_energy_J_m2 = 0.1\nrolling_friction = 0.01",
    "fluid": 'name = "water"',
}


def _put(folder: Path, top: str, tables: dict[str, str]) -> Path:
    text = top + "\n" + "\n".join(f"[{name}]\n{body}" for name, body in (_BASE | tables).items() if body)
    return put(folder, text, SCENE)


def _simulated(folder: Path, top: str, tables: dict[str, str]) -> Simulation:
    return simulate(_put(folder, top, tables))


def _told(folder: Path, top: str, tables: dict[str, str]) -> Told:
    _put(folder, top, tables)
    return command(folder, ["simulate", SCENE, "--out", "out"])


def _finite(outcomes: list[str] | None = None) -> Callable[[Simulation], None]:
    def check(found: Simulation) -> None:
        table = found.table()
        assert np.isfinite(table.select_dtypes("number").to_numpy()).all(), table
        assert (table["energy_change"] <= 1e-12).all()
        json.dumps(found.to_dict(), allow_nan=False)
        if outcomes is not None:
            assert list(table["outcome"]) == outcomes

    return check


def _case(
    name: str, what: str, answer: str, outcomes: list[str] | None = None, top: str = "", **tables: str
) -> HardCase:
    return HardCase(
        name, "scenes", what, answer, lambda folder: _simulated(folder, top, tables), _finite(outcomes)
    )


def _refused(name: str, what: str, answer: str, says: str, top: str = "", **tables: str) -> HardCase:
    def check(told: Any) -> None:
        assert told.status == 3, told
        assert says in told.err, told.err
        assert told.err.startswith("ifrfit: scene.toml")
        assert told.err.count("\n") == 1
        assert told.out == ""
        assert told.left == ()

    return HardCase(name, "scenes", what, answer, lambda folder: _told(folder, top, tables), check)


CASES = (
    _case(
        "no approach",
        "A scene at exactly 90 degrees, where V = 0, with adhesion, fluid and rolling friction.",
        "No capture, e_n as given, finite numbers.",
        ["rebounds"],
        impact="gamma_deg = 90\nspeed_m_s = 1",
        contact="interface_energy_J_m2 = 0.1",
        fluid="",
    ),
    _case(
        "around the sticking speed",
        "A 5 um glass sphere at 0.071 and 0.074 m/s, below and above its sticking speed of 0.073 m/s.",
        "Captured with v_n = 0, and a slow rebound.",
        ["captured", "rebounds"],
        impact="gamma_deg = 0\nspeed_m_s = [0.071, 0.074]",
        constants="e_n = 1\ne_t = -0.95\nmu = 0.1",
        contact="interface_energy_J_m2 = 0.1",
        fluid="",
    ),
    _case(
        "radius of 1 nm and of 1 m",
        "Spheres of 2 nm and of 2 m with adhesion, rolling friction and water.",
        "Finite numbers; the small one is captured, the large one is not.",
        ["captured", "rebounds"],
        impact="gamma_deg = 30\nspeed_m_s = 1",
        sphere='diameter_m = [2e-9, 2]\nmaterial = "soda-lime-glass"',
    ),
    _case(
        "the fastest scene",
        "Impacts at 100 km/s that yield, with adhesion.",
        "Finite numbers, no energy from nowhere.",
        ["rebounds", "rebounds", "rebounds"],
        impact="gamma_deg = [0, 45, 90]\nspeed_km_s = 100",
        constants="e_t = -0.95\nmu = 0.1",
    ),
    _case(
        "e_n of 0",
        "A scene with e_n = 0 and every effect that modifies it.",
        "Finite numbers, v_n = 0.",
        constants="e_n = 0\ne_t = -0.95\nmu = 0.1",
    ),
    _case(
        "Poisson's ratio of 0 and 0.5",
        "A sphere with nu = 0 on a wall with nu = 0.5.",
        "Finite numbers.",
        sphere="diameter_um = 5\nmaterial = { young_GPa = 1, poisson = 0, density_kg_m3 = 1000 }",
        wall="material = { young_GPa = 1, poisson = 0.5 }",
    ),
    _refused(
        "effect against constant",
        "A scene that gives e_n and lists plasticity, which computes it.",
        "Refused with exit status 3, nothing written: one of them has to go.",
        "effects lists plasticity, which computes what constants.e_n gives. Remove one.",
        'effects = ["plasticity"]',
    ),
    _refused(
        "effect without its numbers",
        "A scene that lists adhesion and knows no interface energy.",
        "Refused with exit status 3, nothing written: the missing key is named.",
        "contact.interface_energy_J_m2",
        'effects = ["adhesion"]',
        contact="",
    ),
    _refused(
        "liquid law in a gas",
        "A scene that lists the fluid and names air.",
        "Refused with exit status 3, nothing written: the law is that of liquids.",
        "the law is that of spheres in liquids",
        'effects = ["fluid"]',
        fluid='name = "air"',
    ),
    _refused(
        "one number in two units",
        "A scene with a diameter in mm and in m.",
        "Refused with exit status 3, nothing written: both keys are named.",
        "sphere.diameter_m and diameter_mm give the same twice. Remove one.",
        sphere="diameter_mm = 5\ndiameter_m = 0.005",
    ),
    _refused(
        "constant that creates energy",
        "A scene with e_t = 0 in closure IFR.",
        "Refused with exit status 3, nothing written: e_t lies between -1 and -2/5.",
        "constants.e_t: 0 is impossible (-1 to -0.4",
        constants="e_n = 0.9\ne_t = 0\nmu = 0.1",
    ),
)
