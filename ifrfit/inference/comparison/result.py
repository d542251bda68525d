"""What a comparison of closures found, as frozen values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from ifrfit.data import Source
from ifrfit.inference.comparison.types import Loo, PriorRow, PsiPlane, Verdict
from ifrfit.inference.io.json_text import write_json
from ifrfit.inference.io.plain import to_plain
from ifrfit.inference.result.display import Display
from ifrfit.inference.result.fit_result import FitResult

if TYPE_CHECKING:
    import pandas as pd

SCHEMA = "ifrfit/compare/1"
# as in result.json
_OF_ALL_FITS = ("ifrfit", "created", "command", "seed", "versions", "input", "inertia_factor")
_OF_EACH_FIT = ("noise", "constants", "derived", "fit", "facts", "warnings")


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


@dataclass(frozen=True)
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
    """

    entries: Mapping[str, Entry]
    priors: tuple[PriorRow, ...]
    psi_plane: PsiPlane
    verdict: Verdict
    notes: tuple[str, ...] = ()
    drawn_by: ClassVar[str] = "ifrfit.report.comparison"

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

    def table(self) -> pd.DataFrame:
        """One row a closure, the best first.

        Returns
        -------
        DataFrame
            Index closure; free, rank, chi2, aic, aicc, bic, log_evidence, log_bayes_factor, probability,
            lack_of_fit_p, elpd_loo, elpd_difference, se_difference, largest_pareto_k; nan where not defined.
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
                "lack_of_fit_p": entry.fit.facts["lack_of_fit"].figures["p"],
                "elpd_loo": loo.elpd if loo else None,
                "elpd_difference": loo.difference if loo else None,
                "se_difference": loo.se_difference if loo else None,
                "largest_pareto_k": loo.largest_k if loo else None,
            }
        table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("closure")
        return table.astype(dict.fromkeys(table.columns.difference(["free", "rank"]), float))

    def to_dict(self) -> dict[str, Any]:
        """Exactly the content of compare.json: only str, int, float, bool, None, list and dict."""
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
        """Write compare.json; it appears whole or not at all."""
        write_json(self.to_dict(), Path(path))


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
