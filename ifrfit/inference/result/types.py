"""What a result is made of: constants with their statuses, facts, the noise, statistics of the fit."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray

from ifrfit.errors import UsageError
from ifrfit.inference.io.plain import INTERNAL, OPTIONAL, Null, Shape
from ifrfit.inference.model.entry_names import entry_name
from ifrfit.inference.model.error_model import PLAIN, ErrorModel
from ifrfit.text import joined

Status = Literal["determined", "one_sided", "prior", "not_determined", "fixed"]
Interval = Annotated[tuple[float, float], Null((-math.inf, math.inf))]
FloatOrNan = Annotated[float, Null((math.nan,))]
Array = NDArray[np.float64]

# the name of a noise common to all rows; every other noise has that of an observable
FACTOR = "factor"


@dataclass(frozen=True)
class Estimate:
    """One constant (or a quantity derived from the constants).

    Attributes
    ----------
    value : float or None
        Best value; None if the data do not determine it.
    mean : float or None
        Posterior mean, where the method has one.
    stderr : float or None
        Standard deviation; None where there is none (fixed, not determined).
    interval68, interval95 : tuple of float
        Credible or confidence interval; an end may be infinite.
    status : str
        determined, one_sided, prior, not_determined or fixed.
    reason : str
        Why the status is not simply "determined", in a few words.
    """

    value: float | None
    mean: float | None = field(default=None, kw_only=True, metadata=OPTIONAL)
    stderr: float | None
    interval68: Interval
    interval95: Interval
    status: Status
    reason: str = ""

    def interval(self, level: float = 0.95) -> Interval:
        """Interval of the given level, 0.68 or 0.95.

        Raises
        ------
        UsageError
            For any other level.
        """
        if level == 0.95:
            return self.interval95
        if level == 0.68:
            return self.interval68
        raise UsageError(f"Intervals are kept at 0.68 and 0.95, not at {level}.")

    def __format__(self, spec: str) -> str:
        """By the format of the package ``uncertainties``: ``f"{mu:.2uS}"`` is 0.0894(88).

        Without a standard deviation the format of a float, with what "u", "S", "L" and "P" add left out.
        """
        if self.value is None:
            return "not determined"
        if self.stderr and math.isfinite(self.stderr):
            from uncertainties import ufloat

            return format(ufloat(self.value, self.stderr), spec or ".2uP")
        return format(self.value, "".join(sign for sign in spec if sign not in "uSLP") if spec else ".10g")

    def __str__(self) -> str:
        words = format(self, "")
        return words if self.status in ("determined", words.replace(" ", "_")) else f"{words} {self.status}"


@dataclass(frozen=True)
class Fact:
    """One named finding about a fit, with its number and its threshold.

    Attributes
    ----------
    ok : bool
        Whether all is well.
    says : str
        The finding in one sentence (with the remedy where it is not well).
    figures : mapping
        The numbers behind it; ``tested`` is False where the data are too few for the question.
    threshold : str
        The rule.
    """

    ok: bool
    says: str
    figures: Mapping[str, Any]
    threshold: str

    @property
    def is_tested(self) -> bool:
        """Whether the question could be asked of these data."""
        return bool(self.figures.get("tested", True))


# a failing fact of this name is told by the status of the constant already
QUIET_FACTS = ("at_bound",)


def is_quiet(name: str, fact: Fact) -> bool:
    """Whether a failing fact is a note: a status tells it, or no user can act on it (a proof is missing)."""
    return name in QUIET_FACTS or (name == "global_optimum" and fact.figures.get("n_optima_same", 1) == 1)


@dataclass(frozen=True)
class CommonErrorSummary:
    """Errors that rows have in common, by the columns common1 and so on of the points.

    Attributes
    ----------
    numbers : tuple of int
        Of the columns.
    fitted : tuple of float
        Each at the optimum of least squares, in its standard deviations; empty where they were ignored.
    """

    numbers: tuple[int, ...]
    fitted: tuple[float, ...] = ()

    @property
    def are_counted(self) -> bool:
        """Whether they were part of the errors."""
        return bool(self.fitted)

    @property
    def words(self) -> str:
        """How many, and where they stand."""
        many = f"{len(self.numbers)} error{'s' if len(self.numbers) > 1 else ''}"
        first, last = self.numbers[0], self.numbers[-1]
        columns = f"columns common{first} to" if last > first else "column"
        return f"{many} that rows have in common ({columns} common{last})"


@dataclass(frozen=True)
class NoiseSummary:
    """What sigma meant.

    Attributes
    ----------
    policy : str
        known, scaled, unknown or mixed.
    sigma : mapping
        Sigma of each "series/observable".
    estimates : mapping
        What the data say of each unknown sigma, by the same names; of the common factor under `FACTOR`.
    prior : mapping
        Bounds of the log-uniform prior of each of these; empty where the method needs none.
    error_model : ErrorModel
        How values scatter about the model, where that is not plainly Gaussian.
    separate : bool
        Whether unknown noises are those of each series.
    angle_offset : Estimate or None
        Offset of the set angles, degrees, where it was fitted; its prior is in `error_model`.
    given : tuple of str
        Under policy mixed each "series/observable" whose sigma was taken as given; else empty.
    common_errors : CommonErrorSummary or None
        Errors that rows have in common, where there are any.
    """

    policy: str
    sigma: Mapping[str, FloatOrNan]
    estimates: Mapping[str, Estimate] = field(default_factory=dict, metadata=OPTIONAL)
    prior: Mapping[str, Interval] = field(default_factory=dict, metadata=OPTIONAL)
    error_model: ErrorModel = field(default=PLAIN, metadata={**OPTIONAL, "key": "scatter"})
    separate: bool = field(default=False, metadata=OPTIONAL)
    angle_offset: Estimate | None = field(default=None, metadata=OPTIONAL)
    given: tuple[str, ...] = field(default=(), metadata=OPTIONAL)
    common_errors: CommonErrorSummary | None = field(default=None, metadata=OPTIONAL)

    def whose(self, *, given: bool) -> str:
        """Observables whose sigma was taken as given, or those whose noise was estimated, in words.

        With the series where an observable is both.
        """
        others = {key.rpartition("/")[2] for key in self.sigma if (key in self.given) is not given}
        words = []
        for key in self.sigma:
            if (key in self.given) is given:
                series, _, observable = key.rpartition("/")
                words.append(f"{observable} in {series}" if observable in others else observable)
        return joined(list(dict.fromkeys(words)))


@dataclass(frozen=True)
class Correlation:
    """Correlation matrix of the free constants."""

    names: tuple[str, ...]
    matrix: Annotated[Array, Shape(("names", "names"))]


@dataclass(frozen=True)
class FitStatistics:
    """Counts and misfit. chi2 holds no prior terms; those are in prior_chi2. None where not defined.

    Where rows have errors in common, chi2 is that of generalised least squares.
    """

    n: int
    n_sliding: int
    n_sticking: int
    rank: int
    prior_chi2: FloatOrNan
    chi2: FloatOrNan
    dof: int
    reduced_chi2: float | None
    p_value: float | None
    rmse: FloatOrNan
    log_likelihood: FloatOrNan
    aic: FloatOrNan
    bic: FloatOrNan
    log_evidence: float | None = None


@dataclass(frozen=True)
class State:
    """The optimum in the coordinates in which it was found, for predictions.

    Attributes
    ----------
    names : tuple of str
        e_n, the closure constant, kappa; with a series in brackets where separate: ``kappa[run 1]``.
    point : ndarray
        The optimum.
    center, covariance : ndarray
        Of the local Gaussian (the centre lies beyond a bound that holds the optimum back); directions
        that the data leave loose have the variance of the default prior.
    lower, upper : ndarray
        Bounds, infinite where there is none.
    sample : ndarray or None
        Independent posterior draws, (n, names); None where the local Gaussian stands for the posterior.
    """

    names: tuple[str, ...]
    point: Annotated[Array, Shape(("names",))]
    center: Annotated[Array, Shape(("names",))]
    covariance: Annotated[Array, Shape(("names", "names"))]
    lower: Annotated[Array, Shape(("names",)), Null((-math.inf,))]
    upper: Annotated[Array, Shape(("names",)), Null((math.inf,))]
    sample: Array | None = field(default=None, metadata=INTERNAL)


Constants = Mapping[str, Estimate | Mapping[str, Estimate]]
Angles = Estimate | Sequence[Estimate] | None  # one transition, two, or none
Derived = Mapping[str, Estimate | Mapping[str, Angles]]


def by_entry(constants: Constants) -> dict[str, Estimate]:
    """Each estimate by its own name, with the series in brackets where separate."""
    flat: dict[str, Estimate] = {}
    for name, found in constants.items():
        each = {"": found} if isinstance(found, Estimate) else found
        flat |= {entry_name(name, series): estimate for series, estimate in each.items()}
    return flat
