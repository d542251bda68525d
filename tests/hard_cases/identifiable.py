"""Hard cases of identifiability: what the data can say, and what they cannot."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from hard_cases.case import FILE, METHODS, OUT, HardCase, Told, command, put, refused
from hard_cases.synthetic import FAN, GRAZING, HEADER, STEEP, TRUTH, rows, table, values

from ifrfit import fit
from ifrfit.inference import FitResult

KNOWN = {"e_n": TRUTH["e_n"]}


def fitted(text: str, **options: Any) -> Callable[[Path, str], FitResult]:
    """Fit a table by a method; e_n is fixed at its true value unless `fix` says otherwise."""
    options = {"fix": KNOWN, **options}
    return lambda folder, method: fit(put(folder, text), method=method, **options)


def within(result: FitResult, sds: float = 5.0, **truth: float) -> None:
    """Each constant has a value within some sd of the truth."""
    for name, value in truth.items():
        found = result.constants[name]
        assert found.value is not None, (name, found)
        assert abs(found.value - value) <= sds * found.stderr, (name, found)


def statuses(result: FitResult) -> Mapping[str, str]:
    """Constant to status."""
    return {name: found.status for name, found in result.flat_constants().items()}


def _sliding(result: FitResult) -> None:
    assert statuses(result) == {"e_n": "fixed", "e_t": "determined", "mu": "determined"}
    within(result, e_t=TRUTH["e_t"], mu=TRUTH["mu"])
    assert (result.fit.n_sliding, result.fit.n_sticking) == (len(GRAZING), 0)
    assert result.facts["identifiable"].ok


def _sticking(result: FitResult) -> None:
    assert result.constants["e_t"].status == "determined"
    within(result, e_t=TRUTH["e_t"])
    mu = result.constants["mu"]
    assert mu.value is None
    assert mu.status in ("one_sided", "not_determined")
    low, high = mu.interval95
    # the last impact sticks: mu is at least tan(27 degrees)/(5/2)/(1 + e_n), less some noise
    assert 0.08 < low < TRUTH["mu"]
    assert high == math.inf
    fact = result.facts["identifiable"]
    assert not fact.ok
    assert fact.figures["rank"] == 1
    assert "no impact slides" in fact.says
    assert "measure beyond 27 degrees" in fact.says
    if result.method == "exact":
        assert result.derived["transition_angle_deg"] == {"run": None}


def _sliding_wholly_free(result: FitResult) -> None:
    assert statuses(result) == {"e_n": "not_determined", "e_t": "determined", "mu": "not_determined"}
    assert result.derived["kappa"].status == "determined"
    within(result, e_t=TRUTH["e_t"])
    kappa = result.derived["kappa"]
    assert abs(kappa.value - TRUTH["mu"] * (1.0 + TRUTH["e_n"])) <= 5.0 * kappa.stderr
    fact = result.facts["identifiable"]
    assert fact.figures["rank"] == 2
    assert "kappa = mu (1 + e_n)" in fact.says


def _open(result: FitResult) -> None:
    """Nothing is determined, nothing has a value, and the truth is among what is compatible."""
    # either a combination is loose, or another optimum explains the data as well
    assert not (result.facts["identifiable"].ok and result.facts["global_optimum"].ok)
    for name in ("e_t", "mu"):
        found = result.constants[name]
        assert found.status in ("not_determined", "one_sided"), (name, found)
        assert found.value is None
        assert found.stderr is None
        low, high = found.interval95
        assert low <= TRUTH[name] <= high, (name, found)
    assert any(result.constants[name].status == "not_determined" for name in ("e_t", "mu"))


def _silent(result: FitResult) -> None:
    assert statuses(result) == {"e_n": "fixed", "e_t": "not_determined", "mu": "not_determined"}
    e_t, mu = (np.array(result.constants[name].interval95) for name in ("e_t", "mu"))
    assert tuple(e_t) == (-1.0, -0.4)
    assert tuple(mu) == (0.0, math.inf)
    assert result.facts["identifiable"].figures["rank"] == 0


def _single(result: FitResult) -> None:
    assert statuses(result) == {
        "e_n": "fixed",
        "e_t[run]": "determined",
        "e_t[single]": "not_determined",
        "mu[run]": "determined",
        "mu[single]": "not_determined",
    }
    flat = result.flat_constants()
    for name in ("e_t", "mu"):
        low, high = flat[f"{name}[single]"].interval95
        assert low <= TRUTH[name] <= high
        assert abs(flat[f"{name}[run]"].value - TRUTH[name]) <= 5.0 * flat[f"{name}[run]"].stderr


def _refusal(text: str, *options: str) -> Callable[[Path, str], Told]:
    def run(folder: Path, method: str) -> Told:
        put(folder, text)
        return command(folder, ["fit", FILE, *options, "--method", method, "--out", OUT])

    return run


def _case(
    name: str, what: str, answer: str, run: Callable[..., Any], check: Callable[[Any], None], **more: Any
) -> HardCase:
    return HardCase(name, "identifiability", what, answer, run, check, METHODS, **more)


def _needs_sigma(name: str, what: str, text: str, *options: str) -> HardCase:
    answer = "Refused with exit status 3, nothing written: these values need a sigma."
    return _case(name, what, answer, _refusal(text, *options), refused("a sigma", "Add a column sigma"))


def _on_bound(constant: str, bound: float, sign: int) -> Callable[[FitResult], None]:
    def check(result: FitResult) -> None:
        found = result.constants[constant]
        assert found.status == "one_sided", found
        assert found.value is not None
        assert abs(found.value - bound) <= 3.0 * found.stderr
        inner, outer = (found.interval95[0], found.interval95[1])[::sign]
        assert inner == bound
        assert sign * (outer - found.value) > 0.0
        others = [x for x in ("e_n", "e_t", "mu") if x != constant]
        assert all(result.constants[x].status == "determined" for x in others), statuses(result)

    return check


def _bound_table(seed: int | None, **constants: float) -> str:
    drops = (5.0, 10.0, 15.0, 20.0, 25.0)
    text = table(sigma=0.01, seed=seed, **constants)
    level = values(drops, "e_n", **constants)
    return text + rows(drops, level, 0.005, "e_n")


_BOUNDS = tuple(
    _case(
        f"truth on a bound: {constant} = {bound:g}, {noise}",
        f"Data made with {constant} = {bound:g}, an end of its domain, {noise}.",
        f"{constant} is one_sided: its interval runs from the bound to its 95 % quantile; "
        "the other constants are determined.",
        fitted(_bound_table(seed, **{constant: bound}), fix={}),
        _on_bound(constant, bound, sign),
        slow=slow,
    )
    for constant, bound, sign in (("e_t", -1.0, 1), ("mu", 0.0, 1), ("e_n", 1.0, -1))
    for noise, seed, slow in (
        ("without noise", None, ("profile", "mcmc")),
        ("with noise", 1, ("mcmc",)),
        ("with other noise", 2, ("profile", "mcmc")),
    )
)

CASES = (
    _case(
        "only sliding impacts",
        "beta from 40 to 85 degrees, where every impact slides; e_n is given.",
        "e_t and mu are determined and right; no impact is counted as sticking.",
        fitted(table(GRAZING, sigma=0.01, seed=1)),
        _sliding,
    ),
    _case(
        "only sliding impacts, e_n free",
        "The same with nothing said about e_n.",
        "e_t and kappa = mu (1 + e_n) are determined; e_n and mu are not, and the remedy is named.",
        fitted(table(GRAZING, sigma=0.01, seed=1), fix={}),
        _sliding_wholly_free,
    ),
    _case(
        "only sticking impacts",
        "beta from 3 to 27 degrees, where every impact sticks; e_n is given.",
        "e_t is determined; mu has no value, only the lower limit that keeps the last impact sticking.",
        fitted(table(STEEP, sigma=0.01, seed=1)),
        _sticking,
    ),
    _case(
        "all points at one angle",
        "Eight readings of beta at 45 degrees with known sigma; e_n is given.",
        "e_t and mu are not determined: no value, the compatible intervals hold the truth.",
        fitted(table((45.0,) * 8, sigma=0.01, seed=1)),
        _open,
    ),
    _case(
        "one sliding point",
        "One reading of beta at 45 degrees with known sigma; e_n is given.",
        "e_t and mu are not determined: no value, the compatible intervals hold the truth.",
        fitted(table((45.0,), sigma=0.01)),
        _open,
    ),
    _case(
        "as many points as constants",
        "beta at 20 and 60 degrees with known sigma; e_n is given, so two points meet two constants.",
        "Sticking and sliding explain them and sliding alone does too: nothing is determined, "
        "the compatible intervals span both.",
        fitted(table((20.0, 60.0), sigma=0.01)),
        _open,
    ),
    _case(
        "fewer points than constants",
        "beta at 20 and 60 degrees with known sigma, and three constants free.",
        "Nothing is determined; the compatible intervals hold the truth.",
        fitted(table((20.0, 60.0), sigma=0.01), fix={}),
        _open,
    ),
    _case(
        "rows that say nothing",
        "v_x at normal incidence without spin, where nothing moves along the wall whatever the constants.",
        "Nothing is determined; the compatible intervals are the whole domain (exact: 95 % of it).",
        fitted(HEADER + rows((0.0,) * 3, np.zeros(3), 0.01, "v_x")),
        _silent,
    ),
    _case(
        "one point in its own series",
        "A full series and a series of one sliding point, e_t and mu separate by series.",
        "The full series has its constants; those of the single point are not determined.",
        fitted(
            table(sigma=0.01, seed=1) + rows((45.0,), values((45.0,), "beta"), 0.01, series="single"),
            separate=("e_t", "mu"),
        ),
        _single,
    ),
    _needs_sigma(
        "one point, sigma unknown",
        "One reading of beta without a sigma.",
        table((45.0,)),
        "--fix",
        "e_n=0.94",
    ),
    _needs_sigma(
        "as many points as constants, sigma unknown",
        "Two readings of beta without a sigma for two constants.",
        table((20.0, 60.0)),
        "--fix",
        "e_n=0.94",
    ),
    _needs_sigma(
        "no noise, sigma unknown",
        "Data that the law fits exactly, without a sigma: they have no noise to learn from.",
        table(FAN),
        "--fix",
        "e_n=0.94",
    ),
    *_BOUNDS,
)
