"""Hard cases of numerics: exact data, kinks, repeated rows, wide weights, outliers."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from hard_cases.case import METHODS, HardCase, put
from hard_cases.exact import FR, IFR, Law, best_chi2
from hard_cases.identifiable import KNOWN, fitted, statuses, within
from hard_cases.synthetic import FAN, HEADER, TRUTH, noise, rows, table, values

from ifrfit import fit
from ifrfit.inference import FitResult

# 5/2 mu (1 + e_n) = 1: the transition lies at 45 degrees exactly
KINK = {"e_n": 0.6, "e_t": -0.9, "mu": 0.25}
_TIGHT = 1e-9


@dataclass(frozen=True)
class Judged:
    """A fit beside the optimum of the brute-force solver."""

    result: FitResult
    chi2: float
    c: float
    kappa: float


Solve = Callable[[Path, str], Judged]
best = functools.cache(best_chi2)  # the same for every method


def _judged(gamma: Any, beta: Any, sigma: Any, *, e_n: float, closure: str = "ifr", law: Law = IFR) -> Solve:
    """Fit with e_n fixed and solve the same by brute force."""
    gamma, beta, sigma = (tuple(float(x) for x in column) for column in (gamma, beta, sigma))

    def run(folder: Path, method: str) -> Judged:
        path = put(folder, HEADER + rows(gamma, np.array(beta), sigma))
        result = fit(path, fix={"e_n": e_n}, closure=closure, method=method)
        chi2, c, kappa = best(gamma, beta, sigma, law)
        return Judged(result, float(chi2), float(c), float(kappa))

    return run


def _certified(judged: Judged) -> None:
    """The certificate says what the brute force says."""
    chi2 = judged.result.fit.chi2
    assert abs(chi2 - judged.chi2) <= _TIGHT * max(judged.chi2, 1e-3), (chi2, judged.chi2)
    gap = judged.result.facts["global_optimum"].figures["gap"]
    assert gap is not None
    assert gap <= _TIGHT * max(1.0, chi2)
    assert "global optimum certified" in judged.result.facts["global_optimum"].says
    if judged.result.method in ("exact", "mcmc"):
        _sound(judged.result)


def _sound(result: FitResult) -> None:
    """The posterior is as well known as it promises, and its numbers make sense together."""
    converged = result.facts["converged"]
    # FR's transition has no end: a few of its smallest problems stop short of 1e-4, and say so; two rows of
    # very unequal weight leave a thin arm beside a broad region, in which walkers stay for thousands of steps
    told = result.method == "mcmc" and "did not converge in 10,000 steps" in converged.says
    assert converged.ok or result.closure == "fr" or told, converged.says
    assert result.method == "mcmc" or np.isfinite(result.fit.log_evidence)
    for name, found in result.flat_constants().items():
        (low68, high68), (low95, high95) = found.interval68, found.interval95
        assert low95 <= low68 <= high68 <= high95, (name, found)
        if found.value is not None and found.status != "fixed":
            assert low95 <= found.mean <= high95, (name, found)


def _all_certified(several: list[Judged]) -> None:
    for judged in several:
        _certified(judged)


def _several(runs: list[Solve]) -> Callable[[Path, str], list[Judged]]:
    """All of them; profiles, which take a hundred such solves each, of the first one only."""
    return lambda folder, method: [run(folder, method) for run in runs[: 1 if method == "profile" else None]]


def _exactly(truth: dict[str, float]) -> Callable[[FitResult], None]:
    def check(result: FitResult) -> None:
        assert result.fit.chi2 < 1e-15
        for name in ("e_t", "mu"):
            assert result.constants[name].status == "determined"
            # data without noise: the optimum is the truth, the median beside it by the bend of the law
            by_law = result.method in ("exact", "mcmc")
            off = 0.25 * result.constants[name].stderr if by_law else 1e-10
            assert abs(result.constants[name].value - truth[name]) <= off
        assert all(result.facts[x].ok for x in ("global_optimum", "identifiable", "lack_of_fit", "outliers"))

    return check


def _on_kink(sigma: float, seed: int) -> Solve:
    gamma = (*FAN, 45.0, 45.0)
    beta = values(gamma, "beta", **KINK) + noise(len(gamma), sigma, seed)
    return _judged(gamma, beta, [sigma] * len(gamma), e_n=KINK["e_n"])


def _repeated(seed: int) -> Callable[[Path, str], tuple[Judged, FitResult]]:
    gamma, sigma = FAN[::2], [0.05] * len(FAN[::2])
    beta = values(gamma, "beta") + noise(len(gamma), 0.05, seed)
    once = _judged(gamma, beta, sigma, e_n=TRUTH["e_n"])
    thrice = _judged(gamma * 3, [*beta] * 3, sigma * 3, e_n=TRUTH["e_n"])
    return lambda folder, method: (thrice(folder, method), once(folder, method).result)


def _same_constants(pair: tuple[Judged, FitResult]) -> None:
    thrice, once = pair
    _certified(thrice)
    assert abs(thrice.result.fit.chi2 - 3.0 * once.fit.chi2) <= _TIGHT * thrice.result.fit.chi2
    by_optimum = once.method == "lsq"
    for name in ("e_t", "mu"):
        one, three = once.constants[name], thrice.result.constants[name]
        ratio = one.stderr / three.stderr
        if by_optimum:
            assert abs(three.value - one.value) <= 1e-9
            assert abs(ratio - np.sqrt(3.0)) <= 1e-6
        else:
            # the bound of e_t and the bends of the law weigh less where more rows speak
            assert abs(three.value - one.value) <= one.stderr
            assert 1.3 < ratio < 2.2, (name, ratio)


def _wide(decades: float, seed: int, **other: Any) -> Solve:
    """Weights 1/sigma^2 that span so many decades, in an order that has nothing to do with the angle."""
    rng = np.random.default_rng(seed)
    gamma = np.sort(rng.uniform(3.0, 87.0, 12))
    sigma = rng.permutation(np.logspace(-0.5 * decades, 0.0, 12))
    closure = other.get("closure", "ifr")
    truth = {"beta0": 0.45, "e_t": None} if closure == "fr" else {}
    return _judged(
        gamma,
        values(gamma, "beta", closure=closure, **truth) + noise(12, sigma, seed + 100),
        sigma,
        e_n=TRUTH["e_n"],
        **other,
    )


def _random(seed: int) -> Solve:
    """A random problem of one to seven rows; the law may or may not hold, angles may repeat."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 8))
    gamma = rng.uniform(0.5, 89.5, n)
    if seed % 3 == 0:
        gamma = np.clip(np.round(gamma / 15.0) * 15.0, 15.0, 75.0)
    sigma = 10.0 ** rng.uniform(-rng.choice([0.0, 3.0, 6.0]), 0.0, n)
    closure, law = ("fr", FR) if seed % 2 else ("ifr", IFR)
    own = {"e_t": None, "beta0": rng.uniform(-1.0, 1.0)} if seed % 2 else {"e_t": rng.uniform(-1.0, -0.4)}
    beta = values(gamma, "beta", closure=closure, mu=float(10.0 ** rng.uniform(-3.0, 1.0)), **own)
    beta = rng.normal(0.0, 3.0, n) if seed % 5 == 0 else beta + rng.normal(0.0, 1.0, n) * sigma
    return _judged(gamma, beta, sigma, e_n=TRUTH["e_n"], closure=closure, law=law)


_ON_A_WALL = _judged(
    (7.785361739874544, 19.764368619915796),
    (-0.770645627714175, -0.5078478743580739),
    (0.024531274313359372, 0.45036496140631394),
    e_n=0.94,
)
_FLAT = (
    ((45.83336890044357,), (-2.4493066231601186,), (0.9343784940111839,)),
    ((57.58978165816252,), (0.7920073128007523,), (0.04683408881561234,)),
    ((32.677179360930715,), (0.8355554392723159,), (0.011912771247432627,)),
    ((50.190713122508306,), (-0.613421677360849,), (2.1880558537941664e-07,)),
    ((60.0, 60.0), (-0.12402910066027852, -0.2508904097734972), (0.07854007969574729, 0.7278469778506573)),
)
_ONE_HEAVY_ROW = _judged(
    (28.35389947290638, 44.51289919858475, 18.123876276591673),
    (0.2914836512337662, -0.06538431578069273, 0.8607459009773053),
    (0.008641457683062775, 0.008530038168870668, 4.831301679157932e-07),
    e_n=0.94,
)

OUTLIER_LINE = 14
_DENSE = tuple(float(g) for g in range(5, 86, 2))


def _with_outlier(sigma: float | None) -> str:
    """One value 50 sigma too high, in line 14 of the file."""
    value = values(_DENSE, "beta") + noise(len(_DENSE), 0.01, 1)
    value[OUTLIER_LINE - 2] += 50 * 0.01
    return HEADER + rows(_DENSE, value, sigma)


def _outlier(text: str) -> Callable[[Path, str], tuple[FitResult, FitResult]]:
    def run(folder: Path, method: str) -> tuple[FitResult, FitResult]:
        path = put(folder, text)
        bad = fit(path, fix=KNOWN, method=method)
        return bad, fit(path, fix=KNOWN, method=method, exclude=OUTLIER_LINE)

    return run


def _named_and_repaired(pair: tuple[FitResult, FitResult]) -> None:
    bad, good = pair
    fact = bad.facts["outliers"]
    assert not fact.ok
    assert fact.figures["rows"] == [f"impacts.csv line {OUTLIER_LINE} (beta)"]
    assert f"--exclude {OUTLIER_LINE}" in fact.says
    assert good.facts["outliers"].ok
    assert good.facts["lack_of_fit"].ok
    assert good.fit.n == bad.fit.n - 1
    assert good.inputs[0].rows_skipped == {"excluded": 1}
    assert statuses(good) == {"e_n": "fixed", "e_t": "determined", "mu": "determined"}
    within(good, e_t=TRUTH["e_t"], mu=TRUTH["mu"])


def _case(
    name: str, what: str, answer: str, run: Callable[..., Any], check: Callable[[Any], None], **more: Any
) -> HardCase:
    choices = {"slow": ("profile", "mcmc"), **more}
    return HardCase(name, "numerics", what, answer, run, check, METHODS, **choices)


_CERTIFICATE = (
    "The optimum is certified, with a gap of at most 1e-9, and its chi2 is that of a brute-force solver in "
    "80-digit arithmetic to 1e-9."
)
_REPAIRED = (
    "The fact outliers fails and names the row; --exclude with that row gives the right constants and no "
    "outlier."
)

CASES = (
    _case(
        "no noise at all",
        "beta from 5 to 85 degrees exactly as the law has it, with a known sigma of 0.05.",
        "e_t and mu are recovered to 1e-10 (exact: their medians to a quarter of their sd) and determined, "
        "chi2 is below 1e-15.",
        fitted(table(sigma=0.05, e_t=-0.9)),
        _exactly({**TRUTH, "e_t": -0.9}),
    ),
    _case(
        "no noise, a point on the kink",
        "Exact data with a point at the transition itself (45 degrees, where 5/2 kappa = 1).",
        "e_t and mu are recovered to 1e-10 (exact: their medians to a quarter of their sd) and determined, "
        "chi2 is below 1e-15.",
        fitted(table((*FAN, 45.0), sigma=0.05, **KINK), fix={"e_n": KINK["e_n"]}),
        _exactly(KINK),
    ),
    _case(
        "points on the kink",
        "Noisy data, three rows of which lie at the transition itself; four draws of the noise.",
        _CERTIFICATE,
        _several([_on_kink(0.05, seed) for seed in (1, 2)] + [_on_kink(0.3, seed) for seed in (1, 2)]),
        _all_certified,
    ),
    _case(
        "duplicated rows",
        "Every row of a table three times.",
        _CERTIFICATE + " The constants are those of the rows once, their sd smaller by the root of 3 "
        "(profile, exact: about).",
        _repeated(1),
        _same_constants,
    ),
    *(
        _case(
            f"weights over 1e{decades}",
            f"Weights 1/sigma^2 that span {decades} decades over twelve angles; three draws.",
            _CERTIFICATE,
            _several([_wide(decades, seed) for seed in (1, 2, 3)]),
            _all_certified,
        )
        for decades in (12, 16)
    ),
    _case(
        "weights over 1e12, closure FR",
        "The same for closure FR, whose kink lines depend on both constants.",
        _CERTIFICATE,
        _several([_wide(12, seed, closure="fr", law=FR) for seed in (1, 2, 3)]),
        _all_certified,
    ),
    _case(
        "two rows, optimum at mu = 0",
        "Two sliding rows whose best constants lie where the bound of mu and a kink line fall together.",
        _CERTIFICATE,
        _ON_A_WALL,
        _certified,
    ),
    _case(
        "one row, one angle",
        "Four tables of one row and one of two rows at one angle: sums of squares with a flat direction.",
        _CERTIFICATE,
        _several([_judged(*columns, e_n=0.94) for columns in _FLAT]),
        _all_certified,
    ),
    _case(
        "three rows, one of them heavy",
        "Three rows, one with a weight 3e8 times that of the others.",
        _CERTIFICATE,
        _ONE_HEAVY_ROW,
        _certified,
    ),
    _case(
        "random small problems",
        "Six random problems of one to seven rows: closures IFR and FR, repeated angles, weights over up to "
        "1e12, laws that do not hold.",
        _CERTIFICATE,
        _several([_random(seed) for seed in range(6)]),
        _all_certified,
    ),
    _case(
        "further random small problems",
        "Eighteen more of them.",
        _CERTIFICATE,
        _several([_random(seed) for seed in range(6, 24)]),
        _all_certified,
        slow=("profile", "exact", "mcmc"),
    ),
    _case(
        "outlier at 50 sigma",
        "One of 41 values of beta is 50 sigma too high; sigma is known.",
        _REPAIRED,
        _outlier(_with_outlier(0.01)),
        _named_and_repaired,
    ),
    _case(
        "outlier at 50 sigma, sigma unknown",
        "The same without a sigma, where the outlier feigns a large noise.",
        _REPAIRED,
        _outlier(_with_outlier(None)),
        _named_and_repaired,
    ),
)
