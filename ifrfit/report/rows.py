"""The rows of the table of constants, the same in every style."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ifrfit.inference.result import Estimate, FitResult
from ifrfit.report.regimes import joined
from ifrfit.report.rounding import decimals, fixed
from ifrfit.report.words import status_words


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Attributes
    ----------
    name : str
        Constant, kappa or noise.
    series : str
        Whose, where the constant is separate; else empty.
    estimate : Estimate or None
        None for a noise, which has a value only.
    plain : str
        The value where there is no estimate.
    remark : str
        Status or meaning, in words.
    """

    name: str
    series: str
    estimate: Estimate | None
    plain: str
    remark: str

    @property
    def label(self) -> str:
        """Name with the series in brackets."""
        return f"{self.name} [{self.series}]" if self.series else self.name


def table_rows(result: FitResult) -> list[Row]:
    """Constants in the order of the closure, then kappa, then the noise."""
    rows = [
        Row(name, series, estimate, "", status_words(estimate))
        for name, entry in result.constants.items()
        for series, estimate in _each(entry)
    ]
    rows += [
        Row("kappa", series, estimate, "", _kappa_words(estimate))
        for series, estimate in _each(result.derived.get("kappa"))
    ]
    return rows + list(_noise_rows(result))


def _each(entry: Any) -> list[tuple[str, Estimate]]:
    if isinstance(entry, Estimate):
        return [("", entry)]
    return list(entry.items()) if isinstance(entry, Mapping) else []


def _kappa_words(estimate: Estimate) -> str:
    meaning = "mu (1 + e_n)"
    return meaning if estimate.status in ("determined", "fixed") else f"{meaning}; {status_words(estimate)}"


def _noise_rows(result: FitResult) -> Iterator[Row]:
    """One row a value: series and observables that share a noise are named together."""
    if result.noise.policy == "known":
        return
    groups: dict[tuple[str, float, str], list[str]] = {}
    for key, sigma in result.noise.sigma.items():
        series, _, observable = key.rpartition("/")
        factor = _factor(result, series, observable) if result.noise.policy == "scaled" else None
        if factor is not None:
            groups.setdefault(("times the given sigma", float(f"{factor:.6g}"), ""), []).append(observable)
        else:
            groups.setdefault((f"of {observable}", float(f"{sigma:.6g}"), "series"), []).append(series)
    meanings = [meaning for meaning, _, _ in groups]
    for (meaning, value, kind), names in groups.items():
        # names are worth the space only where the same words stand for several values
        whose = f" {'in' if kind else 'of'} {joined(list(dict.fromkeys(names)))}"
        remark = meaning + (whose if meanings.count(meaning) > 1 else "")
        places = decimals(value) if value > 0.0 and np.isfinite(value) else 0
        yield Row("noise", "", None, fixed(value, places), remark)


def _factor(result: FitResult, series: str, observable: str) -> float | None:
    """What the given sigmas were multiplied with; None if the result holds no points to tell."""
    rows = result.points
    if not len(rows):
        return None
    rows = rows[(rows["series"] == series) & (rows["observable"] == observable)]
    ratio = (rows["sigma_used"] / rows["sigma"]).to_numpy(dtype=float)
    ratio = ratio[np.isfinite(ratio)]
    return float(np.median(ratio)) if len(ratio) else None
