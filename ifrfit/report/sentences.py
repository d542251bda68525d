"""What a report says in words and numbers: what was fitted, how well, and what needs attention."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from ifrfit.inference.estimators import title_of
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.types import Estimate, Fact, is_quiet
from ifrfit.option_words import in_python
from ifrfit.physics import CLOSURES, OBSERVABLES
from ifrfit.physics.effects import EFFECTS
from ifrfit.text import as_given, decimals, fixed, interval_text, joined, p_text, sd_text

HEADLINES = {
    "left_out_readings": "readings that are left out contradict those used",
    "unrelated_readings": "readings do not go with the angle",
    "beyond_closure": "readings lie beyond what the closure can give",
    "converged": "the estimator did not converge",
    "global_optimum": "several sets of constants are equally good",
    "angle_offset": "the angle offset is not credible",
    "noise_modes": "several sets of constants explain the data",
    "noise_dof": "a noise rests on one degree of freedom",
    "identifiable": "the data do not determine every constant",
    "lack_of_fit": "the data contradict the closure",
    "pooling": "the series do not share their constants",
    "unequal_noise": "the series do not share their noise",
    "tiny_friction": "mu is smaller than that of any dry contact",
    "sigma_of_few": "each sigma looks like a guess from few readings",
    "scatter_too_small": "the data scatter less than their sigma",
    "scatter_too_large": "the data scatter more than their sigma",
    "mixture": "the table looks as if it held impacts of two kinds",
    "independence": "errors are not independent",
    "normal_restitution": "the readings of e_n contradict what is taken of them",
    "prior_conflict": "the data contradict a value that was taken for known",
    "slips": "the table looks as if it had a slip in it",
    "repeats": "repeats share an error",
    "angle_scatter": "the scatter is that of angles with errors",
    "growing_scatter": "the scatter grows as that of velocities would",
    "scatter_by_angle": "the scatter changes with the angle",
    "rounded_readings": "readings are rounded to coarser steps than they scatter",
    "censoring": "values look clipped",
    "truncation": "values look left out for their size",
    "repeated_number": "one number stands in the place of several readings",
    "duplicates": "impacts stand in the table twice",
    "effects": "the residuals call for a further effect",
    "outliers": "outliers",
    "predictive": "the posterior does not predict such data",
    "resampling": "there is too little to draw from",
    "sharing": "the series do not share their constants",
    "angular_momentum": "the velocities contradict the inertia factor",
}
CHECKS = {
    "chi2": "chi2",
    "runs": "runs of signs",
    "largest": "largest residual",
    "share": "share inside the 95 % band",
}


def places_of(estimate: Estimate) -> int | None:
    """Decimal places for the value and the interval of an estimate.

    The standard deviation decides, or half the half width of the 95 % interval where tails make it wider than
    that; without one the half width, or its finite end. None where there is nothing to go by: the numbers are
    shown as they are.
    """
    low, high = estimate.interval95
    if estimate.stderr is not None and math.isfinite(estimate.stderr) and estimate.stderr > 0.0:
        half = abs(high - low) / 2.0
        return decimals(0.5 * half if 0.0 < half < estimate.stderr else estimate.stderr)
    ends = [end for end in (low, high) if math.isfinite(end)]
    width = abs(high - low) / 2.0 if len(ends) == 2 else abs(ends[0]) if ends else 0.0
    return decimals(width) if width > 0.0 and math.isfinite(width) else None


def value_text(estimate: Estimate) -> str:
    """The value, rounded by its uncertainty; "-" where the data do not determine it."""
    if estimate.value is None:
        return "-"
    places = places_of(estimate)
    return as_given(estimate.value) if places is None else fixed(estimate.value, places)


def plus_minus(estimate: Estimate, sign: str = "±") -> str:
    """The value with its standard deviation, where there is one."""
    known = estimate.value is not None and estimate.stderr
    return value_text(estimate) + (f" {sign} {sd_text(known)}" if known else "")


def span_text(estimate: Estimate) -> str:
    """The 95 % interval, with the digits of the value."""
    return interval_text(estimate.interval95, places_of(estimate))


def by_series(entry: object) -> dict[str, Estimate]:
    """An estimate by the series whose it is: "" where all share it, nothing where there is none."""
    each = entry if isinstance(entry, Mapping) else {"": entry}
    return {series: found for series, found in each.items() if isinstance(found, Estimate)}


def labelled(name: str, series: str) -> str:
    """A constant's name, with the series in brackets where separate."""
    return f"{name} [{series}]" if series else name


_ABSENT = 0.05  # p above which the residuals show nothing of an effect
_NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine")


def sigma_words(result: FitResult) -> str:
    """Say what sigma meant."""
    policy = result.noise.policy
    if policy == "known":
        return "sigma given"
    if policy == "scaled":
        return "given sigma scaled to the scatter"
    if policy == "mixed":
        return f"sigma of {result.noise.whose(given=True)} given"
    given = len(result.points) > 0 and bool(result.points["sigma"].notna().any())
    return "given sigma not used" if given else "no sigma given"


def closure_title(result: FitResult) -> str:
    """The closure as in reports; a name that is not known here as it is."""
    return CLOSURES[result.closure].title if result.closure in CLOSURES else result.closure


def model_line(result: FitResult) -> str:
    """Closure, method and noise in one line."""
    parts = [f"closure {closure_title(result)}", _method_words(result), noise_words(result)]
    if result.noise.error_model.words:
        parts.append(result.noise.error_model.words)
    if result.inertia_factor != 0.4:
        parts.append(f"inertia factor {result.inertia_factor:.6g}")
    return ", ".join(parts)


def _method_words(result: FitResult) -> str:
    """The method; of a bootstrap also what was drawn anew, and how often."""
    words = title_of(result.method)
    figures = result.facts["converged"].figures if "converged" in result.facts else {}
    if not {"scheme", "replicates"} <= figures.keys():
        return words
    return f"{words} ({figures['scheme']}, {figures['replicates']:,} replicates)"


def noise_words(result: FitResult) -> str:
    """What was taken for noise."""
    noise = result.noise
    sizes = {f"{sigma:.9g}" for key, sigma in noise.sigma.items() if key not in noise.given}
    count = len(noise.estimates or sizes)
    number = _NUMBERS[count] if count < len(_NUMBERS) else str(count)
    unknown = f"{number} unknown noise{'s' if count != 1 else ''}"
    named = {"known": "known noise", "scaled": "noise scaled", "mixed": f"{unknown} beside given sigma"}
    return named.get(noise.policy, unknown)


def misfit_line(result: FitResult) -> str:
    """chi2 with its degrees of freedom, and the evidence; empty where neither says anything.

    chi2 says nothing where sigma follows from the scatter, and only a posterior has an evidence.
    """
    fit, parts = result.fit, []
    if result.noise.policy == "known":
        text = f"chi2 = {fit.chi2:.4g} for {fit.dof} degree{'s' if fit.dof != 1 else ''} of freedom"
        parts.append(text if fit.p_value is None else f"{text} (p = {p_text(fit.p_value)})")
    if fit.log_evidence is not None:
        parts.append(f"log evidence {fixed(fit.log_evidence, 2)}")
    return "; ".join(parts)


def assumed_line(result: FitResult) -> str:
    """What decides the answer although nobody said so; empty where all was said."""
    return f"assumed: {', '.join(result.assumed)}" if result.assumed else ""


def effort_line(result: FitResult) -> str:
    """What an asked accuracy or time came to; empty where neither was asked."""
    return "" if result.effort is None else f"effort: {result.effort.says}"


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
    return [
        labelled(name, series)
        for name, entry in result.constants.items()
        for series, estimate in by_series(entry).items()
        if estimate.status == "not_determined"
    ]


def failing_facts(result: FitResult) -> dict[str, Fact]:
    """Facts that say LOOK: those that fail, but for notes and for what another of them tells better."""
    pooling = result.facts.get("pooling")
    # where series do not share their constants no closure is to blame for a misfit of all
    series_differ = pooling is not None and not pooling.ok
    return {
        name: fact
        for name, fact in result.facts.items()
        if not fact.ok
        and not is_quiet(name, fact)
        and not (name == "predictive" and _covers_predictive(result))
        and not (name == "lack_of_fit" and (series_differ or "by_outliers" in fact.figures))
        # that constants are open is told of each of them
        and not (name == "identifiable" and undetermined(result))
    }


def headline(result: FitResult) -> str:
    """What needs attention, in a line; empty if all is well."""
    open_constants = undetermined(result)
    phrases = [HEADLINES.get(name, name.replace("_", " ")) for name in failing_facts(result)]
    if open_constants:
        verb = "are" if len(open_constants) > 1 else "is"
        phrases.append(f"{joined(open_constants)} {verb} not determined")
    return "; ".join(phrases)


def _covers_predictive(result: FitResult) -> str:
    """The failing fact that says already what failing predictive checks say; empty if none does.

    Lack of fit says where the misfit sits, and outliers name the row whose residual is too large.
    """
    check = result.facts.get("predictive")
    if check is None or check.ok:
        return ""
    partners = ["lack_of_fit"]
    if list(check.figures.get("failed", ())) == ["largest"]:
        partners.append("outliers")
    return next((name for name in partners if name in result.facts and not result.facts[name].ok), "")


def _also_predicted(result: FitResult) -> str:
    """What predictive checks add to a failing fact: which of them fail too."""
    figures = result.facts["predictive"].figures
    named = [f"{CHECKS.get(name, name)} (p = {p_text(figures[f'p_{name}'])})" for name in figures["failed"]]
    return f"; posterior predictive checks fail too: {joined(named)}"


def scene_notes(result: FitResult) -> list[str]:
    """What the conditions of the data say of the effects, where it adds to what the residuals say."""
    fact = result.facts.get("effects")
    called = fact.figures["called"] if fact is not None else []
    tests = fact.figures["tests"] if fact is not None else {}
    lines = []
    for line in result.effects:
        title = EFFECTS[line.effect].title if line.effect in EFFECTS else line.effect
        if line.visible:
            also = ", as the residuals do" if line.effect in called else ""
            absent = tests.get(line.effect, {}).get("p", 0.0) > _ABSENT
            lines.append(
                f"by its conditions the scene calls for {title}{also}: {line.says}"
                f"{'; the residuals do not show it' if absent else ''}"
            )
        elif called[:1] == [line.effect] and line.signal is not None:
            lines.append(
                f"by its conditions the scene would hardly show {title}: {line.says}; look for another reason"
            )
    return lines


def findings(result: FitResult) -> list[tuple[str, str]]:
    """Facts and warnings as (kind, sentence); kind is LOOK, ok or note, LOOK first.

    Of a fit that was asked for in Python, options are named as Python does.
    """
    partner = _covers_predictive(result)
    facts = [
        (
            name,
            replace(fact, says=fact.says.rstrip(".") + _also_predicted(result)) if name == partner else fact,
        )
        for name, fact in result.facts.items()
        if not (partner and name == "predictive")
    ]
    alarms = [("LOOK", f.says) for name, f in facts if not f.ok and not is_quiet(name, f)]
    fine = [("ok", fact.says) for _, fact in facts if fact.ok and fact.is_tested]
    notes = [("note", f.says) for name, f in facts if not f.is_tested or (not f.ok and is_quiet(name, f))]
    notes += [("note", says) for says in scene_notes(result)]
    shown = {says for _, says in alarms + fine + notes}
    # that data are a stand-in is said at the very top
    handled = tuple(f"{source.name} is a STAND-IN" for source in result.inputs)
    notes += [
        ("note", warning)
        for warning in result.warnings
        if warning not in shown and not warning.startswith(handled)
    ]
    found = alarms + fine + notes
    return found if result.command else [(kind, in_python(says)) for kind, says in found]


def sentence(says: str) -> str:
    """A finding as a sentence: with a full stop, and a capital unless a quantity's name comes first."""
    first = says.partition(" ")[0].rstrip(",:;")
    constants = (closure.constant for closure in CLOSURES.values())
    shown = says if first in {*OBSERVABLES, *constants, "chi2", "kappa"} else f"{says[:1].upper()}{says[1:]}"
    return f"{shown.rstrip('.')}."
