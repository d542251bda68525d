"""What `reproduce` fits: one table of every choice, the fits, and the lines they give."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from scipy.special import bdtr

from ifrfit.data.catalogue import load_dataset, printed_constants
from ifrfit.data.finding import entry
from ifrfit.errors import IfrfitError
from ifrfit.inference.api import fit
from ifrfit.inference.result import FitResult
from ifrfit.inference.rules import GAP
from ifrfit.report.provenance import STAND_IN, provenance_words

LEVEL = 0.95


@dataclass(frozen=True)
class Case:
    """One fit of the table, with every choice it makes beyond the defaults, and why.

    Attributes
    ----------
    name : str
        Stem of its figures.
    dataset : str
    reason : str
        Why these constants are fixed, have a prior or are free.
    series, observable : tuple of str
        Rows used; the dataset's own choice where empty.
    fixed : tuple of str
        Constants held at the value the source prints.
    prior : mapping
        Constant to (mean, sd).
    gamma_min : float, optional
        Degrees.
    """

    name: str
    dataset: str
    reason: str
    series: tuple[str, ...] = ()
    observable: tuple[str, ...] = ()
    fixed: tuple[str, ...] = ()
    prior: Mapping[str, tuple[float, float]] | None = None
    gamma_min: float | None = None


_BETA = "e_n is fixed at the printed value: beta cannot tell e_n from mu"
_NOMINAL = f"{_BETA}; rows state the nominal spin, whose spread is in the scatter"
_FREE = "nothing is fixed: {} depends on all three constants"
_KHARAZ = (
    "prior of e_n as Chung & Ooi (2011) simulate this experiment, e_n = 0.98, since e_n is not in the data"
)

CASES = (
    Case("kharaz-2001", "kharaz-2001", _KHARAZ, prior={"e_n": (0.98, 0.01)}),
    Case(
        "kharaz-2001-from-15-deg",
        "kharaz-2001",
        f"{_KHARAZ}; without the near-normal impacts, where microslip is expected",
        prior={"e_n": (0.98, 0.01)},
        gamma_min=15.0,
    ),
    Case("netl-glass-acrylic", "netl-glass-acrylic", "repeats of e_n and mu, each measured by itself"),
    # mu is printed as 0.12 without and as 0.14 with spin: one fit of all three would have no single true mu
    Case("cross-2019-no-spin", "cross-2019", _BETA, ("no spin",), ("beta",), ("e_n",)),
    Case("cross-2019-spin-0-225", "cross-2019", _NOMINAL, ("spin 0.225",), ("beta",), ("e_n",)),
    Case("cross-2019-spin-0-833", "cross-2019", _NOMINAL, ("spin 0.833",), ("beta",), ("e_n",)),
    Case("buck-2017", "buck-2017", _BETA, ("no spin",), ("beta",), ("e_n",)),
    Case("hashemnia-2019", "hashemnia-2019", _BETA, ("no spin",), ("beta",), ("e_n",)),
    Case("reagle-2013", "reagle-2013", _FREE.format("beta_tot"), ("27 m/s",), ("beta_tot",)),
    Case("wang-2020", "wang-2020", _FREE.format("delta"), ("no spin",), ("delta_deg",)),
)


@dataclass(frozen=True)
class Line:
    """One constant of one fit: a line of constants.csv. Empty cells are None."""

    dataset: str
    series: str
    constant: str
    printed: float | None
    value: float | None
    stderr: float | None
    lo95: float | None
    hi95: float | None
    status: str
    identifiable: bool
    lack_of_fit_ok: bool
    lack_of_fit_p: float | None
    certified: bool
    provenance: str
    figure: str
    note: str

    @property
    def recovers(self) -> bool | None:
        """Whether the 95 % interval holds the printed value; None unless the data give an interval."""
        low, high = self.lo95, self.hi95
        if self.printed is None or self.status not in ("determined", "one_sided"):
            return None
        return (low is None or low <= self.printed) and (high is None or self.printed <= high)


@dataclass(frozen=True)
class Done:
    """A case with its fit and its lines; no fit where the user's own data do not have what it asks for."""

    case: Case
    result: FitResult | None
    lines: tuple[Line, ...]
    refusal: str = ""

    @property
    def stand_in(self) -> bool:
        """Whether any of the rows used were generated."""
        return any(STAND_IN in line.provenance for line in self.lines)


def fit_case(case: Case) -> Done:
    """Fit one case.

    Data that the user installed in the place of a dataset are taken; if they lack what the case asks for,
    that is told in `refusal`.
    """
    printed = printed_constants(case.dataset)
    own = printed.get(case.series[0], {}) if case.series else {}
    try:
        result = fit(
            load_dataset(case.dataset),
            method="lsq",
            series=case.series,
            observable=case.observable,
            fix={name: own[name] for name in case.fixed},
            prior=case.prior,
            gamma_min=case.gamma_min,
        )
    except IfrfitError as error:
        if entry(case.dataset).installed is None:
            raise
        return Done(case, None, (), str(error))
    return Done(case, result, tuple(_lines(case, result, own)))


def _lines(case: Case, result: FitResult, printed: Mapping[str, float]) -> list[Line]:
    provenance = provenance_words(tuple(str(kind) for kind in result.points["provenance"].unique()))
    note = case.reason
    if STAND_IN in provenance:
        note = f"STAND-IN, recovers what was put in and says nothing about the experiment; {note}"
    gap = result.facts["global_optimum"].figures["gap"]
    objective = result.fit.chi2 + result.fit.prior_chi2
    lack = result.facts["lack_of_fit"]
    return [
        Line(
            dataset=case.dataset,
            series=", ".join(str(name) for name in result.points["series"].unique()),
            constant=name,
            printed=printed.get(name),
            value=found.value,
            stderr=found.stderr,
            lo95=_finite(found.interval95[0]),
            hi95=_finite(found.interval95[1]),
            status=found.status,
            identifiable=result.facts["identifiable"].ok,
            lack_of_fit_ok=lack.ok,
            lack_of_fit_p=lack.figures["p"],
            certified=gap is not None and gap <= GAP * max(1.0, objective),
            provenance=provenance,
            figure=case.name,
            note=note,
        )
        for name, found in result.flat_constants().items()
    ]


def _finite(end: float) -> float | None:
    return end if math.isfinite(end) else None


def held(lines: Sequence[Line]) -> tuple[int, int]:
    """Count intervals of stand-ins that hold the value put in.

    Returns
    -------
    hits, k : int
        k intervals come from the data: those of constants that are determined or one-sided.
    """
    told = [line.recovers for line in lines if STAND_IN in line.provenance and line.recovers is not None]
    return sum(told), len(told)


def chance(hits: int, k: int) -> float:
    """Probability of `hits` or fewer out of k intervals of 95 % (binomial law, independent intervals)."""
    return float(bdtr(hits, k, LEVEL)) if k else 1.0
