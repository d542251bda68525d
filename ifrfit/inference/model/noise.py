"""The noise of the rows: given, given up to a common factor, unknown, or given for some rows alone."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.entry_names import entry_name
from ifrfit.inference.model.rows import Rows

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Bool = NDArray[np.bool_]

Policy = Literal["known", "scaled", "unknown", "mixed"]
POLICIES: tuple[Policy, ...] = get_args(Policy)
CHOICES = f"{', '.join(POLICIES[:-1])} or {POLICIES[-1]}"

_FINE, _FEWEST_READINGS = (
    1e-3,
    5,
)  # last decimal and number of readings with which a largest of 1 is no chance
_FEW = 256  # values that are looked at before all are
_DECIMALS = 6  # finest resolution taken for a value that is written with more


@dataclass(frozen=True)
class NoiseModel:
    """What is known of the size of the errors.

    Rows whose errors share an unknown size form a group, and the group's noise is a parameter: under "scaled"
    one factor on the given sigma of all rows, its group named ""; under "unknown" one sigma for each
    observable, its group named "observable" ("series/observable" where there is one series), or one for each
    series and observable, its group named "series/observable". Under "mixed" rows that have a sigma are
    known, and are in no group; the others are grouped as under "unknown".

    Attributes
    ----------
    policy : {"known", "scaled", "unknown", "mixed"}
    sigma : ndarray, (n,)
        Standard uncertainty of each row as given; nan where none is. Under "mixed" nan where it is unknown.
    prior_bounds : mapping of str to (float, float)
        Ends of the log-uniform prior of a group's noise, where they are chosen; see `bounds` for the others.
    separate : bool
        Whether an unknown noise is one of each series.
    scale : ndarray, (n,), optional
        Standard uncertainty of each row over that of one measurement, where rows stand for several; else 1.
    counts : ndarray, (n,), optional
        How many measurements each row stands for; else 1.
    """

    policy: Policy
    sigma: Array
    prior_bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    separate: bool = False
    scale: Array | None = None
    counts: Array | None = None

    def count(self, rows: Index) -> float:
        """How many measurements some rows stand for."""
        return float(rows.size if self.counts is None else self.counts[rows].sum())

    def per_measurement(self, sigma: Array, rows: Index) -> float:
        """Root mean square over measurements of the uncertainty of one, given that of each row."""
        square = sigma[rows] ** 2
        if self.scale is not None:
            square = square / self.scale[rows] ** 2
        weight = None if self.counts is None else self.counts[rows]
        return float(np.sqrt(square.mean() if weight is None else np.average(square, weights=weight)))

    @property
    def is_known(self) -> bool:
        """Whether sigma is taken as given."""
        return self.policy == "known"

    @property
    def is_scaled(self) -> bool:
        """Whether one unknown factor is common to the given sigma of all rows."""
        return self.policy == "scaled"

    @property
    def is_unknown(self) -> bool:
        """Whether each observable has an unknown sigma, and given ones are not used."""
        return self.policy == "unknown"

    @property
    def is_mixed(self) -> bool:
        """Whether some rows have a known sigma, and others an unknown one."""
        return self.policy == "mixed"

    @property
    def has_unknown(self) -> bool:
        """Whether any row has an unknown sigma, not up to a factor."""
        return self.is_unknown or self.is_mixed

    @cached_property
    def is_given(self) -> Bool:
        """Rows whose sigma is taken as given, (n,)."""
        return np.isfinite(self.sigma) if self.is_mixed else np.full(self.sigma.size, self.is_known)

    @cached_property
    def base(self) -> Array:
        """Standard uncertainty of each row up to the noise of its group, (n,): 1 where that is unknown."""
        one = np.ones(self.sigma.size) if self.scale is None else self.scale
        if self.is_mixed:
            return np.where(self.is_given, self.sigma, one)
        return one if self.is_unknown else self.sigma

    def groups(self, measured: Mapping[str, Index], n_series: int) -> Mapping[str, Index]:
        """Rows of each group with an unknown noise, by its name; empty where sigma is known.

        Parameters
        ----------
        measured : mapping of str to ndarray of int
            Rows of each "series/observable".
        n_series : int
            Of the problem, also where these rows are of fewer.
        """
        if self.is_known:
            return {}
        if self.is_scaled:
            return {"": np.arange(self.sigma.size)}
        if self.is_mixed:
            unknown = {name: rows[~self.is_given[rows]] for name, rows in measured.items()}
            measured = {name: rows for name, rows in unknown.items() if rows.size}
        return measured if self.separate or n_series == 1 else _by_observable(measured)

    def sigma_at(self, noise: Array, groups: Iterable[Index]) -> Array:
        """Standard uncertainty of each row, (m, n), or (1, n) where it is known.

        Parameters
        ----------
        noise : ndarray, (m, n_groups)
            Noise of each group.
        groups : iterable of ndarray of int
            Rows of each group, in the same order.
        """
        if self.is_known:
            return self.sigma[None, :]
        sigma = np.tile(self.base, (noise.shape[0], 1))
        for rows, own in zip(groups, noise.T, strict=True):
            sigma[:, rows] = own[:, None] * self.base[rows]
        return sigma

    def bounds(
        self, rows: Rows, measured: Mapping[str, Index], n_series: int
    ) -> Mapping[str, tuple[float, float]]:
        """Ends of the log-uniform prior of each group's noise; empty where sigma is known.

        From the resolution of the values (their last decimal, at most the sixth, over sqrt(12): what rounding
        alone leaves) to the natural scale of the observable: 1, or 90 degrees for an angle, or the largest
        value if that is larger. A common factor has the ends of sigma over the given sigma.
        """
        if self.is_known:
            return {}
        found = {}
        groups = self.groups(measured, n_series) if self.has_unknown else measured
        for name, own in groups.items():
            value = rows.value[own]
            unit = rows.observables[rows.which[own[0]]].unit
            natural = max(90.0 if unit == "deg" else 1.0, float(np.abs(value).max()))
            found[name] = (resolution(value) / math.sqrt(12.0), natural)
        if self.has_unknown:
            return found | dict(self.prior_bounds)
        low = min(found[name][0] / float(self.sigma[own].max()) for name, own in measured.items())
        high = max(found[name][1] / float(self.sigma[own].min()) for name, own in measured.items())
        return {"": (low, high)} | dict(self.prior_bounds)

    def with_bounds(self, bounds: Mapping[str, tuple[float, float]]) -> NoiseModel:
        """The same with chosen ends of the priors, by the name of the group."""
        return replace(self, prior_bounds=dict(bounds))

    def take(self, rows: Index) -> NoiseModel:
        """The same for some rows."""
        scale, counts = (None if x is None else x[rows] for x in (self.scale, self.counts))
        taken = replace(self, sigma=self.sigma[rows], scale=scale, counts=counts)
        return taken if not self.is_mixed else replace(taken, policy=_policy_of(taken.sigma))


def mixed_noise(sigma: Array, measured: Mapping[str, Index], *, separate: bool = False) -> NoiseModel:
    """The noise where sigma is used as far as it is given.

    The rows of a series and observable are known where each of them has a sigma. Where one lacks it those of
    all of them are left: what sets the row apart may be its noise.

    Parameters
    ----------
    sigma : ndarray, (n,)
        nan where none is given.
    measured : mapping of str to ndarray of int
        Rows of each "series/observable".
    separate : bool
        Whether an unknown noise is one of each series.

    Returns
    -------
    NoiseModel
        "known" or "unknown" where nothing is left to mix.
    """
    used = sigma.copy()
    for rows in measured.values():
        if not np.isfinite(sigma[rows]).all():
            used[rows] = np.nan
    policy = _policy_of(used)
    return NoiseModel(policy, used if policy == "mixed" else sigma, separate=separate)


def _policy_of(sigma: Array) -> Policy:
    given = np.isfinite(sigma)
    return "known" if given.all() else "mixed" if given.any() else "unknown"


def noise_name(group: str) -> str:
    """Name of a group's noise among the parameters: "noise", or "noise[series/observable]"."""
    return entry_name("noise", group)


def _by_observable(measured: Mapping[str, Index]) -> Mapping[str, Index]:
    """Rows of each observable, whatever the series."""
    parts: dict[str, list[Index]] = {}
    for name, rows in measured.items():
        parts.setdefault(name.rpartition("/")[2], []).append(rows)
    return {name: np.sort(np.concatenate(rows)) for name, rows in parts.items()}


def in_steps(value: Array, step: float) -> bool:
    """Whether every value is a multiple of a decimal."""
    # few tell mostly that not all are
    some = (value[:_FEW], value) if value.size > _FEW else (value,)
    numbers = (each / step for each in some)
    return all(bool((np.abs(number - np.round(number)) < 1e-7).all()) for number in numbers)


def resolution(value: Array) -> float:
    """The last decimal that any value is written with."""
    for step in 10.0 ** -np.arange(_DECIMALS):  # one at a time: there may be many values
        if in_steps(value, step):
            return float(step)
    return float(10.0**-_DECIMALS)


def normalised(value: Array) -> bool:
    """Whether readings look divided by their largest: it is 1 in every one of three decimals or more."""
    return value.size >= _FEWEST_READINGS and float(value.max()) == 1.0 and resolution(value) <= _FINE
