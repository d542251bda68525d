"""What a comparison of closures found, as frozen values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np

from ifrfit.data import Source
from ifrfit.inference.diagnostics.thresholds import REFUTED
from ifrfit.inference.io.json_text import save_json
from ifrfit.inference.io.plain import to_plain
from ifrfit.inference.model.rows import Array
from ifrfit.inference.result.display import Display
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.types import Interval

if TYPE_CHECKING:
    import pandas as pd

Kind = Literal["stand_in", "refuted", "undecided", "preferred"]

# Log evidence below the best closure's: no impact is left out in earnest there, no prior integrated anew
HOPELESS = 50.0
SCHEMA = "ifrfit/compare/1"
# as in result.json
_OF_ALL_FITS = ("ifrfit", "created", "command", "seed", "versions", "input", "inertia_factor")
_OF_EACH_FIT = ("noise", "constants", "derived", "fit", "facts", "warnings")


@dataclass(frozen=True)
class Loo:
    """Leave-one-impact-out cross-validation of one closure.

    Attributes
    ----------
    elpd, se : float
        Sum over impacts of the log density that the others predict for it, and its standard error.
    p_loo : float
        Effective number of constants.
    difference, se_difference : float
        elpd less that of the closure with the largest, at most 0, and the standard error of that, impact by
        impact.
    n_draws : int
    threshold : float
        Of k.
    refitted, doubtful : tuple of str
        Impacts whose k is over the threshold, or whose weights could not be smoothed: left out in an exact
        refit instead; or neither.
    impacts : tuple of str
        Line of the file, or impact_id.
    pointwise, pareto_k : ndarray, (n_impacts,)
        Of each impact, in the order of `impacts`. The k are those before any refit; -inf where the weights
        are bounded, nan where their tail has too few values.
    """

    elpd: float
    se: float
    p_loo: float
    difference: float
    se_difference: float
    n_draws: int
    threshold: float
    refitted: tuple[str, ...]
    doubtful: tuple[str, ...]
    impacts: tuple[str, ...]
    pointwise: Array
    pareto_k: Array

    @property
    def largest_k(self) -> float:
        """Largest Pareto k; nan if any is."""
        return float(self.pareto_k.max())


@dataclass(frozen=True)
class PriorRow:
    """Log evidences under one choice of the priors' widths.

    Attributes
    ----------
    varied : str
        What differs from the stated priors, in words; empty for these themselves.
    log_evidence : mapping
        Closure to its log evidence; None where that prior has no meaning for it, or it no hope.
    mu_upper : float or None
        Upper end of the prior of mu where this is what differs.
    """

    varied: str
    log_evidence: Mapping[str, float | None]
    mu_upper: float | None = None

    def log_bayes_factor(self, one: str, other: str) -> float | None:
        """Log Bayes factor of `one` over `other`; None where either has no evidence here."""
        first, second = self.log_evidence[one], self.log_evidence[other]
        return None if first is None or second is None else first - second


@dataclass(frozen=True)
class Slope:
    """A slope in the psi plane, or a difference of two.

    Attributes
    ----------
    value : float
    stderr : float or None
        With the regimes held; None where the data do not tell the slope there.
    interval95 : tuple of float
        Of the profile; an end is infinite where it does not close.
    expected : mapping
        Closure to what it allows, (lowest, highest); None for a closure that has no straight line there.
    p : mapping
        Closure to the p value of the best that it allows.
    """

    value: float
    stderr: float | None
    interval95: Interval
    expected: Mapping[str, Interval | None]
    p: Mapping[str, float] = field(default_factory=dict)

    @property
    def determined(self) -> bool:
        """Whether the profile closes on both sides."""
        return bool(np.isfinite(self.interval95).all())

    @property
    def contradicts(self) -> tuple[str, ...]:
        """Closures of which no constant gives a slope that the rows leave likely."""
        return tuple(name for name, p in self.p.items() if p < REFUTED)


@dataclass(frozen=True)
class PsiPlane:
    """Slopes of V_t/U_n against U_t/U_n, free in both regimes.

    Attributes
    ----------
    reason : str
        Why there are none; empty where there are.
    n, n_sticking, n_sliding : int
        Rows that can be restated in the plane, and how they divide at the optimum.
    sliding : Slope or None
        Slope of sliding: 1 in FR, -e_t in IFR.
    difference : Slope or None
        Slope of sliding minus slope of sticking: 7/5 in IFR, 1 in IFR-contact, 1 + beta0 in FR.
    left_out : mapping
        Observable to the reason why its rows are not in the plane.
    """

    reason: str = ""
    n: int = 0
    n_sticking: int = 0
    n_sliding: int = 0
    sliding: Slope | None = field(default=None, metadata={"key": "sliding_slope"})
    difference: Slope | None = field(default=None, metadata={"key": "sliding_minus_sticking"})
    left_out: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Verdict:
    """Which closure the data prefer, in one sentence.

    Attributes
    ----------
    kind : {"stand_in", "refuted", "undecided", "preferred"}
    says : str
    tied : tuple of str
        Closures that the data do not tell apart from the best, which is the first; one alone if it is
        preferred; empty on stand-ins.
    next : str or None
        The best of the others.
    log_bayes_factor : float or None
        Of the best over `next`.
    strength : str
        positive, strong or very strong; empty where nothing is preferred.
    over_priors : tuple of float or None
        Smallest and largest value of that factor over the table of priors.
    """

    kind: Kind
    says: str
    tied: tuple[str, ...] = ()
    next: str | None = None
    log_bayes_factor: float | None = None
    strength: str = ""
    over_priors: Interval | None = None


@dataclass(frozen=True)
class Entry:
    """One closure of a comparison.

    Attributes
    ----------
    fit : FitResult
        The whole fit by exact posterior.
    free : int
        Free constants; ``fit.fit.rank`` of them, or of their combinations, are determined.
    aicc : float or None
        None where its form is not defined: it is with one unknown noise scale, and more rows than constants.
    log_bayes_factor : float
        Log evidence less that of the best closure, at most 0.
    probability : float
        Posterior probability, all closures of the comparison equally probable before.
    prior : mapping
        Free constant to the ends of its uniform prior, or to (mean, sd) of the user's.
    loo : Loo or None
    """

    fit: FitResult
    free: int
    aicc: float | None
    log_bayes_factor: float
    probability: float
    prior: Mapping[str, Mapping[str, float]]
    loo: Loo | None = None

    @property
    def log_evidence(self) -> float:
        """Log of the integral of likelihood times normalised prior."""
        found = self.fit.fit.log_evidence
        assert found is not None  # every fit of a comparison is by exact posterior
        return found


@dataclass(frozen=True, repr=False)
class Comparison(Display):
    """Closures side by side. Frozen; `to_dict` gives exactly compare.json.

    Attributes
    ----------
    entries : mapping of str to Entry
        By closure, in the order asked for.
    priors : tuple of PriorRow
        The stated priors first.
    psi_plane : PsiPlane
    verdict : Verdict
    notes : tuple of str
        What was applied to which closure, and what the reader should know.

    Examples
    --------
    >>> import ifrfit
    >>> both = ifrfit.compare("cornell-glass", ["ifr", "fr"], loo=False)
    >>> both.table()[["free", "rank"]]
             free  rank
    closure
    ifr         3     3
    fr          3     3
    """

    entries: Mapping[str, Entry]
    priors: tuple[PriorRow, ...]
    psi_plane: PsiPlane
    verdict: Verdict
    notes: tuple[str, ...] = ()
    drawn_by: ClassVar[str] = "ifrfit.report.comparison"

    def _headline(self) -> str:
        entries = ", ".join(f"{name} {self.entries[name].log_bayes_factor:.1f}" for name in self.ranked)
        return f"log Bayes factors {entries}; {self.best.fit.n} values"

    @property
    def ranked(self) -> tuple[str, ...]:
        """Closures by their evidence, the best first."""
        return tuple(sorted(self.entries, key=lambda name: -self.entries[name].log_evidence))

    @property
    def best(self) -> FitResult:
        """Fit of the closure with the largest evidence."""
        return self.entries[self.ranked[0]].fit

    @property
    def inputs(self) -> tuple[Source, ...]:
        """Files or datasets, as in each fit."""
        return self.best.inputs

    @property
    def converged(self) -> bool:
        """Whether the posterior of every closure did."""
        return all(entry.fit.facts["converged"].ok for entry in self.entries.values())

    def p_of_fit(self, entry: Entry) -> float | None:
        """p of the fit of a closure: of chi2 where that of the best one is.

        What the best one describes then excuses no other closure by a sigma that is too small.
        """
        by_chi2 = self.best.facts["lack_of_fit"].figures.get("test") == "chi2"
        p: float | None = entry.fit.facts["lack_of_fit"].figures["p"]
        return entry.fit.fit.p_value if by_chi2 and entry.fit.fit.p_value is not None else p

    def table(self) -> pd.DataFrame:
        """One row a closure, the best first.

        Returns
        -------
        DataFrame
            Index closure; free, rank, chi2, aic, aicc, bic, log_evidence, log_bayes_factor, probability,
            lack_of_fit_p, elpd_loo, elpd_difference, se_difference, largest_pareto_k; nan where not defined.

        Examples
        --------
        >>> import ifrfit
        >>> both = ifrfit.compare("cornell-glass", ["ifr", "fr"], loo=False)
        >>> both.table()["log_evidence"].round(1)
        closure
        ifr    60.6
        fr     60.4
        Name: log_evidence, dtype: float64
        """
        import pandas as pd

        rows = {}
        for name in self.ranked:
            entry = self.entries[name]
            fit, loo = entry.fit.fit, entry.loo
            rows[name] = {
                "free": entry.free,
                "rank": fit.rank,
                "chi2": fit.chi2,
                "aic": fit.aic,
                "aicc": entry.aicc,
                "bic": fit.bic,
                "log_evidence": entry.log_evidence,
                "log_bayes_factor": entry.log_bayes_factor,
                "probability": entry.probability,
                "lack_of_fit_p": self.p_of_fit(entry),
                "elpd_loo": loo.elpd if loo else None,
                "elpd_difference": loo.difference if loo else None,
                "se_difference": loo.se_difference if loo else None,
                "largest_pareto_k": loo.largest_k if loo else None,
            }
        table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("closure")
        return table.astype(dict.fromkeys(table.columns.difference(["free", "rank"]), float))

    def to_dict(self) -> dict[str, Any]:
        """Exactly the content of compare.json: only str, int, float, bool, None, list and dict.

        Examples
        --------
        >>> import ifrfit
        >>> both = ifrfit.compare("cornell-glass", ["ifr", "fr"], loo=False)
        >>> list(both.to_dict()["closures"])
        ['ifr', 'fr']
        """
        fits = {name: entry.fit.to_dict() for name, entry in self.entries.items()}
        best = fits[self.ranked[0]]
        return {
            "schema": SCHEMA,
            **{key: best[key] for key in _OF_ALL_FITS},
            "verdict": to_plain(self.verdict),
            "closures": {
                name: _entry(self.entries[name]) | {key: fits[name][key] for key in _OF_EACH_FIT}
                for name in self.ranked
            },
            "priors": to_plain(self.priors),
            "psi_plane": _plane(self.psi_plane),
            "notes": list(self.notes),
        }

    def save(self, path: str | Path) -> None:
        """Write compare.json, into a folder that is made where need be; it appears whole or not at all.

        Examples
        --------
        >>> import ifrfit
        >>> both = ifrfit.compare("cornell-glass", ["ifr", "fr"], loo=False)
        >>> both.save("compare.json")
        """
        save_json(self.to_dict(), path)


def _entry(entry: Entry) -> dict[str, Any]:
    names = ("free", "aicc", "log_evidence", "log_bayes_factor", "probability", "prior", "loo")
    return {name: to_plain(getattr(entry, name)) for name in names}


def _plane(plane: PsiPlane) -> dict[str, Any]:
    """The slopes, with what follows from them."""
    content: dict[str, Any] = {"available": not plane.reason} | to_plain(plane)
    for key, slope in (("sliding_slope", plane.sliding), ("sliding_minus_sticking", plane.difference)):
        if slope is not None:
            content[key]["contradicts"] = list(slope.contradicts)
    return content
