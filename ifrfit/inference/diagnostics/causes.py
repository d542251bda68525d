"""What the residuals call for: a slip of the hand in the table before any physical effect."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ifrfit.inference.diagnostics.omitted_effects.score_tests import Score
from ifrfit.inference.diagnostics.slips.evidence import Slip, drop_of_effect, is_decisive, too_few, tried
from ifrfit.inference.diagnostics.slips.messages import none_words, slip_words
from ifrfit.inference.diagnostics.thresholds import ALIKE, FACTS, REFUTED
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.result.types import Fact


def slips_first(
    problem: Problem, fit: LeastSquaresFit, scores: Mapping[str, Score], effects: Fact | None
) -> dict[str, Fact]:
    """Try every slip, and compare with it what the effects explain.

    Where a slip explains the data as well as an effect, the slip is named first with the effect beside it,
    and the effect is no finding of its own.

    Parameters
    ----------
    problem : Problem
    fit : LeastSquaresFit
    scores : mapping of str to Score
        Tests of the effects.
    effects : Fact or None
        What the residuals call for among them.

    Returns
    -------
    dict
        ``slips``, and ``effects`` unless a slip takes its place.
    """
    rest = {} if effects is None else {"effects": effects}
    rule = FACTS["slips"]
    if too_few(problem, fit):
        return {
            "slips": Fact(True, "too few rows to tell a slip in the table", {"called": [], "tests": {}}, rule)
        } | rest
    slips = tried(problem, fit)
    found: dict[str, float] = {}
    if any(is_decisive(slip) for slip in slips):
        found = {name: drop_of_effect(problem, fit, one) for name, one in scores.items() if one.p < REFUTED}
    named = named_slips(slips, max(found.values(), default=0.0))
    figures: dict[str, object] = {
        "called": [_key(slip) for slip in named],
        "tests": {_key(slip): _figures(slip) for slip in slips},
    }
    if not named:
        return {"slips": Fact(True, none_words(slips), figures, rule)} | rest
    top = max(slip.rank for slip in named)
    others = found.keys() - {slip.name for slip in named}
    alike = [name for name in found if name in others and found[name] >= top - ALIKE]
    says = slip_words(problem, named, alike)
    return {"slips": Fact(False, says, figures | {"effects": alike}, rule)}


def named_slips(slips: Sequence[Slip], of_effects: float) -> list[Slip]:
    """Decisive slips that explain as much as anything else does, the most telling first."""
    decisive = sorted((slip for slip in slips if is_decisive(slip)), key=lambda slip: -slip.rank)
    top = max([of_effects, *(slip.rank for slip in decisive)])
    return [slip for slip in decisive if slip.rank >= top - ALIKE]


def _key(slip: Slip) -> str:
    return f"{slip.name} {slip.observable}".strip()


def _figures(slip: Slip) -> dict[str, float]:
    return {"p": slip.p, "drop": slip.drop, "size": slip.size, "sd": slip.sd}
