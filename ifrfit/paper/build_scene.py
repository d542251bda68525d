"""From a figure of the table and its fit to everything that is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ifrfit.inference.result.fit_result import FitResult
from ifrfit.paper.axes import INCIDENCE, Abscissa, Ordinate
from ifrfit.paper.figures import PaperFigure
from ifrfit.paper.scene import Scene
from ifrfit.physics.angles import Array
from ifrfit.report.figures import NON_BREAKING, contradiction
from ifrfit.report.plot_elements import Band, Curve, Pen, Points, is_outlier, numbers, sticks
from ifrfit.report.provenance import STAND_IN, is_stand_in, provenance_words
from ifrfit.report.regimes import transition_is_open, transitions
from ifrfit.report.rounding import span_text, value_text
from ifrfit.report.shading import Mark, Regimes, regimes_of, spans
from ifrfit.report.style import COLOURS, SeriesStyle, series_styles
from ifrfit.text import sd_text

if TYPE_CHECKING:
    import pandas as pd

WARNING = "STAND-IN DATA, not an experiment:\ngenerated from the printed constants"
_SYMBOLS = {"e_n": "$e_n$", "e_t": "$e_t$", "beta0": r"$\beta_0$", "mu": "μ"}


@dataclass(frozen=True)
class Fitted:
    """The fits that a figure shows.

    Attributes
    ----------
    result : FitResult
        Drawn with bands.
    other : FitResult or None
        A second one, drawn as a line.
    other_label : str
    """

    result: FitResult
    other: FitResult | None = None
    other_label: str = ""


def theory_scene(figure: PaperFigure) -> Scene:
    """A figure without data: lines of given constants, regimes of the first of them."""
    assert figure.y is not None
    model, setting = figure.models[0], figure.settings[0]
    curves = tuple(m.curve(figure.x, figure.y, setting) for m in figure.models)
    marks = model.marks(figure.x, setting)
    if figure.x.spin:
        ranges: tuple[tuple[float, float, str], ...] = ((figure.x.low, figure.x.high, "sliding"),)
    else:
        key = tuple((a, a, a) for a in model.transitions(setting)) or "sliding"
        places = ((figure.x.inside(low), figure.x.inside(high), regime) for low, high, regime in spans(key))
        ranges = tuple(span for span in places if span[1] > span[0])
    words = tuple(f"transition at {angle:.2f}°" for angle in model.transitions(setting) if marks)
    # the line is that of the constants themselves here: drawn in full
    label = curves[0].label.replace("printed", "corrected equations")
    first = replace(curves[0], label=label, pen=Pen(COLOURS[0], "-", 1.3))
    notes = (*words, "theory alone, no data")
    return Scene(
        figure.stem,
        _title(figure),
        figure.x,
        figure.y,
        (first, *curves[1:]),
        regimes=(Regimes(ranges, marks),),
        notes=notes,
    )


def with_points(figure: PaperFigure, fitted: Fitted) -> Scene:
    """A figure with data, the fit to them, and lines of given constants."""
    assert figure.y is not None
    result, y = fitted.result, figure.y
    rows = result.points[result.points["observable"] == _observable(figure, result)]
    x = figure.x.with_points(figure.x.of_gamma(rows["gamma_deg"].to_numpy(dtype=float)))
    styles = series_styles([str(name) for name in rows["series"].unique()])
    points = []
    for series, own in styles.items():
        part = rows[rows["series"] == series]
        value, sigma, residual = numbers(part, "value", "sigma_used", "standardised")
        points.append(points_of(result, part, series, y.sign * value, sigma, y.sign * residual, own, x))
    shown_observable = _observable(figure, result)
    curves = [
        recovered_curve(result, shown_observable, rows[rows["series"] == s], s, x, y, own)
        for s, own in styles.items()
    ]
    if fitted.other is not None:
        other = fitted.other.points
        name, observable = str(other["series"].iloc[0]), str(other["observable"].iloc[0])
        table = fitted.other.predict(x.gamma(x.grid), observable=observable, series=name)
        values = y.sign * table["value"].to_numpy(dtype=float)
        label = f"{fitted.other_label}: {estimates_words(fitted.other)}"
        curves.append(Curve("other", label, x.grid, values, Pen(COLOURS[2], "-.", 0.9)))
    curves += [m.curve(x, y, setting) for m in figure.models for setting in figure.settings]
    regimes = regimes_of(result, styles, x.inside)
    # the printed transition stands once for each setting
    printed = tuple(m for setting in figure.settings for m in figure.models[0].marks(x, setting))
    regimes = tuple(replace(part, marks=(*part.marks, *_own(printed, part, regimes))) for part in regimes)
    return Scene(
        figure.stem,
        _title(figure),
        x,
        y,
        tuple(curves),
        tuple(points),
        regimes,
        warnings_of(result),
        _transition_notes(figure, result),
        is_stand_in(result),
    )


def recovered_curve(
    result: FitResult,
    observable: str,
    rows: pd.DataFrame,
    series: str,
    x: Abscissa,
    y: Ordinate,
    series_style: SeriesStyle,
) -> Curve:
    """Curve of the recovered constants, with credible bands and those of one more measurement."""
    spin = [float(rows[name].median()) for name in ("spin_x", "spin_y")]
    angles = [e.value for e in transitions(result, series) if e.value is not None]
    kinks = x.of_gamma(np.array(angles, dtype=float))
    at = np.unique(np.concatenate([x.grid, kinks[(kinks > x.low) & (kinks < x.high)]]))
    gamma = x.gamma(at)
    table = result.predict(gamma, *spin, observable=observable, series=series, sigma=noise_at(gamma, rows))
    label = f"recovered: {estimates_words(result)}"
    credible, predictive = (Band.of(table, prefix, y.sign) for prefix in ("", "new_"))
    values = y.sign * table["value"].to_numpy(dtype=float)
    return Curve("recovered", label, at, values, Pen(series_style.colour, "-", 1.3), credible, predictive)


def noise_at(gamma: Array, rows: pd.DataFrame) -> Array:
    """Sigma of one more measurement at each angle: between the angles of the data, linear."""
    own = rows.groupby("gamma_deg")["sigma_used"].mean()
    return np.asarray(np.interp(gamma, own.index.to_numpy(dtype=float), own.to_numpy(dtype=float)))


def estimates_words(result: FitResult) -> str:
    """Constants with their standard deviations, for a legend."""
    words = []
    for name, found in result.flat_constants().items():
        symbol = _SYMBOLS.get(name, name)
        if found.status == "fixed":
            words.append(f"{symbol} {value_text(found)} given")
        elif found.value is None:
            words.append(f"{symbol} open")
        elif found.status == "one_sided":
            words.append(f"{symbol} in {span_text(found)}")
        else:
            words.append(f"{symbol} {value_text(found)}±{sd_text(found.stderr or 0.0)}")
    # a value stays with its symbol where a line is broken
    return ", ".join(word.replace(" ", NON_BREAKING) for word in words).replace("-", "−")


def _own(printed: Sequence[Mark], part: Regimes, every: Sequence[Regimes]) -> tuple[Mark, ...]:
    """Printed transitions of one part: all of them where the series share theirs, else by series."""
    if len(every) == 1:
        return tuple(printed)
    names = [mark.label.rpartition(", ")[2] for mark in part.marks]
    return tuple(mark for mark in printed if mark.label.rpartition(", ")[2] in names)


def warnings_of(result: FitResult) -> tuple[str, ...]:
    """What nobody may overlook."""
    warnings = [WARNING] if is_stand_in(result) else []
    lack = result.facts["lack_of_fit"]
    if not lack.ok:
        warnings.append(contradiction(result, lack.figures.get("p")))
    return tuple(warnings)


def points_of(
    result: FitResult,
    rows: pd.DataFrame,
    name: str,
    value: Array,
    sigma: Array,
    residual: Array,
    own: SeriesStyle,
    x: Abscissa = INCIDENCE,
) -> Points:
    """Observations in a figure.

    Parameters
    ----------
    result : FitResult
    rows : DataFrame
        Of its points.
    name : str
        In the legend, beside their provenance.
    value, sigma, residual : ndarray, (n,)
        As the figure shows them; where sigma is not finite there is no error bar.
    own : SeriesStyle
    x : Abscissa
    """
    kinds = tuple(str(kind) for kind in rows["provenance"].unique())
    words = "STAND-IN, not measured" if STAND_IN in kinds else provenance_words(kinds)
    return Points(
        f"{name} ({words})" if name else words,
        x.of_gamma(rows["gamma_deg"].to_numpy(dtype=float)),
        value,
        np.where(np.isfinite(sigma), sigma, 0.0),
        own,
        ", ".join(kinds),
        sticks(rows),
        residual,
        is_outlier(result, rows),
    )


def _observable(figure: PaperFigure, result: FitResult) -> str:
    """What the rows are: the figure's observable, or the reading of it that the data name."""
    assert figure.y is not None
    there = [str(name) for name in result.points["observable"].unique()]
    return figure.y.observable if figure.y.observable in there else there[0]


def _title(figure: PaperFigure) -> str:
    return f"Fig. {figure.name}  {figure.title}" if figure.kind != "real" else figure.title


def _transition_notes(figure: PaperFigure, result: FitResult) -> tuple[str, ...]:
    """Transition angles in words: printed, and recovered with their standard deviations."""
    model, lines = figure.models[0], []
    for setting in figure.settings:
        angles = model.transitions(setting)
        printed = " and ".join(f"{angle:.2f}°" for angle in angles) or "none"
        own = transitions(result, setting.series)
        found = " and ".join(
            f"{value_text(e)}°±{sd_text(e.stderr or 0.0)}°" for e in own if e.value is not None
        )
        of = f"transition, {setting.series}" if len(figure.settings) > 1 else "transition"
        lines.append(f"{of}: printed {printed}, recovered {found or _without(result, setting.series)}")
    return tuple(lines)


def _without(result: FitResult, series: str) -> str:
    return "open" if transition_is_open(result, series) else "none"
