"""Do all series share a constant, or has each its own? By the evidence of both."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ifrfit.errors import DataError
from ifrfit.inference.diagnostics.thresholds import FACTS
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.result.types import Fact

INDIFFERENT = 3.0
DECIDED = 20.0

_MOST = 3  # constants that are also tried one by one
_READABLE = 1e4  # factors beyond are written as powers of e


def sharing(
    problem: Problem,
    log_evidence: float,
    evidence_of: Callable[[Problem], float],
    names: Collection[str] = (),
) -> Fact | None:
    """Weigh constants that are separate for each series against ones that all series share.

    Parameters
    ----------
    problem : Problem
        The question as asked.
    log_evidence : float
        Its evidence.
    evidence_of : callable
        From another question to its log evidence. One that it refuses by `DataError` is passed over.
    names : collection of str
        Empty: the separate constants are tried shared, all at once and, where there are several, one by one.
        Else: the shared constants of these names are tried separate in the same way (fixed ones are passed
        over, and so are separate ones).

    Returns
    -------
    Fact or None
        None where there is nothing to ask: one series, no such constant, a series of a single row (which any
        constant of its own would meet), or no evidence. Figures: tested, direction, and models, the question
        as asked first: its separate constants, its log evidence, and the log Bayes factor of it over the
        question as asked; also preferred, the separate constants of the model that is favoured (None without
        a preference).

    Notes
    -----
    The evidence weighs fit against the room that the prior leaves (Jeffreys 1961; MacKay 2003, chapter 28):
    a constant of its own for each series costs a factor of about its posterior over its prior width, per
    series beyond the first. So a prior twice as wide favours sharing by twice as much a series.
    """
    free = [c for c in problem.parameters if c.fixed is None]
    if names:
        tested = [c.name for c in free if c.name in names and not c.separate]
    else:
        tested = [c.name for c in free if c.separate]
    alone = bool(names) and int(np.bincount(problem.rows.series).min()) < 2
    if len(problem.series) < 2 or not tested or alone or not math.isfinite(log_evidence):
        return None
    now = frozenset(c.name for c in problem.parameters if c.separate)
    models = [_Model(now, log_evidence)]
    for flipped in [tested, *([name] for name in tested[:_MOST] if len(tested) > 1)]:
        try:
            other = _with_separate(problem, now ^ frozenset(flipped))
            models.append(_Model(now ^ frozenset(flipped), evidence_of(other)))
        except DataError:  # too few rows for so many constants
            continue
    models = [model for model in models if math.isfinite(model.log_evidence)]
    if len(models) < 2:
        return None
    return _fact(models, tested, separate=bool(names))


@dataclass(frozen=True)
class _Model:
    """Which constants are separate, and the evidence of that."""

    separate: frozenset[str]
    log_evidence: float

    def words(self, tested: Sequence[str]) -> str:
        shared = " and ".join(f"one {name}" for name in tested if name not in self.separate)
        own = " and ".join(name for name in tested if name in self.separate)
        parts = ([f"{shared} for all series"] if shared else []) + ([f"separate {own}"] if own else [])
        return " with ".join(parts)


def _with_separate(problem: Problem, separate: frozenset[str]) -> Problem:
    """The same question with these constants separate, and the unknown noises with them."""
    noise = replace(problem.noise, separate=bool(separate))
    return problem.with_noise(noise).with_parameters(
        replace(p, separate=p.name in separate) for p in problem.parameters
    )


def _fact(models: list[_Model], tested: list[str], *, separate: bool) -> Fact:
    now, others = models[0], models[1:]
    rival = max(others, key=lambda model: model.log_evidence)
    better, worse = (rival, now) if rival.log_evidence > now.log_evidence else (now, rival)
    gain = better.log_evidence - worse.log_evidence
    decided = gain >= math.log(INDIFFERENT)
    figures = {
        "tested": tested,
        "direction": "separate" if separate else "shared",
        "models": [
            {
                "separate": sorted(model.separate),
                "log_evidence": model.log_evidence,
                "log_bayes_factor": model.log_evidence - now.log_evidence,
            }
            for model in models
        ],
        "preferred": sorted(better.separate) if decided else None,
    }
    refuted = separate and better is rival and gain > math.log(DECIDED)
    first, second = better.words(tested), worse.words(tested)
    if not decided:
        says = f"the data have no preference between {now.words(tested)} and {rival.words(tested)}"
        return Fact(True, f"{says} ({_factor(gain)})", figures, FACTS["sharing"])
    says = f"the data favour {first} over {second} by {_factor(gain)}"
    if refuted:
        says += ": " + " ".join(f"--separate {name}" for name in tested if name in better.separate)
    return Fact(not refuted, says, figures, FACTS["sharing"])


def _factor(log_factor: float) -> str:
    """A factor as one says it."""
    if log_factor > math.log(_READABLE):
        return f"a factor e^{log_factor:.0f}"
    factor = math.exp(log_factor)
    return f"a factor {factor:.0f}" if factor >= 10.0 else f"a factor {factor:.2g}"
