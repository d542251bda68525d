"""The verdict at the top of a report: what was determined, how well, and what contradicts it."""

from __future__ import annotations

from ifrfit.inference.estimators import title_of
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.types import Estimate
from ifrfit.report.page.blocks import Badge
from ifrfit.report.provenance import STAND_IN, is_stand_in, kinds_of, provenance_words
from ifrfit.report.regimes import count_impacts, has_angle
from ifrfit.report.rounding import plus_minus, span_text, value_text
from ifrfit.report.sentences import HEADLINES, QUIET_FACTS, closure_title, headline, undetermined
from ifrfit.text import joined

MOST_NAMED = 6
VERBS = {
    "found": "give",
    "prior": "give, with your prior,",
    "limit": "say",
    "open": "do not determine",
}
CHECKED = ("lack_of_fit", "outliers", "predictive")


def badges(result: FitResult) -> tuple[Badge, ...]:
    """Provenance, closure, method; and whether anything needs attention."""
    kinds = dict.fromkeys(kind for source in result.inputs for kind in kinds_of(result, source))
    tones = [
        Badge(
            "STAND-IN, not an experiment" if kind == STAND_IN else provenance_words((kind,)),
            "stand-in" if kind == STAND_IN else "plain",
        )
        for kind in kinds
    ]
    found = [*tones, Badge(f"closure {closure_title(result)}"), Badge(title_of(result.method))]
    if headline(result):
        found.append(Badge("needs attention", "look"))
    return tuple(found)


def verdict(result: FitResult) -> tuple[str, str]:
    """Two sentences: what was determined and how well, and what contradicts it."""
    return _determined(result), _contradicted(result)


def _determined(result: FitResult) -> str:
    groups: dict[str, list[str]] = {}
    for name, estimate in result.flat_constants().items():
        groups.setdefault(_group(estimate), []).append(_estimate_words(name, estimate))
    clauses = [
        f"{verb} {joined(_shortened(groups[group]))}" for group, verb in VERBS.items() if group in groups
    ]
    fixed = f"{joined(_shortened(groups['fixed']))} was given to the fit" if "fixed" in groups else ""
    if len(groups.get("fixed", ())) > 1:
        fixed = fixed.replace(" was ", " were ")
    words = "; they ".join(clauses) or "leave nothing to find"
    main_clause = f"{_amount(result)} {words}"
    sentence = f"{main_clause}; {fixed}." if fixed else f"{main_clause}."
    if is_stand_in(result):
        what = sentence[:1].lower() + sentence[1:]
        return f"A fit to generated data, which recovers what was put in and is no finding: {what}"
    return sentence


def _group(estimate: Estimate) -> str:
    if estimate.status == "fixed":
        return "fixed"
    if estimate.value is None:
        return "limit" if estimate.status == "one_sided" else "open"
    return "prior" if estimate.status == "prior" else "found"


def _estimate_words(name: str, estimate: Estimate) -> str:
    label = name.replace("[", " [")
    span = span_text(estimate)
    if estimate.status == "fixed":
        return f"{label} = {value_text(estimate)}"
    if estimate.value is None:
        if span == "any value":
            return label
        return f"{label} {span} (95 %)" if span[0] in "<>" else f"{label} (95 % in {span})"
    side = f" (one-sided, 95 % in {span})" if estimate.status == "one_sided" else ""
    return f"{label} = {plus_minus(estimate)}{side}"


def _shortened(words: list[str]) -> list[str]:
    if len(words) <= MOST_NAMED:
        return words
    return [*words[:MOST_NAMED], f"{len(words) - MOST_NAMED} more"]


def _amount(result: FitResult) -> str:
    """Count what the data are, as the subject of a sentence."""
    points = result.points
    if not len(points):
        return f"{result.fit.n} rows"
    observables = [str(name) for name in points["observable"].unique()]
    if not any(has_angle(name) for name in observables):
        return f"{len(points)} value{'s' if len(points) != 1 else ''} of {joined(observables)}"
    count = count_impacts(points)
    return f"{count} impact{'s' if count != 1 else ''} ({joined(observables)})"


def _contradicted(result: FitResult) -> str:
    open_ones = undetermined(result)
    failing = [
        name
        for name, fact in result.facts.items()
        if not fact.ok and name not in QUIET_FACTS and not (name == "identifiable" and open_ones)
    ]
    if failing:
        words = [_failure_words(name, result) for name in failing]
        return f"Against it stands: {'; '.join(words)}."
    fine = [result.facts[name].says.rstrip(".") for name in CHECKED if name in result.facts]
    fine = [f"{says[:1].lower()}{says[1:]}" for says in fine]
    return f"Nothing found contradicts it: {'; '.join(fine)}." if fine else "Nothing was found against it."


def _failure_words(name: str, result: FitResult) -> str:
    """Where a misfit sits is told at once; the rest by name, for the findings have the sentences."""
    if name == "lack_of_fit":
        return result.facts[name].says.rstrip(".").partition(". ")[0]
    return HEADLINES.get(name, name.replace("_", " "))
