"""The constants that leave a fit, one number each, and the curve that they draw."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ifrfit.errors import UsageError
from ifrfit.inference.model.entry_names import entry_name, split_name
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.types import Estimate, by_entry
from ifrfit.physics.angles import Incidence
from ifrfit.physics.closure import Closure
from ifrfit.physics.closures import get_closure
from ifrfit.physics.rebound import Rebound, rebound_of
from ifrfit.text import joined, meant

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ExportedConstants:
    """Constants of a fit as numbers.

    Attributes
    ----------
    closure : Closure
    inertia_factor : float
        J = I/(m R^2).
    values : mapping of str to float
        By the closure's own names, in its order.
    """

    closure: Closure
    inertia_factor: float
    values: Mapping[str, float]

    @property
    def e_n(self) -> float:
        """Normal restitution."""
        return self.values["e_n"]

    @property
    def mu(self) -> float:
        """Friction."""
        return self.values["mu"]

    @property
    def own(self) -> float:
        """The closure's own constant; 0 without one."""
        return self.values[self.closure.constant] if self.closure.constant else 0.0

    def rebound(self, incidence: Incidence) -> Rebound:
        """What the fitted closure does."""
        return rebound_of(incidence, self.closure, self.e_n, self.own, self.mu, self.inertia_factor)

    def beta(self, tau: ArrayLike) -> Array:
        """Restitution of the contact point at slip ratios |U_t|/U_n; that of little slip at 0."""
        slip = np.maximum(np.asarray(tau, dtype=float), 1e-9)
        cosine = 1.0 / np.hypot(1.0, slip)
        zero = np.zeros_like(slip)
        at = Incidence(slip * cosine, cosine, zero, zero, slip * cosine, zero)
        return np.asarray(self.rebound(at).beta)

    @property
    def sticking_restitution(self) -> float:
        """Beta in the limit of little slip: -1 without friction, 1 where the slip is reversed."""
        return float(self.beta(0.0))


def exported_constants(
    result: FitResult, *, series: str | None = None, fix: Mapping[str, float] | None = None
) -> ExportedConstants:
    """Take the constants out of a result.

    Parameters
    ----------
    result : FitResult
    series : str, optional
        Whose constants, where they are separate.
    fix : mapping of str to float, optional
        Values that the user names himself, of constants that the data do not determine.

    Raises
    ------
    UsageError
        For a constant that is not determined, a series that is missing or unknown, and a value that belongs
        to no constant, or to one that is determined.
    """
    closure = get_closure(result.closure)
    named = {name: _number(name, value) for name, value in (fix or {}).items()}
    found = by_entry(result.constants)
    values: dict[str, float] = {}
    for name in closure.constants:
        entry = entry_name(name, _series(found, name, series))
        value = found[entry].value
        if name in named:
            _check_named(name, named[name], found[entry])
            value = named.pop(name)
        if value is None:
            low, high = found[entry].interval95
            raise UsageError(
                f"{entry} is not determined by the data (95 %: {low:.3g} to {high:.3g}) and is not exported. "
                f"Measure more, fit with a prior, or name a value of your own: --fix {name}=VALUE."
            )
        values[name] = float(value)
    if named:
        name = next(iter(named))
        raise UsageError(
            f"--fix {name}: closure {closure.title} has no such constant. It has "
            f"{joined(closure.constants)}.{meant(name, closure.constants)}"
        )
    _check_series(result, found, series)
    if fix:
        _check_kappa(result, values, series)
    return ExportedConstants(closure, result.inertia_factor, values)


def _check_series(result: FitResult, found: Mapping[str, object], series: str | None) -> None:
    """Refuse an unknown series also where all share the constants."""
    if series is None or result.points.empty or any(split_name(entry)[1] for entry in found):
        return
    there = [str(name) for name in result.points["series"].unique()]
    if series not in there:
        raise UsageError(
            f"--series {series}: the fit has no such series, and one set of constants for all: "
            f"{joined(there)}."
        )


def _check_named(name: str, value: float, found: Estimate) -> None:
    """Refuse a value of the user's that the fit contradicts."""
    if found.value is not None:
        raise UsageError(
            f"--fix {name}={value:g}: the fit has {name} = {found.value:g} ({found.status}). An export does "
            "not replace what a fit has: fit again with it, or leave it out."
        )
    low, high = found.interval95
    if value < low or value > high:
        raise UsageError(
            f"--fix {name}={value:g}: the data leave {name} from {low:.3g} to {high:.3g} (95 %). Name a "
            "value within that, or fit again with yours."
        )


def _check_kappa(result: FitResult, values: Mapping[str, float], series: str | None) -> None:
    """Refuse named values whose mu (1 + e_n) the data contradict: sliding impacts know that product alone."""
    kappa = result.derived.get("kappa")
    found = kappa.get(series or "") if isinstance(kappa, Mapping) else kappa
    if not isinstance(found, Estimate):
        return
    low, high = found.interval95
    e_n, given = values["e_n"], values["mu"] * (1.0 + values["e_n"])
    if given < low or given > high:
        raise UsageError(
            f"The data leave kappa = mu (1 + e_n) from {low:.3g} to {high:.3g} (95 %), and the values named "
            f"give {given:.3g}: with e_n = {e_n:g} name a mu from {low / (1.0 + e_n):.3g} to "
            f"{high / (1.0 + e_n):.3g}."
        )


def _series(found: Mapping[str, object], name: str, series: str | None) -> str:
    """Series in the entry of a constant; empty where all share it."""
    labels = [split_name(entry)[1] for entry in found if split_name(entry)[0] == name]
    if labels == [""]:
        return ""
    if series in labels:
        return str(series)
    asked = "" if series is None else f"There is no series '{series}'. "
    raise UsageError(f"{asked}{name} is separate by series: name one with --series, of {joined(labels)}.")


def _number(name: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
        raise UsageError(f"--fix {name}: {value!r} is not a number.")
    if name == "e_n" and not 0.0 <= value <= 1.0:
        raise UsageError(f"--fix {name}={value:g}: it must lie between 0 and 1.")
    if name == "mu" and value < 0.0:
        raise UsageError(f"--fix {name}={value:g}: it must be 0 or more.")
    return float(value)
