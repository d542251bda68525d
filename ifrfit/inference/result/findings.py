"""What a fit found, as frozen values: constants with statuses, facts, and the points it rests on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, cast

import pandas as pd

from ifrfit.data import Source
from ifrfit.errors import UsageError
from ifrfit.inference.accuracy.request import Effort
from ifrfit.inference.diagnostics.omitted_effects.types import EffectLine, SceneOfData
from ifrfit.inference.distributions.protocol import Distribution
from ifrfit.inference.io.plain import INTERNAL, OPTIONAL
from ifrfit.inference.model.parameters import Parameter
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.profile.types import ProfileLikelihood
from ifrfit.inference.result.constants_table import ConstantsTable
from ifrfit.inference.result.deferred import Deferred, Postponed, PostponedField, known
from ifrfit.inference.result.estimation import Saves
from ifrfit.inference.result.state import distribution_of
from ifrfit.inference.result.types import (
    Angles,
    Constants,
    Correlation,
    Derived,
    Estimate,
    Fact,
    FitStatistics,
    NoiseSummary,
    State,
    by_entry,
)

if TYPE_CHECKING:
    _Constants = ConstantsTable
else:
    _Constants = Constants  # as files hold them; `__post_init__` makes the table


@dataclass(frozen=True, kw_only=True, repr=False)
class Findings:
    """Everything that a fit found. Frozen; in the order of result.json, see `ifrfit.inference.io.plain`.

    `constants`, `derived`, `assumed`, `warnings`, `state` and `points` may be given as `Postponed`, and are
    worked out when they are first read.

    Attributes
    ----------
    closure, method : str
    inertia_factor : float
    inputs : tuple of Source
        Files or datasets with hash, rows used and skipped, provenance and selection.
    noise : NoiseSummary
    constants : mapping
        Name to `Estimate`, or to a mapping of series to `Estimate` where the constant is separate.
    derived : mapping
        kappa, transition_angle_deg (by series; None where there is no transition), beta_sticking;
        poisson_ratio in the place of the latter under closure maw.
    correlation : Correlation
        Names of the free constants and their correlation matrix.
    fit : FitStatistics
    facts : mapping of str to Fact
        Worked out when they are first read.
    warnings : tuple of str
    state : State
    points : DataFrame
        Rows used: the common schema plus sigma_used, fitted, residual, standardised, tau and sticking. A
        random sample of them where data were not held in memory (`is_sampled`).
    command, seed, created, versions
        How to repeat it.
    asked : tuple of Parameter
        The constants as they were asked for: domain, fixed value, prior, separate or shared. Empty where the
        file that the result was read from does not say.
    assumed : tuple of str
        What decides the answer although neither user nor data said so, in words: the inertia factor, no spin,
        the size of the errors.
    effort : Effort or None
        What --accuracy or --budget asked and reached; None where neither was given.
    scene : SceneOfData or None
        What is known of what hit what; None where nothing is.
    effects : tuple of EffectLine
        Each effect's criterion on that scene; empty without one. What the residuals call for is the fact
        ``effects``.
    distribution : Distribution
        Of the parameters, kappa, the transition and free noises:
        ``fit.distribution.quantile("kappa", [0.025, 0.975])``. Of a result that was read from a file it is
        what the file keeps: draws, or the Gaussian about the optimum.
    problem, least_squares
        The question and its optimum, for further questions; None where the result was read from a file.
    profiles : mapping of str to ProfileLikelihood
        By name of the quantity, of --method profile; not kept in result.json.
    files : mapping of str to Saves
        File name to what the method writes beside result.json.
    """

    created: str
    command: str
    seed: int
    versions: Mapping[str, str]
    inputs: tuple[Source, ...] = field(metadata={"key": "input"})
    closure: str
    inertia_factor: float
    method: str
    noise: NoiseSummary
    asked: tuple[Parameter, ...] = field(default=(), metadata=INTERNAL)
    assumed: tuple[str, ...] = field(default=(), metadata=OPTIONAL)
    effort: Effort | None = field(default=None, metadata=OPTIONAL)
    constants: _Constants
    derived: Derived
    correlation: Correlation
    fit: FitStatistics
    facts: Mapping[str, Fact]
    scene: SceneOfData | None = field(default=None, metadata=OPTIONAL)
    effects: tuple[EffectLine, ...] = field(default=(), metadata=OPTIONAL)
    warnings: tuple[str, ...]
    state: State
    points: pd.DataFrame = field(metadata=INTERNAL)
    problem: Problem | None = field(default=None, repr=False, compare=False, metadata=INTERNAL)
    least_squares: LeastSquaresFit | None = field(default=None, repr=False, compare=False, metadata=INTERNAL)
    # None stands for what `state` keeps of it, see __post_init__
    distribution: Distribution = field(default=None, repr=False, compare=False, metadata=INTERNAL)  # type: ignore[assignment]
    profiles: Mapping[str, ProfileLikelihood] = field(
        default_factory=dict, repr=False, compare=False, metadata=INTERNAL
    )
    files: Mapping[str, Saves] = field(default_factory=dict, repr=False, compare=False, metadata=INTERNAL)

    def __post_init__(self) -> None:
        if not isinstance(self.__dict__["constants"], Postponed):
            object.__setattr__(self, "constants", ConstantsTable(self.constants))
        if not isinstance(self.facts, Deferred):
            object.__setattr__(self, "facts", known(self.facts))
        if cast("Distribution | None", self.distribution) is None:
            object.__setattr__(self, "distribution", distribution_of(self.state))

    def problem_and_optimum(self) -> tuple[Problem, LeastSquaresFit]:
        """The question of the fit and its optimum.

        Raises
        ------
        UsageError
            For a result that was read from a file, or of rows that were not held in memory: it has neither.
        """
        if self.problem is None or self.least_squares is None:
            raise UsageError(
                "This takes all rows, and the result holds none of its problem: it was read from a file, or "
                "the rows were not held in memory. Fit the data again, or a part of them in one file."
            )
        return self.problem, self.least_squares

    @property
    def is_sampled(self) -> bool:
        """Whether the points are a random sample of the rows that were used: these are not kept."""
        return 0 < len(self.points) < self.fit.n

    @property
    def is_posterior(self) -> bool:
        """Whether draws and bands are those of a posterior: the posterior predictive checks were made."""
        return "predictive" in self.facts

    @property
    def provenance(self) -> tuple[str, ...]:
        """Distinct provenances of the data used."""
        return tuple(dict.fromkeys(source.provenance for source in self.inputs))

    @property
    def transitions(self) -> Mapping[str, Angles]:
        """Transition angles in degrees by series: one, two, or None."""
        found = self.derived.get("transition_angle_deg", {})
        return {} if isinstance(found, Estimate) else found

    def flat_constants(self) -> dict[str, Estimate]:
        """Constants by name, with the series in brackets where separate."""
        return by_entry(self.constants)


for _name in (
    "constants",
    "derived",
    "assumed",
    "warnings",
    "state",
    "points",
):  # after the decorator, which would take them for defaults
    setattr(Findings, _name, PostponedField(_name))
