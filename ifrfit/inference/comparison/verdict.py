"""Which closure the data prefer, how strongly, and which small flaws of a measurement would turn that."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ifrfit.data.schema import STAND_IN
from ifrfit.inference.comparison.result import Entry, PriorRow, Verdict
from ifrfit.inference.diagnostics.slips.compared_fit import Slip
from ifrfit.inference.diagnostics.slips.messages import FLAWS, flaw_words
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.types import Interval
from ifrfit.physics.closures import get_closure
from ifrfit.text import joined, p_text

# Kass & Raftery (1995), Journal of the American Statistical Association 90, 773: natural logarithms
SCALE = ((5.0, "very strong"), (3.0, "strong"), (1.0, "positive"))
INDIFFERENT = 1.0
SCALE_WORDS = "over 1 positive, over 3 strong, over 5 very strong"

_ADVERBS = {"very strong": "very strongly", "strong": "strongly", "positive": "slightly"}
_REFUSED = 5.0  # of the log evidence of the best closure, that a prior may cost before it is none
_STRONG = min(least for least, word in SCALE if word == "strong")


def verdict_of(entries: Mapping[str, Entry], priors: Sequence[PriorRow]) -> Verdict:
    """Judge the closures.

    Parameters
    ----------
    entries : mapping of str to Entry
    priors : sequence of PriorRow

    Returns
    -------
    Verdict
        stand_in wherever a row was generated here, whatever the numbers; refuted where the best closure has
        lack of fit; undecided where another lies within a log Bayes factor of 1, or its best curve within the
        noise of the best one's: then only the widths of the priors weigh them; undecided, too, where another
        leads as soon as mu may be larger than its prior has it.
    """
    ranked = sorted(entries, key=lambda name: -entries[name].log_evidence)
    kinds = set(entries[ranked[0]].fit.points["provenance"])
    if STAND_IN in kinds:
        return Verdict("stand_in", _stand_in_words(entries[ranked[0]].fit))
    best = ranked[0]
    found = _turned_by_room(entries, ranked, priors) or _refuted(entries, ranked)
    if found is None:
        tied = [best] + [name for name in ranked[1:] if _ties(entries, best, name)]
        found = _preferred(entries, ranked, priors) if len(tied) == 1 else _undecided(entries, ranked, tied)
    says = found.says
    if "simulated" in kinds:
        says = f"Of the simulation, not of an experiment: {says[:1].lower()}{says[1:]}"
    loose = [title(name) for name, entry in entries.items() if not entry.fit.facts["converged"].ok]
    if loose:
        says += f" Provisional: the fit of {joined(loose)} did not converge."
    return replace(found, says=says)


def title(name: str) -> str:
    """A closure as in reports."""
    return get_closure(name).title


def strength_of(log_bayes_factor: float) -> str:
    """Word of the scale; empty below it."""
    return next((word for least, word in SCALE if log_bayes_factor > least), "")


def curve_distance(one: FitResult, other: FitResult) -> float:
    """Chi2 between two closures' best curves: below 1 the noise hides which of them made the data."""
    first, second = (fit.points["fitted"].to_numpy(dtype=float) for fit in (one, other))
    if one.problem is not None and one.problem.noise.counts is not None:  # each has condensed rows of its own
        theirs, optimum = other.problem_and_optimum()
        second = replace(theirs, rows=one.problem.rows).predict(optimum.optimum.theta)
    return float((((first - second) / one.points["sigma_used"].to_numpy(dtype=float)) ** 2).sum())


def over_priors(priors: Sequence[PriorRow], best: str, other: str) -> Interval | None:
    """Smallest and largest log Bayes factor over the table; None where nothing was varied.

    Priors that the data refuse under the best closure, as a mu that ends below its own, do not count.
    """
    stated = priors[0].log_evidence[best]
    kept = [
        row
        for row in priors
        if stated is None or (own := row.log_evidence[best]) is None or own > stated - _REFUSED
    ]
    found = [row.log_bayes_factor(best, other) for row in kept]
    known = [x for x in found if x is not None]
    return (min(known), max(known)) if len(priors) > 1 else None


def _stand_in_words(fit: FitResult) -> str:
    points = fit.points
    names = list(dict.fromkeys(points["source"][points["provenance"] == STAND_IN]))
    are = "are stand-ins" if len(names) > 1 else "is a stand-in"
    return (
        f"Not answerable until real points are installed: {joined(names)} {are}, and the generator decides "
        "which closure fits."
    )


def _ties(entries: Mapping[str, Entry], best: str, name: str) -> bool:
    gap = entries[best].log_evidence - entries[name].log_evidence
    return gap <= INDIFFERENT or curve_distance(entries[best].fit, entries[name].fit) < 1.0


def _turned_by_room(
    entries: Mapping[str, Entry], ranked: Sequence[str], priors: Sequence[PriorRow]
) -> Verdict | None:
    """Verdict where a prior of mu that ends farther out has another closure come near, or lead; else None.

    The optimum of that closure lies beyond the stated end, where it describes the data, and its evidence is
    that of a tail.
    """
    best = ranked[0]
    stated = entries[best].prior.get("mu", {}).get("upper", math.inf)
    wider = [row for row in priors if row.mu_upper is not None and row.mu_upper > stated]
    gaps = {name: entries[best].log_evidence - entries[name].log_evidence for name in ranked}
    leads = [
        (lead, row, name)
        for row in wider
        for name in ranked[1:]
        if gaps[name] > _STRONG
        and entries[name].fit.facts["lack_of_fit"].ok
        and (lead := row.log_bayes_factor(name, best)) is not None
        and lead > -_STRONG
    ]
    if not leads:
        return None
    lead, row, other = max(leads, key=lambda each: each[0])
    then = f"leads {title(best)} ({_number(lead)})" if lead > 0.0 else f"is behind by {_number(-lead)}"
    says = (
        f"Which closure the data favour hangs on how large mu may be: with its prior as stated, up to "
        f"{stated:g}, {title(best)} leads {title(other)} (log Bayes factor {_number(gaps[other])}); "
        f"{row.varied}, {title(other)} {then}. Give mu that room, by bounds up to {row.mu_upper:g}."
    )
    return Verdict("undecided", says, (best, other), None, None, "", over_priors(priors, best, other))


def _refuted(entries: Mapping[str, Entry], ranked: Sequence[str]) -> Verdict | None:
    """Verdict where the best closure does not describe the data; None where it does."""
    lack = {name: entries[name].fit.facts["lack_of_fit"] for name in ranked}
    best = ranked[0]
    facts = entries[best].fit.facts
    wide = facts.get("scatter_too_large", facts.get("angle_scatter"))
    if wide is not None and entries[best].fit.noise.policy == "known":
        says = (
            f"At the sigma given no closure holds, not even {title(best)}, the best of them, but the law "
            f"need not be the reason: {wide.says}."
        )
        return Verdict("refuted", says, (best,))
    if lack[best].ok:
        return None
    p, where = lack[best].figures["p"], lack[best].figures.get("where", "in no one place")
    why = f"p = {p_text(p)}; the misfit sits {where}"
    sound = [name for name in ranked if lack[name].ok]
    if not sound:
        number = f"All {len(ranked)} closures" if len(ranked) > 2 else "Both closures"
        says = f"{number} are refuted: even {title(best)}, the best of them, has lack of fit ({why})."
    else:
        gap = entries[best].log_evidence - entries[sound[0]].log_evidence
        says = (
            f"{title(best)}, which the evidence favours, is refuted ({why}); {title(sound[0])} is not, but "
            f"its evidence is less by a log Bayes factor of {gap:.1f}: doubt the noise."
        )
    return Verdict("refuted", says, (best,))


def _preferred(entries: Mapping[str, Entry], ranked: Sequence[str], priors: Sequence[PriorRow]) -> Verdict:
    best, second = ranked[0], ranked[1]
    gap = entries[best].log_evidence - entries[second].log_evidence
    strength = strength_of(gap)
    spread = over_priors(priors, best, second)
    others = f"{title(second)}, the next best," if len(ranked) > 2 else title(second)
    says = (
        f"The data favour {title(best)} over {others} {_ADVERBS[strength]} "
        f"(log Bayes factor {_number(gap)}; {SCALE_WORDS})"
    )
    if spread is not None:
        ends = f"{_number(spread[0])} to {_number(spread[1])}"
        if strength_of(spread[0]) != strength:
            says += f", but that rests on the widths of the priors: over the table of priors it is {ends}"
        elif math.ceil(spread[1] * 10.0) > math.floor(spread[0] * 10.0) + 1:
            says += f"; over the table of priors it is {ends}"
    return Verdict("preferred", says + ".", (best,), second, gap, strength, spread)


def _undecided(entries: Mapping[str, Entry], ranked: Sequence[str], tied: Sequence[str]) -> Verdict:
    best = tied[0]
    gaps = {name: entries[best].log_evidence - entries[name].log_evidence for name in ranked}
    near = [name for name in tied[1:] if gaps[name] <= INDIFFERENT]
    alike = [name for name in tied[1:] if gaps[name] > INDIFFERENT]
    parts = []
    if near:
        factor = f"log Bayes factor {_number(max(gaps[name] for name in near))}"
        parts.append(f"from {joined([title(n) for n in near], 'or')} ({factor}; below 1 is no preference)")
    if alike:
        its = "whose best curve coincides" if len(alike) == 1 else "whose best curves coincide"
        factor = f"log Bayes factor {_number(max(gaps[name] for name in alike))}"
        parts.append(
            f"from {joined([title(n) for n in alike], 'or')}, {its} with its own within the noise "
            f"({factor}, which only weighs the widths of the priors)"
        )
    says = f"These data cannot tell {title(best)} {', nor '.join(parts)}"
    rest = [name for name in ranked if name not in tied]
    if not rest:
        return Verdict("undecided", says + ".", tuple(tied))
    # the weakest of the tied against the best of the rest: what holds for all of them
    least = gaps[rest[0]] - max(gaps[name] for name in tied)
    strength = strength_of(least)
    if strength:
        each = "both" if len(tied) == 2 else "all of them"
        over = f"{title(rest[0])}, the next," if len(rest) > 1 else title(rest[0])
        says += f"; they favour {each} over {over} {_ADVERBS[strength]} ({_number(least)} or more)"
    return Verdict("undecided", says + ".", tuple(tied), rest[0], gaps[rest[0]], strength)


def _number(x: float) -> str:
    """A log Bayes factor: to a tenth, and to units where large."""
    text = f"{x:.1f}" if abs(x) < 100.0 else f"{np.round(x):.0f}"
    return text.replace("-0.0", "0.0")


def rivals_with_flaws(entries: Mapping[str, Entry], ranked: Sequence[str]) -> dict[str, tuple[str, float]]:
    """Closures that the data no longer refuse strongly where one flaw of the measurement is fitted with them.

    The Bayes factor of a flaw is that of the slip as the fit of each closure tried it, its size with the
    prior of a slip; the best closure has its best flaw, too.

    Parameters
    ----------
    entries : mapping of str to Entry
    ranked : sequence of str
        The best first.

    Returns
    -------
    dict
        Closure to the flaw in words, and to the log Bayes factor that is left of the best closure over it.
    """
    best, *others = ranked
    level = entries[best].log_evidence + max(0.0, _best_flaw(entries[best])[0])
    found = {}
    for name in others:
        gain, words = _best_flaw(entries[name])
        left = level - entries[name].log_evidence - gain
        if gain > INDIFFERENT and left < _STRONG:
            found[name] = words, left
    return found


def _best_flaw(entry: Entry) -> tuple[float, str]:
    """Largest log Bayes factor of a flaw, and the flaw in words; -inf where none was tried."""
    fact = entry.fit.facts.get("slips")
    tests = {} if fact is None else fact.figures["tests"]
    known = {name: tests[name] for name in FLAWS if "log_bayes_factor" in tests.get(name, ())}
    if not known:
        return -math.inf, ""
    name = max(known, key=lambda one: known[one]["log_bayes_factor"])
    test = known[name]
    slip = Slip(name, test["drop"], test["p"], test["size"], test["sd"])
    return test["log_bayes_factor"], flaw_words(slip)
