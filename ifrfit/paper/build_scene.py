"""From a figure of the table and its fits to everything that is drawn; real data are converted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from ifrfit.data.catalogue import load_dataset
from ifrfit.errors import DataError
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.paper.figures import PaperFigure
from ifrfit.paper.recovered_constants import case_named
from ifrfit.paper.scene import INCIDENCE, Abscissa, Ordinate, Scene
from ifrfit.physics import OBSERVABLES
from ifrfit.physics.angles import Array, Incidence
from ifrfit.physics.rebound import rebound_with
from ifrfit.report.figures import NON_BREAKING, contradiction
from ifrfit.report.panels import Band, Curve, Pen, Points, is_outlier, numbers, sticks
from ifrfit.report.provenance import STAND_IN, is_stand_in, provenance_words
from ifrfit.report.regimes import Mark, Regimes, regimes_of, spans, transition_is_open, transitions
from ifrfit.report.sentences import span_text, value_text
from ifrfit.report.style import COLOURS, GREY, SeriesStyle, series_styles
from ifrfit.text import sd_text

if TYPE_CHECKING:
    import pandas as pd

WARNING = "STAND-IN DATA, not an experiment:\ngenerated from the printed constants"
_SYMBOLS = {"e_n": "$e_n$", "e_t": "$e_t$", "beta0": r"$\beta_0$", "mu": "μ"}
_DIRECT = SeriesStyle(COLOURS[2], "D", "-")
_NEEDS_E_N = ("mu_app", "delta_deg")
_STEP = 1e-6


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
    return tuple(filter(None, (WARNING if is_stand_in(result) else "", contradiction(result))))


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


def real_data(figure: PaperFigure, fitted: Fitted) -> Scene:
    """A figure of real data: points, the fit with its bands, another fit as a line, and printed constants.

    Measured were the centre's restitution and, of some, the spin after. Each of them gives the impulse, and
    the impulse gives beta, psi_after, mu_app and delta; what a source gives directly as well is drawn and
    not fitted. Points of `fitted.other` that `fitted.result` leaves out are drawn in grey.

    Raises
    ------
    DataError
        If nothing was fitted that gives the impulse by itself.
    """
    assert figure.y is not None
    result, every, y = fitted.result, fitted.other, figure.y
    assert every is not None
    e_n = float(result.flat_constants()["e_n"].value or 0.0)
    measured = _tangential(result)
    points = [
        part
        for name, styles in zip(measured, series_styles(list(measured)).values(), strict=True)
        for part in _converted(result, every, name, styles, y, e_n)
    ]
    points += _direct(figure, y)
    rows = _noise_rows(result, measured[0], y, e_n)
    series = str(result.points["series"].iloc[0])
    styles = {series: SeriesStyle(COLOURS[0], "o", "-")}
    curve = recovered_curve(result, y.observable, rows, series, figure.x, y, styles[series])
    table = every.predict(figure.x.gamma(figure.x.grid), observable=y.observable, series=series)
    against = contradiction(every)
    contradicted = ", contradicted" if against else ""
    line = Curve(
        "other",
        f"{figure.other_label}{contradicted}: {estimates_words(every)}",
        figure.x.grid,
        y.sign * table["value"].to_numpy(dtype=float),
        Pen(GREY, (0, (3, 2)), 0.9),
    )
    printed = [m.curve(figure.x, y, s) for m in figure.models for s in figure.settings]
    warnings = (against,) if against else ()
    return Scene(
        figure.stem,
        figure.title,
        figure.x,
        y,
        (replace(curve, label=curve.label.replace("recovered", figure.label)), line, *printed),
        tuple(points),
        regimes_of(result, styles, figure.x.inside),
        warnings,
        _notes(result, y, e_n),
    )


def _tangential(result: FitResult) -> tuple[str, ...]:
    """What was fitted and gives the impulse by itself."""
    there = [str(name) for name in result.points["observable"].unique()]
    found = [n for n in there if OBSERVABLES[n].linear is not None and OBSERVABLES[n].scale == "one"]
    if not found:
        raise DataError(
            f"{result.inputs[0].name}: its figures need beta, beta_cm or the spin after, and there is "
            f"{', '.join(there)}."
        )
    return tuple(found)


def _converted(
    result: FitResult, every: FitResult, measured: str, series_style: SeriesStyle, y: Ordinate, e_n: float
) -> list[Points]:
    """Points of one measurement: those fitted, with residuals, and those left out of the fit."""
    fitted = result.points[result.points["observable"] == measured]
    rows = every.points[every.points["observable"] == measured]
    factor = float((fitted["sigma_used"] / fitted["sigma"]).median()) if len(fitted) else 1.0
    left = rows[~rows["row"].isin(fitted["row"])]
    left = left.assign(sigma_used=factor * left["sigma"])
    found = []
    for part, used in ((fitted, True), (left, False)):
        if not len(part):
            continue
        value, sigma, sign = _converted_values(part, measured, y, e_n)
        name = f"from {OBSERVABLES[measured].symbol}" + ("" if used else ", not fitted")
        residual = y.sign * sign * part["standardised"].to_numpy(dtype=float)
        own = series_style if used else SeriesStyle(GREY, series_style.marker, "-")
        points = points_of(result, part, name, y.sign * value, sigma, residual, own)
        found.append(points if used else replace(points, residual=None, is_outlier=None))
    return found


def _converted_values(
    rows: pd.DataFrame, measured: str, y: Ordinate, e_n: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows as the observable shown, with its sigma; 1 or -1 as it rises or falls with what was measured."""
    incidence = Incidence.of(rows["gamma_deg"], rows["spin_x"], rows["spin_y"], degrees=True)
    value, sigma = (rows[name].to_numpy(dtype=float) for name in ("value", "sigma_used"))
    (here, spread), (there, _) = (
        convert_observable(y.observable, measured, v, sigma, incidence, e_n=e_n)
        for v in (value, value + sigma)
    )
    return here, spread, np.sign(there - here)


def _noise_rows(result: FitResult, measured: str, y: Ordinate, e_n: float) -> pd.DataFrame:
    """The fitted rows of one measurement with their sigma in the observable shown."""
    rows = result.points[result.points["observable"] == measured]
    return rows.assign(sigma_used=_converted_values(rows, measured, y, e_n)[1])


def _direct(figure: PaperFigure, y: Ordinate) -> list[Points]:
    """A further series, where it is of the observable shown."""
    table = load_dataset(case_named(figure.case).dataset).table
    rows = table[(table["series"] == figure.direct) & (table["observable"] == y.observable)]
    if not len(rows):
        return []
    kinds = tuple(str(kind) for kind in rows["provenance"].unique())
    label = f"read directly, not fitted ({provenance_words(kinds)})"
    x, value, sigma = (rows[name].to_numpy(dtype=float) for name in ("gamma_deg", "value", "sigma"))
    return [Points(label, x, y.sign * value, sigma, _DIRECT, ", ".join(kinds))]


def _notes(result: FitResult, y: Ordinate, e_n: float) -> tuple[str, ...]:
    series = str(result.points["series"].iloc[0])
    words = [f"transition: {value_text(e)}°±{sd_text(e.stderr or 0.0)}°" for e in transitions(result, series)]
    needs = [f"points need $e_n$, taken as {e_n:.3f}"] if y.observable in _NEEDS_E_N else []
    return (*words, *needs)


def convert_observable(
    target: str,
    measured: str,
    value: Array,
    sigma: Array,
    incidence: Incidence,
    *,
    e_n: float,
    inertia_factor: float = 0.4,
) -> tuple[Array, Array]:
    """Convert tangential measurements into another observable by the balance of angular momentum.

    Parameters
    ----------
    target, measured : str
        Observables; `measured` is of the tangential kind and does not depend on e_n.
    value, sigma : ndarray, (n,)
        What was measured, with its standard uncertainty.
    incidence : Incidence
        Of the n impacts.
    e_n : float
        Normal restitution, which some observables need (mu_app, delta).
    inertia_factor : float

    Returns
    -------
    value, sigma : ndarray, (n,)
        In the unit of `target`; sigma to first order. nan where it is undefined.

    Notes
    -----
    No closure enters: centre and spin change by the same impulse, -k U_t per mass.
    """
    offset, slope = OBSERVABLES[measured].linear(incidence, inertia_factor)  # type: ignore[misc]
    with np.errstate(divide="ignore", invalid="ignore"):
        k, sigma_k = (value - offset) / slope, sigma / np.abs(slope)

    def read(factor: Array) -> Array:
        sticking = np.zeros(factor.shape, dtype=bool)
        state = rebound_with(incidence, factor, sticking, np.asarray(e_n), inertia_factor)
        return np.asarray(OBSERVABLES[target].value(state, np.zeros_like(factor)))

    gradient = (read(k + _STEP) - read(k - _STEP)) / (2.0 * _STEP)
    return read(k), np.asarray(np.abs(gradient) * sigma_k)
