"""Which effect the residuals call for, which others they do not tell from it, and what is said of both."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ifrfit.inference.diagnostics.omitted_effects.effect_signatures import LAWS, RIVALS, directions
from ifrfit.inference.diagnostics.omitted_effects.score_tests import Score, holm, scores
from ifrfit.inference.diagnostics.thresholds import ALIKE, FACTS, REFUTED
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.result.types import Fact
from ifrfit.physics.closures import get_closure
from ifrfit.text import p_text

_CALLED = {
    "compliance": "tangential compliance (microslip)",
    "viscoelastic": "viscoelastic restitution, which falls with the speed",
    "plasticity": "yield, which makes restitution fall with the speed",
    "adhesion": "adhesion, which takes restitution from the slowest impacts",
    "rolling": "rolling friction",
    "sticking-law": "another constant law of sticking",
    "sliding-law": "a restitution in sliding too",
    "restitution-by-angle": "a restitution that changes with the angle, as of a body with faces",
    "friction-by-speed": "friction that depends on the speed of sliding",
    "friction-by-load": "friction that depends on the normal speed, and so on the angle",
    "inertia-factor": "another inertia factor",
}
_SHORT = {
    "compliance": "compliance",
    "viscoelastic": "viscoelasticity",
    "plasticity": "yield",
    "adhesion": "adhesion",
    "rolling": "rolling friction",
}
_NARROW = "One set of constants holds for a narrow range of speeds: --speed-min, --speed-max"
_MOST = 0.9  # of a direction lies where the words say


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


def called_title(name: str) -> str:
    """What is called for, in a few words."""
    return _CALLED[name].partition(",")[0]


def short_words(name: str) -> str:
    """An effect, or what may be mistaken for one, in a few words."""
    return _SHORT.get(name) or called_title(name)


def called_words(problem: Problem, named: Sequence[Score]) -> str:
    """The effect that the residuals call for, where, how large, what else it may be, what to do."""
    first = named[0]
    effect, *others = dict.fromkeys(_effect_words(one) for one in named)
    says = f"the residuals call for {effect}"
    if others:
        rest = [other.partition(",")[0] for other in others]
        says += f", not told apart from {' or '.join(rest)}"
    parts = [f"p = {p_text(first.p)}", *_where(problem, first), *_size(problem, named), *_taken(first)]
    return f"{says}: {'; '.join(parts)}. {_remedy(problem, named)}"


def _effect_words(one: Score) -> str:
    """What is called for; without a name of its own where the size of a law e_n(v) is open."""
    if one.direction.name in LAWS and not one.direction.whole:
        return "a restitution that falls with the speed"
    return _CALLED[one.direction.name]


def none_words(tested: Sequence[str], p: float) -> str:
    """What was looked for in vain."""
    names = [_SHORT[name] for name in tested if name not in RIVALS]
    return f"no effect shows in the residuals ({', '.join(names)} looked for; p = {p_text(p)})"


def _where(problem: Problem, one: Score) -> list[str]:
    """The rows that an effect shows in."""
    table = problem.observations.table
    if one.direction.name == "compliance":
        gamma = table["gamma_deg"].to_numpy(dtype=float)
        return [f"at impacts up to {_end(gamma, one.weight):.3g} degrees"]
    if one.direction.name == "adhesion":
        speed = table["speed_m_s"].to_numpy(dtype=float)
        return [f"at impacts up to {_end(speed, one.weight):.3g} m/s"] if np.isfinite(speed).any() else []
    if one.direction.name == "rolling":
        share = [one.weight[problem.rows.rows_of(name)].sum() for name in problem.rows.names]
        return [f"mostly in {problem.rows.names[int(np.argmax(share))]}"]
    return []


def _end(values: np.ndarray, weight: np.ndarray) -> float:
    """Value below which most of a direction lies."""
    known = np.isfinite(values)
    order = np.flatnonzero(known)[np.argsort(values[known], kind="stable")]
    total = np.cumsum(weight[order])
    return float(values[order[min(int(np.searchsorted(total, _MOST * total[-1])), order.size - 1)]])


def _taken(one: Score) -> list[str]:
    """How much of chi2 it takes, where chi2 says something."""
    if one.chi2 is None:
        return []
    before, after = one.chi2
    return [f"chi2 falls from {before:.4g} to {after:.4g} for {one.dof} degrees of freedom"]


def _size(problem: Problem, named: Sequence[Score]) -> list[str]:
    """How strong the effect is, beside what its theory says."""
    one = named[0]
    name, figures = one.direction.name, one.direction.figures
    if name == "compliance":
        return [
            f"strength {_pair(one.strength, one.sd)}, where 1 is Maw, Barber & Fawcett's "
            f"with chi = {figures['chi']:.3g}"
        ]
    if name in LAWS:
        fall = figures["fall"]
        if one.direction.by_kappa:
            return []
        seen = f"e_n falls by {_pair(one.strength * fall, one.sd * fall)} for ten times the speed"
        if not one.direction.whole:
            return [seen]
        return [f"{seen}, where {_SHORT[name]} that gives this e_n makes it {fall:.2g}"]
    if name == "adhesion":
        return [f"a sticking speed of {math.sqrt(max(one.strength, 0.0)):.2g} m/s"]
    if name == "rolling":
        return [f"mu_r = {_pair(one.strength, one.sd)}"]
    if name == "inertia-factor":
        return [f"some {problem.inertia_factor * (1.0 + one.strength):.2g} to first order"]
    if name == "restitution-by-angle":
        way = "rises" if one.strength > 0.0 else "falls"
        return [f"e_n {way} by {abs(one.strength):.2g} times the tangent of the angle"]
    if name == "friction-by-load":
        way = "rises" if one.strength > 0.0 else "falls"
        return [f"mu {way} by {abs(one.strength):.2g} of itself as the normal speed doubles from its mean"]
    if name == "friction-by-speed":
        share = math.log(10.0) * one.strength
        way = "rises" if share > 0.0 else "falls"
        return [f"mu {way} by {abs(share):.2g} of itself for ten times the speed"]
    return []


def _pair(value: float, sd: float) -> str:
    """Value +- sd with two digits of the sd."""
    places = max(1 - math.floor(math.log10(sd)), 0) if sd > 0.0 else 3
    return f"{value:.{places}f} +- {sd:.{places}f}"


def _remedy(problem: Problem, named: Sequence[Score]) -> str:
    names = [one.direction.name for one in named]
    if names[0] == "compliance" and problem.closure.constant is None:
        return "A closure with a constant of its own may do as well: ifrfit compare shows it"
    if names[0] == "compliance" and not problem.error_model.is_plain:
        return "Closure maw holds it, with independent Gaussian errors of the values only"
    if names[0] == "compliance":
        return "Try --closure maw; ifrfit compare shows how much better it is"
    if names[0] in ("sticking-law", "sliding-law"):
        return (
            f"ifrfit compare shows which closure does better than {get_closure(problem.closure.name).title}"
        )
    if names[0] == "inertia-factor":
        return "Give the body's own with --inertia-factor"
    if names[0] == "friction-by-load":
        return "One mu holds for a narrow range of angles: --gamma-min, --gamma-max"
    if names[0] == "restitution-by-angle":
        return "One e_n holds for a narrow range of angles: --gamma-min, --gamma-max"
    if names[0] == "rolling":
        return "No closure holds it; the velocities of the centre (v_x, v_n, beta_cm) do not feel it"
    if any(one.direction.by_kappa for one in named):
        return (
            "These rows hold e_n in kappa = mu (1 + e_n) only, so that mu may depend on the speed instead: "
            f"measure e_n at several speeds. {_NARROW}"
        )
    return _NARROW
