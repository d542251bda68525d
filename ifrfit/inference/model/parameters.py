"""The constants of a fit: their bounds, and what the user fixed, knew before or wants separate."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass

from ifrfit.errors import UsageError
from ifrfit.physics.closures import Closure

_LARGEST = 1e6  # of a number that can be meant seriously
_SMALLEST_SD = 1e-12
_PRIOR_MU = 2.0  # upper end of the default prior of mu; matters only where the data do not determine mu


@dataclass(frozen=True)
class Constant:
    """One constant of the closure.

    Attributes
    ----------
    name : str
        e_n, mu, or that of the closure.
    lower, upper : float
        Domain; by default the passive one.
    fixed : float or None
        Value the user gave.
    prior : (float, float) or None
        Mean and standard deviation of an auxiliary measurement.
    separate : bool
        Whether each series has its own value.
    """

    name: str
    lower: float
    upper: float
    fixed: float | None = None
    prior: tuple[float, float] | None = None
    separate: bool = False

    @property
    def prior_upper(self) -> float:
        """Upper end of the default prior, finite."""
        return self.upper if math.isfinite(self.upper) else max(_PRIOR_MU, 2.0 * self.lower)

    @property
    def prior_sd(self) -> float:
        """Standard deviation of the default prior, uniform over the domain."""
        return (self.prior_upper - self.lower) / math.sqrt(12.0)


def make_constants(
    closure: Closure,
    inertia_factor: float,
    *,
    fix: Mapping[str, float] | None = None,
    prior: Mapping[str, tuple[float, float]] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    separate: Collection[str] = (),
) -> tuple[Constant, ...]:
    """Put the user's choices over the passive domain.

    Raises
    ------
    UsageError
        For a name the closure does not have, a value outside its bounds, or choices that contradict.
    """
    fix, prior, bounds = dict(fix or {}), dict(prior or {}), dict(bounds or {})
    for option, names in (("fix", fix), ("prior", prior), ("bounds", bounds), ("separate", separate)):
        for name in names:
            if name not in closure.constants:
                raise UsageError(
                    f"--{option} {name}: closure {closure.title} has no such constant. "
                    f"It has {', '.join(closure.constants)}."
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
        lower, upper = bounds.get(name, default[name])
        _check_bounds(name, lower, upper)
        _check_limits(closure, name, lower, upper)
        fixed = fix.get(name)
        if fixed is not None:
            _check_fixed(name, fixed, lower, upper, name in prior, name in separate)
        if name in prior:
            _check_prior(name, *prior[name])
        made.append(Constant(name, lower, upper, fixed, prior.get(name), name in separate))
    return tuple(made)


def _check_prior(name: str, mean: float, sd: float) -> None:
    if not _SMALLEST_SD <= sd <= _LARGEST:
        raise UsageError(
            f"--prior {name}: the standard deviation must be positive and sensible, as in {name}=0.1,0.02."
        )
    if not abs(mean) <= _LARGEST:
        raise UsageError(f"--prior {name}: no impact has a mean of {mean:g}.")


def _check_bounds(name: str, lower: float, upper: float) -> None:
    if math.isnan(lower) or math.isnan(upper) or not lower < upper:
        raise UsageError(f"--bounds {name}: the lower end {lower:g} must lie below the upper end {upper:g}.")
    if abs(lower) > _LARGEST or (abs(upper) > _LARGEST and not (name == "mu" and math.isinf(upper))):
        raise UsageError(f"--bounds {name}: both ends must be finite and at most {_LARGEST:g} in size.")
    physical = {"e_n": (0.0, math.inf), "mu": (0.0, math.inf)}.get(name)
    if physical and lower < physical[0]:
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
