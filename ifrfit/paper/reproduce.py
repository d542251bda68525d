"""Redraw the paper's figures from the bundled datasets, and put the recovered constants into one table."""

from __future__ import annotations

import csv
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from ifrfit.data.catalogue import dataset_names, load_dataset
from ifrfit.errors import DataError, UsageError
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.paper import schemes
from ifrfit.paper.build_scene import Fitted, real_data, theory_scene, with_points
from ifrfit.paper.constants_table import Answer, across_regimes, across_spins, reading, table_text
from ifrfit.paper.drawing import draw
from ifrfit.paper.figures import FIGURES, PaperFigure
from ifrfit.paper.recovered_constants import CASES, COLUMNS, Case, FittedCase, case_named, fit_case
from ifrfit.paper.scene import Row, Scene, rounded, rows_of, write_rows
from ifrfit.report.atomic_folder import Contents, deliver
from ifrfit.report.provenance import STAND_IN
from ifrfit.report.style import SUFFIXES, save_svg_and_png

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_OTHER = {"beta": "contact point's", "beta_cm": "centre's"}
TABLE = "constants.csv"
FORMATS = (*SUFFIXES, "csv")
_OF_FIGURES = "panel,kind,label,"  # at the beginning of each csv
REAL = ("measured", "published", "digitised")


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
        if figure.name == "1":
            return DrawnFigure(figure.stem, schemes.draw_impact(), tuple(schemes.rows()))
        return DrawnFigure(figure.stem, schemes.draw_springs(), ())
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
        done[figure.case] = replace(done[figure.case], result=None, refusal=error.in_shell)
        return None


def _fitted(case: Case, done: dict[str, FittedCase]) -> FittedCase:
    if case.name not in done:
        done[case.name] = fit_case(case)
    return done[case.name]


@dataclass(frozen=True)
class Choice:
    """Figures to draw, those wanted but left out, and the datasets that may be fitted."""

    figures: tuple[PaperFigure, ...]
    left_out: tuple[str, ...]
    datasets: frozenset[str]


def reproduce(
    out: Path,
    *,
    figures: Sequence[str] = (),
    digitised_only: bool = False,
    progress: Callable[[str], object] = lambda line: None,
) -> str:
    """Redraw the figures of the paper and of the bundled real data, and tabulate the constants behind them.

    Parameters
    ----------
    out : Path
        Folder for svg, png and csv of each figure and constants.csv; the same bytes on every run. What an
        earlier run left there is replaced, nothing else is touched.
    figures : sequence of str
        Names of the figures wanted, as "5" or "4"; all of them if empty. constants.csv, which is about all,
        is left as it is where some are named.
    digitised_only : bool
        Leave out whatever does not rest on points that were measured, published or digitised.
    progress : callable
        Told a line per figure.

    Returns
    -------
    str
        The table of constants, at most 100 columns wide, with a line feed at its end.

    Raises
    ------
    UsageError
        For an unknown figure, if none of those wanted has real points, if nothing can be written there, or a
        constants.csv of another make lies there.
    """
    out = Path(out)
    choice = select_figures(figures, digitised_only)
    whole = not figures
    _check_free(out, whole)
    done: dict[str, FittedCase] = {}

    def fill(folder: Path) -> list[str]:
        done.update(_run(folder, choice, whole, progress))
        return [path.name for path in folder.iterdir()]

    ours = [
        f"{figure.stem}.{suffix}" for figure in (FIGURES if whole else choice.figures) for suffix in FORMATS
    ]
    # the table is in place last; what an earlier run left without a successor goes
    record, *others = [TABLE, *ours] if whole else ours
    marks = {TABLE: ",".join(COLUMNS[:4])} | {name: _OF_FIGURES for name in ours if name.endswith(".csv")}
    written = deliver(fill, out, Contents(record, tuple(others), "reproduction", marks), force=True)
    count = sum(name != TABLE for name in written) // len(FORMATS)
    named = [f"{count} figure{'s' if count != 1 else ''} (svg, png and csv)"]
    text = table_text(list(done.values()), _answers(done))
    left = f"\nleft out, without real points: {', '.join(choice.left_out)}\n" if choice.left_out else ""
    return f"{text}{left}\nwritten: {out}/  {' and '.join([*([TABLE] if whole else []), *named])}\n"


def _check_free(out: Path, whole: bool) -> None:
    if out.exists() and not out.is_dir():
        raise UsageError(f"{out} is a file. Name a folder with --out.")
    table = out / TABLE
    if whole and table.is_file():
        with table.open(encoding="utf-8", errors="replace") as file:
            ours = file.readline().startswith(",".join(COLUMNS[:4]))
        if not ours:
            raise UsageError(f"{table} is not a table of this command. Choose another folder with --out.")


def _run(
    folder: Path, choice: Choice, whole: bool, progress: Callable[[str], object]
) -> dict[str, FittedCase]:
    """Fit, draw and write into a folder; the fits by the names of their cases."""
    done: dict[str, FittedCase] = {}
    for figure in choice.figures:
        started = time.monotonic()
        drawn = make_figure(figure, done)
        if drawn is not None:
            save_svg_and_png(drawn.figure, folder, drawn.stem)
            write_rows(drawn.rows, folder / f"{drawn.stem}.csv")
        how = f"{time.monotonic() - started:.1f} s" if drawn is not None else "not drawn, see the table"
        plain = figure.title.replace("$", "").replace("\\", "")
        progress(f"{figure.stem:<17} {plain}, {how}")
    for case in CASES if whole else ():
        if case.name not in done and case.dataset in choice.datasets:
            done[case.name] = fit_case(case)
    done = {case.name: done[case.name] for case in CASES if case.name in done}
    if whole:
        _write_table(folder / TABLE, list(done.values()))
    return done


def _write_table(path: Path, done: Sequence[FittedCase]) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows(line.cells() for d in done for line in d.lines)


def _answers(done: dict[str, FittedCase]) -> list[Answer]:
    """What the data say to the paper's questions: one set in both regimes, one mu, which beta."""
    answers = [
        across_regimes(d)
        for d in done.values()
        if not d.case.repeats_data and d.result is not None and d.result.points["gamma_deg"].notna().any()
    ]
    answers.append(across_spins(done))
    if "buck-2017" in done:
        answers.append(reading(done["buck-2017"]))
    return [answer for answer in answers if answer is not None]


def select_figures(names: Sequence[str], digitised_only: bool) -> Choice:
    """Look the wanted figures up; a number stands for all its parts.

    Raises
    ------
    UsageError
        If there is no such figure, or none of those wanted has points that were measured, published or
        digitised.
    """
    requested = _named(names)
    if not digitised_only:
        return Choice(requested, (), frozenset(dataset_names()))
    real = frozenset(name for name in dataset_names() if _is_real(name))
    of_case = {case.name: case.dataset for case in CASES}
    selected = tuple(figure for figure in requested if of_case.get(figure.case, "") in real)
    if not selected:
        listed = ", ".join(figure.stem for figure in requested)
        raise UsageError(
            f"--digitised-only: nothing of {listed} rests on points that were measured, "
            "published or digitised. Put yours in with 'ifrfit datasets install NAME FILE'."
        )
    left_out = tuple(figure.stem for figure in requested if figure not in selected)
    return Choice(selected, left_out, real)


def _named(names: Sequence[str]) -> tuple[PaperFigure, ...]:
    if not names:
        return FIGURES
    found: list[PaperFigure] = []
    for name in names:
        requested = name.strip().lower().removeprefix("fig").lstrip(". ").replace("kharaz-2001", "kharaz")
        hits = [f for f in FIGURES if f.name.lower() == requested] or [
            f for f in FIGURES if _part(f, requested)
        ]
        if not hits:
            there = ", ".join(figure.name for figure in FIGURES)
            raise UsageError(f"--figure {name}: there is no such figure. There are {there}.")
        found += hits
    return tuple(figure for figure in FIGURES if figure in found)


def _part(figure: PaperFigure, requested: str) -> bool:
    """Whether a figure is a part of the wanted one: 4a of 4, A2.1b of A2.1, kharaz-beta of kharaz."""
    name = figure.name.lower()
    if not requested or not name.startswith(requested):
        return False
    rest = name.removeprefix(requested)
    return rest in ("a", "b") or rest.startswith("-")


def _is_real(dataset: str) -> bool:
    kinds = set(load_dataset(dataset).provenance)
    return STAND_IN not in kinds and bool(kinds & set(REAL))
