"""Small tables of impacts, made by `ifrfit.rebound` with seeded noise and written as CSV."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import ifrfit
from ifrfit.physics import OBSERVABLES

Array = NDArray[np.float64]

IFR = {"e_n": 0.94, "e_t": -0.9, "mu": 0.12}


@dataclass(frozen=True)
class Run:
    """Impacts of one series.

    Attributes
    ----------
    gamma : sequence of float
        Incidence angles, degrees.
    noise : mapping of str to float
        Observable to the standard deviation of its noise; these observables are measured.
    constants : mapping of str to float
        e_n, mu and the closure's constant.
    closure : str
    spin_x, spin_y : float
        R omega/u before.
    series : str
    inertia_factor : float
    sigma : float or None
        Stated sigma over the true one; None: no sigma is stated.
    columns : mapping of str to str
        Further columns, the same in every row.
    same_impacts : bool
        Whether the observables are of the same impacts.
    shifts : mapping of int to float
        Row of the first observable to what is added to its value: outliers.
    speeds : sequence of float
        m/s, one an angle; empty: not stated.
    """

    gamma: tuple[float, ...]
    noise: Mapping[str, float]
    constants: Mapping[str, float] = field(default_factory=lambda: dict(IFR))
    closure: str = "ifr"
    spin_x: float = 0.0
    spin_y: float = 0.0
    series: str = "run"
    inertia_factor: float = 0.4
    sigma: float | None = 1.0
    columns: Mapping[str, str] = field(default_factory=dict)
    same_impacts: bool = False
    shifts: Mapping[int, float] = field(default_factory=dict)
    speeds: tuple[float, ...] = ()

    def rows(self, rng: np.random.Generator) -> list[dict[str, str]]:
        """Rows of the common schema. Six decimals: the file does not hang on the last bit of the rebound."""
        made = []
        for number, (name, sd) in enumerate(self.noise.items()):
            value = self._true(name) + sd * rng.standard_normal(len(self.gamma))
            for i, angle in enumerate(self.gamma):
                shift = self.shifts.get(i, 0.0) if number == 0 else 0.0
                row = {
                    "series": self.series,
                    "observable": name,
                    "gamma_deg": "" if name == "mu" else f"{angle:.6f}",
                    "spin_x": f"{self.spin_x:.6f}",
                    "spin_y": f"{self.spin_y:.6f}",
                    "value": f"{value[i] + shift:.6f}",
                    "sigma": "" if self.sigma is None else f"{self.sigma * sd:.6f}",
                    **self.columns,
                }
                if self.same_impacts:
                    row["impact_id"] = f"{self.series} {i + 1}"
                if self.speeds:
                    row["speed_m_s"] = f"{self.speeds[i]:.6f}"
                made.append(row)
        return made

    def _true(self, name: str) -> Array:
        if name in ("e_n", "mu"):
            return np.full(len(self.gamma), self.constants[name])
        return OBSERVABLES[name].value(self.rebound(), np.asarray(self.constants["mu"]))

    def rebound(self) -> ifrfit.Rebound:
        """What the closure says of every impact."""
        return ifrfit.rebound(
            np.array(self.gamma),
            self.spin_x,
            self.spin_y,
            closure=self.closure,
            degrees=True,
            inertia_factor=self.inertia_factor,
            **self.constants,
        )


def angles(low: float, high: float, count: int) -> tuple[float, ...]:
    """Evenly spaced angles, degrees."""
    return tuple(np.linspace(low, high, count).round(3).tolist())


def repeated(gamma: tuple[float, ...], times: int) -> tuple[float, ...]:
    """Each angle so many times."""
    return tuple(angle for angle in gamma for _ in range(times))


WIDE = angles(6.0, 80.0, 20)
SOME = angles(10.0, 76.0, 9)
FEW = angles(10.0, 75.0, 6)
MAW = {"e_n": 0.95, "chi": 1.44, "mu": 0.1}
THREE = {"beta_cm": 0.02, "spin_y_after": 0.025, "e_n": 0.01}

RUNS: Mapping[str, tuple[Run, ...]] = {
    "beta": (Run(WIDE, {"beta": 0.03}),),
    "beta-e_n": (Run(WIDE, {"beta": 0.03}), Run(FEW, {"e_n": 0.01})),
    "beta-bare": (Run(WIDE, {"beta": 0.03}, sigma=None), Run(FEW, {"e_n": 0.01}, sigma=None)),
    "beta-understated": (Run(WIDE, {"beta": 0.03}, sigma=0.4), Run(FEW, {"e_n": 0.01}, sigma=0.4)),
    "beta-few": (Run(FEW, {"beta": 0.03}),),
    "outliers": (Run(WIDE, {"beta": 0.02}, shifts={3: 0.25, 14: -0.3}), Run(FEW, {"e_n": 0.01})),
    "outliers-bare": (Run(WIDE, {"beta": 0.02}, sigma=None, shifts={3: 0.25, 14: -0.3}),),
    "repeats": (Run(repeated(angles(10.0, 75.0, 8), 3), {"beta": 0.03}, sigma=None),),
    "three": (Run(WIDE, THREE, same_impacts=True),),
    "three-bare": (Run(WIDE, THREE, same_impacts=True, sigma=None),),
    "two-series": (
        Run(WIDE, {"beta": 0.03}, series="a"),
        Run(WIDE, {"beta": 0.03}, {**IFR, "mu": 0.16, "e_t": -0.8}, spin_y=0.3, series="b"),
        Run(FEW, {"e_n": 0.01}, series="a"),
        Run(FEW, {"e_n": 0.01}, {**IFR, "e_n": 0.9}, series="b"),
    ),
    "two-series-small": (
        Run(SOME, {"beta": 0.03}, series="a"),
        Run(SOME, {"beta": 0.03}, {**IFR, "mu": 0.16}, spin_y=0.3, series="b"),
        Run(FEW, {"e_n": 0.01}, series="a"),
    ),
    "two-series-bare": (
        Run(WIDE, {"beta_cm": 0.02, "e_n": 0.01}, series="a", sigma=None),
        Run(WIDE, {"beta_cm": 0.04, "e_n": 0.01}, {**IFR, "mu": 0.16}, spin_y=0.3, series="b", sigma=None),
    ),
    "three-series": tuple(
        Run(angles(8.0, 78.0, 10), {"beta": 0.03}, {**IFR, "mu": mu}, spin_y=spin, series=name)
        for name, mu, spin in (("a", 0.1, 0.0), ("b", 0.14, 0.2), ("c", 0.18, -0.2))
    ),
    "sliding": (Run(angles(45.0, 80.0, 12), {"beta": 0.03}),),
    "sticking": (Run(angles(3.0, 15.0, 12), {"beta": 0.03}),),
    "frictionless": (Run(WIDE, {"beta": 0.03}, {**IFR, "mu": 0.002}),),
    "fr": (
        Run(WIDE, {"beta": 0.03}, {"e_n": 0.9, "beta0": 0.4, "mu": 0.15}, "fr"),
        Run(FEW, {"e_n": 0.01}, {"e_n": 0.9, "mu": 0.15}),
    ),
    "fr-two-series": tuple(
        Run(WIDE, {"beta": 0.03}, {"e_n": 0.9, "beta0": b, "mu": 0.15}, "fr", series=name, spin_y=spin)
        for name, b, spin in (("a", 0.3, 0.0), ("b", 0.5, 0.25))
    ),
    "f": (
        Run(WIDE, {"beta": 0.03}, {"e_n": 0.9, "mu": 0.15}, "f"),
        Run(FEW, {"e_n": 0.01}, {"e_n": 0.9, "mu": 0.15}),
    ),
    "ifr-contact": (Run(WIDE, {"beta": 0.03}, {**IFR, "e_t": -0.6}, "ifr-contact"),),
    "maw": (Run(WIDE, {"beta": 0.03}, MAW, "maw"), Run(FEW, {"e_n": 0.01}, MAW, "maw")),
    "maw-few": (Run(FEW, {"beta": 0.03}, MAW, "maw"),),
    "maw-two-series": (
        Run(angles(8.0, 78.0, 12), {"beta": 0.03}, MAW, "maw", series="a"),
        Run(angles(8.0, 78.0, 12), {"beta": 0.03}, {**MAW, "chi": 1.3}, "maw", series="b", spin_y=0.2),
    ),
    "hollow": (
        Run(WIDE, {"beta": 0.03}, {**IFR, "e_t": -0.85}, inertia_factor=2 / 3),
        Run(FEW, {"e_n": 0.01}),
    ),
    "hollow-centre": (
        Run(WIDE, {"beta_cm": 0.02, "v_n": 0.01}, {**IFR, "e_t": -0.85}, inertia_factor=2 / 3),
    ),
    "disc": (Run(WIDE, {"beta": 0.03}, {**IFR, "e_t": -0.85}, inertia_factor=0.5),),
    "small": (Run(SOME, {"beta": 0.03}), Run(FEW, {"e_n": 0.01})),
    "delta-small": (Run(SOME, {"delta_deg": 1.0}), Run(FEW, {"e_n": 0.01})),
    "delta-few": (Run(FEW, {"delta_deg": 1.0}),),
    "delta": (Run(angles(8.0, 78.0, 16), {"delta_deg": 1.0}), Run(FEW, {"e_n": 0.01})),
    "delta-bare": (Run(SOME, {"delta_deg": 1.0}, sigma=None), Run(FEW, {"e_n": 0.01}, sigma=None)),
    "mu_app": (Run(WIDE, {"mu_app": 0.006}), Run(FEW, {"e_n": 0.01})),
    "beta_tot": (Run(WIDE, {"beta_tot": 0.01}),),
    "beta_tot-bare": (Run(WIDE, {"beta_tot": 0.01}, sigma=None),),
    "psi": (Run(WIDE, {"psi_out_deg": 2.0}), Run(FEW, {"e_n": 0.01})),
    "tan-psi": (Run(WIDE, {"tan_psi_after": 0.02}, spin_y=0.2), Run(FEW, {"e_n": 0.01})),
    "tan-psi-out": (Run(WIDE, {"tan_psi_out": 0.02}),),
    "psi-after": (Run(WIDE, {"psi_after_deg": 1.0}, spin_y=-0.2),),
    "mu-rows": (Run(WIDE, {"beta": 0.03}), Run(FEW, {"mu": 0.005})),
    "velocities": (Run(WIDE, {"v_x": 0.01, "v_n": 0.008, "spin_y_after": 0.02}, spin_y=0.3),),
    "lateral": (
        Run(
            WIDE,
            {"v_x": 0.01, "v_y": 0.01, "spin_x_after": 0.02, "spin_y_after": 0.02, "e_n": 0.01},
            spin_x=0.3,
            spin_y=0.1,
            same_impacts=True,
        ),
    ),
    "lambda": (Run(WIDE, {"lambda_deg": 1.5}, spin_x=0.4), Run(FEW, {"e_n": 0.01})),
    "angles": (Run(WIDE, {"beta": 0.02}, columns={"sigma_gamma_deg": "2"}), Run(FEW, {"e_n": 0.01})),
    "angles-centre": (
        Run(
            angles(14.0, 80.0, 12),
            {"beta_cm": 0.02, "spin_y_after": 0.02},
            same_impacts=True,
            columns={"sigma_gamma_deg": "1.5"},
        ),
    ),
    "spins": (
        Run(SOME, {"beta": 0.02}, spin_y=0.3, columns={"sigma_spin_y": "0.05", "sigma_gamma_deg": "1"}),
    ),
    "speeds": (
        Run(WIDE, {"beta": 0.03}, speeds=tuple(np.linspace(0.5, 4.3, 20).round(3).tolist())),
        Run(FEW, {"e_n": 0.01}, speeds=(0.5, 1.0, 1.5, 2.0, 3.0, 4.0)),
    ),
}

COLUMNS = (
    "series",
    "observable",
    "gamma_deg",
    "spin_x",
    "spin_y",
    "value",
    "sigma",
    "sigma_gamma_deg",
    "sigma_spin_y",
    "impact_id",
    "speed_m_s",
)


def write_table(name: str, folder: Path) -> Path:
    """Write a table of `RUNS`, or the raw velocities, to a CSV file of that name.

    Parameters
    ----------
    name : str
    folder : Path
        Must be there.

    Returns
    -------
    Path
    """
    path = folder / f"{name}.csv"
    lines = _raw_lines() if name == "raw" else _lines(name)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def _rng(name: str) -> np.random.Generator:
    """One stream a table, whatever other tables there are."""
    return np.random.default_rng(list(name.encode()))


def _lines(name: str) -> list[str]:
    rng = _rng(name)
    rows = [row for run in RUNS[name] for row in run.rows(rng)]
    used = [column for column in COLUMNS if any(row.get(column) for row in rows)]
    return [",".join(used), *(",".join(row.get(column, "") for column in used) for row in rows)]


def _raw_lines() -> list[str]:
    """Velocities and spins before and after, with back-spin, for a sphere of 5 mm radius at 2 m/s."""
    rng, speed, radius, spin = _rng("raw"), 2.0, 0.005, 0.15
    run = Run(angles(8.0, 78.0, 14), {}, spin_y=spin)
    after = run.rebound()
    lines = ["u_x_m_s,u_z_m_s,omega_y_rad_s,v_x_m_s,v_z_m_s,omega_y_after_rad_s,radius_mm"]
    for i, angle in enumerate(run.gamma):
        noise = rng.standard_normal(3) * (0.01, 0.01, 0.015)
        cells = (
            speed * math.sin(math.radians(angle)),
            speed * math.cos(math.radians(angle)),
            spin * speed / radius,
            speed * (float(after.v_x[i]) + noise[0]),
            -speed * (float(after.v_n[i]) + noise[1]),
            (float(after.spin_y[i]) + noise[2]) * speed / radius,
            1000.0 * radius,
        )
        lines.append(",".join(f"{cell:.5f}" for cell in cells))
    return lines
