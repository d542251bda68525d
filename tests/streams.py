"""Tables of impacts in several files, as data that are not held in memory."""

from __future__ import annotations

import gzip

import numpy as np
import pandas as pd

from ifrfit.physics import OBSERVABLES, rebound

TRUTH = {"e_n": 0.9, "e_t": -0.7, "mu": 0.15}


def impacts(n, seed=0, *, columns=("beta", "e_n"), spin=0.3, sigma=0.03, series=1, **truth):
    """A wide table with sigma that differ, and spins."""
    rng = np.random.default_rng(seed)
    gamma, spin_y = rng.uniform(1.0, 88.0, n), spin * rng.standard_normal(n)
    own = TRUTH | truth
    state = rebound(gamma, 0.0, spin_y, degrees=True, **own)
    table = pd.DataFrame({"gamma_deg": gamma, "spin_y": spin_y})
    for name in columns:
        each = sigma * np.exp(0.3 * rng.standard_normal(n))
        values = OBSERVABLES[name].value(state, np.asarray(own["mu"])) + np.zeros(n)
        table[name] = values + each * rng.standard_normal(n)
        if name == "v_n":
            table.loc[table[name] < 0.0, name] = np.nan  # noise beyond what can be
        table[f"sigma_{name}"] = each
    if series > 1:
        table["series"] = [f"s{number}" for number in rng.integers(series, size=n)]
    return table


def folder_of(path, table, parts=3, suffix="csv"):
    """The table in several files of a folder."""
    path.mkdir()
    for number, rows in enumerate(np.array_split(np.arange(len(table)), parts)):
        part = table.iloc[rows]
        if suffix == "parquet":
            part.to_parquet(path / f"{number}.parquet", row_group_size=700)
        elif suffix == "csv.gz":
            with gzip.open(path / f"{number}.csv.gz", "wt", encoding="utf-8") as file:
                part.to_csv(file, index=False)
        else:
            part.to_csv(path / f"{number}.csv", index=False)
    return path
