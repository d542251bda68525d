"""Write docs/precision.md: where single precision is enough. The numbers are computed, none is typed."""

from __future__ import annotations

import numpy as np
from studies import DOCS, markdown, render

from ifrfit.cost.arithmetic_costs import DOUBLE, SINGLE, arithmetic_costs
from ifrfit.cost.report.text import precision_sentences, precision_table

CONSTANTS = {"e_n": 0.94, "e_t": -0.98, "mu": 0.12}


def page() -> str:
    """Return the page as text."""
    costs = arithmetic_costs(gamma_deg=np.arange(1.0, 90.0), spin_y=0.0, **CONSTANTS)
    tables = []
    for name, title in ((SINGLE, "Single precision"), (DOUBLE, "Double precision")):
        head, *rows = precision_table(costs, name)
        tables.append({"title": title, "text": markdown(head, rows)})
    return render(
        "precision.md",
        constants=", ".join(f"{name} = {value:g}" for name, value in CONSTANTS.items()),
        tables=tables,
        sentences=precision_sentences(costs, times=False),
    )


if __name__ == "__main__":
    (DOCS / "precision.md").write_text(page(), encoding="utf-8")
