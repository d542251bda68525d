"""Means of repeated rows, with their count and standard error."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ifrfit.data.observations import Observations, make_table

# What makes two rows repeats of one setting. Provenance keeps a mean from mixing kinds of data.
_SETTING = ["source", "series", "observable", "gamma_deg", "spin_x", "spin_y", "provenance"]


def average_replicates(obs: Observations, *, across_impacts: bool = False) -> Observations:
    """Replace repeated rows by their mean.

    Rows repeat one another if source, series, observable, angle, spins and provenance are equal, and the
    impact_id too unless `across_impacts`. With n >= 2 values the uncertainty is the standard error s/sqrt(n)
    from their scatter, whatever their own sigma said; a row alone stays as it is. Rows that are means already
    count with their number of repeats, the scatter among the means being what is seen.

    Parameters
    ----------
    obs : Observations
    across_impacts : bool
        Average over impacts with different impact_id. The means of one setting then share a new impact_id, so
        that observables of the same impacts are still not counted twice.

    Returns
    -------
    Observations
        ``n_repeats`` counts the repeats, ``row`` is the first row of each mean, ``speed_m_s`` their mean
        speed. ``rows_skipped`` counts the others as ``averaged with repeats``.
    """
    table = obs.table
    keys = [*_SETTING] if across_impacts else [*_SETTING, "impact_id"]
    group = table.groupby(keys, sort=False, dropna=False).ngroup().to_numpy()
    count = np.bincount(group)
    if not len(table) or count.max() < 2:
        return obs.with_note("No rows repeat one another: nothing was averaged.")
    value, weight = table["value"].to_numpy(), table["n_repeats"].to_numpy()
    total = np.bincount(group, weight)
    mean = np.bincount(group, weight * value) / total
    square = np.bincount(group, weight * (value - mean[group]) ** 2)
    with np.errstate(divide="ignore", invalid="ignore"):
        error = np.sqrt(square / (count - 1) / total)
    first = np.unique(group, return_index=True)[1]
    columns = {name: table[name].to_numpy()[first] for name in table.columns}
    many = count > 1
    columns["value"] = np.where(many, mean, columns["value"])
    # no scatter at all is a resolution limit, not certainty
    columns["sigma"] = np.where(many, np.where(error > 0, error, np.nan), columns["sigma"])
    columns["n_repeats"] = total.astype(np.int64)
    columns["speed_m_s"] = np.bincount(group, table["speed_m_s"].to_numpy()) / count
    if across_impacts:
        columns["impact_id"] = _new_ids(columns)
    means = make_table(columns)
    sources = []
    for source in obs.sources:
        used = int((means["source"] == source.name).sum())
        gone = int((table["source"] == source.name).sum()) - used
        skipped = {**source.rows_skipped, **({"averaged with repeats": gone} if gone else {})}
        sources.append(replace(source, rows_used=used, rows_skipped=skipped))
    note = (
        f"{int(count[many].sum())} repeated rows were averaged to {int(many.sum())} means; their uncertainty "
        "is the standard error s/sqrt(n)."
    )
    return replace(obs, table=means, sources=tuple(sources)).with_note(note)


def _new_ids(columns: dict[str, np.ndarray]) -> np.ndarray:
    """Name impacts after their setting; rows that had no impact_id get none."""
    ids = columns["impact_id"].astype(object)
    parts = zip(
        columns["series"], columns["gamma_deg"], columns["spin_x"], columns["spin_y"], ids, strict=True
    )
    return np.array([f"mean {s} {g!r} {x!r} {y!r}" if old else "" for s, g, x, y, old in parts], dtype=object)
