"""Write the table of closure MAW by the memory-function solver; print its error between the nodes.

Usage: python scripts/compliance_table.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ifrfit.physics.compliance import rebound_ratio
from ifrfit.physics.compliance.law import HIGHEST_CHI, LOWEST_CHI
from ifrfit.physics.compliance.memory import memory_ratio
from ifrfit.physics.compliance.table import compliance_table

TARGET = Path(__file__).parents[1] / "ifrfit" / "physics" / "compliance" / "table.csv"
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
    chi = np.round(np.arange(LOWEST_CHI, HIGHEST_CHI + 0.5 * SPACING, SPACING), 6)
    place = np.concatenate((np.linspace(0.0, 1.0, BELOW + 1), 1.0 + np.arange(1, BEYOND + 1) / BEYOND))
    lines = [HEADER, ",".join(["0", *(f"{x:.7g}" for x in place)])]
    for x in chi:
        psi1 = np.where(place <= 1.0, np.maximum(place, SMALLEST), 1.0 + (place - 1.0) * (4.0 * x - 2.0))
        beta = -memory_ratio(psi1, np.full(psi1.size, x), STEPS) / psi1
        lines.append(",".join([f"{x:.2f}", *(f"{b:.6f}" for b in beta)]))
    TARGET.write_text("\n".join(lines) + "\n", encoding="utf-8")
    compliance_table.cache_clear()
    rng = np.random.default_rng(1)
    for name, low, high in (("all", LOWEST_CHI, HIGHEST_CHI), ("solid spheres", 7 / 6, 7 / 4)):
        x = rng.uniform(low, high, 20_000)
        psi1 = rng.uniform(0.0, 1.05, x.size) * (4.0 * x - 1.0)
        error = np.abs(rebound_ratio(psi1, x) - memory_ratio(psi1, x, STEPS)).max()
        print(f"{name}: largest error of psi2 between the nodes {error:.1e}")


if __name__ == "__main__":
    main()
