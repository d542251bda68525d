"""Make the stand-in datasets from what the paper's text prints and from assumptions that each one lists.

``python scripts/make_stand_ins.py [FOLDER]`` writes the same bytes every time; the default is datasets/.
The printed constants, conditions and spreads are in stand_ins.toml. Noise goes on what is measured
(velocities of the centre and spin after the impact) and every observable is derived from those noisy values,
so the faces of an impact agree with one another. The seed is the SHA-256 of the dataset's name.
"""

from __future__ import annotations

import hashlib
import sys
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ifrfit.data.descriptor import write_folder
from ifrfit.physics.angles import sincos
from ifrfit.physics.rebound import rebound

Array = NDArray[np.float64]
HERE = Path(__file__).resolve().parent
LICENCE = {"name": "BSD-3-Clause", "title": "BSD 3-Clause, as ifrfit: the numbers are made by it"}


@dataclass(frozen=True)
class Measured:
    """What an experimenter has of each impact: exact state before, noisy state after, per incoming speed."""

    gamma_deg: Array
    spin: Array  # R omega_y/u of the impact itself, not the nominal one
    v_x: Array
    v_n: Array
    spin_after: Array

    def observe(self, observable: str) -> tuple[Array, tuple[Array, Array, Array]]:
        """Value of an observable and its derivatives by v_x, v_n and the spin after."""
        sine, cosine = sincos(self.gamma_deg, degrees=True)
        slip = sine + self.spin
        contact = self.v_x + self.spin_after
        zero, degrees = np.zeros_like(sine), np.degrees(1.0)
        match observable:
            case "beta":
                return -contact / slip, (-1.0 / slip, zero, -1.0 / slip)
            case "psi_after_deg":
                slope = degrees * cosine / (contact**2 + cosine**2)
                return degrees * np.arctan2(contact, cosine), (slope, zero, slope)
            case "mu_app":
                change = self.v_n + cosine
                value = (sine - self.v_x) / change
                return value, (-1.0 / change, -value / change, zero)
            case "beta_tot":
                value = np.hypot(self.v_x, self.v_n)
                return value, (self.v_x / value, self.v_n / value, zero)
            case "delta_deg":
                square = self.v_x**2 + self.v_n**2
                slopes = (degrees * self.v_n / square, -degrees * self.v_x / square, zero)
                return degrees * np.arctan2(self.v_x, self.v_n), slopes
        raise ValueError(f"no rule for {observable}")


def angles(series: Mapping[str, Any]) -> Array:
    """Incidence angles in degrees as the rows will state them: evenly spaced in angle, or in its tangent."""
    grid = series.get("gamma_deg") or series["tan_gamma"]
    points = np.linspace(float(grid["first"]), float(grid["last"]), int(grid["n"]))
    degrees = points if "gamma_deg" in series else np.degrees(np.arctan(points))
    return np.asarray(np.round(degrees, 6), dtype=float)


def draw(quantity: Mapping[str, float], n: int, rng: np.random.Generator) -> Array:
    """One true value an impact, uniform over value +- spread."""
    return np.asarray(quantity["value"] + quantity["spread"] * rng.uniform(-1.0, 1.0, n))


def spins(series: Mapping[str, Any], n: int, rng: np.random.Generator) -> tuple[Array, Array, float, float]:
    """Draw true speeds and R omega_y/u of the impacts, with the nominal R omega_y/u and its deviation."""
    speed = series.get("speed_m_s", {"value": np.nan, "spread": 0.0})
    speeds = draw(speed, n, rng)
    if "spin_rad_s" not in series:
        return speeds, np.zeros(n), 0.0, 0.0
    rate, radius = series["spin_rad_s"], series["radius_m"]
    nominal = radius * rate["value"] / speed["value"]
    # standard deviation of a uniform spread is spread/sqrt(3); a ratio adds relative variances
    relative = np.hypot(rate["spread"] / rate["value"], speed["spread"] / speed["value"]) / np.sqrt(3.0)
    return speeds, radius * draw(rate, n, rng) / speeds, nominal, nominal * float(relative)


def number(value: float) -> str:
    """Write in fixed notation, the same on every platform; empty if there is no number."""
    return "" if np.isnan(value) else f"{value:z.6f}"


def rows_of(
    name: str, series: Mapping[str, Any], level: float, rng: np.random.Generator
) -> list[dict[str, str]]:
    """Make the rows of one series: impacts drawn, rebounded, measured with noise and observed."""
    gamma = angles(series)
    n = len(gamma)
    speeds, spin, nominal, sigma_spin = spins(series, n, rng)
    exact = rebound(gamma, spin_y=spin, degrees=True, **series["constants"])
    true = Measured(gamma, spin, exact.v_x, exact.v_n, exact.spin_y)
    noise = level * rng.standard_normal((3, n))
    measured = Measured(gamma, spin, exact.v_x + noise[0], exact.v_n + noise[1], exact.spin_y + noise[2])
    stated = series.get("speed_m_s", {})
    shown = speeds if stated.get("individual") else np.full(n, stated.get("value", np.nan))
    label = str(series["label"])
    slug = label.replace(" ", "-").replace("/", "-per-")
    rows = []
    for observable in series["observables"]:
        value, _ = measured.observe(observable)
        # slopes at the noise-free state: a weight must not know its own point's noise
        sigma = level * np.sqrt(sum(slope**2 for slope in true.observe(observable)[1]))
        rows += [
            {
                "series": label,
                "observable": observable,
                "gamma_deg": number(gamma[i]),
                "spin_x": number(0.0),
                "spin_y": number(nominal),
                "sigma_spin_y": number(sigma_spin) if sigma_spin else "",
                "speed_m_s": number(shown[i]),
                "value": number(value[i]),
                "sigma": number(sigma[i]),
                "impact_id": f"{name}-{slug}-{i + 1:02d}",
                "provenance": "stand-in",
            }
            for i in range(n)
        ]
    return rows


def _range(series: Mapping[str, Any]) -> str:
    """Say over which incidence a series goes."""
    if "tan_gamma" in series:
        return f"tan gamma from {series['tan_gamma']['first']:g} to {series['tan_gamma']['last']:g}"
    return f"incidence from {series['gamma_deg']['first']:g} to {series['gamma_deg']['last']:g} degrees"


def assumptions(spec: Mapping[str, Any]) -> list[str]:
    """List everything the paper does not print, in sentences."""
    listed = [
        "The impacts follow the IFR closure with the constants the paper prints; a fit recovers what was "
        "put in.",
        f"Noise: independent and normal, {100 * spec['noise_level']:g} % of the incoming speed, on v_x, v_n "
        "and R Omega_y after the impact. The paper prints no noise level.",
        "sigma is that noise propagated to first order, at the noise-free state. Incidence angles are exact.",
    ]
    for series in spec["series"]:
        listed.append(
            f"Series '{series['label']}': {len(angles(series))} impacts, {_range(series)}, evenly spaced. "
            "The paper prints neither their number nor their range."
        )
        speed = series.get("speed_m_s", {})
        if "spin_rad_s" in series:
            listed.append(
                f"Series '{series['label']}': the printed spreads of speed and spin are read as uniform and "
                "independent. Each impact has its own, and beta is computed with them; the row states "
                "the nominal speed and spin, and sigma_spin_y is the standard deviation of R omega_y/u over "
                "the spreads."
            )
        elif speed.get("individual"):
            listed.append(
                "Speeds are drawn uniformly from the printed range; they do not enter the observables."
            )
    if len({tuple(series["constants"].items()) for series in spec["series"]}) > 1:
        listed.append(
            "Each series is made with the constants printed for its own figure: "
            + "; ".join(f"{s['label']} with mu = {s['constants']['mu']:g}" for s in spec["series"])
            + "."
        )
    return listed + list(spec.get("assumptions", ()))


def about(name: str, spec: Mapping[str, Any], paper: Mapping[str, str]) -> dict[str, Any]:
    """Say everything datapackage.json says apart from the numbers."""
    default = next(s for s in spec["series"] if s["label"] == spec["default_series"][0])
    own = {
        "provenance": "stand-in",
        "materials": spec["materials"],
        "figures": spec["figures"],
        "conditions": spec["conditions"],
        "default_observables": spec["default_observables"],
        "default_series": spec["default_series"],
        **({"default_reason": spec["default_reason"]} if "default_reason" in spec else {}),
        "noise": spec["noise"],
        "noise_reason": spec["noise_reason"],
        "faces": [],
        "inertia_factor": 0.4,
        "assumptions": assumptions(spec),
        "printed_constants": default["constants"],
        "printed_constants_by_series": {
            s["label"]: {**s["constants"], "where": s["where"]} for s in spec["series"]
        },
        "made_by": "scripts/make_stand_ins.py; seed: SHA-256 of the dataset's name",
    }
    description = (
        "STAND-IN, generated from the constants and conditions that the paper prints for "
        f"{spec['figures']}. The points of the experiment are not published as numbers. A fit to it shows "
        f"that the tool works, not what {spec['materials']} does."
    )
    sources = [
        {"title": f"{paper['title']}: constants and conditions", "path": paper["path"]},
        {"title": f"{spec['experiment']}: the experiment (its points are not used)"},
    ]
    return {
        "name": name,
        "title": spec["title"],
        "description": description,
        "licenses": [LICENCE],
        "sources": sources,
        "ifrfit": own,
    }


def make(folder: Path) -> list[Path]:
    """Write every stand-in dataset below `folder`; returns their folders."""
    with (HERE / "stand_ins.toml").open("rb") as file:
        specs = tomllib.load(file)
    paper = specs.pop("paper")
    made = []
    for name, spec in specs.items():
        seed = int.from_bytes(hashlib.sha256(name.encode()).digest(), "big")
        rng = np.random.default_rng(seed)
        rows = [row for series in spec["series"] for row in rows_of(name, series, spec["noise_level"], rng)]
        write_folder(folder / name, about(name, spec, paper), pd.DataFrame(rows))
        made.append(folder / name)
    return made


if __name__ == "__main__":
    make(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE.parent / "datasets")
