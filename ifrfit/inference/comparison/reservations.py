"""What has to be settled before a verdict on closures is believed: what the fit of its best closure fails."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from ifrfit.inference.comparison.result import Entry, Verdict
from ifrfit.inference.diagnostics.headlines import HEADLINES
from ifrfit.inference.diagnostics.thresholds import REFUTED
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.types import Fact, is_quiet
from ifrfit.physics.closures import get_closure
from ifrfit.text import joined

# what the comparison tells in words of its own
_IN_OTHER_LINES = ("converged", "lack_of_fit", "effects", "identifiable", "predictive")
# what a slip feigns under a closure that does not name it
_FEIGNED = ("slips", "outliers")


def failures(result: FitResult) -> dict[str, Fact]:
    """Facts of a fit on which no comparison should rest: those that say LOOK there, in its order.

    Lack of fit, effects and convergence, which comparisons tell, are not among them, and neither is what
    the data determine of constants.
    """
    return {
        name: fact
        for name, fact in result.facts.items()
        if not fact.ok and name not in _IN_OTHER_LINES and not is_quiet(name, fact)
    }


def reservations(
    entries: Mapping[str, Entry], leading: Sequence[str], *, refuted: bool = False
) -> dict[str, dict[str, Fact]]:
    """What stands against a verdict, each fact once, with the first closure whose fit fails it.

    Parameters
    ----------
    entries : mapping of str to Entry
    leading : sequence of str
        Closures that the verdict rests on, the best first.
    refuted : bool
        Whether the best closure does not describe the data: then a slip that explains them beside another
        closure, and more than its own, takes the place of its own slips and outliers.

    Returns
    -------
    dict
        Closure to its facts that fail.
    """
    found: dict[str, dict[str, Fact]] = {}
    seen: set[str] = set()
    for name in leading:
        own = {key: fact for key, fact in failures(entries[name].fit).items() if key not in seen}
        found |= {name: own} if own else {}
        seen |= own.keys()
    other = _slip_of_others(entries, leading) if refuted else None
    if other is None:
        return found
    name, fact = other
    # told beside it, each with its remedy, what it feigns would be further faults
    left = {
        one: {key: fact for key, fact in own.items() if key not in _FEIGNED} for one, own in found.items()
    }
    return {name: {"slips": fact}} | {one: own for one, own in left.items() if own}


def _slip_of_others(entries: Mapping[str, Entry], leading: Sequence[str]) -> tuple[str, Fact] | None:
    """The slip that explains most, with its closure, where it is none that a leading closure names.

    With a slip repaired another closure may lead: they compare by evidence with half of what the slip takes
    off -2 log likelihood. Those of others count where they leave no misfit.
    """
    found: dict[str, Fact] = {}
    for name, entry in entries.items():
        fact = failures(entry.fit).get("slips")
        if fact is not None and (name in leading or fact.figures.get("p_left", 0.0) >= REFUTED):
            found[name] = fact
    if not found:
        return None

    def explained(name: str) -> float:
        figures = found[name].figures
        taken: float = figures["tests"][figures["called"][0]]["drop"]
        return entries[name].log_evidence + 0.5 * taken

    best = max(found, key=explained)
    own = [found[name].figures["called"][0] for name in leading if name in found]
    return None if best in leading or found[best].figures["called"][0] in own else (best, found[best])


def with_reservations(verdict: Verdict, entries: Mapping[str, Entry], brief: Collection[str] = ()) -> Verdict:
    """The verdict, with what is to be settled first in its sentence.

    Parameters
    ----------
    verdict : Verdict
    entries : mapping of str to Entry
    brief : collection of str
        Closures whose fits did not look for slips, outliers, effects and sharing.
    """
    if verdict.kind == "stand_in":
        return verdict
    found = reservations(entries, verdict.tied, refuted=verdict.kind == "refuted")
    whose: dict[str, list[str]] = {}
    for name, own in found.items():
        for key in own:
            whose.setdefault(_headline(key), []).append(get_closure(name).title)
    parts = [f"{words} ({joined(titles)})" for words, titles in whose.items()]
    says = f"{verdict.says} Settle first: {'; '.join(parts)}." if parts else verdict.says
    unseen = [name for name in verdict.tied if name in brief]
    others = [name for name in entries if name not in brief and failures(entries[name].fit)]
    if len(unseen) == len(verdict.tied) and others and not parts:
        titles = [joined([get_closure(name).title for name in each]) for each in (others, unseen)]
        says += (
            f" Provisional: what the fit of {titles[0]} tells of the table was not looked for in that of "
            f"{titles[1]}."
        )
    return replace(verdict, says=says)


def _headline(name: str) -> str:
    return HEADLINES.get(name, name.replace("_", " "))
