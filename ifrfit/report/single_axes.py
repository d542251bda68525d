"""One picture of a fit on axes that the user has: data, residuals, marginals, profiles, closures.

Nothing of our own style is set: size, fonts and ticks are those of the axes, as rcParams had them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.errors import UsageError
from ifrfit.inference.comparison.result import Comparison
from ifrfit.inference.distributions.marginal_density import MarginalDensity, marginal_densities
from ifrfit.inference.profile.types import ProfileLikelihood
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.types import Interval
from ifrfit.report import panels
from ifrfit.report.axis_words import symbol
from ifrfit.report.comparison.figure import draw_evidence
from ifrfit.report.credible_regions import contours, regions
from ifrfit.report.regimes import at_true_angles, has_angle
from ifrfit.report.style import COLOURS, GREY, RESIDUAL_DASHES, series_styles
from ifrfit.text import joined, meant

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

DRAWS = 20_000
SHARES = (0.68, 0.95)
CELLS = 50  # of a histogram


def plot_data(result: FitResult, axes: Axes | None = None, observable: str | None = None) -> Axes:
    """Data with error bars, curves with bands."""
    result, name = _drawn(result, observable)
    axes = _axes(axes)
    panels.draw_data(axes, result, name, _styles(result))
    return axes


def plot_residuals(result: FitResult, axes: Axes | None = None, observable: str | None = None) -> Axes:
    """Standardised residuals of an observable."""
    result, name = _drawn(result, observable)
    axes = _axes(axes)
    panels.draw_residuals_of(axes, result, name, _styles(result))
    return axes


def plot_corner(result: FitResult, axes: Any = None, names: Sequence[str] | None = None) -> Any:
    """Marginals on the diagonal, below them the draws with contours that hold 68 and 95 %.

    A law that knows its own density has it on the diagonal, one of draws their histogram.

    Parameters
    ----------
    result : FitResult
    axes : ndarray of Axes, (k, k), optional
    names : sequence of str, optional
        Constants, with the series in brackets where separate, and kappa; by default all that are free.

    Returns
    -------
    ndarray of Axes, (k, k)
        Those above the diagonal are switched off.

    Raises
    ------
    UsageError
        For a name that does not exist, nothing that varies, or axes of another shape.
    """
    draws = result.draws(DRAWS, np.random.default_rng(result.seed))
    there = [str(name) for name in draws]
    # a fixed constant varies in its last digit where kappa and mu made it
    spread = {name: np.ptp(draws[name]) / max(1.0, float(np.abs(draws[name]).max())) for name in there}
    varying = [name for name in there if spread[name] > 1e-12 and not name.startswith("kappa")]
    chosen = varying if names is None else [names] if isinstance(names, str) else list(names)
    for name in chosen:
        if name not in there:
            raise UsageError(
                f"There are no draws of '{name}'. There are {joined(there)}.{meant(name, there)}"
            )
    if not chosen:
        raise UsageError("Every constant is fixed: there is no marginal to draw.")
    k = len(chosen)
    if axes is None:
        axes = _figure(1.8 * k, 1.8 * k).subplots(k, k, squeeze=False)
    grid = np.atleast_2d(np.asarray(axes, dtype=object))
    if grid.shape != (k, k):
        raise UsageError(f"axes of shape {grid.shape}: {joined(chosen)} take ({k}, {k}).")
    for each in grid.flat:
        _drawable(each)
    values = {name: draws[name].to_numpy(dtype=float) for name in chosen}
    windows = {name: _window(values[name]) for name in chosen}
    densities = marginal_densities(result.distribution, result.asked, values)
    for i, below in enumerate(chosen):
        for j, across in enumerate(chosen):
            if j > i:
                grid[i, j].set_axis_off()
                continue
            grid[i, j].set_xlim(*windows[across])
            if i == j:
                _draw_marginal(grid[i, j], values[across], windows[across], densities.get(across))
            else:
                _draw_pair(grid[i, j], values[across], values[below], windows[across], windows[below])
            if i == k - 1:
                grid[i, j].set_xlabel(symbol(across))
            if j == 0 < i:
                grid[i, j].set_ylabel(symbol(below))
    return grid


def plot_profile(profile: ProfileLikelihood, axes: Axes | None = None) -> Axes:
    """Least rise of the misfit with one quantity held, and the cuts of 68 and 95 % intervals."""
    axes = _axes(axes)
    axes.plot(profile.x, profile.rise, color=COLOURS[0])
    top = 2.1 * profile.cut(0.95)
    for level in SHARES:
        axes.axhline(profile.cut(level), color=GREY, ls=RESIDUAL_DASHES, lw=0.8)
        at = (0.99, profile.cut(level))
        axes.annotate(f"{100 * level:.0f} %", at, xycoords=("axes fraction", "data"), ha="right", va="bottom")
    axes.plot([profile.value], [0.0], "o", color=COLOURS[0], clip_on=False)
    axes.set_ylim(0.0, top)
    axes.set_xlabel(symbol(profile.name))
    axes.set_ylabel("rise of the misfit")
    return axes


def plot_compare(comparison: Comparison, axes: Axes | None = None) -> Axes:
    """Log Bayes factors of the closures against the best."""
    axes = _axes(axes)
    draw_evidence(axes, comparison, series_styles(list(comparison.entries)))
    return axes


def _window(values: Array) -> Interval:
    """Where all but a few draws are; about the one value that most of them have, where they have."""
    low, high = np.quantile(values, (0.001, 0.999))
    room = 1e-6 * max(1.0, abs(low)) if high <= low else 0.0
    return float(low - room), float(high + room)


def _draw_marginal(axes: Axes, values: Array, window: Interval, density: MarginalDensity | None) -> None:
    """The density, or a histogram of the draws."""
    if density is None:
        axes.hist(values, bins=CELLS, range=window, histtype="step", color=COLOURS[0], density=True)
    else:
        axes.plot(density.middles, density.density, color=COLOURS[0])
        axes.set_ylim(0.0, None)
    axes.set_yticks([])


def _draw_pair(axes: Axes, x: Array, y: Array, across: Interval, along: Interval) -> None:
    """Some of the draws, and the lines around most of all of them."""
    axes.set_ylim(*along)
    axes.plot(x[::20], y[::20], ls="none", marker=".", ms=1.0, color=COLOURS[0], alpha=0.3, zorder=1)
    found = regions(x, y, across, along)
    if found is None:
        return
    for level in found.levels:
        for line in contours(found, level):
            axes.plot(line[:, 0], line[:, 1], color=COLOURS[0], lw=1.0)


def _drawn(result: FitResult, observable: str | None) -> tuple[FitResult, str]:
    """The result at its true angles, and the observable that is drawn: the first one if none is named."""
    names = [str(name) for name in result.points["observable"].unique()]
    if not names:
        raise UsageError("This result holds no points, so there is nothing to draw. Fit the data again.")
    if observable is not None and observable not in names:
        raise UsageError(
            f"There is no '{observable}' in this fit. There is {joined(names)}.{meant(observable, names)}"
        )
    angled = [name for name in names if has_angle(name)]
    return at_true_angles(result), observable or (angled or names)[0]


def _styles(result: FitResult) -> Any:
    return series_styles([str(name) for name in result.points["series"].unique()])


def _axes(axes: Axes | None) -> Axes:
    new: Axes = _figure(4.5, 3.2).subplots() if axes is None else _drawable(axes)
    return new


def _drawable(axes: Any) -> Any:
    """Axes, or the sentence on what was given in their place."""
    from matplotlib.axes import Axes

    if not isinstance(axes, Axes) or axes.name == "3d":
        raise UsageError(
            f"ax: {axes!r:.60} is no Axes of matplotlib with two dimensions. Give one, as plt.subplots()[1], "
            "or leave it out."
        )
    return axes


def _figure(width: float, height: float) -> Any:
    """A figure of pyplot, so that a notebook shows it."""
    from matplotlib import pyplot

    return pyplot.figure(figsize=(width, height), layout="constrained")
