"""The profile likelihood of one quantity."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ifrfit.inference.profile.types import ProfileLikelihood
from ifrfit.report.page.drawings.canvas import panel, symbol
from ifrfit.report.style import COLOURS, GREY, drawing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH_MM, HEIGHT_MM = 62.0, 48.0
LONGEST = 14  # characters of a series' name


def draw_profile(profile: ProfileLikelihood) -> Figure:
    """Rise of the objective against the quantity, with the cuts of 68 and 95 %."""
    cuts = {level: profile.cut(level) for level in (0.68, 0.95)}
    top = 2.1 * cuts[0.95]
    known = profile.x[np.isfinite(profile.x)]
    with drawing():
        figure, axes = panel(WIDTH_MM, HEIGHT_MM, left=11.0)
        for level, pieces, alpha in ((0.95, profile.pieces, 0.14), (0.68, profile.pieces68, 0.22)):
            for piece in pieces:  # one without end is shaded as far as the profile is known
                low, high = np.clip(piece, known.min(), known.max()).tolist()
                axes.axvspan(low, high, color=COLOURS[0], alpha=alpha, lw=0.0)
            axes.axhline(cuts[level], color=GREY, lw=0.7, ls=(0, (4, 3)))
            axes.text(
                0.5,
                cuts[level] + 0.02 * top,
                f"{100 * level:.0f} %",
                transform=axes.get_yaxis_transform(),
                ha="center",
                va="bottom",
                color=GREY,
                fontsize=6.5,
            )
        shown = np.isfinite(profile.x) & (profile.rise <= 1.5 * top)
        axes.plot(profile.x[shown], profile.rise[shown], color=COLOURS[0], lw=1.3)
        axes.plot([profile.value], [0.0], marker="o", ms=4.5, color=COLOURS[0], clip_on=False, zorder=5)
        x = known[profile.rise[np.isfinite(profile.x)] <= top]
        if x.size > 1 and x.max() > x.min():
            axes.set_xlim(float(x.min()), float(x.max()))
        axes.set_ylim(0.0, top)
        axes.locator_params(axis="x", nbins=5)
        axes.set_xlabel(symbol(profile.name, LONGEST))
        axes.set_ylabel("rise")
    return figure
