"""The fits of `reproduce` and their constants; every choice of a fit is in ``cases.toml``."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from importlib.resources import files
from typing import Any

from scipy.special import bdtr

from ifrfit.data import Observations
from ifrfit.data.catalogue import entry, load_dataset, printed_constants
from ifrfit.errors import IfrfitError
from ifrfit.inference.fit import fit
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.report.provenance import STAND_IN, provenance_words
from ifrfit.text import decimals, fixed

LEVEL = 0.95
DIGITS = 4  # of a standard deviation, to whose 1e-4 a posterior is known; of a p value
_STAND_IN_NOTE = "STAND-IN: shows whether the fit recovers what was put in, and nothing about the experiment"


@dataclass(frozen=True)
class Case:
    """One fit of the table, with every choice it makes beyond the defaults, and why.

    Attributes
    ----------
    name : str
        As in the column `case` of constants.csv.
    dataset : str
    reason : str
        Why these constants are fixed, have a prior or are free.
    figures : tuple of str
        Names of the figures that show it, see `ifrfit.paper.figures`.
    series, observable : tuple of str
        Rows used; the dataset's own choice where empty.
    fixed : tuple of str
        Constants held at the value the source prints.
    prior : mapping
        Constant to (mean, sd).
    gamma_min : float, optional
        Degrees.
    closure : str
    repeats_data : bool
        Its impacts are those of another case, seen through another observable: it is not counted twice.
    readings : tuple of str
        Observables that the values may be meant as, where the source leaves it open. The one that the data
        name is taken.
    """

    name: str
    dataset: str
    reason: str
    figures: tuple[str, ...] = ()
    series: tuple[str, ...] = ()
    observable: tuple[str, ...] = ()
    fixed: tuple[str, ...] = ()
    prior: Mapping[str, tuple[float, float]] | None = None
    gamma_min: float | None = None
    closure: str = "ifr"
    repeats_data: bool = False
    readings: tuple[str, ...] = ()


def _case(**own: Any) -> Case:
    """A case from its table in ``cases.toml``."""
    own = {name: tuple(value) if isinstance(value, list) else value for name, value in own.items()}
    return Case(**own)


_TEXT = files("ifrfit.paper").joinpath("cases.toml").read_text("utf-8")
CASES = tuple(_case(**table) for table in tomllib.loads(_TEXT)["case"])


def case_named(name: str) -> Case:
    """A case of the table."""
    return next(case for case in CASES if case.name == name)


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
    case: str
    figure: str
    note: str

    @property
    def recovers(self) -> bool | None:
        """Whether the 95 % interval holds the printed value; None unless the data give an interval."""
        low, high = self.lo95, self.hi95
        if self.printed is None or self.status not in ("determined", "one_sided"):
            return None
        return (low is None or low <= self.printed) and (high is None or self.printed <= high)

    def cells(self) -> list[str]:
        """Text of each column: numbers to the digits that are known, which are the same on every machine."""
        places = decimals(self.stderr, DIGITS) if self.stderr else None
        texts = {
            "lack_of_fit_p": "" if self.lack_of_fit_p is None else f"{self.lack_of_fit_p:.{DIGITS}g}",
            **{name: _number(getattr(self, name), places) for name in ("value", "stderr", "lo95", "hi95")},
        }
        return [texts.get(name, _plain(getattr(self, name))) for name in COLUMNS]


COLUMNS = tuple(field.name for field in fields(Line))


def _number(value: float | None, places: int | None) -> str:
    if value is None:
        return ""
    return f"{value:.6g}" if places is None else fixed(value, places)


def _plain(value: object) -> str:
    if value is None:
        return ""
    return str(value).lower() if isinstance(value, bool) else str(value)


@dataclass(frozen=True)
class FittedCase:
    """A case with its fit; no fit, but the reason, where the user's own data do not have what it asks for."""

    case: Case
    result: FitResult | None
    refusal: str = ""

    @property
    def name(self) -> str:
        """Of the case."""
        return self.case.name

    @property
    def stand_in(self) -> bool:
        """Whether any of the rows used were generated."""
        return any(STAND_IN in line.provenance for line in self.lines)

    @cached_property
    def lines(self) -> tuple[Line, ...]:
        """Lines of constants.csv, one a constant."""
        result, case = self.result, self.case
        if result is None:
            return ()
        printed = case_constants(case)
        provenance = provenance_words(tuple(str(kind) for kind in result.points["provenance"].unique()))
        _, least_squares = result.problem_and_optimum()
        lack = result.facts["lack_of_fit"]
        return tuple(
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
                certified=least_squares.optimum.certified,
                provenance=provenance,
                case=case.name,
                figure=" ".join(case.figures),
                note=f"{_STAND_IN_NOTE}; {case.reason}" if STAND_IN in provenance else case.reason,
            )
            for name, found in result.flat_constants().items()
        )


def case_constants(case: Case) -> Mapping[str, float]:
    """Constants that the paper prints for the first series of a case."""
    return printed_constants(case.dataset).get(case.series[0], {}) if case.series else {}


def fit_case(case: Case, *, reading: str | None = None) -> FittedCase:
    """Fit one case by the exact posterior.

    Data that the user installed in the place of a dataset are taken; if they lack what the case asks for,
    that is told in `refusal`.

    Parameters
    ----------
    case : Case
    reading : str, optional
        Observable to take the values for, one of the case's readings; what the data name if not given.
    """
    try:
        data, observable = _read(case, load_dataset(case.dataset), reading)
        result = fit(
            data,
            series=case.series,
            observable=observable,
            fix={name: case_constants(case)[name] for name in case.fixed},
            prior=case.prior,
            gamma_min=case.gamma_min,
            closure=case.closure,
        )
    except IfrfitError as error:
        if entry(case.dataset).installed is None:
            raise
        return FittedCase(case, None, error.in_shell)
    return FittedCase(case, result)


def _read(case: Case, data: Observations, reading: str | None) -> tuple[Observations, tuple[str, ...]]:
    """The data with their values taken for one of the readings, and the observables to use."""
    table = data.table
    there = [name for name in case.readings if (table["observable"] == name).any()]
    if not there:
        return data, case.observable
    if reading in (None, there[0]):
        return data, (there[0],)
    named = table[table["observable"] == there[0]].reset_index(drop=True)
    return replace(data, table=named.assign(observable=reading)), (str(reading),)


def _finite(end: float) -> float | None:
    return end if math.isfinite(end) else None


def count_recovered(done: Iterable[FittedCase]) -> tuple[int, int]:
    """Count intervals of stand-ins that hold the value put in.

    Returns
    -------
    hits, k : int
        k intervals come from the data: those of constants that are determined or one-sided. Impacts that are
        fitted again through another observable do not count again.
    """
    lines = [line for d in done if d.stand_in and not d.case.repeats_data for line in d.lines]
    recovered = [line.recovers for line in lines if line.recovers is not None]
    return sum(recovered), len(recovered)


def chance(hits: int, k: int) -> float:
    """Probability of `hits` or fewer out of k intervals of 95 % (binomial law, independent intervals)."""
    return float(bdtr(hits, k, LEVEL)) if k else 1.0
