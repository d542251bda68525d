"""The criteria of a comparison as columns: a head, and what stands there of a closure."""

from __future__ import annotations

import math
from collections.abc import Callable

from ifrfit.inference.comparison import Comparison
from ifrfit.inference.comparison.result import Entry
from ifrfit.text import fixed, p_text, plus_minus

Column = tuple[str, Callable[[Entry], str]]


def cross_validated(comparison: Comparison) -> bool:
    """Whether impacts were left out of every closure's fit."""
    return all(entry.loo is not None for entry in comparison.entries.values())


def criteria(comparison: Comparison) -> list[Column]:
    """Columns that say something of these data: chi2 does not where sigma follows from the scatter."""
    columns: list[Column] = [("constants", lambda e: f"{e.fit.fit.rank} of {e.free}")]
    if comparison.best.noise.policy not in ("unknown", "mixed"):
        columns.append(("chi2", lambda e: _short(e.fit.fit.chi2)))
    columns += [("p of fit", _p_of_fit), ("AIC", lambda e: fixed(e.fit.fit.aic, 1))]
    if any(entry.aicc is not None for entry in comparison.entries.values()):
        columns.append(("AICc", lambda e: "-" if e.aicc is None else fixed(e.aicc, 1)))
    return [
        *columns,
        ("BIC", lambda e: fixed(e.fit.fit.bic, 1)),
        ("log evidence", lambda e: fixed(e.log_evidence, 2)),
        ("log BF", lambda e: fixed(e.log_bayes_factor, 2)),
        ("probability", lambda e: _probability(e.probability)),
    ]


def _p_of_fit(entry: Entry) -> str:
    p = entry.fit.facts["lack_of_fit"].figures["p"]
    return "-" if p is None else p_text(p).split(",")[0]


def _probability(p: float) -> str:
    if p < 0.001:
        return "< 0.001"
    return "> 0.999" if p > 0.999 else f"{p:.3f}"


def _short(x: float) -> str:
    return f"{x:.0f}" if abs(x) >= 1e4 else f"{x:.4g}" if abs(x) >= 1.0 else f"{x:.2g}"


def _difference(entry: Entry) -> str:
    loo = entry.loo
    assert loo is not None
    if loo.difference == 0.0:
        return "the best"
    if not loo.se_difference > 0.0:
        return fixed(loo.difference, 1)
    return plus_minus(loo.difference, loo.se_difference)


def _refits(entry: Entry) -> str:
    loo = entry.loo
    assert loo is not None
    parts = [f"{len(loo.refitted)} refitted"] if loo.refitted else []
    parts += [f"{len(loo.doubtful)} doubtful"] if loo.doubtful else []
    return ", ".join(parts) or "none"


CROSS_VALIDATION: list[Column] = [
    ("leave-one-impact-out", lambda e: fixed(e.loo.elpd, 2) if e.loo else ""),
    ("difference", _difference),
    ("p_loo", lambda e: fixed(e.loo.p_loo, 1) if e.loo else ""),
    ("largest Pareto k", lambda e: _k_text(e.loo.largest_k) if e.loo else ""),
    ("k too large", _refits),
]


def _k_text(k: float) -> str:
    return "< 0" if k == -math.inf else "-" if math.isnan(k) else f"{k:.2f}"
