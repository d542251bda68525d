"""The parameters of a fit from what the user states of them: fixed values, priors, bounds, series, ties."""

from __future__ import annotations

import math
import shlex
from collections.abc import Collection, Iterable, Mapping

from ifrfit.errors import UsageError
from ifrfit.inference.model.entry_names import quantity_of, split_name
from ifrfit.inference.model.parameters import PRIOR_MU, Parameter
from ifrfit.inference.model.prior_laws import Normal, PriorLaw, ShapedLaw
from ifrfit.physics.closure import Closure
from ifrfit.text import meant

_OUTSIDE = 3.0  # sd by which an earlier measurement may lie outside the domain
_LARGEST = 1e6  # of a number that can be meant seriously
_SMALLEST_SD = 1e-5  # of a prior that leaves a constant free: the grids of every method resolve it


def make_parameters(
    closure: Closure,
    inertia_factor: float,
    *,
    fix: Mapping[str, float] | None = None,
    prior: Mapping[str, tuple[float, float] | PriorLaw] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    separate: Collection[str] = (),
    tie: Mapping[str, str] | None = None,
) -> tuple[Parameter, ...]:
    """Put the user's choices over the passive domain.

    Raises
    ------
    UsageError
        For a name the closure does not have, a value outside its bounds, or choices that contradict.
    """
    fix, prior, bounds = dict(fix or {}), dict(prior or {}), dict(bounds or {})
    tied = [quantity_of(name) for name in tie or {}]
    chosen = (("fix", fix), ("prior", prior), ("bounds", bounds), ("separate", separate), ("tie", tied))
    for option, names in chosen:
        for name in names:
            if name not in closure.constants:
                if "[" in str(name) and quantity_of(name) in closure.constants:
                    raise UsageError(_of_one_series(option, name))
                raise UsageError(
                    f"--{option} {name}: closure {closure.title} has no such constant. "
                    f"It has {', '.join(closure.constants)}.{meant(name, closure.constants)}"
                )
    default = {"e_n": (0.0, 1.0), "mu": (0.0, math.inf)}
    if closure.constant:
        low, high = closure.domain(inertia_factor)
        if not low < high and closure.constant not in bounds and closure.constant not in fix:
            raise UsageError(
                f"--inertia-factor {inertia_factor:g}: the passive domain [{low:g}, {high:g}] of "
                f"{closure.constant} is empty. Give --bounds {closure.constant}=LO,HI if you mean it."
            )
        default[closure.constant] = (low, high)
    made = []
    for name in closure.constants:
        law = _law_of(name, prior)
        lower, upper = bounds.get(name, default[name])
        if law is not None:
            lower, upper = _ends_of(law, name, lower, upper, has_bounds=name in bounds)
        _check_bounds(name, lower, upper)
        _check_limits(closure, name, lower, upper)
        fixed = fix.get(name)
        if fixed is not None:
            _check_fixed(name, fixed, lower, upper, name in prior, name in separate)
        moments = None if law is None else law.moments(lower, upper)
        if moments is not None:
            _check_prior(name, *moments, lower, upper)
            if math.isinf(upper):
                _check_size(name, *moments)
        passive = default[name] if (lower, upper) != default[name] else None
        shape = law if isinstance(law, ShapedLaw) else None
        ties = tuple((entry, text) for entry, text in (tie or {}).items() if quantity_of(entry) == name)
        made.append(Parameter(name, lower, upper, fixed, moments, name in separate, passive, shape, ties))
    return tuple(made)


def _of_one_series(option: str, name: str) -> str:
    """Why an option about a constant in one series is refused."""
    quantity, label = split_name(name)
    return (
        f"--{option} {name}: --{option} is of a constant in all series. Name {quantity}, or fit {label} "
        f"on its own, --series {shlex.quote(label)}."
    )


def _law_of(name: str, prior: Mapping[str, tuple[float, float] | PriorLaw]) -> PriorLaw | None:
    """The law of a constant's prior; two numbers are a normal one."""
    given = prior.get(name)
    if given is None or isinstance(given, PriorLaw):
        return given
    _check_normal(name, *given)
    return Normal(*given)


def _ends_of(
    law: PriorLaw, name: str, lower: float, upper: float, *, has_bounds: bool
) -> tuple[float, float]:
    """The domain under a law."""
    ends = law.ends(lower, upper)
    if has_bounds and ends != (lower, upper):
        raise UsageError(f"--prior {name}={law} contradicts --bounds {name}={lower:g},{upper:g}: keep one.")
    return ends


def _check_normal(name: str, mean: float, sd: float) -> None:
    if not 0.0 < sd <= _LARGEST:
        raise UsageError(
            f"--prior {name}: the standard deviation must be positive and sensible, as in {name}=0.1,0.02."
        )
    if not abs(mean) <= _LARGEST:
        raise UsageError(f"--prior {name}: no impact has a mean of {mean:g}.")


def _check_prior(name: str, mean: float, sd: float, lower: float, upper: float) -> None:
    if sd < _SMALLEST_SD:
        raise UsageError(
            f"--prior {name}={mean:g},{sd:g}: an sd below {_SMALLEST_SD:g} fixes {name}. "
            f"Use --fix {name}={mean:g}."
        )
    _check_normal(name, mean, sd)
    if not lower - _OUTSIDE * sd <= mean <= upper + _OUTSIDE * sd:
        raise UsageError(
            f"--prior {name}={mean:g},{sd:g}: it lies outside the domain [{lower:g}, {upper:g}]. "
            f"If you mean it, widen it with --bounds {name}=LO,HI."
        )


def _check_size(name: str, mean: float, sd: float) -> None:
    """Refuse a prior far beyond the default one: a slip of the decimal point would go unseen."""
    if mean > PRIOR_MU + _OUTSIDE * sd:
        raise UsageError(
            f"--prior {name}={mean:g},{sd:g}: a {name} beyond {PRIOR_MU:g} is hardly one of an impact. "
            f"If you mean it, say how far it may reach with --bounds {name}=0,HI."
        )


def priors_beyond_domain(parameters: Iterable[Parameter]) -> tuple[str, ...]:
    """What is said of priors whose mean lies outside the domain, where an earlier measurement may lie."""
    return tuple(
        f"the prior of {one.name}, {one.prior[0]:g} +- {one.prior[1]:g}, cut off at the end of the domain "
        f"[{one.lower:g}, {one.upper:g}], beyond which its mean lies"
        for one in parameters
        if one.prior is not None and not one.lower <= one.prior[0] <= one.upper
    )


def _check_bounds(name: str, lower: float, upper: float) -> None:
    if math.isnan(lower) or math.isnan(upper) or not lower < upper:
        raise UsageError(f"--bounds {name}: the lower end {lower:g} must lie below the upper end {upper:g}.")
    if abs(lower) > _LARGEST or (abs(upper) > _LARGEST and not (name == "mu" and math.isinf(upper))):
        raise UsageError(f"--bounds {name}: both ends must be finite and at most {_LARGEST:g} in size.")
    if name in ("e_n", "mu") and lower < 0.0:
        raise UsageError(f"--bounds {name}: {name} cannot be negative, so the lower end must be 0 or more.")


def _check_limits(closure: Closure, name: str, lower: float, upper: float) -> None:
    own = closure.own
    if own is None or own.name != name or own.limits[0] <= lower < upper <= own.limits[1]:
        return
    advice = f" ({own.advice})" if own.advice else ""
    raise UsageError(
        f"{name} from {lower:g} to {upper:g}: {own.limits_words or f'closure {closure.title}'} reaches from "
        f"{own.limits[0]:g} to {own.limits[1]:g}. Give --bounds {name}=LO,HI inside{advice}."
    )


def _check_fixed(
    name: str, value: float, lower: float, upper: float, has_prior: bool, is_separate: bool
) -> None:
    if abs(value) > _LARGEST:
        raise UsageError(f"--fix {name}={value:g}: no impact has such a value.")
    if not lower <= value <= upper:
        raise UsageError(
            f"--fix {name}={value:g}: outside the domain [{lower:g}, {upper:g}]. "
            f"If you mean it, widen it with --bounds {name}=LO,HI."
        )
    if has_prior or is_separate:
        raise UsageError(
            f"--fix {name} contradicts --{'prior' if has_prior else 'separate'} {name}: keep one."
        )
