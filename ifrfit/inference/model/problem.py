"""A fit's question: which rows, which closure, which constants, what noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ifrfit.data import Observations
from ifrfit.errors import DataError, UsageError
from ifrfit.inference.model.error_model import PLAIN, Scatter
from ifrfit.inference.model.parameters import Constant
from ifrfit.physics.angles import Incidence
from ifrfit.physics.closures import Closure
from ifrfit.physics.observables import OBSERVABLES, get_observable
from ifrfit.physics.rebound import rebound_with

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_STEP = 1e-6  # of central differences of the curved observables: error about 1e-11


@dataclass(frozen=True)
class RowModel:
    """What each row measures, as numbers.

    Attributes
    ----------
    incidence : Incidence
    tau : ndarray
        |U_t|/U_n.
    names : tuple of str
        The observables that occur.
    which : ndarray of int
        Observable of each row, an index into `names`.
    series : ndarray of int
        Series of each row.
    value : ndarray
    """

    incidence: Incidence
    tau: Array
    names: tuple[str, ...]
    which: Index
    series: Index
    value: Array

    def rows_of(self, name: str) -> Index:
        """Rows of one observable."""
        if len(self.names) == 1:
            return np.arange(self.which.size)
        return np.flatnonzero(self.which == self.names.index(name))

    def take(self, rows: Index) -> RowModel:
        """The same for some rows."""
        if rows.size == self.tau.size and bool((np.diff(rows) == 1).all()):
            return self
        i = self.incidence
        incidence = Incidence(
            i.sine[rows], i.cosine[rows], i.spin_x[rows], i.spin_y[rows], i.slip_x[rows], i.slip_y[rows]
        )
        return RowModel(
            incidence, self.tau[rows], self.names, self.which[rows], self.series[rows], self.value[rows]
        )


@dataclass(frozen=True)
class Problem:
    """Observations, closure, constants and noise policy. Evaluation is pure.

    The vector theta holds one entry a constant, or one a series where the constant is separate, fixed ones
    included; `names` labels the entries.
    """

    observations: Observations
    closure: Closure
    inertia_factor: float
    constants: tuple[Constant, ...]
    series: tuple[str, ...]
    rows: RowModel
    sigma: Array  # as given; nan where not
    noise: str  # known, scaled or unknown
    noise_bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # of its prior, if chosen
    scatter: Scatter = PLAIN

    @property
    def names(self) -> tuple[str, ...]:
        """Label of each entry of theta."""
        return tuple(
            f"{c.name}[{s}]" if c.separate else c.name
            for c in self.constants
            for s in (self.series if c.separate else ("",))
        )

    def entries(self) -> tuple[Constant, ...]:
        """Constant behind each entry of theta."""
        return tuple(c for c in self.constants for _ in (self.series if c.separate else ("",)))

    @property
    def free(self) -> NDArray[np.bool_]:
        """Which entries of theta are not fixed."""
        return np.array([c.fixed is None for c in self.entries()])

    @property
    def has_oblique(self) -> bool:
        """Whether any row knows the closure: one that measures neither e_n nor mu alone."""
        return any(OBSERVABLES[name].kind in ("tangential", "curved") for name in self.rows.names)

    def positions(self) -> Mapping[str, Index]:
        """Constant's name to its place in theta, one a series."""
        places, start = {}, 0
        for c in self.constants:
            n = len(self.series)
            places[c.name] = start + (np.arange(n) if c.separate else np.zeros(n, dtype=np.intp))
            start += n if c.separate else 1
        return places

    def per_row(self, theta: Array) -> tuple[Array, Array, Array]:
        """(e_n, closure constant, mu) of each row."""
        places = self.positions()
        series = self.rows.series
        c = theta[places[self.closure.constant]][series] if self.closure.constant else np.zeros(series.size)
        return theta[places["e_n"]][series], c, theta[places["mu"]][series]

    def fitted(self, theta: Array) -> Array:
        """Value of each row at theta."""
        e_n, c, mu = self.per_row(theta)
        k, _ = self.impulse(e_n, c, mu)
        return self.values_with(k, e_n, mu)

    def impulse(self, e_n: Array, c: Array, mu: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Impulse factor k of each row, and whether it sticks."""
        law = self.closure.law(self.inertia_factor)
        k, sticks = law.impulse(self.rows.incidence, c, mu * (1.0 + e_n))
        return k, sticks.astype(bool)

    def values_with(self, k: Array, e_n: Array, mu: Array) -> Array:
        """Value of each row, given its impulse factor."""
        out = np.empty(k.size)
        for name in self.rows.names:
            at = self.rows.rows_of(name)
            part = self.rows.take(at)
            state = rebound_with(
                part.incidence, k[at], np.zeros(at.size, dtype=bool), e_n[at], self.inertia_factor
            )
            out[at] = get_observable(name).value(state, mu[at])
        return out

    def jacobian(self, theta: Array) -> Array:
        """Derivative of each row's value by each entry of theta, in the regimes at theta, (n, p)."""
        e_n, c, mu = self.per_row(theta)
        k, _ = self.impulse(e_n, c, mu)
        by_k = self._difference(k, e_n, mu, 1.0, 0.0)
        by_e = self._difference(k, e_n, mu, 0.0, 1.0)
        law = self.closure.law(self.inertia_factor)
        by_c, by_kappa = law.slopes(self.rows.incidence, c, mu * (1.0 + e_n))
        is_mu = np.array([OBSERVABLES[n].kind == "friction" for n in self.rows.names])[self.rows.which]
        columns = {
            "e_n": by_e + by_k * mu * by_kappa,
            "mu": np.where(is_mu, 1.0, by_k * (1.0 + e_n) * by_kappa),
        }
        if self.closure.constant:
            columns[self.closure.constant] = by_k * by_c
        out = np.zeros((k.size, len(self.names)))
        for name, places in self.positions().items():
            out[np.arange(k.size), places[self.rows.series]] += columns[name]
        return out

    def _difference(self, k: Array, e_n: Array, mu: Array, dk: float, de: float) -> Array:
        up = self.values_with(k + _STEP * dk, e_n + _STEP * de, mu)
        down = self.values_with(k - _STEP * dk, e_n - _STEP * de, mu)
        return (up - down) / (2.0 * _STEP)

    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of the entries of theta."""
        entries = self.entries()
        return np.array([c.lower for c in entries]), np.array([c.upper for c in entries])

    def prior_residuals(self, theta: Array) -> Array:
        """Standardised distance of each entry with a prior from the prior's mean."""
        return np.array(
            [
                (value - c.prior[0]) / c.prior[1]
                for c, value in zip(self.entries(), theta, strict=True)
                if c.prior is not None
            ]
        )

    def with_rows(self, rows: Index) -> Problem:
        """The same question of some of the rows."""
        table = self.observations.table.iloc[rows]
        return replace(
            self,
            observations=replace(self.observations, table=table),
            rows=self.rows.take(rows),
            sigma=self.sigma[rows],
        )

    def groups(self) -> dict[str, Index]:
        """Rows of each "series/observable", the groups that share an unknown noise."""
        code = self.rows.series * len(self.rows.names) + self.rows.which
        found = {}
        for value in np.unique(code):
            series, which = divmod(int(value), len(self.rows.names))
            found[f"{self.series[series]}/{self.rows.names[which]}"] = np.flatnonzero(code == value)
        return found


def make_problem(
    observations: Observations,
    closure: Closure,
    inertia_factor: float,
    constants: tuple[Constant, ...],
    noise: str | None,
) -> Problem:
    """Turn selected observations into a problem.

    Parameters
    ----------
    observations : Observations
    closure : Closure
    inertia_factor : float
    constants : tuple of Constant
    noise : {"known", "scaled", "unknown"} or None
        None: unknown where a row has no sigma; else the most careful policy that a dataset states, and known
        where none states one.

    Raises
    ------
    DataError
        If the policy needs a sigma that a row lacks.
    UsageError
        For an unknown policy.
    """
    table = observations.table
    if len(table) == 0:
        raise DataError("No rows are left to fit.")
    gamma = np.nan_to_num(table["gamma_deg"].to_numpy(dtype=float))
    incidence = Incidence.of(
        gamma, table["spin_x"].to_numpy(dtype=float), table["spin_y"].to_numpy(dtype=float), degrees=True
    )
    series, series_index = _codes(table["series"])
    names, which = _codes(table["observable"])
    rows = RowModel(
        incidence, incidence.tau, names, which, series_index, table["value"].to_numpy(dtype=float)
    )
    sigma = table["sigma"].to_numpy(dtype=float)
    policy = _noise_policy(observations, sigma, noise)
    return Problem(observations, closure, inertia_factor, constants, series, rows, sigma, policy)


def _codes(column: object) -> tuple[tuple[str, ...], Index]:
    import pandas as pd

    codes, labels = pd.factorize(pd.Series(column))
    return tuple(str(label) for label in labels), np.asarray(codes, dtype=np.intp)


def _noise_policy(observations: Observations, sigma: Array, noise: str | None) -> str:
    has_all = bool(np.isfinite(sigma).all())
    if noise is None:
        stated = {s.descriptor.noise for s in observations.sources if s.descriptor and s.descriptor.noise}
        # where sources differ the most careful policy holds: a sigma that is not the whole noise never is
        careful = next((policy for policy in ("unknown", "scaled") if policy in stated), "known")
        return careful if has_all else "unknown"
    if noise not in ("known", "scaled", "unknown"):
        raise UsageError(f"--noise {noise}: choose known, scaled or unknown.")
    if noise != "unknown" and not has_all:
        row = observations.table[~np.isfinite(sigma)].iloc[0]
        raise DataError(
            f"{row['source']}, line {row['row']}: no sigma, but --noise {noise} needs one in every row. "
            "Add it, or use --noise unknown."
        )
    return noise
