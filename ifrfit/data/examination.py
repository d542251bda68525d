"""What a file holds, how its columns are understood, and what can be fitted from it, before anything is."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ifrfit.data.column_roles import identify
from ifrfit.data.conventions import parse_conventions
from ifrfit.data.observations import Observations
from ifrfit.data.read_tracks import read_tracks
from ifrfit.data.readers import observe, read_table
from ifrfit.data.tracks.track_table import read_track_cells, track_columns
from ifrfit.physics.observables import OBSERVABLES

_SIMILAR_DEG = 1.0  # angles closer than this are one setting


@dataclass(frozen=True)
class Examination:
    """What is found of a file.

    Attributes
    ----------
    file : str
    columns : tuple of str
        How each column is understood, in words.
    rows : tuple of str
        What there is of each series and observable.
    fits : tuple of str
        What can be fitted.
    missing : tuple of str
        What is not there, and what follows.
    notes : tuple of str
        What reading had to say.
    """

    file: str
    columns: tuple[str, ...]
    rows: tuple[str, ...]
    fits: tuple[str, ...]
    missing: tuple[str, ...]
    notes: tuple[str, ...]


def examine(
    path: str | Path,
    convention: Sequence[str] | Mapping[str, str] = (),
    tracks: Mapping[str, Any] | None = None,
) -> Examination:
    """Read a file and say what it holds.

    Parameters
    ----------
    path : str or Path
        Whatever `ifrfit.read` takes of files.
    convention : sequence of ``NAME=CHOICE`` or mapping
        As in `ifrfit.read`.
    tracks : mapping, optional
        Options of `ifrfit.read_tracks`, where the file holds tracks.

    Raises
    ------
    DataError, UsageError
        As `ifrfit.read`.
    """
    conventions = parse_conventions(convention)
    if tracks is not None:
        found = read_tracks(path, **tracks, convention=convention)
        cells = read_track_cells(Path(path), conventions)
        columns = tuple(track_columns(cells, conventions))
    else:
        cells = read_table(Path(path), conventions)
        columns = tuple(identify(cells, conventions).lines())
        found = observe(cells, conventions)
    return Examination(
        str(path),
        columns,
        tuple(_rows(found.table)),
        tuple(_fits(found.table)),
        tuple(_missing(found)),
        found.notes,
    )


def _rows(table: pd.DataFrame) -> Iterator[str]:
    for (series, observable), part in table.groupby(["series", "observable"], sort=False):
        angles = part["gamma_deg"].dropna()
        over = "" if angles.empty else f", {angles.min():.4g} to {angles.max():.4g} degrees from the normal"
        values = f"{part['value'].min():.4g} to {part['value'].max():.4g}"
        yield f"{len(part)} {observable} of {series}: {values}{over}"


def _kinds(table: pd.DataFrame) -> dict[str, list[str]]:
    """Observables of the table by what they depend on."""
    found: dict[str, list[str]] = {}
    for name in dict.fromkeys(table["observable"]):
        found.setdefault(OBSERVABLES[name].kind, []).append(str(name))
    return found


def _fits(table: pd.DataFrame) -> Iterator[str]:
    kinds = _kinds(table)
    if "normal" in kinds:
        yield f"e_n, from {', '.join(kinds['normal'])}"
    oblique = [*kinds.get("tangential", ()), *kinds.get("curved", ())]
    if oblique:
        settings = _settings(table[table["observable"].isin(oblique)])
        alone = (
            ""
            if settings > 1
            else "; one angle alone shows sticking or sliding, hardly both: one constant of the two"
        )
        whole = "mu" if "normal" in kinds else "mu (1 + e_n)"
        yield f"e_t and {whole}, from {', '.join(oblique)}{alone}"
    if "friction" in kinds:
        yield f"mu, from {', '.join(kinds['friction'])}"


def _settings(table: pd.DataFrame) -> int:
    """Different angles, as far as they can be told."""
    angles = np.sort(table["gamma_deg"].dropna().to_numpy())
    return int(1 + np.sum(np.diff(angles) > _SIMILAR_DEG)) if angles.size else 0


def _missing(found: Observations) -> Iterator[str]:
    table, kinds = found.table, _kinds(found.table)
    oblique = "tangential" in kinds or "curved" in kinds
    if oblique and "normal" not in kinds:
        yield "e_n: without it mu is known only in mu (1 + e_n). Add a column e_n, or say --fix e_n=..."
    if not oblique and "friction" not in kinds:
        yield "an observable of the tangential impulse, such as beta: without one neither e_t nor mu is known"
    for name, part in table.groupby("observable", sort=False):
        lacking = int(part["sigma"].isna().sum())
        if lacking:
            of = "all" if lacking == len(part) else f"{lacking} of {len(part)}"
            yield f"sigma of {of} {name}: the scatter about the fit will tell (--noise unknown)"
    if table["gamma_deg"].notna().any() and table["sigma_gamma_deg"].isna().all():
        yield "sigma_gamma_deg: the angles are taken as exact"
    if table["speed_m_s"].isna().all():
        yield "speed_m_s: whether constants change with speed cannot be seen"
    if not table["provenance"].astype(str).str.len().any():
        yield "provenance: whether this was measured, digitised or simulated. Say --convention provenance=..."
