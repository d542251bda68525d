"""Write the table of closure MAW by the memory-function solver, and its splines; print their error.

Usage: python scripts/compliance_table.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from ifrfit.physics.compliance import rebound_ratio
from ifrfit.physics.compliance.law import HIGHEST_CHI, LOWEST_CHI, compliance_table
from ifrfit.physics.compliance.solvers import memory_ratio

FOLDER = Path(__file__).parents[1] / "ifrfit" / "physics" / "compliance"
TABLE, SPLINES = FOLDER / "table.csv", FOLDER / "splines.npz"
STEPS = 16_000
SPACING = 0.05  # of chi
BELOW, BEYOND = 8, 128  # intervals of psi1 from 0 to 1, and from 1 to 4 chi - 1
SMALLEST = 1e-5  # psi1 that stands for 0, where beta has a limit
HEADER = f"""# beta = -psi2/psi1 of the contact point of an elastic sphere with tangential compliance.
# Provenance: computed by scripts/compliance_table.py, memory-function solver with {STEPS} steps a collision.
# Source of the model: Maw, Barber & Fawcett (1976), Wear 38, 101.
# First row: place of each column; psi1 itself up to 1, beyond psi1 = 1 + (place - 1)(4 chi - 2).
# Other rows: chi, then beta. From place 2 on the contact slips throughout: beta = 4 chi/psi1 - 1."""


def main() -> None:
    """Solve, write, and compare with the solver between the nodes."""
    write_table()
    write_splines()
    compliance_table.cache_clear()
    rng = np.random.default_rng(1)
    for name, low, high in (("all", LOWEST_CHI, HIGHEST_CHI), ("solid spheres", 7 / 6, 7 / 4)):
        x = rng.uniform(low, high, 20_000)
        psi1 = rng.uniform(0.0, 1.05, x.size) * (4.0 * x - 1.0)
        error = np.abs(rebound_ratio(psi1, x) - memory_ratio(psi1, x, STEPS)).max()
        print(f"{name}: largest error of psi2 between the nodes {error:.1e}")


def write_table() -> None:
    """Beta at the nodes, as text."""
    chi = np.round(np.arange(LOWEST_CHI, HIGHEST_CHI + 0.5 * SPACING, SPACING), 6)
    place = np.concatenate((np.linspace(0.0, 1.0, BELOW + 1), 1.0 + np.arange(1, BEYOND + 1) / BEYOND))
    lines = [HEADER, ",".join(["0", *(f"{x:.7g}" for x in place)])]
    for x in chi:
        psi1 = np.where(place <= 1.0, np.maximum(place, SMALLEST), 1.0 + (place - 1.0) * (4.0 * x - 2.0))
        beta = -memory_ratio(psi1, np.full(psi1.size, x), STEPS) / psi1
        lines.append(",".join([f"{x:.2f}", *(f"{b:.6f}" for b in beta)]))
    TABLE.write_text("\n".join(lines) + "\n", encoding="utf-8")


def write_splines() -> None:
    """The cubics that evaluation needs, through the values that stand in the table."""
    rows = np.loadtxt(TABLE, delimiter=",", comments="#")
    place, chi, beta = rows[0, 1:], rows[1:, 0], rows[1:, 1:]
    first = int(np.flatnonzero(place == 1.0)[0])
    # two more chi by the parabola through the last three
    ends = [3.0 * (beta[0] - beta[1]) + beta[2]], [3.0 * (beta[-1] - beta[-2]) + beta[-3]]
    beta = np.concatenate((ends[0], beta, ends[1]))
    # a range each of their own: the curvature has a kink at psi1 = 1
    nodes = np.concatenate([cubics(beta[:, : first + 1]), cubics(beta[:, first:])], axis=1)
    np.savez_compressed(SPLINES, chi=chi, nodes=nodes, first=first)


def cubics(values: np.ndarray) -> np.ndarray:
    """Not-a-knot splines through evenly spaced nodes, (m, n) to (m, n - 1, 4); lowest power first."""
    return CubicSpline(np.arange(values.shape[1]), values, axis=1).c[::-1].transpose(2, 1, 0)


if __name__ == "__main__":
    main()
