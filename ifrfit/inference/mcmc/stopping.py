"""What chains say of themselves, and when to stop: each rule, what it found, how many more steps it takes.

arviz-stats is imported where it is asked: processes that only walk start a fifth sooner without it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from emcee.autocorr import integrated_time
from numpy.typing import NDArray
from scipy import special, stats

from ifrfit.inference.diagnostics.thresholds import ESS, LENGTH, RHAT, STABLE

Array = NDArray[np.float64]

_DISCARDED = 10.0  # autocorrelation times after which the starts are forgotten
_TAILS = (0.05, 0.95)
_WITNESSES = 16  # walkers of each ensemble that the autocorrelation time is taken from: known to some 8 %

_MET_BEFORE = 1.1  # R-hat from which on the ensembles have not met, and nothing can be foretold


@dataclass(frozen=True)
class Evidence:
    """Diagnostics of chains, each worked out when it is asked for.

    An ensemble is one chain. Its walkers see one another, so R-hat over them says nothing: a mode that all of
    them missed is missed by each. Between ensembles nothing is shared, and R-hat compares these: the draws of
    all walkers of an ensemble, ordered in time, split into an earlier and a later half.

    Attributes
    ----------
    quantities : mapping of str to ndarray, (ensembles, steps, walkers)
        All steps from the first one on.
    """

    quantities: Mapping[str, Array]

    @property
    def steps(self) -> int:
        """Steps of each ensemble."""
        return int(next(iter(self.quantities.values())).shape[1])

    @cached_property
    def late_tau(self) -> Mapping[str, float]:
        """Autocorrelation time of each quantity over the later half of all steps, in steps."""
        return {name: autocorrelation_time(x[:, self.steps // 2 :]) for name, x in self.quantities.items()}

    @cached_property
    def discarded(self) -> int:
        """Steps at the beginning that count for nothing: 10 autocorrelation times, at most half of all."""
        longest = max(self.late_tau.values())
        half = self.steps // 2
        return min(math.ceil(_DISCARDED * longest), half) if math.isfinite(longest) else half

    @cached_property
    def kept(self) -> Mapping[str, Array]:
        """What is left."""
        return {name: x[:, self.discarded :] for name, x in self.quantities.items()}

    @cached_property
    def tau(self) -> Mapping[str, float]:
        """Autocorrelation time of each quantity over what is kept, in steps."""
        return {name: autocorrelation_time(x) for name, x in self.kept.items()}

    @cached_property
    def rhat(self) -> Mapping[str, float]:
        """Rank-normalised split R-hat over the ensembles."""
        return {name: rhat(x) for name, x in self.kept.items()}

    @cached_property
    def bulk(self) -> Mapping[str, float]:
        """Effective draws in the bulk."""
        return {name: effective_bulk(x) for name, x in self.kept.items()}

    @cached_property
    def tail(self) -> Mapping[str, float]:
        """Effective draws in the tails."""
        return {name: effective_tail(x) for name, x in self.kept.items()}


def autocorrelation_time(x: Array) -> float:
    """Integrated autocorrelation time in steps, from the mean autocorrelation function of 16 walkers each.

    Parameters
    ----------
    x : ndarray, (ensembles, steps, walkers)

    Returns
    -------
    float
        Infinite where nothing moved.

    Notes
    -----
    By emcee, with the window of Sokal (1989), 5 autocorrelation times.
    """
    series = np.moveaxis(x[:, :, :_WITNESSES], 1, 0).reshape(x.shape[1], -1)
    series = series[:, np.ptp(series, axis=0) > 0.0]  # a walker that stood still has no autocorrelation
    if x.shape[1] < 4 or series.shape[1] == 0:
        return math.inf
    return float(integrated_time(series, tol=0)[0])


def rhat(x: Array) -> float:
    """Rank-normalised split R-hat over the ensembles; infinite where it is not defined.

    Parameters
    ----------
    x : ndarray, (ensembles, steps, walkers)

    References
    ----------
    Vehtari et al. (2021), Bayesian Analysis 16, 667.
    """
    if x.shape[1] < 4 or np.ptp(x) == 0.0:
        return math.inf
    from arviz_stats.base.array import array_stats

    with np.errstate(all="ignore"):
        found = float(array_stats.rhat(x.reshape(x.shape[0], -1), method="rank"))
    return found if math.isfinite(found) else math.inf


def effective_bulk(x: Array) -> float:
    """Effective number of draws for the mean of the rank-normalised quantity.

    Parameters
    ----------
    x : ndarray, (ensembles, steps, walkers)
    """
    ranks = stats.rankdata(x.reshape(-1))
    z = special.ndtri((ranks - 0.375) / (ranks.size + 0.25))
    return effective(z.reshape(x.shape))


def effective_tail(x: Array) -> float:
    """Effective number of draws for the shares below the 5 and the 95 % quantile, the smaller of the two.

    Parameters
    ----------
    x : ndarray, (ensembles, steps, walkers)
    """
    return min(effective((x <= edge).astype(float)) for edge in np.quantile(x, _TAILS))


def effective(z: Array) -> float:
    """Number of independent draws with which the mean of z would be known as well as from these chains.

    The walkers of an ensemble depend on one another, so neither can each count as a chain, nor can their
    draws be put into one row: in such a row an autocorrelation begins only after as many places as there are
    walkers, and estimators that stop at the first small one overlook it. What is sound is the series of the
    means over the walkers (Goodman & Weare 2010, section 3): of each ensemble one series in time, whose own
    effective number N and variance v give the error of the overall mean, v/N, with every correlation between
    walkers in it. Then var(z)/(v/N) is the number wanted.

    Parameters
    ----------
    z : ndarray, (ensembles, steps, walkers)

    Returns
    -------
    float
        0 where it is not defined.
    """
    means = z.mean(axis=2)
    if means.shape[1] < 4 or np.ptp(means) == 0.0:
        return 0.0
    from arviz_stats.base.array import array_stats

    with np.errstate(all="ignore"):
        of_means = float(array_stats.ess(means, method="mean"))
    found = float(z.var()) / float(means.var()) * of_means
    return found if math.isfinite(found) else 0.0


class Finding(NamedTuple):
    """What a rule found.

    Attributes
    ----------
    rule : str
    ok : bool
    says : str
        What is wrong, or empty.
    steps_more : float
        Steps of each ensemble until the rule will hold; 0 where it does, infinite where nobody can tell.
    """

    rule: str
    ok: bool
    says: str
    steps_more: float


@dataclass(frozen=True)
class Verdict:
    """All rules together.

    Attributes
    ----------
    findings : tuple of Finding
    """

    findings: tuple[Finding, ...]

    @property
    def ok(self) -> bool:
        """Whether every rule holds."""
        return all(finding.ok for finding in self.findings)

    @property
    def failed(self) -> tuple[str, ...]:
        """Names of the rules that do not."""
        return tuple(finding.rule for finding in self.findings if not finding.ok)

    @property
    def says(self) -> str:
        """What is wrong, rule by rule."""
        return "; ".join(finding.says for finding in self.findings if not finding.ok)

    @property
    def steps_more(self) -> int | None:
        """Steps until every rule will hold, to two digits upwards; None where nobody can tell."""
        most = max(finding.steps_more for finding in self.findings)
        if not math.isfinite(most):
            return None
        unit = int(10 ** max(0, math.floor(math.log10(max(most, 1.0))) - 1))
        return math.ceil(most / unit) * unit


def length(evidence: Evidence) -> Finding:
    """Long enough for its own autocorrelation time to be known: 50 of them."""
    name, tau = _worst(evidence.tau)
    kept = evidence.steps - evidence.discarded
    if kept >= LENGTH * tau:
        return Finding("length", True, "", 0.0)
    known = f"{kept / tau:.0f}" if math.isfinite(tau) else "no"
    says = f"the chain has {known} autocorrelation times of {name}, for {LENGTH} wanted"
    return Finding("length", False, says, LENGTH * tau - kept)


def stable(evidence: Evidence) -> Finding:
    """The autocorrelation time of all that is kept is that of the later half."""
    changes = {name: abs(evidence.late_tau[name] / tau - 1.0) for name, tau in evidence.tau.items()}
    name, change = _worst({name: math.inf if math.isnan(x) else x for name, x in changes.items()})
    if change <= STABLE:
        return Finding("stable", True, "", 0.0)
    if not math.isfinite(change):
        return Finding("stable", False, f"{name} does not move", math.inf)
    says = f"the autocorrelation time of {name} differs by {100.0 * change:.0f} % in the later half"
    # an estimate's error falls with the root of the length
    return Finding("stable", False, says, _times(evidence, (change / STABLE) ** 2))


def agreement(evidence: Evidence) -> Finding:
    """R-hat over the ensembles."""
    name, worst = _worst(evidence.rhat)
    if worst < RHAT:
        return Finding("rhat", True, "", 0.0)
    says = f"R-hat of {name} is {worst:.3g} over the ensembles, for less than {RHAT:g} wanted"
    if worst > _MET_BEFORE:
        return Finding("rhat", False, f"{says}: they are not in the same place", math.inf)
    # where the ensembles have met, the variance between them falls with the length
    return Finding("rhat", False, says, _times(evidence, (worst**2 - 1.0) / (RHAT**2 - 1.0)))


def bulk(evidence: Evidence) -> Finding:
    """Enough effective draws in the bulk."""
    return _enough("bulk", evidence.bulk, evidence)


def tail(evidence: Evidence) -> Finding:
    """Enough effective draws in the tails."""
    return _enough("tail", evidence.tail, evidence)


# the cheap ones first: as long as one of them fails the others need not be asked
RULES: tuple[Callable[[Evidence], Finding], ...] = (length, stable, bulk, tail, agreement)


def verdict_of(evidence: Evidence) -> Verdict:
    """Ask every rule."""
    return Verdict(tuple(rule(evidence) for rule in RULES))


def is_met(evidence: Evidence) -> bool:
    """Whether every rule holds; asks no further after one that does not."""
    return all(rule(evidence).ok for rule in RULES)


def _enough(rule: str, found: Mapping[str, float], evidence: Evidence) -> Finding:
    name, least = min(found.items(), key=lambda item: item[1])
    if least >= ESS:
        return Finding(rule, True, "", 0.0)
    says = f"{least:,.0f} effective draws of {name} in the {rule}, for {ESS:,} wanted"
    return Finding(rule, False, says, _times(evidence, ESS / least) if least > 0.0 else math.inf)


def _times(evidence: Evidence, factor: float) -> float:
    """Steps more until what is kept is so many times as long."""
    return (factor - 1.0) * (evidence.steps - evidence.discarded)


def _worst(found: Mapping[str, float]) -> tuple[str, float]:
    return max(found.items(), key=lambda item: item[1])
