"""Plot of the posterior benchmark: error against time, a panel a scene."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from posterior_peers import DYNESTY, EMCEE, EMCEE_LONG, LMFIT, NUTS, NUTS_COLD, ULTRANEST
from posterior_scenes import TITLES

if TYPE_CHECKING:
    from posterior import Row

# Okabe and Ito's colours; each method has a marker of its own, too
_SAMPLERS = {
    EMCEE: ("#E69F00", "o"),
    EMCEE_LONG: ("#E69F00", "s"),
    LMFIT: ("#D55E00", "^"),
    DYNESTY: ("#009E73", "D"),
    ULTRANEST: ("#CC79A7", "v"),
    NUTS: ("#56B4E9", "P"),
    NUTS_COLD: ("#56B4E9", "X"),
}
_EXACT = "#0072B2"
_LABELS = ("exact", "exact, least squares included")
_TARGET = 1e-2


def draw(rows: Sequence[Row], path: Path) -> None:
    """Error against time, both logarithmic."""
    import matplotlib as mpl

    mpl.use("svg")
    import matplotlib.pyplot as plt

    keys = list(dict.fromkeys(row.scene for row in rows))
    if not keys:
        return
    columns = min(3, len(keys) + 1)
    lines = -(-(len(keys) + 1) // columns)
    with plt.rc_context({"svg.fonttype": "none", "svg.hashsalt": "ifrfit", "font.size": 9}):
        figure, grid = plt.subplots(
            lines,
            columns,
            figsize=(3.5 * columns, 3.1 * lines),
            sharex=True,
            sharey=True,
            squeeze=False,
            layout="constrained",
        )
        panels = list(grid.flat)
        handles: dict[str, object] = {}
        for panel, key in zip(panels, keys, strict=False):
            _panel(panel, [row for row in rows if row.scene == key], handles)
            panel.set_title(f"({key}) {TITLES[key]}", fontsize=8)
            panel.set_xlabel("time (s)")
            panel.tick_params(labelbottom=True)
        for line in grid:
            line[0].set_ylabel("error (posterior sd)")
        for panel in panels[len(keys) :]:
            panel.set_axis_off()
        panels[len(keys)].legend(handles.values(), handles.keys(), loc="center", frameon=False)
        figure.savefig(path, metadata={"Date": None})
        plt.close(figure)


def _panel(axes: object, rows: Sequence[Row], handles: dict[str, object]) -> None:
    """One scene."""
    axes.axhline(_TARGET, color="0.8", linewidth=0.8, zorder=0)  # type: ignore[attr-defined]
    exact = [row for row in rows if row.kind == "exact"]
    errors = [row.error for row in exact]
    if exact:
        times = [[row.time_s for row in exact], [row.with_start_s for row in exact]]
        for label, x, style, face in zip(_LABELS, times, ("-", "--"), (_EXACT, "white"), strict=True):
            (handles[label],) = axes.loglog(  # type: ignore[attr-defined]
                x, errors, style, color=_EXACT, marker="o", markersize=5, markerfacecolor=face
            )
    for row in rows:
        if row.kind == "sampler":
            colour, marker = _SAMPLERS[row.method]
            (handles[row.method],) = axes.loglog(  # type: ignore[attr-defined]
                row.time_s,
                row.error,
                linestyle="",
                color=colour,
                marker=marker,
                markersize=6,
                markeredgecolor="black",
                markeredgewidth=0.4,
            )
