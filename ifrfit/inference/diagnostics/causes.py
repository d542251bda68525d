"""What the residuals call for: a slip of the hand in the table before series that differ and any effect."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from ifrfit.inference.diagnostics.nested_models import Pooling, pooling
from ifrfit.inference.diagnostics.omitted_effects.experimental_conditions import Setting
from ifrfit.inference.diagnostics.omitted_effects.score_tests import Score, effect_scores, effects_fact
from ifrfit.inference.diagnostics.slips.compared_fit import (
    ComparedFit,
    Slip,
    fitted_effect,
    has_likely_size,
    is_decisive,
    offsets_by_series,
)
from ifrfit.inference.diagnostics.slips.evidence import WORTH_A_TRY, explains_little, misfit_left, tried
from ifrfit.inference.diagnostics.slips.messages import none_words, offset_words, short_slip_words, slip_words
from ifrfit.inference.diagnostics.slips.rival_closures import rival_closures
from ifrfit.inference.diagnostics.thresholds import ALIKE, DECISIVE, FACTS, REFUTED
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import OBLIQUE
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.result.types import Constants, Fact, by_entry
from ifrfit.physics.compliance.law import chi_range

_FEWEST = 3  # degrees of freedom below which no slip is looked for
_OF_STICKING = "sticking-law"
_RARE = ("incoming-spin", "incoming-roll")
_LIKE_STICKING = ("inertia-factor", "incoming-roll")


def causes_of(
    problem: Problem, fit: LeastSquaresFit, setting: Setting | None, constants: Constants
) -> dict[str, Fact]:
    """What the residuals call for.

    Parameters
    ----------
    problem : Problem
    fit : LeastSquaresFit
    setting : Setting or None
        The scene of the data.
    constants : mapping
        Name to `Estimate`, or to one a series.

    Returns
    -------
    dict
        ``pooling`` of several series, ``slips``, and ``effects`` where one could show in these rows; of these
        what nothing before them explains.
    """
    chi, speed = None, 0.0
    if setting is not None:
        chi = _chi(setting, problem.inertia_factor)
        speed = setting.speed[0] if len(setting.speed) == 1 else 0.0
    found = effect_scores(problem, fit, chi=chi, speed=speed, e_n_known=_has_value("e_n", constants))
    return slips_first(problem, fit, found, effects_fact(problem, found), pooling(problem, fit))


def _chi(setting: Setting, j: float) -> float | None:
    """Compliance number of the materials, where it is one that like materials can have."""
    if setting.contact.stiffness_ratio is None:
        return None
    chi = 0.5 * setting.contact.stiffness_ratio * (1.0 + 1.0 / j)
    low, high = chi_range(j)
    return chi if low <= chi <= high else None


def _has_value(name: str, found: Mapping[str, Any]) -> bool:
    return all(one.value is not None for one in by_entry({name: found[name]}).values())


def slips_first(
    problem: Problem,
    fit: LeastSquaresFit,
    scores: Mapping[str, Score],
    effects: Fact | None,
    shared: Pooling | None = None,
) -> dict[str, Fact]:
    """Try every slip, and compare with it what the effects explain, and what constants of each series do.

    Where a slip explains the data as well as an effect, the slip is named first with the effect beside it,
    and the effect is no finding of its own. Series that differ are the ordinary case: a slip takes their
    place where it explains more, and stands alone where it explains decisively more.

    Parameters
    ----------
    problem : Problem
    fit : LeastSquaresFit
    scores : mapping of str to Score
        Tests of the effects.
    effects : Fact or None
        What the residuals call for among them.
    shared : Pooling, optional
        Whether the series share their constants.

    Returns
    -------
    dict
        ``pooling`` where it was asked; ``slips``, unless series that differ feign them; ``effects`` unless a
        slip or series that differ take their place.
    """
    differ = shared is not None and not shared.fact.ok
    if shared is not None and differ:
        shared = _beside_offsets(problem, fit, shared)
    pooling = {} if shared is None else {"pooling": shared.fact}
    # constants that differ feign effects: they are looked for when the series are apart
    rest = {} if effects is None or differ else {"effects": effects}
    rule = FACTS["slips"]
    if ComparedFit.of(problem, fit).dof < _FEWEST:
        says = "no slip in the table is looked for: there are too few rows"
        none = Fact(True, says, {"called": [], "tests": {}, "tested": False}, rule)
        return pooling | ({} if differ else {"slips": none}) | rest
    shows = any(one.p < REFUTED for one in scores.values())
    slips = tried(problem, fit, differ=differ, effects=shows)
    decisive = any(is_decisive(slip) for slip in slips)
    fitted = _fitted_effects(problem, fit, scores, decisive=decisive)
    found = {name: one.drop for name, one in fitted.items() if one.p < REFUTED}
    named = named_slips(slips, max(found.values(), default=0.0))
    if named:  # what no test shows may explain as much as what one does
        found |= _falls_of_others(problem, fit, scores, found)
    of_all = [slip.rank for slip in named if not slip.series]  # judged at the same noises
    of_scores = [_least_fall(scores[name], fall) for name, fall in found.items()]
    like = _look_alikes(slips, max(of_all if named else of_scores, default=math.inf), named)
    beside = [] if named else [short_slip_words(problem, one) for one in like]
    named += like if named else []
    if not differ and (again := effects_fact(problem, {**scores, **fitted}, beside)) is not None:
        rest = {"effects": again}
    left = {slip: misfit_left(problem, fit, slip) for slip in named}
    # one that explains all stands before look-alikes, and the zero of an angle before spin that nobody saw
    named.sort(key=lambda slip: (left[slip] < REFUTED, not is_decisive(slip), slip.name in _RARE))
    figures: dict[str, object] = {
        "called": [_key(slip) for slip in named],
        "tests": {_key(slip): _figures(slip) for slip in slips},
    }
    if not named:
        return pooling | ({} if differ else {"slips": Fact(True, none_words(slips), figures, rule)}) | rest
    top = max(slip.rank for slip in named)
    others = found.keys() - {slip.name for slip in named}
    alike = [name for name in found if name in others and found[name] >= top - ALIKE]
    if _OF_STICKING in others and _OF_STICKING not in alike and _is_of_sticking(problem, named):
        alike.append(_OF_STICKING)
    apart = ""
    if shared is not None and differ:
        more = top - _drop_of_series(problem, fit, shared, named[0])
        if more < ALIKE:
            words = short_slip_words(problem, named[0]) if more > -ALIKE else ""
            return {"pooling": shared.beside(words)}
        apart = shared.constants if more < DECISIVE else ""
        pooling = {"pooling": shared.after_slip()} if more >= DECISIVE else pooling
    closures = rival_closures(problem, fit, named[0])
    says = slip_words(problem, named, alike, apart, left[named[0]], closures)
    figures |= {"effects": alike, "p_left": left[named[0]], "closures": closures}
    return pooling | {"slips": Fact(False, says, figures, rule)}


def _fitted_effects(
    problem: Problem, fit: LeastSquaresFit, scores: Mapping[str, Score], *, decisive: bool
) -> dict[str, Score]:
    """Effects with their falls of -2 log likelihood and their sizes, as slips have them.

    That is where they show, be it beyond first order alone; these are looked for beside a slip that is
    `decisive`, too.
    """
    suspicious = [name for name, one in scores.items() if one.p < REFUTED]
    found: dict[str, Score] = {}
    if decisive or suspicious or explains_little(ComparedFit.of(problem, fit)):
        likely = (name for name, one in scores.items() if one.direction.likely and name not in suspicious)
        found = {name: fitted_effect(problem, fit, scores[name], len(scores)) for name in likely}
        found = {name: one for name, one in found.items() if one.p < REFUTED}
    if suspicious:
        found |= {name: fitted_effect(problem, fit, scores[name], len(scores)) for name in suspicious}
    return found


def _beside_offsets(problem: Problem, fit: LeastSquaresFit, shared: Pooling) -> Pooling:
    """The fact with an offset of the angles in each series, where that explains as much as constants do."""
    offsets = offsets_by_series(problem, fit)
    if offsets is None or offsets[0] < _drop_of_series(problem, fit, shared) - ALIKE:
        return shared
    return shared.or_slip(offset_words(problem, offsets[1]))


def _drop_of_series(
    problem: Problem, fit: LeastSquaresFit, shared: Pooling, slip: Slip | None = None
) -> float:
    """Fall of -2 log likelihood with constants of each series, at the noises that a slip was judged by."""
    of_all = ComparedFit.of(problem, fit)
    judged = ComparedFit.by_series(problem, fit) if slip is not None and slip.series else of_all
    wider = ComparedFit(shared.problem, shared.fit, judged.misfit)
    return judged.likelihood - wider.likelihood


def named_slips(slips: Sequence[Slip], of_effects: float) -> list[Slip]:
    """Decisive slips that explain as much as anything else does, the most telling first.

    One in a single series is judged at the noise of each series, one of the whole table at that asked for.
    """
    every = [slip for slip in slips if is_decisive(slip)]
    decisive = sorted(every, key=lambda slip: -slip.rank)
    top = max([of_effects, *(slip.rank for slip in decisive)])
    return [slip for slip in decisive if slip.rank >= top - ALIKE]


def _look_alikes(slips: Sequence[Slip], top: float, named: Collection[Slip]) -> list[Slip]:
    """Slips that take as much as what a test shows, whether one of so many shows them or not.

    Those that are not `named` already, the most telling first.
    """
    fitted = (slip for slip in slips if slip.sd and slip.values is not None and slip not in named)
    near = (slip for slip in fitted if not slip.is_least and has_likely_size(slip) and not slip.series)
    return sorted((slip for slip in near if slip.rank >= top - ALIKE), key=lambda slip: -slip.rank)


def _least_fall(score: Score, fall: float) -> float:
    """What an effect takes off -2 log likelihood, fitted or, where a line shows it, to first order."""
    return min(fall, score.drop) if score.p < REFUTED else fall


def _falls_of_others(
    problem: Problem, fit: LeastSquaresFit, scores: Mapping[str, Score], found: Collection[str]
) -> dict[str, float]:
    """Falls of -2 log likelihood of effects that have not been `found`, and that one test might show."""
    others = [name for name, one in scores.items() if one.p < WORTH_A_TRY and name not in found]
    return {name: fitted_effect(problem, fit, scores[name], len(scores)).drop for name in others}


def _is_of_sticking(problem: Problem, named: Sequence[Slip]) -> bool:
    """Whether a slip is named that is nothing but another law of sticking in these rows.

    Without spins beside velocities an inertia factor is, and so is a share of rolling before impact. Of that
    law the score has the first order, so that its own fall of -2 log likelihood tells too little.
    """
    of_spin = {each.numerator == "spin" for each in problem.rows.observables if each.kind in OBLIQUE}
    return len(of_spin) == 1 and any(slip.name in _LIKE_STICKING for slip in named)


def _key(slip: Slip) -> str:
    of = f"{slip.name} {slip.observable}".strip()
    return f"{of} in {slip.series}" if slip.series else of


def _figures(slip: Slip) -> dict[str, float]:
    figures = {"p": slip.p, "drop": slip.drop, "size": slip.size, "sd": slip.sd}
    return figures | ({"log_bayes_factor": slip.log_bayes_factor} if 0.0 < slip.sd < math.inf else {})
