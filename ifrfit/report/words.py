"""What a report says in words: what was fitted, how well, and what needs attention."""

from __future__ import annotations

from ifrfit.inference.result import Estimate, FitResult
from ifrfit.physics import CLOSURES
from ifrfit.report.regimes import joined

METHODS = {
    "lsq": "least squares",
    "exact": "exact posterior",
    "mcmc": "Markov chain Monte Carlo",
    "bootstrap": "bootstrap",
    "profile": "profile likelihood",
}
HEADLINES = {
    "converged": "the estimator did not converge",
    "global_optimum": "the optimum is not proven to be the best",
    "identifiable": "the data do not determine every constant",
    "lack_of_fit": "the data contradict the closure",
    "outliers": "outliers",
    "angular_momentum": "the velocities contradict the inertia factor",
}
# a failing fact of this name is told by the status of the constant already
QUIET_FACTS = ("at_bound",)
_NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine")


def sigma_words(result: FitResult) -> str:
    """Say what sigma meant."""
    policy = result.noise.policy
    if policy == "known":
        return "sigma given"
    if policy == "scaled":
        return "given sigma scaled to the scatter"
    given = len(result.points) > 0 and bool(result.points["sigma"].notna().any())
    return "given sigma not used" if given else "no sigma given"


def model_line(result: FitResult) -> str:
    """Closure, method and noise in one line."""
    closure = CLOSURES[result.closure].title if result.closure in CLOSURES else result.closure
    count = len(set(result.noise.sigma.values()))
    number = _NUMBERS[count] if count < len(_NUMBERS) else str(count)
    noise = {"known": "known noise", "scaled": "noise scaled"}.get(
        result.noise.policy, f"{number} unknown noise{'s' if count != 1 else ''}"
    )
    parts = [f"closure {closure}", METHODS.get(result.method, result.method), noise]
    if result.inertia_factor != 0.4:
        parts.append(f"inertia factor {result.inertia_factor:.6g}")
    return ", ".join(parts)


def misfit_line(result: FitResult) -> str:
    """chi2 with its degrees of freedom; empty where sigma follows from the scatter: it says nothing there."""
    fit = result.fit
    if result.noise.policy != "known":
        return ""
    text = f"chi2 = {fit.chi2:.4g} for {fit.dof} degree{'s' if fit.dof != 1 else ''} of freedom"
    return text if fit.p_value is None else f"{text} (p = {fit.p_value:.2g})"


def status_words(estimate: Estimate) -> str:
    """The status of a constant, with its reason."""
    reason = estimate.reason.rstrip(".")
    if estimate.status == "fixed":
        plain = not reason or reason.startswith("fixed")
        return (reason or "fixed by you") if plain else f"fixed: {reason}"
    words = {
        "determined": "determined",
        "one_sided": "one-sided",
        "prior": "prior",
        "not_determined": "not determined",
    }[estimate.status]
    return f"{words}: {reason}" if reason else words


def undetermined(result: FitResult) -> list[str]:
    """Names of the constants that the data leave open."""
    names = []
    for name, entry in result.constants.items():
        estimates = {"": entry} if isinstance(entry, Estimate) else entry
        for series, estimate in estimates.items():
            if estimate.status == "not_determined":
                names.append(f"{name} [{series}]" if series else name)
    return names


def headline(result: FitResult) -> str:
    """What needs attention, in a line; empty if all is well."""
    failing = [name for name, fact in result.facts.items() if not fact.ok and name not in QUIET_FACTS]
    open_constants = undetermined(result)
    phrases = [
        HEADLINES.get(name, name.replace("_", " "))
        for name in failing
        if name != "identifiable" or not open_constants
    ]
    if open_constants:
        verb = "are" if len(open_constants) > 1 else "is"
        phrases.append(f"{joined(open_constants)} {verb} not determined")
    return "; ".join(phrases)


def findings(result: FitResult) -> list[tuple[str, str]]:
    """Facts and warnings as (kind, sentence); kind is LOOK, ok or note, LOOK first."""
    facts = result.facts.items()
    look = [("LOOK", f.says) for name, f in facts if not f.ok and name not in QUIET_FACTS]
    fine = [("ok", fact.says) for _, fact in facts if fact.ok]
    notes = [("note", f.says) for name, f in facts if not f.ok and name in QUIET_FACTS]
    told = {says for _, says in look + fine + notes}
    # that data are a stand-in is said at the very top
    said_above = tuple(f"{source.name} is a STAND-IN" for source in result.inputs)
    notes += [
        ("note", warning)
        for warning in result.warnings
        if warning not in told and not warning.startswith(said_above)
    ]
    return look + fine + notes
