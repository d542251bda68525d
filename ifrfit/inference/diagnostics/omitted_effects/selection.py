"""Which effect the residuals call for, and which others they do not tell from it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from ifrfit.inference.diagnostics.omitted_effects.effect_signatures import RIVALS, directions
from ifrfit.inference.diagnostics.omitted_effects.messages import called_words, none_words
from ifrfit.inference.diagnostics.omitted_effects.restitution_laws import LAWS
from ifrfit.inference.diagnostics.omitted_effects.score_tests import Score, holm, scores
from ifrfit.inference.diagnostics.thresholds import ALIKE, FACTS, REFUTED
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.result.types import Fact


def effect_scores(
    problem: Problem,
    fit: LeastSquaresFit,
    *,
    chi: float | None = None,
    speed: float = 0.0,
    e_n_known: bool = True,
) -> dict[str, Score]:
    """Test the residuals for effects that the closure does not hold, and for what may be mistaken for them.

    Parameters
    ----------
    problem : Problem
    fit : LeastSquaresFit
    chi : float, optional
        Compliance number of the materials, where they are known.
    speed : float
        Of rows that state none, m/s; 0 where it is not known.
    e_n_known : bool
        Whether e_n is determined or fixed.

    Returns
    -------
    dict
        By name, with p corrected for the number of tests; empty where no effect could show in these rows.
    """
    theta = fit.optimum.theta
    jacobian = problem.jacobian(theta)
    every = directions(problem, theta, jacobian, fit.sigma, chi=chi, speed=speed, e_n_known=e_n_known)
    residual = problem.residual(theta) / fit.sigma
    tested = scores(
        [replace(d, change=d.change / fit.sigma) for d in every],
        jacobian / fit.sigma[:, None],
        residual,
        known=problem.noise.is_known and problem.error_model.is_plain,
    )
    if all(one.direction.name in RIVALS for one in tested):
        return {}
    corrected = [replace(one, p=p) for one, p in zip(tested, holm([one.p for one in tested]), strict=True)]
    return _each_best(corrected)


def effects_fact(problem: Problem, found: Mapping[str, Score]) -> Fact | None:
    """Which effect the residuals call for; None where none could show in these rows."""
    if not found:
        return None
    named = best_of([one for one in found.values() if one.p < REFUTED])
    figures: dict[str, object] = {
        "called": [one.direction.name for one in named],
        "tests": {name: _figures(one) for name, one in found.items()},
    }
    least = min(one.p for one in found.values())
    says = called_words(problem, named) if named else none_words(list(found), least)
    return Fact(not named, says, figures, FACTS["effects"])


def _each_best(tested: Sequence[Score]) -> dict[str, Score]:
    """By name; of an effect at several of its numbers the one that explains most."""
    found: dict[str, Score] = {}
    for one in tested:
        other = found.get(one.direction.name)
        if other is None or one.drop * one.towards > other.drop * other.towards:
            found[one.direction.name] = one
    return found


def _figures(one: Score) -> dict[str, float]:
    shown = {"p": one.p, "drop": one.drop, "strength": one.strength, "sd": one.sd}
    return shown | dict(one.direction.figures)


def best_of(significant: Sequence[Score]) -> list[Score]:
    """The direction that takes most of the misfit, and those that take about as much.

    The two laws e_n(v) have nearly the same shape and differ by their size: where e_n is known, the one
    whose own size fits worse falls out.
    """
    if not significant:
        return []
    top = max(one.drop for one in significant)
    near = sorted((one for one in significant if one.drop >= top - ALIKE), key=lambda one: -one.drop)
    laws = [one for one in near if one.direction.name in LAWS and one.direction.whole]
    best = max((one.drop_whole for one in laws), default=0.0)
    return [one for one in near if one not in laws or one.drop_whole >= best - ALIKE]
