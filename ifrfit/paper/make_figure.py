"""Make one figure: its fits, its picture and its rows."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from ifrfit.errors import DataError
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.paper.build_scene import Fitted, theory_scene, with_points
from ifrfit.paper.cases import Case, case_named
from ifrfit.paper.drawing import draw
from ifrfit.paper.figures import PaperFigure
from ifrfit.paper.real_data import real_data
from ifrfit.paper.recovered_constants import FittedCase, fit_case
from ifrfit.paper.scene import Row, Scene, rounded, rows_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_OTHER = {"beta": "contact point's", "beta_cm": "centre's"}


@dataclass(frozen=True)
class DrawnFigure:
    """A figure and the rows of its csv."""

    stem: str
    figure: Figure
    rows: tuple[Row, ...]


def make_figure(figure: PaperFigure, done: dict[str, FittedCase]) -> DrawnFigure | None:
    """Draw a figure of the table.

    Parameters
    ----------
    figure : PaperFigure
    done : dict
        Fits made so far, by case; those made here are put in.

    Returns
    -------
    DrawnFigure or None
        None where the user's own data do not have what the figure shows.
    """
    if figure.kind == "scheme":
        return _scheme(figure)
    scene = scene_of(figure, done)
    if scene is None:
        return None
    scene = rounded(scene)
    return DrawnFigure(figure.stem, draw(scene), tuple(rows_of(scene)))


def scene_of(figure: PaperFigure, done: dict[str, FittedCase]) -> Scene | None:
    """What a figure with an axis shows; None where the fit was refused."""
    if figure.kind == "theory":
        return theory_scene(figure)
    case = case_named(figure.case)
    result = _fitted(case, done).result
    if result is None:
        return None
    if figure.kind == "real":
        return _real(figure, result, done)
    if not case.readings:
        return with_points(figure, Fitted(result))
    named = str(result.points["observable"].iloc[0])
    other = next(name for name in case.readings if name != named)
    label = f"recovered if they are the {_OTHER[other]}"
    return with_points(figure, Fitted(result, fit_case(case, reading=other).result, label))


def _real(figure: PaperFigure, result: FitResult, done: dict[str, FittedCase]) -> Scene | None:
    other = _fitted(case_named(figure.other), done).result
    if other is None:
        return None
    try:
        return real_data(figure, Fitted(result, other))
    except DataError as error:
        done[figure.case] = replace(done[figure.case], result=None, refusal=str(error))
        return None


def _fitted(case: Case, done: dict[str, FittedCase]) -> FittedCase:
    if case.name not in done:
        done[case.name] = fit_case(case)
    return done[case.name]


def _scheme(figure: PaperFigure) -> DrawnFigure:
    from ifrfit.paper import scheme_impact, scheme_springs

    if figure.name == "1":
        return DrawnFigure(figure.stem, scheme_impact.draw(), tuple(scheme_impact.rows()))
    return DrawnFigure(figure.stem, scheme_springs.draw(), ())
