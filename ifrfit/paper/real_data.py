"""The bundled real data as the paper's kinds of figure.

Measured were the centre's restitution and, of some, the spin after. Each of them gives the impulse, and the
impulse gives beta, psi_after, mu_app and delta; what a source gives directly as well is drawn and not fitted.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd

from ifrfit.data.catalogue import load_dataset
from ifrfit.errors import DataError
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.paper.axes import Ordinate
from ifrfit.paper.build_scene import (
    Fitted,
    estimates_words,
    points_of,
    recovered_curve,
)
from ifrfit.paper.cases import case_named
from ifrfit.paper.figures import PaperFigure
from ifrfit.paper.observable_conversion import convert_observable
from ifrfit.paper.scene import Scene
from ifrfit.physics import OBSERVABLES
from ifrfit.physics.angles import Incidence
from ifrfit.report.figures import contradiction
from ifrfit.report.plot_elements import Curve, Pen, Points
from ifrfit.report.provenance import provenance_words
from ifrfit.report.regimes import transitions
from ifrfit.report.rounding import value_text
from ifrfit.report.shading import regimes_of
from ifrfit.report.style import COLOURS, GREY, SeriesStyle, series_styles
from ifrfit.text import sd_text

_DIRECT = SeriesStyle(COLOURS[2], "D", "-")
_NEEDS_E_N = ("mu_app", "delta_deg")


def real_data(figure: PaperFigure, fitted: Fitted) -> Scene:
    """A figure of real data: points, the fit with its bands, another fit as a line, and printed constants.

    Points of `fitted.other` that `fitted.result` leaves out are drawn in grey.

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
    lack = every.facts["lack_of_fit"]
    contradicted = "" if lack.ok else ", contradicted"
    line = Curve(
        "other",
        f"{figure.other_label}{contradicted}: {estimates_words(every)}",
        figure.x.grid,
        y.sign * table["value"].to_numpy(dtype=float),
        Pen(GREY, (0, (3, 2)), 0.9),
    )
    printed = [m.curve(figure.x, y, s) for m in figure.models for s in figure.settings]
    warnings = () if lack.ok else (contradiction(every, lack.figures.get("p")),)
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
