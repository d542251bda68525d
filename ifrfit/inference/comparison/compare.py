"""`compare`: closures side by side on the same impacts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from ifrfit.errors import UsageError
from ifrfit.inference.comparison.closure_questions import (
    applied_where,
    chosen_closures,
    constant_choices,
    fit_each,
)
from ifrfit.inference.comparison.information_criteria import aicc, probabilities
from ifrfit.inference.comparison.loo import loo_of, with_differences
from ifrfit.inference.comparison.prior_sensitivity import prior_of, prior_table
from ifrfit.inference.comparison.psi_plane import psi_plane
from ifrfit.inference.comparison.result import Comparison, Entry
from ifrfit.inference.comparison.types import Loo
from ifrfit.inference.comparison.verdict import verdict_of
from ifrfit.inference.fit import Data, gather
from ifrfit.inference.result.fit_result import FitResult

_OF_CONSTANTS = ("fix", "prior", "bounds", "separate", "params")


def compare(
    data: Data | Sequence[Data],
    closures: str | Iterable[str] | None = None,
    *,
    loo: bool = True,
    seed: int = 0,
    **choices: Any,
) -> Comparison:
    """Weigh closures against each other by what they say of the same impacts.

    Parameters
    ----------
    data : str, Path, Observations, or a sequence of them
        As `fit`.
    closures : iterable of str, optional
        Two or more; all there are by default.
    loo : bool
        Whether to cross-validate by leaving impacts out (needs ArviZ's statistics; takes longer).
    seed : int
        Of the draws behind bands and cross-validation.
    **choices
        Keywords of `fit` but for closure and method. A choice for a constant that only some closures have
        (`fix`, `prior`, `bounds`, `separate`, `params`) applies to these, which is noted.

    Returns
    -------
    Comparison

    Raises
    ------
    UsageError
        For choices that do not exist or contradict, or fewer than two closures.
    DataError
        For data that are refused.

    Notes
    -----
    The evidence is the integral of the likelihood over the normalised prior, by the quadrature of the exact
    posterior. Posterior probabilities take all closures as equally probable before. How far the evidence
    rests on the widths of the priors is in `Comparison.priors`.
    """
    if "method" in choices or "closure" in choices:
        raise UsageError(
            "A comparison is by exact posterior, and `closures` names its closures: leave out `method` and "
            "`closure`."
        )
    asked, notes = chosen_closures(closures, choices)
    constants = constant_choices(choices)
    notes += applied_where(asked, constants)
    rest = {key: value for key, value in choices.items() if key not in _OF_CONSTANTS}
    observations = gather(data, rest.get("convention", ()), rest.get("inertia_factor"))
    return weighed(fit_each(observations, asked, constants, rest | {"seed": seed}), notes, loo, seed)


def weighed(fits: dict[str, FitResult], notes: tuple[str, ...], loo: bool, seed: int) -> Comparison:
    """Put fits by exact posterior, one a closure, side by side; arguments as `compare`."""
    priors = prior_table(fits)
    found = _cross_validated(fits, seed) if loo else {}
    if loo and not found:
        notes += ("Too many rows for cross-validation by draws: with so many the evidence decides.",)
    problems = [fit.problem for fit in fits.values()]
    if not problems[0].has_oblique:
        notes += ("No row is of an oblique impact: e_n and mu alone say nothing of a closure.",)
    entries = _entries(fits, found)
    plane = psi_plane(problems)
    return Comparison(entries, priors, plane, verdict_of(entries, priors), notes)


def _cross_validated(fits: dict[str, FitResult], seed: int) -> dict[str, Loo]:
    """Every closure with draws of its own, whichever others are compared; empty for too many rows."""
    found = {}
    for name, fit in fits.items():
        own = loo_of(fit, np.random.SeedSequence([seed, *name.encode()]))
        if own is None:
            return {}
        found[name] = own
    return with_differences(found)


def _entries(fits: dict[str, FitResult], loo: dict[str, Loo]) -> dict[str, Entry]:
    evidence = {name: float(fit.law.log_evidence) for name, fit in fits.items()}
    chance = probabilities(evidence)
    top = max(evidence.values())
    return {
        name: Entry(
            fit=fit,
            free=int(fit.problem.parameters.free.sum()),
            aicc=aicc(fit),
            log_bayes_factor=evidence[name] - top,
            probability=chance[name],
            prior=prior_of(fit.problem),
            loo=loo.get(name),
        )
        for name, fit in fits.items()
    }
