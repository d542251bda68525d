"""Which choice is best for which accuracy, in words that follow from the measurements alone."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ifrfit.cost.inference_costs import BOOTSTRAP, LSQ, OTHER_QUESTION, PROFILE
from ifrfit.cost.pareto_front import Choice, best_for, cheapest
from ifrfit.cost.result import Costs
from ifrfit.cost.timing import Kind
from ifrfit.inference.estimators import title_of
from ifrfit.text import duration, joined, power_of_ten

TARGETS = tuple(10.0**-k for k in range(1, 17))
_ASIDE = {LSQ: "least squares with its covariance", PROFILE: "profiles", BOOTSTRAP: "replicates"}
_ACCURACY = {"inference": "of an sd", "physics": "in beta"}
_MUCH = 3.0  # times the time of another from which on a method is worth a word


def sentences(costs: Costs, kind: Kind) -> tuple[str, ...]:
    """Which choice is best for which accuracy; what the others come to; and what is no comparison."""
    if kind == "arithmetic":
        from ifrfit.cost.report.precision import precision_sentences

        return tuple(precision_sentences([cost for cost in costs.costs if cost.kind == kind]))
    choices = [choice for choice in costs.of(kind) if not math.isnan(choice.error)]
    rivals = [choice for choice in choices if choice.method not in OTHER_QUESTION]
    if not rivals:
        return ()
    found = best_for(rivals, TARGETS)
    lines = [_best(found, kind)] if found else []
    winners = [choice for _, _, choice in found]
    fastest = min(rivals, key=lambda c: c.time.median)
    if fastest not in winners:
        lines.append(
            f"The fastest, {choice_name(fastest)} ({duration(fastest.time.median)}), comes to "
            f"{error_text(fastest.error)} {_ACCURACY[kind]}"
        )
    others = dict.fromkeys(c.method for c in rivals if c.method not in {w.method for w in winners})
    behind = (_behind(method, rivals, kind) for method in others)
    return (*lines, *filter(None, behind), *_other_question(choices))


def choice_name(choice: Choice) -> str:
    """Method and setting."""
    name = method_name(choice.method)
    return f"{name}, {choice.setting}" if choice.setting else name


def method_name(method: str) -> str:
    """A method in words; those that approach the posterior by their short names."""
    return title_of(method) if method in OTHER_QUESTION else method


def error_text(error: float) -> str:
    """An error with two digits and its power of ten, as 1.2e-5."""
    if math.isnan(error) or error == 0.0:
        return "-" if error else "0"
    digits, _, exponent = f"{error:.1e}".partition("e")
    return f"{digits}e{int(exponent)}" if exponent else "infinite"


def _best(found: Sequence[tuple[float, float, Choice]], kind: Kind) -> str:
    parts = []
    for loose, tight, choice in found:
        span = power_of_ten(loose) if loose == tight else f"{power_of_ten(loose)} to {power_of_ten(tight)}"
        parts.append(f"{span}: {choice_name(choice)} ({duration(choice.time.median)})")
    return f"Cheapest for an error of at most so much {_ACCURACY[kind]}: {'; '.join(parts)}"


def _behind(method: str, rivals: Sequence[Choice], kind: Kind) -> str:
    """What a method that is best for no accuracy comes to, and what would have been much cheaper."""
    own = min((c for c in rivals if c.method == method), key=lambda c: (c.error, c.time.median))
    better = cheapest([c for c in rivals if c.method != method], own.error)
    if better is None or own.time.median < _MUCH * better.time.median:
        return ""
    ratio = ratio_text(own.time.median / better.time.median)
    return (
        f"{choice_name(own)} comes to {error_text(own.error)} {_ACCURACY[kind]} in "
        f"{duration(own.time.median)}, {ratio} the time of {choice_name(better)}, which is no less exact"
    )


def ratio_text(ratio: float) -> str:
    """How many times, with two digits."""
    return f"{ratio:.2g} times" if ratio < 100.0 else f"{float(f'{ratio:.2g}'):,.0f} times"


def _other_question(choices: Sequence[Choice]) -> list[str]:
    """What least squares, profiles and replicates are from the posterior: a floor, not a failure."""
    found = {}
    for method in OTHER_QUESTION:
        own = [c for c in choices if c.method == method and not math.isnan(c.error)]
        if own:
            last = own[-1]  # the longest: what is left there is not chance
            found[method] = f"{last.error:.2g} sd ({title_of(method)}, {duration(last.time.median)})"
    if not found:
        return []
    names = joined([_ASIDE[method] for method in found]).capitalize()
    return [
        f"{names} answer{'s' if len(found) == 1 else ''} another question than the posterior: however "
        "exactly computed, a mean, an sd or an end of an interval differs from it by up to "
        f"{joined(list(found.values()))}"
    ]
