"""The question of a fit: which rows, which closure, which parameters, what noise and errors."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ifrfit.data import Observations
from ifrfit.data.observations import word_of
from ifrfit.errors import DataError, UsageError
from ifrfit.inference.model.common_errors import CommonErrors, refuse
from ifrfit.inference.model.digest import EXCLUDED, digest
from ifrfit.inference.model.error_model import PLAIN, ErrorModel
from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.model.noise import CHOICES, POLICIES, NoiseModel, Policy, mixed_noise, noise_name
from ifrfit.inference.model.parameters import Parameter, ParameterSet
from ifrfit.inference.model.prior_specification import make_parameters
from ifrfit.inference.model.rows import OBLIQUE, Array, Index, Rows
from ifrfit.physics.angles import Incidence
from ifrfit.physics.closure import Closure
from ifrfit.physics.impulse_laws import Coefficients
from ifrfit.physics.observable import Observable

# policies that a dataset may ask for where sigma is given, the most careful first
_CAREFUL: tuple[Policy, ...] = ("unknown", "scaled")
_HALF_LOG_2PI = 0.5 * math.log(2.0 * math.pi)
OFFSET = "angle_offset"  # among the quantities of a distribution
_OBLIQUE_BY = 1e-6  # degrees from 0 and from 90 where ratios of velocities have no value
_ROUNDING = 1e-13  # relative error of a residual by rounding
_STEP = 1e-6  # of central differences of the curved observables: error about 1e-11


@dataclass(frozen=True)
class Problem:
    """Rows, closure, parameters, noise and error model. Evaluation is pure.

    The vector theta holds the entries of `parameters`, fixed ones included.

    Attributes
    ----------
    rows : Rows
    closure : Closure
    inertia_factor : float
        J of the ball, 0.4 for a solid sphere.
    parameters : ParameterSet
    noise : NoiseModel
    error_model : ErrorModel
    observations : Observations
        Where the rows come from, for what is reported of them. Nothing that is computed depends on it.
    quoted_spins : tuple of (float, float) or None
        R omega/u before impact, along and across the slip, at which the transition angle of each series is
        reported; None: that of its median row.
    common : CommonErrors or None
        Errors that rows have in common; None where all are independent. See `at_common`.
    """

    rows: Rows
    closure: Closure
    inertia_factor: float
    parameters: ParameterSet
    noise: NoiseModel
    observations: Observations = field(metadata=EXCLUDED)
    error_model: ErrorModel = PLAIN
    quoted_spins: tuple[tuple[float, float], ...] | None = field(default=None, metadata=EXCLUDED)
    common: CommonErrors | None = None

    @cached_property
    def digest(self) -> str:
        """SHA-256 of everything that the answer depends on: every field but those for what is reported.

        The closure counts with its coefficients, too, where it is bilinear.
        """
        law = self.closure.law(self.inertia_factor)
        return digest((self, law if isinstance(law, Coefficients) else None))

    @property
    def series(self) -> tuple[str, ...]:
        """Names of the series, in the order of `rows.series`."""
        return self.parameters.series

    @property
    def speeds(self) -> Array:
        """Incoming speed of each row, m/s; nan where a row states none."""
        return self.observations.table["speed_m_s"].to_numpy(dtype=float)

    @property
    def has_oblique(self) -> bool:
        """Whether any row knows the closure: one that measures neither e_n nor mu alone."""
        return self.rows.has_kind(*OBLIQUE)

    def per_row(self, theta: Array) -> tuple[Array, Array, Array]:
        """(e_n, closure constant, mu) of each row at theta, (..., p); (..., n) each."""
        shape = (*theta.shape[:-1], len(self.rows))
        e_n, c, mu = (np.broadcast_to(column, shape) for column in self._columns(theta))
        return e_n, c, mu

    def predict(self, theta: Array) -> Array:
        """Value of each row without noise.

        Parameters
        ----------
        theta : ndarray, (..., p)
            Entries as in `parameters.names`, fixed ones included.

        Returns
        -------
        ndarray, (..., n)
        """
        return self.by_parts(lambda part: part._predict(theta))

    def by_parts(self, of: Callable[[Problem], Array], axis: int = -1) -> Array:
        """What is asked of the problem, row by row along an axis; of many rows, some of them at a time."""
        blocks = self.rows.blocks
        if len(blocks) == 1:
            return of(self)
        return np.concatenate([of(replace(self, rows=rows)) for _, rows in blocks], axis=axis)

    def _predict(self, theta: Array) -> Array:
        columns = self._columns(theta)
        law = self.closure.law(self.inertia_factor)
        shape = np.broadcast_shapes(theta.shape[:-1], self.rows.tau.shape[:-1])
        out, nothing = np.empty((*shape, len(self.rows))), np.zeros(1)
        for observable, at, incidence in self.rows.places:
            e_n, c, mu = (x if x.shape[-1] == 1 else x[..., at] for x in columns)
            # rows that do not know the closure have no impulse to work out
            k = law.impulse(incidence, c, mu * (1.0 + e_n))[0] if observable.kind in OBLIQUE else nothing
            out[..., at] = observable.by_form(incidence, k, e_n, mu, self.inertia_factor)
        return out

    def residual(self, theta: Array) -> Array:
        """Measured value less `predict` of each row, (..., n), at theta, (..., p)."""
        return np.asarray(self.rows.value - self.predict(theta))

    def rounding_variance(self, rows: Index) -> float:
        """Mean square of residuals of some rows, over their base, that rounding may leave."""
        scaled = self.rows.value[rows] / self.noise.base[rows]
        return (_ROUNDING * (float(np.abs(scaled).max()) + 1.0)) ** 2

    def _columns(self, theta: Array) -> tuple[Array, Array, Array]:
        """(e_n, closure constant, mu), each (..., n), or (..., 1) where all rows share it."""
        places = self.parameters.positions

        def column(name: str | None) -> Array:
            if name is None:
                return np.zeros((*theta.shape[:-1], 1))
            return theta[..., places[name][self.rows.series if self.parameters[name].separate else [0]]]

        return column("e_n"), column(self.closure.constant), column("mu")

    def impulse(self, e_n: Array, c: Array, mu: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Impulse factor k of each row, and whether it sticks."""
        law = self.closure.law(self.inertia_factor)
        k, sticks = law.impulse(self.rows.incidence, c, mu * (1.0 + e_n))
        return k, sticks.astype(bool)

    def values_with(self, k: Array, e_n: Array, mu: Array) -> Array:
        """Value of each row, (..., n), given its impulse factor k, (..., n); e_n and mu broadcast to it."""
        k = np.broadcast_to(k, (*k.shape[:-1], len(self.rows)))
        out = np.empty(k.shape)
        for observable, at, incidence in self.rows.places:
            own_e_n, own_mu = (x if x.shape[-1] == 1 else x[..., at] for x in (e_n, mu))
            out[..., at] = observable.by_form(incidence, k[..., at], own_e_n, own_mu, self.inertia_factor)
        return out

    def jacobian(self, theta: Array) -> Array:
        """Derivative of each row's value by each entry of theta, in the regimes at theta.

        Parameters
        ----------
        theta : ndarray, (..., p)

        Returns
        -------
        ndarray, (..., n, p)
        """
        return self.by_parts(lambda part: part._jacobian(theta), -2)

    def _jacobian(self, theta: Array) -> Array:
        shape = np.broadcast_shapes(theta.shape[:-1], self.rows.tau.shape[:-1])
        out = np.zeros((*shape, len(self.rows), len(self.parameters.names)))
        columns, own = self._columns(theta), self.closure.constant
        for observable, at, incidence in self.rows.places:
            constants = tuple(x if x.shape[-1] == 1 else x[..., at] for x in columns)
            by = self._slopes(observable, incidence, *constants)
            row = np.arange(at.start, at.stop, at.step) if isinstance(at, slice) else at
            for name, slope in zip(("e_n", own, "mu"), by, strict=True):
                if name is None or slope is None:
                    continue
                places = self.parameters.positions[name]
                if self.parameters[name].separate:
                    out[..., row, places[self.rows.series[row]]] += slope
                else:
                    out[..., at, places[0]] += slope
        return out

    def _slopes(
        self, observable: Observable, incidence: Incidence, e_n: Array, c: Array, mu: Array
    ) -> tuple[Array | None, Array | None, Array | None]:
        """Derivatives of an observable by e_n, the closure's constant and mu; None for nothing."""

        def value(k: Array, e_n: Array) -> Array:
            return observable.by_form(incidence, k, e_n, mu, self.inertia_factor)

        if observable.kind == "friction":
            return None, None, np.ones(1)
        law = self.closure.law(self.inertia_factor)
        is_oblique = observable.kind in OBLIQUE
        k = law.impulse(incidence, c, mu * (1.0 + e_n))[0] if is_oblique else np.zeros(1)
        by_e = (value(k, e_n + _STEP) - value(k, e_n - _STEP)) / (2.0 * _STEP)
        if not is_oblique:
            return by_e, None, None
        by_k = (value(k + _STEP, e_n) - value(k - _STEP, e_n)) / (2.0 * _STEP)
        by_c, by_kappa = law.slopes(incidence, c, mu * (1.0 + e_n))
        return by_e + by_k * mu * by_kappa, by_k * by_c, by_k * (1.0 + e_n) * by_kappa

    def free_jacobian(self, theta: Array) -> Array:
        """Derivative of the predicted values by the free entries of theta, (n, k)."""
        if self.parameters.is_tied:
            return np.asarray(self.jacobian(theta) @ self.parameters.by_free(theta))
        return np.asarray(self.jacobian(theta)[:, self.parameters.free])

    @cached_property
    def free_parameters(self) -> tuple[FreeParameter, ...]:
        """Domain and prior of each free entry of theta."""
        each = zip(self.parameters.names, self.parameters.entries, self.parameters.free, strict=True)
        return tuple(FreeParameter.of(name, entry) for name, entry, free in each if free)

    @cached_property
    def coordinates(self) -> tuple[FreeParameter, ...]:
        """Domain and prior of each unknown: free entries of theta, logarithms of noises, the angle offset."""
        noises = (
            FreeParameter(
                noise_name(group), math.log(low), math.log(high), None, -math.log(math.log(high / low))
            )
            for group, (low, high) in self.noise_bounds().items()
        )
        return (*self.free_parameters, *noises, *([] if self.offset is None else [self.offset]))

    def log_posterior(self, theta: Array, noise: Array | None = None) -> Array:
        """Log of the normalised prior times the likelihood, for who brings a sampler.

        Parameters
        ----------
        theta : ndarray, (..., p)
            Entries as in `parameters.names`, fixed ones included.
        noise : ndarray, (..., k), optional
            Unknown noises as in `noise_bounds`; needed where there are any. Their prior is uniform in the
            logarithm: the density is one over the free entries of theta and the logarithms of the noises.

        Returns
        -------
        ndarray, (...)
            -inf outside the domain.

        Raises
        ------
        UsageError
            If unknown noises are missing, where an angle offset is unknown as well, or errors are other than
            independent and Gaussian, or rows have errors in common: those need nodes about an optimum, as
            `ifrfit.inference.model.log_posterior.Density` has them.
        """
        if self.error_model.offset is not None:
            raise UsageError(
                "The angle offset is unknown, too. Take "
                "ifrfit.inference.model.log_posterior.Density(problem), or problem.at_offset(degrees)."
            )
        if not self.error_model.is_plain:
            raise UsageError(
                f"{self.error_model.option} has no density by rows. Take "
                "ifrfit.inference.model.log_posterior.Density(problem)."
            )
        if self.common is not None:
            raise UsageError(
                "Rows have errors in common. Take ifrfit.inference.model.log_posterior.Density(problem), "
                "which integrates them out, or problem.at_common(z)."
            )
        groups = self.noise_groups()
        if noise is None and groups:
            names = ", ".join(name or "a common factor" for name in groups)
            raise UsageError(f"The noise is unknown ({names}): give log_posterior the noises, too.")
        theta = np.asarray(theta, dtype=float)
        flat = theta.reshape(-1, theta.shape[-1])
        noises = np.ones((len(flat), 0)) if noise is None else np.reshape(noise, (-1, len(groups)))
        total = np.zeros(len(flat))
        points = (*flat[:, self.parameters.free].T, *np.log(noises).T)
        for each, value in zip(self.coordinates, points, strict=True):
            inside = (value >= each.lower) & (value <= each.upper)
            total = total + np.where(inside, each.log_prior(value), -np.inf)
        if self.parameters.is_tied:
            flat = self.parameters.theta(flat[:, self.parameters.free])
            total = np.where(self.parameters.ties_inside(flat), total, -np.inf)
        inside = np.isfinite(total)
        total[inside] += self.row_log_likelihood(flat[inside], noises[inside]).sum(axis=1)
        return total.reshape(theta.shape[:-1])

    def row_log_likelihood(self, theta: Array, noise: Array) -> Array:
        """Log likelihood of each row under Gaussian errors, (m, n), at theta, (m, p), and noises, (m, k)."""
        if self.common is not None:
            raise refuse("The likelihood of single rows")
        sigma = self.noise.sigma_at(noise, self.noise_groups().values())
        z = self.residual(theta) / sigma
        return np.asarray(-0.5 * z * z - np.log(sigma) - _HALF_LOG_2PI)

    def groups(self) -> Mapping[str, Index]:
        """Rows of each "series/observable"."""
        return self._groups

    @cached_property
    def _groups(self) -> Mapping[str, Index]:
        code = self.rows.series * len(self.rows.names) + self.rows.which
        found = {}
        for value in np.unique(code):
            series, which = divmod(int(value), len(self.rows.names))
            found[f"{self.series[series]}/{self.rows.names[which]}"] = np.flatnonzero(code == value)
        return found

    def noise_groups(self) -> Mapping[str, Index]:
        """Rows that share an unknown noise, by the name of the group; see `NoiseModel`."""
        return self.noise.groups(self.groups(), len(self.series))

    @cached_property
    def noise_numbers(self) -> Index:
        """Number of each row's group among the noise groups, (n,); -1 where sigma is given."""
        found = np.full(len(self.rows), -1)
        for number, rows in enumerate(self.noise_groups().values()):
            found[rows] = number
        return found

    def noise_bounds(self) -> Mapping[str, tuple[float, float]]:
        """Ends of the log-uniform prior of each unknown noise, by the name of its group."""
        return self.noise.bounds(self.rows, self.groups(), len(self.series))

    def with_parameters(self, parameters: Iterable[Parameter]) -> Problem:
        """The same question with other parameters in the place of those of the same names."""
        return replace(self, parameters=self.parameters.with_parameters(parameters))

    def with_fixed(self, values: Mapping[str, float]) -> Problem:
        """The same question with parameters, or single entries of theta, fixed at values by name."""
        return replace(self, parameters=self.parameters.with_fixed(values))

    def within_prior(self) -> Problem:
        """The same where no constant goes beyond its prior: an open mu ends where its default prior does."""
        return self.with_parameters(
            each if each.fixed is not None else replace(each, upper=FreeParameter.of(each.name, each).upper)
            for each in self.parameters
        )

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
        here = {each.name: each for each in self.parameters}
        domains = {each.name: each for each in make_parameters(self.closure, self.inertia_factor)}
        found = []
        for own in make_parameters(closure, self.inertia_factor):
            each = here.get(own.name, own)
            before = domains.get(own.name, own)
            if (each.lower, each.upper) == (before.lower, before.upper):
                each = replace(each, lower=own.lower, upper=own.upper)
            found.append(each)
        return tuple(found)

    def with_noise(self, noise: NoiseModel) -> Problem:
        """The same question under another noise."""
        return replace(self, noise=noise)

    def at_offset(self, degrees: float | Array) -> Problem:
        """The question where every impact came in at its set angle plus an offset, which is then known.

        The offset is an error of the angle between the incoming path and the normal of the wall, as of a
        turned stage. The angle of incidence is all that it changes, in rows that this angle enters: values
        measured after impact and spins stay as they are given. A camera that is turned against the wall errs
        in these as well, and is another matter.

        Parameters
        ----------
        degrees : float, or ndarray, (m, 1)
            Of several, `predict` takes one for each of m theta; nothing else takes several.
        """
        return replace(
            self, rows=self.rows.turned(degrees), error_model=replace(self.error_model, offset=None)
        )

    def at_common(self, value: Array) -> Problem:
        """The question with the errors that rows have in common known: then all others are independent.

        Values and angles of incidence are those measured less what the errors did to them. No angle is taken
        to the other side of the normal, nor below the wall.

        Parameters
        ----------
        value : ndarray, (r,)
            Of each common error, in its standard deviations.
        """
        if self.common is None:
            return self
        gamma = self.rows.gamma_deg
        true = gamma - self.common.gamma_deg @ value
        ends = np.minimum(gamma, _OBLIQUE_BY), np.maximum(gamma, 90.0 - _OBLIQUE_BY)
        rows = self.rows.turned(np.clip(true, *ends) - gamma) if self.common.turns_angles else self.rows
        corrected = replace(rows, value=self.rows.value - self.common.value @ value)
        return replace(self, rows=corrected, common=None)

    @cached_property
    def offset(self) -> FreeParameter | None:
        """The unknown offset of the set angles, degrees, with its prior; None where there is none."""
        if self.error_model.offset is None:
            return None
        low, high = self.offset_range
        return FreeParameter.of(OFFSET, Parameter(OFFSET, low, high, prior=(0.0, self.error_model.offset)))

    @cached_property
    def offset_range(self) -> tuple[float, float]:
        """Offsets, degrees, that leave every oblique impact on its side of the normal, and above the wall."""
        gamma = self.rows.gamma_deg[self.rows.has_angle]
        low = _OBLIQUE_BY - float(gamma[gamma > 0.0].min(initial=90.0))
        return low, 90.0 - float(gamma.max(initial=0.0)) - _OBLIQUE_BY

    @cached_property
    def by_series(self) -> tuple[Problem, ...]:
        """Each series alone, with constants of its own."""
        found = []
        for number in range(len(self.series)):
            part = self.with_rows(np.flatnonzero(self.rows.series == number))
            rows = replace(part.rows, series=np.zeros(len(part.rows), dtype=np.intp))
            found.append(replace(part, rows=rows, parameters=self.parameters.of_series(number)))
        return tuple(found)

    def with_rows(self, rows: Index) -> Problem:
        """The same question of some of the rows."""
        table = self.observations.table.iloc[rows]
        return replace(
            self,
            observations=replace(self.observations, table=table),
            rows=self.rows.take(rows),
            noise=self.noise.take(rows),
            common=None if self.common is None else self.common.take(rows),
        )


def make_problem(
    observations: Observations,
    closure: Closure,
    inertia_factor: float,
    parameters: Iterable[Parameter],
    noise: str | None,
    *,
    separate_noise: bool = False,
    common: bool = True,
) -> Problem:
    """Turn selected observations into a problem.

    Parameters
    ----------
    observations : Observations
    closure : Closure
    inertia_factor : float
    parameters : iterable of Parameter
    noise : {"known", "scaled", "unknown", "mixed"} or None
        mixed: known for each observable of a series where all rows have a sigma, else unknown. None: the most
        careful policy that a dataset states, as far as sigma is given for it; mixed where none states one.
    separate_noise : bool
        Whether each series has unknown noises of its own.
    common : bool
        Whether errors that rows of the table have in common count; else all are independent.

    Raises
    ------
    DataError
        If the policy needs a sigma that a row lacks.
    UsageError
        For an unknown policy.
    """
    table = observations.stored
    if len(table) == 0:
        raise DataError("No rows are left to fit.")
    rows, series = Rows.of(table)
    sigma = table["sigma"].to_numpy(dtype=float)
    policy = noise_policy(observations, sigma, noise)
    model = NoiseModel(policy, sigma, separate=separate_noise)
    problem = Problem(
        rows,
        closure,
        inertia_factor,
        ParameterSet(tuple(parameters), series).with_ties_checked(),
        model,
        observations,
        common=CommonErrors.of(table) if common else None,
    )
    if policy == "mixed":
        problem = problem.with_noise(mixed_noise(sigma, problem.groups(), separate=separate_noise))
    return problem


def noise_policy(observations: Observations, sigma: Array, noise: str | None) -> Policy:
    """What sigma means: as chosen, or as the data's own descriptors and their sigma have it.

    Raises
    ------
    DataError, UsageError
        As `make_problem`.
    """
    has_all = bool(np.isfinite(sigma).all())
    if noise is None:
        stated = {s.descriptor.noise for s in observations.sources if s.descriptor and s.descriptor.noise}
        # where sources differ the most careful policy holds: a sigma that is not the whole noise never is
        careful: Policy = next((policy for policy in _CAREFUL if policy in stated), "mixed")
        return careful if careful != "scaled" or has_all else "unknown"
    policy = next((policy for policy in POLICIES if policy == noise), None)
    if policy is None:
        raise UsageError(f"--noise {noise}: choose {CHOICES}.")
    if policy in ("known", "scaled") and not has_all:
        row = observations.table[~np.isfinite(sigma)].iloc[0]
        word = word_of(observations.sources, row["source"])
        raise DataError(
            f"{row['source']}, {word} {row['row']}: no sigma, but --noise {noise} needs one in every row. "
            "Add it, or use --noise mixed, which takes sigma as far as it is given, or --noise unknown."
        )
    return policy
