"""Rows that a problem of sums is made of: condensed ones, and impacts that stand for themselves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ifrfit.data.observations import make_table

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@dataclass(frozen=True)
class ProblemRows:
    """Rows of one observable; (n,) each.

    Attributes
    ----------
    observable : int
        Among those of the stream.
    series : ndarray of int
        Index into the series of the sums.
    gamma_deg, spin_x, spin_y : ndarray
        Angle in degrees, and spins.
    value : ndarray
    sigma : ndarray
        The weight is sigma^-2, even where it is no uncertainty that was given.
    count : ndarray
        Measurements that each stands for.
    kind : ndarray of int
        Index into names of what rows are, which whoever makes them has.
    """

    observable: int
    series: Index
    gamma_deg: Array
    spin_x: Array
    spin_y: Array
    value: Array
    sigma: Array
    count: Array
    kind: Index

    @classmethod
    def condensed(
        cls, observable: int, series: int, rows: tuple[Array, Array, Array, Array], kind: Index
    ) -> ProblemRows:
        """Condensed rows of one series: angle, value, sigma and count."""
        gamma, value, sigma, count = rows
        number, none = np.full(value.size, series, dtype=np.intp), np.zeros(value.size)
        return cls(observable, number, gamma, none, none, value, sigma, count, kind)

    def __len__(self) -> int:
        return int(self.value.size)


@dataclass(frozen=True)
class JoinedRows:
    """Rows of several observables, series by series.

    Attributes
    ----------
    table : pandas.DataFrame
        In the common schema; ``impact_id`` says what a row is.
    group : ndarray of int, (n,)
        Series times observables.
    sigma, count : ndarray, (n,)
        As `ProblemRows`.
    """

    table: pd.DataFrame
    group: Index
    sigma: Array
    count: Array

    @classmethod
    def of(
        cls,
        parts: Sequence[ProblemRows],
        series: Sequence[str],
        observables: Sequence[str],
        kinds: Sequence[str],
        *,
        has_sigma: bool,
        source: str,
        provenance: str,
    ) -> JoinedRows:
        """The rows of all parts; series stand in the order of their numbers, as in memory."""
        number = np.concatenate([part.series for part in parts])
        order = np.argsort(number, kind="stable")
        which = np.repeat([part.observable for part in parts], [len(part) for part in parts])[order]
        number = number[order]

        def column(name: str) -> NDArray[np.generic]:
            return np.concatenate([getattr(part, name) for part in parts])[order]

        sigma = np.asarray(column("sigma"), dtype=float)
        table = make_table(
            {
                "series": _texts(series, number),
                "observable": _texts(observables, which),
                **{name: column(name) for name in ("gamma_deg", "spin_x", "spin_y", "value")},
                "sigma": sigma if has_sigma else np.full(sigma.size, np.nan),
                "impact_id": _texts(kinds, np.asarray(column("kind"), dtype=np.intp)),
                "source": source,
                "provenance": provenance,
            }
        )
        group = number * len(observables) + which
        return cls(table, group, sigma, np.asarray(column("count"), dtype=float))


def _texts(names: Sequence[str], number: Index) -> pd.Series:
    """Names by their numbers: a text is made once, not once a row."""
    return pd.Series(pd.array(list(names), dtype="str").take(number))
