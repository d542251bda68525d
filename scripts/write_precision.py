"""Write docs/precision.md: where single precision is enough. The numbers are computed, none is typed."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ifrfit.cost.arithmetic_costs import DOUBLE, SINGLE, arithmetic_costs
from ifrfit.cost.report.precision import precision_sentences, precision_table

PAGE = Path(__file__).resolve().parents[1] / "docs" / "precision.md"
CONSTANTS = {"e_n": 0.94, "e_t": -0.98, "mu": 0.12}

HEAD = """# Single and double precision

ifrfit computes in double precision. `ifrfit.physics.kernels.rebound_many` takes single precision too, for
simulations of very many impacts. Here both are held against 50 digits: an impulse balance with vectors,
written apart from the formulas of the package. IFR, solid sphere, {constants}; 200 impacts
of each kind, the largest error of each. Sines, spins and constants are rounded to the precision first, as a
program holds them, and observables are read off velocities and spins in the same precision: beta is -V_t/U_t,
mu_app is P_x/P_n.

"v, spin": velocities and spins after, over 1 + |s| with the spin s before. Angles (psi_after, delta, lambda)
in radians, lambda where there is lateral spin. The given impacts are 1 to 89 degrees without spin; "at the
transition" is to 1e-6 of it.
"""
TAIL = """
Velocities and spins are right all the same; what is lost is a quotient. beta divides by a slip that the spin
has all but cancelled, mu_app by a normal velocity that has all but vanished, and beside a large spin the
velocities themselves are small. Where such impacts matter, take double precision.

Written by `python scripts/write_precision.py`. `ifrfit cost DATA` does the same with your impacts, and
measures what either precision takes in time on your machine.
"""


def page() -> str:
    """Return the page as text."""
    costs = arithmetic_costs(gamma_deg=np.arange(1.0, 90.0), spin_y=0.0, **CONSTANTS)
    parts = [HEAD.format(constants=", ".join(f"{name} = {value:g}" for name, value in CONSTANTS.items()))]
    for name, title in ((SINGLE, "Single precision"), (DOUBLE, "Double precision")):
        head, *rows = precision_table(costs, name)
        lines = [head, ["---"] * len(head), *rows]
        parts.append("\n".join([f"## {title}", "", *("| " + " | ".join(row) + " |" for row in lines), ""]))
    said = precision_sentences(costs, times=False)
    parts.append("\n".join(["## In words", "", *(f"- {sentence}." for sentence in said)]))
    return "\n".join(parts) + "\n" + TAIL


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
