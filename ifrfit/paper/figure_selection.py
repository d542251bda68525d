"""Which figures are wanted, and which of those have real points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ifrfit.data.catalogue import dataset_names, load_dataset
from ifrfit.errors import UsageError
from ifrfit.paper.cases import CASES
from ifrfit.paper.figures import FIGURES, PaperFigure
from ifrfit.report.provenance import STAND_IN

REAL = ("digitised", "measured")


@dataclass(frozen=True)
class Choice:
    """Figures to draw, those wanted but left out, and the datasets that may be fitted."""

    figures: tuple[PaperFigure, ...]
    left_out: tuple[str, ...]
    datasets: frozenset[str]


def select_figures(names: Sequence[str], digitised_only: bool) -> Choice:
    """Look the wanted figures up; a number stands for all its parts.

    Raises
    ------
    UsageError
        If there is no such figure, or none of those wanted has points that were digitised or measured.
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
            f"--digitised-only: nothing of {listed} rests on points that were digitised or "
            "measured. Put yours in with 'ifrfit datasets install NAME FILE'."
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
