"""What a closure is: a model of the tangential impulse, with a constant of its own.

Most are a pair (a, b) in ``k = a + min(b, kappa U_n/|U_t|)``, where -k U_t is the tangential impulse per
mass: `Coefficients`, linear in the closure's own constant. Any other `Law` is fitted by general methods.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ifrfit.errors import UsageError
from ifrfit.physics.angles import Incidence
from ifrfit.physics.impulse_laws import Coefficients, Law, friction_factor

_RESERVED = ("e_n", "mu", "kappa")  # names that every closure has already
_ROUNDING = 1e-9
_STEP = 1e-5  # of differences, over the range of the constant or over kappa
_AGREES = 1e-4  # by which a slope may miss its differences, over the largest


@dataclass(frozen=True)
class Meaning:
    """What the constant of a closure stands for: a quantity that results derive from it.

    Attributes
    ----------
    name : str
        Key in the derived quantities of a result.
    symbol : str
        In tables.
    words : str
        What it is, in a few words.
    value : callable
        From the constant and the inertia factor J; monotone in the constant.
    linear : bool
        Whether `value` is linear in the constant: then mean and standard deviation carry over.
    """

    name: str
    symbol: str
    words: str
    value: Callable[[float, float], float]
    linear: bool = False


@dataclass(frozen=True)
class ClosureConstant:
    """The constant that a closure has beside e_n and mu.

    Attributes
    ----------
    name : str
        On the command line and in result files; a Python identifier.
    latex : str
        Without dollar signs, of what matplotlib's mathtext knows, too.
    help : str
        What it is, in a few words.
    domain : callable
        Inertia factor J to its passive range (theory: no kinetic energy is created).
    limits : (float, float)
        Between which its law can be computed at all.
    limits_words : str
        Who sets `limits`, where they are finite: "the table of closure MAW".
    advice : str
        What bounds are usual, for the message that refuses bounds beyond `limits`.
    meaning : Meaning or None
        Where a result should state what the constant stands for. Of a bilinear law the default is
        beta_sticking, the restitution of the contact point in sticking.
    """

    name: str
    latex: str
    help: str
    domain: Callable[[float], tuple[float, float]]
    limits: tuple[float, float] = (-math.inf, math.inf)
    limits_words: str = ""
    advice: str = ""
    meaning: Meaning | None = None


@dataclass(frozen=True)
class Closure:
    """One model of the tangential impulse.

    Attributes
    ----------
    name : str
        As on the command line.
    title : str
        As in reports.
    law : callable
        Inertia factor J to the `Law` of the impulse.
    source : str
        Where the closure comes from.
    own : ClosureConstant or None
        The constant beside e_n and mu, if it has one.
    regimes : (str, str)
        What impacts below and above the transition are called.
    effect : str
        The effect of scenes that computes this closure's law, if there is one: it takes the closure's
        constant, and is no omitted effect of a fit by this closure.
    caveat : str
        What every result of it should warn of, as a sentence.
    full_title : str
        What the title stands for.
    references : tuple of str
        Keys of what to cite, in ``ifrfit/report/page/assets/references.bib``.
    """

    name: str
    title: str
    law: Callable[[float], Law]
    source: str
    own: ClosureConstant | None = None
    regimes: tuple[str, str] = ("sticking", "sliding")
    effect: str = ""
    caveat: str = ""
    full_title: str = ""
    references: tuple[str, ...] = ()

    @property
    def constant(self) -> str | None:
        """Name of the constant beside e_n and mu, if it has one."""
        return None if self.own is None else self.own.name

    @property
    def constants(self) -> tuple[str, ...]:
        """Names of all constants, in the order of results."""
        return ("e_n", self.own.name, "mu") if self.own else ("e_n", "mu")

    def domain(self, inertia_factor: float) -> tuple[float, float]:
        """Passive range of the constant; (0, 0) without one."""
        return (0.0, 0.0) if self.own is None else self.own.domain(inertia_factor)

    @cached_property
    def bilinear(self) -> bool:
        """Whether the law is linear in the constants in either regime."""
        return isinstance(self.law(0.4), Coefficients)

    def coefficients(self, inertia_factor: float) -> Coefficients:
        """The bilinear law.

        Raises
        ------
        TypeError
            If the closure's law is another one: see `bilinear`.
        """
        law = self.law(inertia_factor)
        if not isinstance(law, Coefficients):
            raise TypeError(f"closure {self.title} is not bilinear")
        return law

    @property
    def meaning(self) -> Meaning | None:
        """What the constant stands for; None where nothing is known of it."""
        if self.own is not None and self.own.meaning is not None:
            return self.own.meaning
        if not self.bilinear:
            return None
        return Meaning("beta_sticking", "beta_sticking", "beta in sticking", self._beta_sticking, linear=True)

    def _beta_sticking(self, c: float, inertia_factor: float) -> float:
        """(a + b)/(J/(1 + J)) - 1, linear in the constant."""
        law = self.coefficients(inertia_factor)
        share = rotational_share(inertia_factor)
        return (law.a0 + law.b0) / share - 1.0 + (law.a1 + law.b1) / share * c

    def acts_in_sliding(self, inertia_factor: float) -> bool:
        """Whether impacts that slide know anything of the constant."""
        if self.own is None:
            return False
        middle = np.clip(0.5 * sum(self.domain(inertia_factor)), *self.own.limits)
        sliding = Incidence.of(80.0, degrees=True)
        by_constant, _ = self.law(inertia_factor).slopes(sliding, middle, 1e-6)
        return bool(np.any(by_constant != 0.0))


def check_closure(closure: Closure) -> None:
    """Refuse a closure that cannot be computed with, contradicts itself, or creates energy in its domain.

    Raises
    ------
    UsageError
        For a name of the constant that is taken or no identifier, for a law without the functions of `Law`,
        for functions of a law that contradict each other, and for a domain at whose ends an impact gains
        kinetic energy.
    """
    own = closure.own
    if own is not None and (not own.name.isidentifier() or own.name in _RESERVED):
        raise UsageError(
            f"Closure {closure.title} calls its constant '{own.name}': take an identifier of Python other "
            f"than {', '.join(_RESERVED)}."
        )
    for j in (0.4, 2.0 / 3.0):
        law = closure.law(j)
        missing = [name for name in vars(Law) if name[0] != "_" and not callable(getattr(law, name, None))]
        if missing:
            raise UsageError(
                f"The law of closure {closure.title} is a {type(law).__name__}: it must have the functions "
                f"of ifrfit.physics.impulse_laws.Law, and lacks {', '.join(missing)}."
            )
        low, high = closure.domain(j)
        _check_functions(closure, law, j)
        for c in {low, high} if own is None or low < high else ():
            _check_passive(closure, law, c, j)


def _check_functions(closure: Closure, law: Law, j: float) -> None:
    """The functions of a law agree with each other, at three constants and impacts of all kinds."""
    own = closure.own
    if own is None:
        name, low, high = "the constant", 0.0, 1.0
    else:
        name, (low, high) = own.name, closure.domain(j)
        low, high = max(low, own.limits[0]), min(high, own.limits[1])
    if not low < high:
        return
    # shares of the range, kappas and angles on which no kink of a law is likely to lie
    width = high - low
    c = (low + width * np.array([0.23, 0.51, 0.77]))[:, None, None]
    kappa = np.array([0.03, 0.17, 0.9])[:, None]
    incidence = Incidence.of(np.linspace(3.7, 86.3, 23), degrees=True)
    h = _STEP * width
    more, less = kappa * (1.0 + _STEP), kappa * (1.0 - _STEP)
    _, sticks = law.impulse(incidence, c, kappa)
    near = [law.impulse(incidence, *each) for each in ((c + h, kappa), (c - h, kappa), (c, more), (c, less))]
    smooth = np.all([each == sticks for _, each in near], axis=0)
    by_c, by_kappa = law.slopes(incidence, c, kappa)
    bound, slope = np.asarray(law.bound(c)), np.broadcast_to(law.bound_slope(c), c.shape)
    friction = friction_factor(incidence, kappa)
    clear = np.abs(friction - bound) > _ROUNDING * np.abs(bound)
    rise_by_c, rise_by_kappa = near[0][0] - near[1][0], near[2][0] - near[3][0]
    rise_of_bound = np.asarray(law.bound(c + h)) - np.asarray(law.bound(c - h))
    elsewhere = (sticks != (friction >= bound)) & clear
    wrong = {
        "it sticks elsewhere than where kappa/tau >= bound": bool(np.any(elsewhere)),
        f"slopes by {name} are not those of impulse": _differ(2.0 * h * by_c, rise_by_c, smooth),
        "slopes by kappa are not those of impulse": _differ(by_kappa, rise_by_kappa / (more - less), smooth),
        "bound_slope is not that of bound": _differ(2.0 * h * slope, rise_of_bound),
    }
    if np.any(slope):
        known = np.asarray(law.constant_at(bound))
        wrong[f"constant_at(bound({name})) is not {name}"] = _differ(
            (known - low) / width, (c - low) / width, slope != 0.0
        )
    else:
        above, below = np.asarray(law.constant_at(bound + 0.1)), np.asarray(law.constant_at(bound - 0.1))
        wrong[f"bound does not depend on {name}: constant_at must be inf above it, -inf below"] = not (
            np.all(above == np.inf) and np.all(below == -np.inf)
        )
    for words, is_so in wrong.items():
        if is_so:
            raise UsageError(
                f"The law of closure {closure.title} contradicts itself with inertia factor {j:.3g}: "
                f"{words}. Correct the law."
            )


def _differ(found: ArrayLike, expected: ArrayLike, where: ArrayLike = True) -> bool:
    """Whether they differ by more than steps and rounding explain, or are not finite."""
    one, two, used = np.broadcast_arrays(found, expected, where)
    allowed = _AGREES * np.max(np.abs(two[used]), initial=0.0) + _ROUNDING * _STEP
    return not np.all(np.abs(one - two)[used] <= allowed)


def _check_passive(closure: Closure, law: Law, c: float, j: float) -> None:
    """The tangential impulse -k U_t creates energy where k (k - 2 J/(1 + J)) > 0."""
    if closure.own is not None and not closure.own.limits[0] <= c <= closure.own.limits[1]:
        return
    incidence = Incidence.of(np.linspace(0.0, 90.0, 91), degrees=True)
    kappa = np.array([0.0, 0.01, 0.1, 0.3, 1.0, 10.0])[:, None]
    k, _ = law.impulse(incidence, c, kappa)
    beta = np.where(incidence.slip > 0.0, k / rotational_share(j) - 1.0, 0.0)
    if not np.all(np.abs(beta) <= 1.0 + _ROUNDING):
        at = "" if closure.own is None else f" with {closure.own.name} = {c:g}"
        raise UsageError(
            f"Closure {closure.title} creates kinetic energy{at}, inertia factor {j:.3g}: the contact point "
            f"leaves with {np.max(np.abs(beta)):.3g} times its velocity. Correct the domain or the law."
        )


def rotational_share(inertia_factor: float) -> float:
    """J/(1 + J): the impulse that stops the contact point, per mass and slip (2/7 for a solid sphere)."""
    return inertia_factor / (1.0 + inertia_factor)
