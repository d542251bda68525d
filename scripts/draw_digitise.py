"""Draw the pictures of docs/how-to/digitise.md: a figure, the clicks on it, and the figure drawn anew.

The figure is that of no paper: 18 values of beta, drawn of known constants with known scatter. The clicks on
it are where its marks are in the picture, 0.7 pixels off at random in each direction. figure.json, a project
of WebPlotDigitizer, holds them; the page's own commands read it.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import ifrfit

FOLDER = Path(__file__).resolve().parents[1] / "docs" / "how-to" / "digitise"
CONSTANTS = {"e_n": 0.9, "e_t": -0.8, "mu": 0.15}
SIGMA = 0.05
CLICK = 0.7  # pixels, in each direction
DPI = 80
SIZE = (6.4, 4.4)  # inches
TICKS = ((0.0, -1.0), (90.0, -1.0), (0.0, -1.0), (0.0, 1.0))  # that are clicked: two on x, two on y


def impacts() -> tuple[np.ndarray, np.ndarray]:
    """Angles in degrees, and values with their scatter."""
    rng = np.random.default_rng(20261125)
    gamma = np.linspace(6.0, 82.0, 18)
    beta = ifrfit.rebound(gamma, degrees=True, **CONSTANTS).beta
    return gamma, beta + SIGMA * rng.standard_normal(len(gamma))


def paper() -> tuple[Figure, Axes]:
    """The figure as a paper has it."""
    gamma, beta = impacts()
    figure = Figure(figsize=SIZE, dpi=DPI)
    axes = figure.add_subplot()
    axes.errorbar(gamma, beta, SIGMA, fmt="ko", mfc="white", ms=6, capsize=3, lw=0.8)
    axes.set(xlim=(0, 90), ylim=(-1, 1), xlabel=r"angle of incidence $\gamma$ (degrees)", ylabel=r"$\beta$")
    figure.tight_layout()
    return figure, axes


def pixels(axes: Axes, points: Sequence[Sequence[float]]) -> np.ndarray:
    """Where values are in the picture, from its upper left corner."""
    found = axes.transData.transform(np.asarray(points))
    return np.column_stack([found[:, 0], SIZE[1] * DPI - found[:, 1]])


def project(axes: Axes) -> dict[str, object]:
    """Clicks on ticks, on points and on the ends of their bars, as WebPlotDigitizer keeps them."""
    rng = np.random.default_rng(7)
    gamma, beta = impacts()

    def clicked(points: Sequence[Sequence[float]]) -> list[tuple[float, float]]:
        exact = pixels(axes, points)
        noise = CLICK * rng.standard_normal(exact.shape)
        return [(round(x, 2), round(y, 2)) for x, y in (exact + noise).tolist()]

    calibration = [
        {"px": x, "py": y, "dx": f"{a:g}", "dy": f"{b:g}", "dz": None}
        for (x, y), (a, b) in zip(clicked(TICKS), TICKS, strict=True)
    ]
    data = [
        {"x": x, "y": y, "tuple": number, "group": group, "value": None}
        for group, shift in enumerate((0.0, SIGMA, -SIGMA))
        for number, (x, y) in enumerate(clicked(np.column_stack([gamma, beta + shift]).tolist()))
    ]
    return {
        "version": [4, 2],
        "axesColl": [
            {
                "name": "XY",
                "type": "XYAxes",
                "isLogX": False,
                "isLogY": False,
                "calibrationPoints": calibration,
            }
        ],
        "datasetColl": [
            {
                "name": "glass",
                "axesName": "XY",
                "groupNames": ["Primary Group", "Upper", "Lower"],
                "metadataKeys": [],
                "data": data,
            }
        ],
        "measurementColl": [],
    }


def with_clicks(figure: Figure, made: dict[str, object]) -> Figure:
    """The picture with what was clicked."""
    over = figure.add_axes((0.0, 0.0, 1.0, 1.0), xlim=(0, SIZE[0] * DPI), ylim=(SIZE[1] * DPI, 0))
    over.patch.set_alpha(0.0)
    over.set_axis_off()
    axes, sets = made["axesColl"], made["datasetColl"]
    for clicks, colour, mark in (
        ([(c["px"], c["py"]) for c in axes[0]["calibrationPoints"]], "tab:red", "x"),
        ([(p["x"], p["y"]) for p in sets[0]["data"] if not p["group"]], "tab:blue", "+"),
        ([(p["x"], p["y"]) for p in sets[0]["data"] if p["group"]], "tab:orange", "+"),
    ):
        over.plot(*zip(*clicks, strict=True), mark, color=colour, ms=9, mew=1.6, clip_on=False)
    return figure


def fitted(folder: Path) -> ifrfit.FitResult:
    """What the page's commands make of the project."""
    found = ifrfit.read_figure(folder / "figure.json", x="gamma_deg", y="beta", bars="sigma")
    noise = ifrfit.Noise("known", angles=ifrfit.AngleErrors("effective"))
    return ifrfit.fit(found, fix={"e_n": CONSTANTS["e_n"]}, noise=noise)


def main(folder: Path = FOLDER) -> None:
    """Write the project and the pictures."""
    folder.mkdir(parents=True, exist_ok=True)
    figure, axes = paper()
    made = project(axes)
    figure.savefig(folder / "figure.png", metadata={"Software": None})
    (folder / "figure.json").write_text(json.dumps(made) + "\n", encoding="utf-8")
    with_clicks(figure, made).savefig(folder / "clicks.png", metadata={"Software": None})
    drawn = fitted(folder).plot()
    drawn.savefig(folder / "redrawn.png", dpi=110, metadata={"Software": None})


if __name__ == "__main__":
    main()
