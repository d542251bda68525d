"""Small flaws of a measurement that would turn the verdict between closures."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from ifrfit.inference.comparison.result import Entry
from ifrfit.inference.comparison.verdict import INDIFFERENT, SCALE
from ifrfit.inference.diagnostics.slips.messages import FLAWS, flaw_words
from ifrfit.inference.diagnostics.slips.slip import Slip

_STRONG = min(least for least, word in SCALE if word == "strong")


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
