"""The folder that holds measured costs: it appears whole or not at all."""

from __future__ import annotations

from pathlib import Path

from ifrfit.cost.result import Costs
from ifrfit.cost.timing import KINDS
from ifrfit.report.atomic_folder import Contents, deliver
from ifrfit.report.style import SUFFIXES, save_svg_and_png

FIGURES = tuple(f"cost-{kind}.{suffix}" for kind in KINDS for suffix in SUFFIXES)
COSTS = Contents("cost.csv", FIGURES, "measurement of costs")


def write_costs(costs: Costs, out: Path, *, force: bool) -> list[str]:
    """Write cost.csv and a diagram a kind.

    Returns
    -------
    list of str
        Names of the files written.

    Raises
    ------
    UsageError
        If the folder holds an earlier measurement and `force` is not given, or nothing can be written there.
    """

    def fill(folder: Path) -> list[str]:
        costs.table().to_csv(folder / COSTS.record, index=False, lineterminator="\n", float_format="%.6g")
        names = [COSTS.record]
        for kind in costs.kinds:
            names += save_svg_and_png(costs.plot(kind), folder, f"cost-{kind}")
        return names

    return deliver(fill, out, COSTS, force=force)
