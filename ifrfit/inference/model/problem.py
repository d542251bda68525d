"""A fit's question: which rows, which closure, which constants, what noise."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ifrfit.data import Observations
from ifrfit.errors import DataError, UsageError
from ifrfit.inference.model.error_model import PLAIN, ErrorModel
from ifrfit.inference.model.parameters import Parameter, ParameterSet, make_parameters
from ifrfit.inference.model.rows import Array, Index, Rows
from ifrfit.physics.angles import Incidence
from ifrfit.physics.closures import Closure
from ifrfit.physics.observables import OBSERVABLES, get_observable
from ifrfit.physics.rebound import rebound_with

_STEP = 1e-6  # of central differences of the curved observables: error about 1e-11


@dataclass(frozen=True)
class Problem:
    """Observations, closure, parameters and noise policy. Evaluation is pure.

    The vector theta holds the entries of `parameters`, fixed ones included.
    """

    observations: Observations
    closure: Closure
    inertia_factor: float
    parameters: ParameterSet
    rows: Rows
    sigma: Array  # as given; nan where not
    noise: str  # known, scaled or unknown
    noise_bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # of its prior, if chosen
    error_model: ErrorModel = PLAIN

    @property
    def series(self) -> tuple[str, ...]:
        """Names of the series, in the order of `rows.series`."""
        return self.parameters.series

    @property
    def has_oblique(self) -> bool:
        """Whether any row knows the closure: one that measures neither e_n nor mu alone."""
        return any(OBSERVABLES[name].kind in ("tangential", "curved") for name in self.rows.names)

    def per_row(self, theta: Array) -> tuple[Array, Array, Array]:
        """(e_n, closure constant, mu) of each row."""
        places = self.parameters.positions
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
        out = np.zeros((k.size, len(self.parameters.names)))
        for name, places in self.parameters.positions.items():
            out[np.arange(k.size), places[self.rows.series]] += columns[name]
        return out

    def _difference(self, k: Array, e_n: Array, mu: Array, dk: float, de: float) -> Array:
        up = self.values_with(k + _STEP * dk, e_n + _STEP * de, mu)
        down = self.values_with(k - _STEP * dk, e_n - _STEP * de, mu)
        return (up - down) / (2.0 * _STEP)

    def with_parameters(self, parameters: Iterable[Parameter]) -> Problem:
        """The same question with other parameters in the place of those of the same names."""
        return replace(self, parameters=self.parameters.with_parameters(parameters))

    def with_fixed(self, values: Mapping[str, float]) -> Problem:
        """The same question with parameters, or single entries of theta, fixed at values by name."""
        return replace(self, parameters=self.parameters.with_fixed(values))

    def with_closure(self, closure: Closure, parameters: Iterable[Parameter] | None = None) -> Problem:
        """The same question for another closure.

        Parameters
        ----------
        closure : Closure
        parameters : iterable of Parameter, optional
            Of that closure. By default each constant that both closures have is fixed, known before, bounded
            and separate as it is here; bounds that are the domain of this closure become those of the other.

        Raises
        ------
        UsageError
            If the closure does not know the error model, or has an empty domain.
        """
        self.error_model.check_closure(closure)
        made = self._parameters_of(closure) if parameters is None else tuple(parameters)
        return replace(self, closure=closure, parameters=ParameterSet(made, self.series))

    def _parameters_of(self, closure: Closure) -> tuple[Parameter, ...]:
        domains = {each.name: each for each in make_parameters(self.closure, self.inertia_factor)}
        found = []
        for own in make_parameters(closure, self.inertia_factor):
            each = self.parameters[own.name] if own.name in self.parameters else own
            before = domains.get(own.name, own)
            if (each.lower, each.upper) == (before.lower, before.upper):
                each = replace(each, lower=own.lower, upper=own.upper)
            found.append(each)
        return tuple(found)

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
    parameters: Iterable[Parameter],
    noise: str | None,
) -> Problem:
    """Turn selected observations into a problem.

    Parameters
    ----------
    observations : Observations
    closure : Closure
    inertia_factor : float
    parameters : iterable of Parameter
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
    rows = Rows(incidence, incidence.tau, names, which, series_index, table["value"].to_numpy(dtype=float))
    sigma = table["sigma"].to_numpy(dtype=float)
    policy = _noise_policy(observations, sigma, noise)
    return Problem(
        observations, closure, inertia_factor, ParameterSet(tuple(parameters), series), rows, sigma, policy
    )


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
