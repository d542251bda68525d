"""Score tests of the residuals along effects' directions, the effects that they call for, and their words."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from ifrfit.inference.diagnostics.omitted_effects.effect_signatures import LAWS, RIVALS, Direction, directions
from ifrfit.inference.diagnostics.quadratic_forms import orthonormal
from ifrfit.inference.diagnostics.thresholds import ALIKE, FACTS, REFUTED
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.result.types import Fact
from ifrfit.physics.closures import get_closure
from ifrfit.text import p_text

# a direction of which the constants take all but this share is none
_SPANNED = 1e-4
_FEWEST = 3  # degrees of freedom left, below which no test is made
_CALLED = {
    "compliance": "tangential compliance (microslip)",
    "viscoelastic": "viscoelastic restitution, which falls with the speed",
    "plasticity": "yield, which makes restitution fall with the speed",
    "adhesion": "adhesion, which takes restitution from the slowest impacts",
    "rolling": "rolling friction",
    "sticking-law": "another constant law of sticking",
    "sliding-law": "a restitution in sliding too",
    "sticking-by-angle": "a constant of sticking that changes with the angle, as of a compliant contact",
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
# what changes, and in which unit
_CHANGES = {
    "restitution-by-angle": ("e_n", "from the smallest angle to the largest"),
    "sticking-by-angle": ("", "from the smallest angle to the largest that knows it"),
    "friction-by-load": ("mu", "of itself as the normal speed doubles from its mean"),
    "friction-by-speed": ("mu", "of itself for ten times the speed"),
}
_REMEDIES = {
    "inertia-factor": "Give the body's own with --inertia-factor",
    "friction-by-load": "One mu holds for a narrow range of angles: --gamma-min, --gamma-max",
    "sticking-by-angle": "One constant holds for a narrow range of angles: --gamma-min, --gamma-max; "
    "--closure maw holds a compliant contact",
    "restitution-by-angle": "One e_n holds for a narrow range of angles: --gamma-min, --gamma-max",
    "rolling": "No closure holds it; the velocities of the centre (v_x, v_n, beta_cm) do not feel it",
}
_NARROW = "One set of constants holds for a narrow range of speeds: --speed-min, --speed-max"
_MOST = 0.9  # of a direction lies where the words say


@dataclass(frozen=True)
class Score:
    """Test of one direction.

    Attributes
    ----------
    direction : Direction
    strength, sd : float
        Estimate to first order and its standard deviation; 1 is the whole effect where the direction says so.
    drop : float
        Fall of -2 log likelihood with the strength free.
    drop_whole : float
        The same at strength 1.
    p : float
        Before correction for the number of tests; one-sided where the effect has a sign. The larger one of
        that of all rows and that without the row which speaks for it most, so that no outlier is an effect.
    weight : ndarray, (n,)
        Share of each row in the direction.
    chi2 : tuple of float, or None
        What the constants leave, and what the direction leaves of that; None where sigma is not known.
    dof : int
        Degrees of freedom with the direction.
    """

    direction: Direction
    strength: float
    sd: float
    drop: float
    drop_whole: float
    p: float
    weight: Array
    chi2: tuple[float, float] | None
    dof: int

    @property
    def towards(self) -> float:
        """1, or -1 where the residuals point against the effect."""
        return 1.0 if self.direction.two_sided or self.strength > 0.0 else -1.0


@dataclass(frozen=True)
class ScoreTest:
    """Residuals that directions are tested against, one after the other.

    Attributes
    ----------
    own : ndarray, (n, k)
        Orthonormal basis of what the constants can take.
    left : ndarray, (n,)
        Part of the residuals over sigma that they cannot.
    known : bool
        Whether sigma is known.
    """

    own: Array
    left: Array
    known: bool

    @classmethod
    def of(cls, jacobian: Array, residual: Array, *, known: bool) -> ScoreTest:
        """The test of a fit; parameters as of `scores`."""
        own = orthonormal(jacobian)
        return cls(own, residual - own @ (own.T @ residual), known)

    def score(self, direction: Direction) -> Score | None:
        """Test a direction; None where the constants imitate it, or too few rows are left."""
        own, left = self.own, self.left
        dof = left.size - own.shape[1]
        if dof < _FEWEST:
            return None
        size = float(np.linalg.norm(direction.change))
        d = direction.change - own @ (own.T @ direction.change)
        d -= own @ (own.T @ d)
        if np.linalg.norm(d) > _SPANNED * size:
            return _score(direction, d, left, dof, self.known)
        if direction.likely and size > 0.0:  # seen beyond first order alone
            return Score(direction, 0.0, 0.0, 0.0, 0.0, 1.0, np.zeros(d.size), None, dof - 1)
        return None


def scores(directions: Iterable[Direction], jacobian: Array, residual: Array, *, known: bool) -> list[Score]:
    """Test every direction that the constants cannot imitate, or imitate to first order alone (p = 1).

    Parameters
    ----------
    directions : iterable of Direction
        With changes in units of sigma.
    jacobian : ndarray, (n, p)
        Of the values over sigma, by every constant: also by fixed ones, so that an effect is not blamed for
        a constant that was fixed wrongly, and by those at a bound.
    residual : ndarray, (n,)
        Over sigma.
    known : bool
        Whether sigma is known; the scatter of the residuals is the yardstick where not, and where it is
        larger than sigma says.

    Returns
    -------
    list of Score
        Empty where too few rows are left.

    Notes
    -----
    With d the part of a direction and r the part of the residuals that no constant can take, d.r/|d| is
    normal with variance 1, and Student's t over the scatter of what is left (Rao 1948, Proc. Camb. Phil.
    Soc. 44, 50).
    """
    test = ScoreTest.of(jacobian, residual, known=known)
    return [one for one in map(test.score, directions) if one is not None]


def _score(direction: Direction, d: Array, left: Array, dof: int, known: bool) -> Score:
    norm = float(np.linalg.norm(d))
    t = float(d @ left) / norm
    total = float(left @ left)
    rest = max(total - t * t, 1e-300)
    scale = math.sqrt(rest / (dof - 1))
    weight = (d / norm) ** 2
    p = _p(t, total, dof, known, direction.two_sided)
    share = d * left * math.copysign(1.0, t)
    top = int(np.argmax(share))
    without = math.copysign((share.sum() - share[top]) / (norm * math.sqrt(max(1.0 - weight[top], 1e-12))), t)
    p = max(p, _p(without, total - float(left[top]) ** 2, dof - 1, known, direction.two_sided))
    at_one = (t * t - (norm - t) ** 2) / (1.0 if known else scale**2)
    drop = t * t if known else dof * math.log1p(t * t / rest)
    yardstick = 1.0 if known else scale
    chi2 = (total, rest) if known else None
    return Score(direction, t / norm, yardstick / norm, drop, at_one, p, weight, chi2, dof - 1)


def _p(t: float, total: float, dof: int, known: bool, two_sided: bool) -> float:
    size = abs(t) if two_sided else t
    rest = max(total - t * t, 1e-300)
    p = float(special.stdtr(dof - 1, -size / math.sqrt(rest / (dof - 1)))) if dof > 1 else 1.0
    if known:
        p = max(p, float(special.ndtr(-size)))
    return min(2.0 * p, 1.0) if two_sided else p


def holm(p: Sequence[float], share: Sequence[float] | None = None) -> list[float]:
    """P-values corrected for their number, in the order given (Holm 1979, Scand. J. Statist. 6, 65).

    `share` says as how many hypotheses each counts, one where it is not given (its section 4).
    """
    weight = np.ones(len(p)) if share is None else np.asarray(share, dtype=float)
    order = np.argsort(np.asarray(p, dtype=float) / weight)
    left = np.cumsum(weight[order][::-1])[::-1]
    corrected = np.asarray(p, dtype=float)[order] / weight[order] * left
    out = np.empty(len(p))
    out[order] = np.minimum(np.maximum.accumulate(corrected), 1.0)
    return [float(x) for x in out]


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
    residual = problem.residual(theta) / fit.sigma
    known = problem.noise.is_known and problem.error_model.is_plain
    test = ScoreTest.of(jacobian / fit.sigma[:, None], residual, known=known)
    p: list[float] = []
    best: dict[
        str, tuple[int, Score]
    ] = {}  # of an effect at several of its numbers the one that explains most
    for each in directions(problem, theta, jacobian, fit.sigma, chi=chi, speed=speed, e_n_known=e_n_known):
        one = test.score(replace(each, change=each.change / fit.sigma))
        if one is None:
            continue
        _, other = best.get(each.name, (0, None))
        if other is None or one.drop * one.towards > other.drop * other.towards:
            best[each.name] = len(p), one
        p.append(one.p)
    if all(name in RIVALS for name in best):
        return {}
    corrected = holm(p)
    return {name: replace(one, p=corrected[number]) for name, (number, one) in best.items()}


def effects_fact(problem: Problem, found: Mapping[str, Score], beside: Sequence[str] = ()) -> Fact | None:
    """Which effect the residuals call for, and what else may be `beside` it; None where none could show."""
    found = {name: one for name, one in found.items() if one.sd > 0.0}  # not what no line shows
    if all(name in RIVALS for name in found):
        return None
    named = best_of([one for one in found.values() if one.p < REFUTED])
    figures: dict[str, object] = {
        "called": [one.direction.name for one in named],
        "tests": {name: _figures(one) for name, one in found.items()},
    }
    least = min(one.p for one in found.values())
    says = called_words(problem, named, beside) if named else none_words(list(found), least)
    return Fact(not named, says, figures, FACTS["effects"])


def _figures(one: Score) -> dict[str, float]:
    shown = {"p": one.p, "drop": one.drop, "strength": one.strength, "sd": one.sd}
    return shown | dict(one.direction.figures)


def best_of(significant: Sequence[Score]) -> list[Score]:
    """The direction that takes most of the misfit, and those that take about as much.

    A trend of the sticking constant stands behind another constant law; compliance is one by itself.
    The two laws e_n(v) have nearly the same shape and differ by their size: where e_n is known, the one
    whose own size fits worse falls out.
    """
    if not significant:
        return []
    top = max(one.drop for one in significant)
    near = sorted((one for one in significant if one.drop >= top - ALIKE), key=lambda one: -one.drop)
    names = {one.direction.name for one in near}
    if "compliance" in names:
        near = [one for one in near if one.direction.name != "sticking-by-angle"]
    elif "sticking-law" in names:
        near.sort(key=lambda one: one.direction.name == "sticking-by-angle")
    laws = [one for one in near if one.direction.name in LAWS and one.direction.whole]
    best = max((one.drop_whole for one in laws), default=0.0)
    return [one for one in near if one not in laws or one.drop_whole >= best - ALIKE]


def called_title(name: str) -> str:
    """What is called for, in a few words."""
    return _CALLED[name].partition(",")[0]


def short_words(name: str) -> str:
    """An effect, or what may be mistaken for one, in a few words."""
    return _SHORT.get(name) or called_title(name)


def called_words(problem: Problem, named: Sequence[Score], beside: Sequence[str] = ()) -> str:
    """The effect that the residuals call for, where, how large, what else it may be, what to do."""
    first = named[0]
    effect, *others = dict.fromkeys(_effect_words(one) for one in named)
    says = f"the residuals call for {effect}"
    if others or beside:
        rest = [*(other.partition(",")[0] for other in others), *beside]
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
        speed = problem.speeds
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
    if name in _CHANGES:
        change = one.strength * (math.log(10.0) if name == "friction-by-speed" else 1.0)
        constant, of = _CHANGES[name]
        constant = constant or one.direction.constant
        return [f"{constant} {'rises' if change > 0.0 else 'falls'} by {abs(change):.2g} {of}"]
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
    if names[0] in _REMEDIES:
        return _REMEDIES[names[0]]
    if any(one.direction.by_kappa for one in named):
        return (
            "These rows hold e_n in kappa = mu (1 + e_n) only, so that mu may depend on the speed instead: "
            f"measure e_n at several speeds. {_NARROW}"
        )
    return _NARROW
