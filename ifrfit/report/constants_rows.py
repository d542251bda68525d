"""The rows of the table of constants, the same in every style."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.types import FACTOR, Estimate
from ifrfit.physics.closures import CLOSURES
from ifrfit.report.sentences import by_series, labelled, status_words
from ifrfit.text import decimals, fixed, joined

MOST_NOISES = 4  # of one observable that are told one by one


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
        None for a noise of which the method knows the value only.
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
        return labelled(self.name, self.series)


def table_rows(result: FitResult) -> list[Row]:
    """Constants in the order of the closure, kappa and what the closure's stands for, offset, noise."""
    rows = [
        Row(name, series, estimate, "", status_words(estimate))
        for name, entry in result.constants.items()
        for series, estimate in by_series(entry).items()
    ]
    rows += [
        Row("kappa", series, estimate, "", _kappa_words(estimate))
        for series, estimate in by_series(result.derived.get("kappa")).items()
    ]
    closure = CLOSURES.get(result.closure)
    meaning = closure.own.meaning if closure is not None and closure.own is not None else None
    if meaning is not None:
        rows += [
            Row(meaning.symbol, series, estimate, "", meaning.words)
            for series, estimate in by_series(result.derived.get(meaning.name)).items()
        ]
    offset = result.noise.angle_offset
    if offset is not None:
        rows.append(Row("angle offset", "", offset, "", f"degrees; {status_words(offset)}"))
    return rows + list(_noise_rows(result))


def constant_symbols() -> dict[str, str]:
    """The constants, every closure's own among them, in LaTeX as mathtext knows it, too."""
    constants = (closure.own for closure in CLOSURES.values())
    own = {each.name: f"${each.latex}$" for each in constants if each is not None}
    return {"e_n": "$e_n$", "mu": r"$\mu$", "kappa": r"$\kappa$"} | own


def _kappa_words(estimate: Estimate) -> str:
    meaning = "mu (1 + e_n)"
    return meaning if estimate.status in ("determined", "fixed") else f"{meaning}; {status_words(estimate)}"


def _noise_rows(result: FitResult) -> Iterator[Row]:
    """Noises with what the posterior knows of them, where there is one; else their values."""
    if result.noise.policy == "known":
        return
    if FACTOR in result.noise.estimates:
        yield Row("noise", "", result.noise.estimates[FACTOR], "", "times the given sigma")
    else:
        found = _unknown_noises(result) if result.noise.estimates else _plain_noises(result)
        if result.noise.policy != "mixed":
            yield from found
            return
        for row in found:
            yield replace(row, remark=f"{row.remark}, from the scatter")
        yield from _given_noises(result)


def _unknown_noises(result: FitResult) -> Iterator[Row]:
    """One row a noise; one row an observable where there are many series."""
    observables: dict[str, dict[str, Estimate]] = {}
    for key, estimate in result.noise.estimates.items():
        series, _, observable = key.rpartition("/")
        observables.setdefault(observable, {})[series] = estimate
    for observable, own in observables.items():
        if len(own) > MOST_NOISES:
            yield _many(observable, [e.value for e in own.values() if e.value is not None])
            continue
        for series, estimate in own.items():
            whose = f" in {series}" if len(own) > 1 else _beside_given(result, observable)
            yield Row("noise", "", estimate, "", f"of {observable}{whose}")


def _beside_given(result: FitResult, observable: str) -> str:
    """Series whose noise of an observable was estimated, where sigma was given in others."""
    cells = [key.rpartition("/") for key in result.noise.sigma]
    own = [
        (series, f"{series}/{name}" in result.noise.given) for series, _, name in cells if name == observable
    ]
    estimated = [series for series, given in own if not given]
    return f" in {joined(estimated)}" if len(estimated) < len(own) else ""


def _many(observable: str, sigmas: list[float]) -> Row:
    """Many noises of one observable: from the smallest to the largest."""
    low, high = (fixed(x, _places(x)) for x in (min(sigmas), max(sigmas)))
    return Row("noise", "", None, f"{low}..{high}", f"of {observable}, in {len(sigmas)} series")


def _places(sigma: float) -> int:
    return decimals(sigma) if sigma > 0.0 and np.isfinite(sigma) else 0


def _given_noises(result: FitResult) -> Iterator[Row]:
    """One row an observable whose sigma was given, beside others whose noise was estimated."""
    estimated = {key.rpartition("/")[2] for key in result.noise.sigma if key not in result.noise.given}
    given: dict[str, list[str]] = {}
    for key in result.noise.given:
        name, _, observable = key.rpartition("/")
        given.setdefault(observable, []).append(name)
    for observable, series in given.items():
        whose = f" in {joined(series)}" if observable in estimated else ""
        sigmas = [result.noise.sigma[f"{name}/{observable}"] for name in series]
        if len(result.points) and not result.is_sampled:
            own = (result.points["observable"] == observable) & result.points["series"].isin(series)
            sigmas = result.points["sigma"][own].to_list()
        low, high = (fixed(x, _places(x)) for x in (min(sigmas), max(sigmas)))
        plain = low if low == high else f"{low}..{high}"
        yield Row("noise", "", None, plain, f"of {observable}{whose}, as given")


def _plain_noises(result: FitResult) -> Iterator[Row]:
    """One row a value: series and observables that share a noise are named together."""
    groups: dict[tuple[str, float, str], list[str]] = {}
    for key, sigma in result.noise.sigma.items():
        if key in result.noise.given:
            continue
        series, _, observable = key.rpartition("/")
        factor = _factor(result, series, observable) if result.noise.policy == "scaled" else None
        if factor is not None:
            groups.setdefault(("times the given sigma", float(f"{factor:.6g}"), ""), []).append(observable)
        else:
            groups.setdefault((f"of {observable}", float(f"{sigma:.6g}"), "series"), []).append(series)
    meanings = [meaning for meaning, _, _ in groups]
    for many in [m for m in dict.fromkeys(meanings) if meanings.count(m) > MOST_NOISES]:
        own = [key for key in groups if key[0] == many]
        yield _many(many.removeprefix("of "), [value for _, value, _ in own])
        groups = {key: names for key, names in groups.items() if key[0] != many}
    for (meaning, value, kind), names in groups.items():
        # names are worth the space only where the same words stand for several values
        whose = f" {'in' if kind else 'of'} {joined(list(dict.fromkeys(names)))}"
        beside = _beside_given(result, meaning.removeprefix("of ")) if kind else ""
        remark = meaning + (whose if meanings.count(meaning) > 1 else beside)
        yield Row("noise", "", None, fixed(value, _places(value)), remark)


def _factor(result: FitResult, series: str, observable: str) -> float | None:
    """What the given sigmas were multiplied with; None if the result holds no points to tell."""
    rows = result.points
    if not len(rows):
        return None
    rows = rows[(rows["series"] == series) & (rows["observable"] == observable)]
    ratio = (rows["sigma_used"] / rows["sigma"]).to_numpy(dtype=float)
    ratio = ratio[np.isfinite(ratio)]
    return float(np.median(ratio)) if len(ratio) else None
