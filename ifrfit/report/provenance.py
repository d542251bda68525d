"""What a report says about the data: where they come from, how many they are, what was left out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from ifrfit.data import Source
from ifrfit.data.schema import STAND_IN as STAND_IN
from ifrfit.inference.diagnostics.omitted_effects.experimental_conditions import condition_of
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.option_words import in_python
from ifrfit.report.regimes import count_impacts, has_angle
from ifrfit.report.sentences import sigma_words
from ifrfit.text import joined

if TYPE_CHECKING:
    import pandas as pd

PROVENANCE = {
    "measured": "Values as their authors measured them",
    "published": "Printed in a table of a publication, rounded as it stands there",
    "digitised": "Read off a published figure, whose reading errors are part of the scatter",
    "simulated": "Computed by a simulation, not measured",
    "": "Where these values come from is not stated; --convention provenance=measured would say it",
}


def is_stand_in(result: FitResult) -> bool:
    """Whether any of the data were generated instead of observed."""
    return any(STAND_IN in kinds_of(result, source) for source in result.inputs)


def stand_in_words(result: FitResult) -> str:
    """What stands before every caption of generated data; empty for data proper."""
    return "STAND-IN data, not an experiment. " if is_stand_in(result) else ""


def kinds_of(result: FitResult, source: Source) -> tuple[str, ...]:
    """Provenances of the rows used of a source; of the whole source where the result holds no points."""
    points = result.points
    if len(points):
        own = points["provenance"][points["source"] == source.name]
        if len(own):
            return tuple(str(kind) for kind in own.unique())
    return tuple(kind.strip() for kind in source.provenance.split(","))


def rows_of(result: FitResult, source: Source) -> pd.DataFrame:
    """The points that come from a source."""
    points = result.points
    return points[points["source"] == source.name] if len(points) else points


def provenance_words(kinds: tuple[str, ...]) -> str:
    """A word or two for a legend or a headline."""
    return ", ".join(kind or "provenance not stated" for kind in kinds)


def stand_in_sentence(source: Source) -> str:
    """Say what a stand-in is and what a fit to it does not show."""
    conditions: Mapping[str, object] = source.descriptor.conditions if source.descriptor else {}
    ball, wall = (condition_of(conditions, key)[0] for key in ("material", "wall"))
    what = f"what {ball} on {wall} does" if ball and wall else "what real spheres and walls do"
    return (
        "STAND-IN, generated from the constants the paper prints. "
        f"This fit shows that the tool works, not {what}."
    )


def provenance_sentences(result: FitResult, source: Source) -> list[str]:
    """Say where the values of a source come from; a stand-in first and in capitals."""
    kinds = sorted(kinds_of(result, source), key=lambda kind: kind != STAND_IN)
    said = [
        stand_in_sentence(source) if kind == STAND_IN else f"{PROVENANCE.get(kind, kind)}." for kind in kinds
    ]
    return said if result.command else [in_python(each) for each in said]


def reference(source: Source, *, full: bool = False) -> str:
    """Title of a dataset, with its references where `full`; empty for a file."""
    if source.descriptor is None:
        return ""
    title, origin = source.descriptor.title.rstrip("."), source.descriptor.source.rstrip(".")
    parts = [title, f"Source: {origin}" if origin and (full or not title) else ""]
    return ". ".join(part for part in parts if part) + "." if any(parts) else ""


def contents(result: FitResult, source: Source) -> str:
    """Say how many impacts of what a source gave, of which kind, and what sigma meant."""
    rows = rows_of(result, source)
    if len(rows) and not result.is_sampled:
        observables = [str(name) for name in rows["observable"].unique()]
        text = f"{_amount(rows)}, {joined(observables)}"
        readings = int(rows["n_repeats"].sum())
        if readings > len(rows):
            text += f" (means of {readings} readings)"
    else:
        text = f"{source.rows_used} rows"
    return f"{text}, {provenance_words(kinds_of(result, source))}, {sigma_words(result)}"


def source_sentences(result: FitResult, source: Source) -> list[str]:
    """Everything about a source: what it holds, where that comes from, its reference, what was left out."""
    sentences = [
        f"{source.name}: {contents(result, source)}.",
        *provenance_sentences(result, source),
        reference(source, full=True),
        left_out(source),
    ]
    return [sentence for sentence in sentences if sentence]


def left_out(source: Source) -> str:
    """Say what was selected and skipped; empty where all of it was used."""
    parts = [f"Selection: {source.selection}"] if source.selection else []
    skipped = {reason: count for reason, count in source.rows_skipped.items() if count}
    if skipped:
        reasons = ", ".join(f"{count} {reason}" for reason, count in skipped.items())
        parts.append(f"{sum(skipped.values())} of {source.rows} rows left out: {reasons}")
    return ". ".join(parts) + "." if parts else ""


def _amount(rows: pd.DataFrame) -> str:
    impacts, count = count_impacts(rows), len(rows)
    angles = any(has_angle(str(name)) for name in rows["observable"].unique())
    if not angles:
        return f"{count} value{'s' if count != 1 else ''}"
    words = f"{impacts} impact{'s' if impacts != 1 else ''}"
    return words if impacts == count else f"{words} ({count} rows)"


def amount_words(result: FitResult) -> str:
    """How many rows are shown, and of how many where these are a sample."""
    shown = len(result.points)
    return f"a random sample of {shown:,} of {result.fit.n:,} rows" if result.is_sampled else f"{shown} rows"
