"""What a report says in words: where the data come from, what was fitted, what needs attention."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from ifrfit.data import Source
from ifrfit.inference.result import Estimate, FitResult
from ifrfit.physics import CLOSURES
from ifrfit.report.regimes import count_impacts, has_angle, joined

if TYPE_CHECKING:
    import pandas as pd

METHODS = {
    "lsq": "least squares",
    "exact": "exact posterior",
    "mcmc": "Markov chain Monte Carlo",
    "bootstrap": "bootstrap",
    "profile": "profile likelihood",
}
PROVENANCE = {
    "measured": "Values as their authors measured them",
    "digitised": "Read off a published figure, whose reading errors are part of the scatter",
    "simulated": "Computed by a simulation, not measured",
    "": "Where these values come from is not stated: add a column provenance",
}
HEADLINES = {
    "converged": "the estimator did not converge",
    "global_optimum": "the global optimum is not certified",
    "identifiable": "the data do not determine every constant",
    "lack_of_fit": "the data contradict the closure",
    "outliers": "outliers",
}
# a failing fact of this name is told by the status of the constant already
QUIET_FACTS = ("at_bound",)
STAND_IN = "stand-in"
_NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine")


def is_stand_in(result: FitResult) -> bool:
    """Whether any of the data were generated instead of observed."""
    rows = result.points
    among_rows = len(rows) > 0 and bool((rows["provenance"] == STAND_IN).any())
    return among_rows or any(STAND_IN in source.provenance for source in result.inputs)


def provenance_words(provenance: str) -> str:
    """One word or two for a legend or a headline."""
    return provenance or "provenance not stated"


def stand_in_sentence(source: Source) -> str:
    """Say what a stand-in is and what a fit to it does not show."""
    conditions: Mapping[str, object] = source.descriptor.conditions if source.descriptor else {}
    ball = _condition(conditions, ("material", "sphere_material", "ball", "sphere", "particle"))
    wall = _condition(conditions, ("wall", "wall_material", "surface", "plate", "target"))
    what = f"what {ball} on {wall} does" if ball and wall else "what real spheres and walls do"
    return (
        "STAND-IN, generated from the constants the paper prints. "
        f"This fit shows that the tool works, not {what}."
    )


def _condition(conditions: Mapping[str, object], names: Sequence[str]) -> str:
    for name in names:
        value = conditions.get(name)
        if isinstance(value, str) and value:
            return value
    return ""


def provenance_sentence(source: Source) -> str:
    """Say where the values of a source come from, with the source's own reference where there is one."""
    kinds = [kind.strip() for kind in source.provenance.split(",")]
    parts = []
    for kind in kinds:
        parts.append(
            stand_in_sentence(source).rstrip(".") if kind == STAND_IN else PROVENANCE.get(kind, kind)
        )
    text = "; ".join(parts)
    if source.descriptor and source.descriptor.source:
        text += f". Source: {source.descriptor.source}"
    return text.rstrip(".") + "."


def contents(result: FitResult, source: Source) -> str:
    """Say how many impacts of what a source gave, and what was left out."""
    rows = result.points
    rows = rows[rows["source"] == source.name] if len(rows) else rows
    if len(rows):
        observables = [str(name) for name in rows["observable"].unique()]
        text = f"{_amount(rows)}, {joined(observables)}"
        readings = int(rows["n_repeats"].sum())
        if readings > len(rows):
            text += f" (means of {readings} readings)"
    else:
        text = f"{source.rows_used} rows"
    return f"{text}, {provenance_words(source.provenance)}, {sigma_words(result)}"


def left_out(source: Source) -> str:
    """Say what was selected and skipped; empty where all of it was used."""
    parts = [f"Selection: {source.selection}"] if source.selection else []
    skipped = {reason: count for reason, count in source.rows_skipped.items() if count}
    if skipped:
        reasons = ", ".join(f"{count} {reason}" for reason, count in skipped.items())
        parts.append(f"{sum(skipped.values())} of {source.rows} rows left out: {reasons}")
    return ". ".join(parts) + "." if parts else ""


def _amount(rows: pd.DataFrame) -> str:
    impacts, count = count_impacts(rows), len(rows)
    angles = any(has_angle(str(name)) for name in rows["observable"].unique())
    if not angles:
        return f"{count} value{'s' if count != 1 else ''}"
    words = f"{impacts} impact{'s' if impacts != 1 else ''}"
    return words if impacts == count else f"{words} ({count} rows)"


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
        return f"fixed: {reason}" if reason else "fixed by you"
    words = {
        "determined": "determined",
        "one_sided": "one-sided",
        "prior": "set by your prior",
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
    notes += [("note", warning) for warning in result.warnings if warning not in told]
    return look + fine + notes
