"""What the bootstrap says of the parameters: its distribution, and what replicates leave open."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ifrfit.inference.bootstrap.estimator import Array, BootstrapDraws
from ifrfit.inference.bootstrap.replicate_fits import NO_E_N, NO_SLIDING
from ifrfit.inference.diagnostics.optimum_facts import ALL_ALIKE, noise_converged, only_kappa_is_seen
from ifrfit.inference.diagnostics.thresholds import FACTS, FAILED
from ifrfit.inference.distributions.draws import Draws
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.laplace import GaussianApproximation
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.result.estimation import Estimation, Unresolved
from ifrfit.inference.result.types import Fact

_LOADED = 1e-6  # share of the prior sd from which on a constant takes part in a loose combination
_ON_BOUND = 1e-9  # within which a replicate lies on the end of its domain
_FEWEST = 20  # replicates with an answer below which they say nothing

_ONE_VALUE = 1e-12  # relative range of replicates that are one

GAUSSIAN = (
    "Draws and bands are those of the Gaussian around the optimum: replicates say nothing of what the data "
    "leave open."
)
ANSWERED = "Draws and bands are those of the replicates that have an answer."
SEPARATED = (
    "Rows of one impact were drawn apart, so errors that they share are lost: --resample cases or wild keeps "
    "them."
)


def estimation_of(found: BootstrapDraws, optimum: LeastSquaresFit) -> Estimation:
    """Distribution of the replicates; percentile intervals follow from it.

    What more than 1 % of the replicates leave open gets no value: they would all lie beyond one end of its
    interval, and nobody knows how far.
    """
    enough = found.answered >= _FEWEST
    alike = _alike(found) if enough and found.scheme.shortage else set()
    predicts = enough and not alike and not _leaves_open(found.problem, optimum.gaussian)
    warnings = (SEPARATED,) if found.scheme.splits_impacts else ()
    bounded = _on_bounds(found) if enough else {}
    if bounded:
        warnings = (*warnings, _bounded_words(bounded, found.answered))
    if not predicts:
        warnings = (*warnings, GAUSSIAN)
    elif found.failed > FAILED * found.replicates:
        warnings = (*warnings, ANSWERED)
    draws = {name: each for name, each in found.draws.items() if not (_is_noise(name) and name in alike)}
    short = found.scheme.shortage
    says = f"too few to draw from: {short}" if short else "enough to draw from"
    return Estimation(
        "bootstrap",
        Draws.of(found.problem, draws) if enough else None,
        {
            "converged": _converged(found, noise_converged(optimum)),
            "resampling": Fact(not short, says, {"scheme": found.scheme.name}, FACTS["resampling"]),
        },
        predicts=predicts,
        unresolved={**_unresolved(found), **{name: Unresolved(ALL_ALIKE) for name in alike - {*bounded}}},
        local=tuple(bounded),
        warnings=warnings,
    )


def _alike(found: BootstrapDraws) -> set[str]:
    """Quantities of which every replicate has the same value: no replicate tells how uncertain they are."""
    every = {**found.draws, **found.kappas}
    return {name for name, x in every.items() if np.ptp(x) <= _ONE_VALUE * np.abs(x).max(initial=1.0)}


def _is_noise(name: str) -> bool:
    return name.startswith("noise")


def _on_bounds(found: BootstrapDraws) -> dict[str, int]:
    """Constants that lie on an end of their domain in most replicates, and in how many.

    However far beyond it the data would have them, the replicates are one number: of a constant on its bound
    the bootstrap is inconsistent (Andrews 2000, Econometrica 68, 399).
    """
    bounded = {}
    for name, entry in zip(found.problem.parameters.names, found.problem.parameters.entries, strict=True):
        draws = found.draws.get(name)
        if draws is None or entry.fixed is not None:
            continue
        room = _ON_BOUND * min(entry.upper - entry.lower, 1.0)
        count = int(((draws <= entry.lower + room) | (draws >= entry.upper - room)).sum())
        if count > draws.size / 2.0:
            bounded[name] = count
    return bounded


def _bounded_words(bounded: Mapping[str, int], answered: int) -> str:
    counts = ", ".join(f"{name} in {count:,}" for name, count in bounded.items())
    return (
        f"Of {answered:,} replicates lies {counts} on a bound of its domain. Such replicates do not tell how "
        "far from the bound it may be: its interval is that of least squares."
    )


def _converged(found: BootstrapDraws, noise: Fact) -> Fact:
    """Whether nearly every replicate has an answer, and the fit that they start from has settled."""
    figures = {
        "scheme": found.scheme.name,
        "replicates": found.replicates,
        "failed": found.failed,
        "reasons": dict(found.reasons),
        "certified": found.certified,
    } | dict(noise.figures)
    many = found.failed > FAILED * found.replicates
    if not noise.ok:
        says = noise.says
    elif not found.failed:
        says = f"all {found.replicates:,} replicates have an answer"
    else:
        counted = sorted(found.reasons.items(), key=lambda item: -item[1])
        why = "; ".join(f"{reason} ({count:,})" for reason, count in counted)
        says = f"{found.failed:,} of {found.replicates:,} replicates have no answer: {why}"
        if many:
            says += (
                f". More than {100 * FAILED:g} % are too many for a 95 % interval: measure more impacts of "
                "the kind that is missing, or use --method exact"
            )
    return Fact(noise.ok and not many, says, figures, FACTS["converged"])


def _unresolved(found: BootstrapDraws) -> dict[str, Unresolved]:
    """What too many replicates leave open, by name; kappa is open where mu is, unless only e_n was lost."""
    problem = found.problem
    reasons = {name: dict(counts) for name, counts in found.undetermined.items()}
    for kappa in problem.parameters.kappas:
        of_mu = found.undetermined.get(problem.parameters.names[kappa.i_mu], {})
        reasons[kappa.name] = {why: n for why, n in of_mu.items() if why != NO_E_N}
    draws = {**found.draws, **found.kappas}
    return {
        name: _open(found, counts, draws[name])
        for name, counts in reasons.items()
        if name in draws and sum(counts.values()) > FAILED * found.replicates
    }


def _open(found: BootstrapDraws, reasons: Mapping[str, int], draws: Array) -> Unresolved:
    reason = f"{sum(reasons.values()):,} of {found.replicates:,} replicates leave it open"
    if set(reasons) == {NO_SLIDING} and draws.size:
        lower68, lower95 = (float(np.quantile(draws, p)) for p in (0.32, 0.05))
        return Unresolved(reason, lower68, lower95)
    return Unresolved(reason)


def _leaves_open(problem: Problem, local: GaussianApproximation) -> bool:
    """Whether the data leave anything loose, but e_n and mu that only share kappa."""
    loose = np.abs(local.vectors[:, ~local.seen]) > _LOADED * problem.parameters.prior_sd[:, None]
    if only_kappa_is_seen(problem):
        loose[sorted(set(problem.parameters.positions["e_n"].tolist()))] = False
    return bool(loose.any())
