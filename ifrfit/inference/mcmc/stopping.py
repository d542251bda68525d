"""When to stop: every rule, what it found, and how many more steps it would take."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from ifrfit.inference.diagnostics.thresholds import ESS, LENGTH, RHAT, STABLE
from ifrfit.inference.mcmc.chain_diagnostics import Evidence

_MET_BEFORE = 1.1  # R-hat from which on the ensembles have not met, and nothing can be foretold


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
