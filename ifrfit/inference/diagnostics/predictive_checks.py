"""Posterior predictive checks: whether the posterior would bring forth such data again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import special

from ifrfit.inference.diagnostics.lack_of_fit import SMOOTH, misfit, most_orderly, oblique_groups
from ifrfit.inference.diagnostics.residuals import row_name
from ifrfit.inference.diagnostics.thresholds import FACTS, REFUTED
from ifrfit.inference.model.log_posterior import Density
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array, Index
from ifrfit.inference.result.types import Fact
from ifrfit.text import p_text

_SEED = 1  # of draws of errors that rows have in common
_MOST = 2_000_000  # row evaluations spent on the checks
_FEWEST = 8  # draws, however many rows there are
_AT_ONCE = 12_000  # evaluations whose arrays stay in the cache
_NOTHING = 1.0  # chi2 of the mean residuals below which their order moves no constant by its sd
_SHARE = 0.95
_TAIL = 1e-15  # probability beyond which a standardised residual is no longer resolved
_BAND = float(special.ndtri(0.5 + 0.5 * _SHARE))


def predictive(problem: Problem, draws: Mapping[str, Array]) -> Fact:
    """Posterior predictive checks of chi2, of runs, of the largest residual and of the share inside the band.

    Whatever the constants, the standardised residuals of a replicated experiment are independent standard
    normal numbers. So the tail probability of each quantity is exact at each draw, and no replicate has to be
    simulated: of chi2 by its own law; of the changes of sign between neighbours in tau, and of the rows
    inside +-1.96 sigma, by the binomial law (two-sided: twice the smaller tail); of the largest of n by
    1 - (2 Phi(x) - 1)^n. Each p is the mean of the tail probability over the draws.

    Parameters
    ----------
    problem : Problem
    draws : mapping of str to ndarray, (m,)
        Independent posterior draws of every free entry of theta by its name; also of
        "noise[series/observable]" where the noise is unknown, of "noise" where it is scaled, and of
        "angle_offset" where an offset of the set angles is unknown. Some 200 are
        enough; of many rows only the first draws are used, at least 8.

    Returns
    -------
    Fact
        Figures: p_chi2, p_runs (None without neighbours in tau, and without scatter), p_largest, p_share,
        share_inside, largest (its row, and its mean standardised residual), n_checks, n_draws, failed; also
        where, if the residuals are too large or too orderly.

    Raises
    ------
    KeyError
        If a free constant or a noise has no draws.

    Notes
    -----
    The data are used twice, for the posterior and for its check, so these p-values are conservative: they
    crowd around one half where the model holds, the more so the more constants there are to the rows. A small
    one is therefore a strong sign. With unknown noise chi2 can hardly fail: sigma was taken from it.

    References
    ----------
    Gelman, Meng & Stern (1996), Statistica Sinica 6, 733; Meng (1994), Annals of Statistics 22, 1142.
    """
    seen = _look(problem, draws)
    p = {
        "chi2": float(special.chdtrc(seen.mean.size, seen.chi2).mean()),
        "runs": _p_runs(seen),
        "largest": _p_largest(seen),
        "share": _p_share(seen),
    }
    known = {name: value for name, value in p.items() if value is not None}
    failed = [name for name, value in known.items() if not value >= REFUTED]
    worst = int(np.argmax(np.abs(seen.mean)))
    figures: dict[str, Any] = {f"p_{name}": value for name, value in p.items()} | {
        "share_inside": float(seen.inside.mean()) / seen.mean.size,
        "largest": {"row": row_name(problem, worst), "standardised": float(seen.mean[worst])},
        "n_checks": len(known),
        "n_draws": int(seen.chi2.size),
        "failed": failed,
    }
    if not failed:
        least = min(known, key=lambda name: known[name])
        says = (
            "the posterior predicts data like these "
            f"(smallest p of {len(known)} checks = {p_text(known[least])}, {_NAMES[least]})"
        )
        return Fact(True, says, figures, FACTS["predictive"])
    named = "; ".join(_phrase(name, known[name], figures, seen) for name in failed)
    says = f"the posterior does not predict such data, by {len(failed)} of {len(known)} checks: {named}"
    return Fact(False, says + _reason(problem, seen, figures), figures, FACTS["predictive"])


_NAMES = {
    "chi2": "chi2",
    "runs": "runs",
    "largest": "largest residual",
    "share": "share inside the 95 % band",
}


@dataclass(frozen=True)
class _Seen:
    """The test quantities at each draw, and the standardised residuals' mean over the draws."""

    chi2: Array
    largest: Array
    inside: Array
    changes: Array
    n_neighbours: int
    mean: Array


def _look(problem: Problem, draws: Mapping[str, Array]) -> _Seen:
    """Evaluate the test quantities, a few draws at a time."""
    n = problem.rows.value.size
    density = Density(problem)
    points = density.points(draws)[: max(_FEWEST, _MOST // n)]
    m = len(points)
    first, second = _neighbours(problem)
    chi2, largest, inside, changes, total = np.empty(m), np.empty(m), np.empty(m), np.empty(m), np.zeros(n)
    step = max(1, _AT_ONCE // n)
    for start in range(0, m, step):
        at = slice(start, min(start + step, m))
        z = _standardised(density, points[at])
        size, positive = np.abs(z), z > 0.0
        chi2[at] = np.einsum("ij,ij->i", z, z)
        largest[at] = size.max(axis=1)
        inside[at] = np.count_nonzero(size < _BAND, axis=1)
        changes[at] = np.count_nonzero(positive[:, first] != positive[:, second], axis=1)
        total += z.sum(axis=0)
    return _Seen(chi2, largest, inside, changes, first.size, total / m)


def _standardised(density: Density, points: Array) -> Array:
    """Residuals that are standard normal numbers if the model holds, (m, n)."""
    problem = density.problem
    if problem.common is not None:  # at common errors drawn beside the constants
        noise = np.exp(points[:, density.of_noise])
        rng = np.random.default_rng(_SEED)
        return density.with_common_errors.standardised(density.theta(points), noise, rng)
    if not problem.error_model.is_plain:
        return np.asarray(special.ndtri(np.clip(density.below(points), _TAIL, 1.0 - _TAIL)))
    residuals = problem.rows.value - density.at_offsets(points).predict(density.theta(points))
    return np.asarray(residuals / density.sigma(points))


def _neighbours(problem: Problem) -> tuple[Index, Index]:
    """Pairs of rows of one observable that follow one another in tau."""
    groups = oblique_groups(problem)
    none = np.empty(0, dtype=np.intp)
    first = np.concatenate([none, *(rows[:-1] for rows in groups)])
    return first, np.concatenate([none, *(rows[1:] for rows in groups)])


def _p_runs(seen: _Seen) -> float | None:
    """Changes of sign between neighbours: each is the toss of a coin, whatever the signs before it."""
    n = seen.n_neighbours
    if n == 0 or _without_scatter(seen):
        return None  # without scatter the signs are those of the draws, not of the data
    return _two_sided(special.bdtr(seen.changes, n, 0.5), special.bdtrc(seen.changes - 1.0, n, 0.5))


def _without_scatter(seen: _Seen) -> bool:
    return float(seen.mean @ seen.mean) < _NOTHING


def _p_share(seen: _Seen) -> float:
    n = seen.mean.size
    return _two_sided(special.bdtr(seen.inside, n, _SHARE), special.bdtrc(seen.inside - 1.0, n, _SHARE))


def _p_largest(seen: _Seen) -> float:
    with np.errstate(divide="ignore"):  # all residuals zero: the logarithm is -inf, and p is 1
        within = np.log1p(-2.0 * special.ndtr(-seen.largest))
    return float(-np.expm1(seen.mean.size * within).mean())


def _two_sided(lower: Array, upper: Array) -> float:
    """Twice the smaller tail of a discrete quantity; both tails hold the value itself."""
    return min(1.0, 2.0 * min(float(lower.mean()), float(upper.mean())))


def _phrase(name: str, p: float, figures: Mapping[str, Any], seen: _Seen) -> str:
    """What a failed check saw."""
    if name == "chi2":
        return f"chi2 is {seen.chi2.mean():.4g} for {seen.mean.size} rows (p = {p_text(p)})"
    if name == "runs":
        count = round(float(seen.changes.mean()))
        changes = f"{count} time{'' if count == 1 else 's'} in {seen.n_neighbours} steps along tau"
        return f"residuals change sign {changes} (p = {p_text(p)})"
    if name == "largest":
        largest = figures["largest"]
        return f"{largest['row']} lies {largest['standardised']:+.1f} sigma off (p = {p_text(p)})"
    return f"{100.0 * figures['share_inside']:.3g} % of the rows inside the 95 % band (p = {p_text(p)})"


def _reason(problem: Problem, seen: _Seen, figures: dict[str, Any]) -> str:
    """Where the misfit sits; or that there is too little of it. A lone far row is named already."""
    failed = figures["failed"]
    if failed == ["largest"]:
        return ""
    if failed == ["share"] and figures["share_inside"] > _SHARE:
        if not problem.noise.is_known:
            return ""
        remedy = "" if _without_scatter(seen) else ": --noise scaled takes it from the data"
        return f"; sigma is larger than the scatter{remedy}"
    # a noise that is unknown fits the sum of squares of its rows, and then only their order tells
    of_order = "runs" in failed and problem.noise.has_unknown
    within = most_orderly(problem, seen.mean) if of_order else np.arange(seen.mean.size)
    where, signs, _ = misfit(problem, seen.mean, within, SMOOTH if of_order else 1)
    figures["where"] = where
    return f"; the misfit sits {where}: {signs}"
