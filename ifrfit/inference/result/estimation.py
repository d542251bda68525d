"""What an estimator hands over: the distribution of the parameters, and how good it is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from ifrfit.inference.result.types import Fact

if TYPE_CHECKING:
    from ifrfit.inference.accuracy.request import Effort
    from ifrfit.inference.distributions.protocol import Distribution
    from ifrfit.inference.profile.types import ProfileLikelihood


class Saves(Protocol):
    """Something that writes itself to a file beside result.json."""

    def save(self, path: Path) -> None:
        """Write the file."""
        ...


@dataclass(frozen=True)
class Unresolved:
    """A parameter that many replicates of an experiment leave open although the data do not.

    Attributes
    ----------
    reason : str
        How many, in words.
    lower68, lower95 : float or None
        Ends of the one-sided intervals where every such replicate sets a lower limit; None where it does not.
    """

    reason: str
    lower68: float | None = None
    lower95: float | None = None


@dataclass(frozen=True)
class Estimation:
    """What a method found out about the parameters of a problem, beyond the optimum it started from.

    `ifrfit.inference.result.build.build_result` makes a `FitResult` of a problem, its optimum and this.

    Attributes
    ----------
    method : str
        Name of the estimator, as in result.json: exact, lsq, profile, mcmc, bootstrap, or a registered one.
    distribution : Distribution or None
        Joint distribution of the free parameters, kappa and free noises. None where the method has none: then
        the Gaussian approximation at the optimum stands in its place.
    diagnostics : mapping of str to Fact
        ``converged``, and what else only the method knows; they replace those of least squares.
    predicts : bool
        Whether predictions and draws are made from the distribution; else from the Gaussian approximation.
    is_posterior : bool
        Whether the distribution is a posterior: then predictive checks are made, and the prior of the noise
        is reported.
    log_evidence : float or None
        Log of the marginal likelihood.
    profiles : mapping of str to ProfileLikelihood
        By name of the quantity; estimates of these quantities are read from their profiles.
    unresolved : mapping of str to Unresolved
        By name of the quantity, what gets no value for reasons that the distribution does not show.
    local : tuple of str
        Parameters whose estimates stay those of least squares: the distribution does not show their spread.
    warnings : tuple of str
        For the user, after those of the data.
    effort : Effort or None
        What --accuracy or --budget asked and reached.
    versions : mapping of str to str
        Of packages that the method used, beside those of every fit.
    files : mapping of str to Saves
        File name to what belongs beside result.json.
    """

    method: str
    distribution: Distribution | None
    diagnostics: Mapping[str, Fact]
    predicts: bool = True
    is_posterior: bool = False
    log_evidence: float | None = None
    profiles: Mapping[str, ProfileLikelihood] = field(default_factory=dict)
    unresolved: Mapping[str, Unresolved] = field(default_factory=dict)
    local: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    effort: Effort | None = None
    versions: Mapping[str, str] = field(default_factory=dict)
    files: Mapping[str, Saves] = field(default_factory=dict)
