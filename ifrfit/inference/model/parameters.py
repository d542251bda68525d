"""The parameters of a fit: their bounds, what is fixed or known before, and their entries by series."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ifrfit.errors import UsageError
from ifrfit.inference.diagnostics.thresholds import HALF
from ifrfit.inference.model.entry_names import entry_name, quantity_of
from ifrfit.inference.model.prior_laws import ShapedLaw
from ifrfit.inference.model.ties import Ties

Array = NDArray[np.float64]
Index = NDArray[np.intp]

PRIOR_MU = 2.0  # upper end of the default prior of mu; matters only where the data do not determine mu


@dataclass(frozen=True)
class Domain:
    """Values that a quantity may have, and how far its default prior reaches.

    Attributes
    ----------
    lower, upper : float
        The upper end may be infinite.
    prior_upper : float
        Upper end of the default prior, uniform from `lower` on; finite.
    passive_sd : float or None
        Standard deviation of the default prior over the passive domain, where bounds of the user stand in its
        place.
    """

    lower: float
    upper: float
    prior_upper: float
    passive_sd: float | None = None

    @property
    def prior_sd(self) -> float:
        """Standard deviation of the default prior."""
        return (self.prior_upper - self.lower) / math.sqrt(12.0)


def _prior_upper(lower: float, upper: float) -> float:
    """Upper end of the default prior over a domain, finite."""
    return upper if math.isfinite(upper) else max(PRIOR_MU, 2.0 * lower)


@dataclass(frozen=True)
class Parameter:
    """One parameter of a fit: a constant of the closure.

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
    passive : (float, float) or None
        The passive domain, where bounds of the user stand in its place.
    shape : ShapedLaw or None
        The law of the prior, where it is neither normal nor uniform; `prior` then has its mean and sd.
    ties : tuple of (str, str)
        Its entries that follow from others, each by its name, and the expression; those of fixed entries say
        what these were fixed by.
    """

    name: str
    lower: float
    upper: float
    fixed: float | None = None
    prior: tuple[float, float] | None = None
    separate: bool = False
    passive: tuple[float, float] | None = None
    shape: ShapedLaw | None = None
    ties: tuple[tuple[str, str], ...] = ()

    def fixed_at(self, value: float) -> Parameter:
        """The same parameter fixed at a value, without its prior."""
        return replace(self, fixed=value, prior=None, shape=None)

    @property
    def ends(self) -> tuple[float, float]:
        """Lowest and highest value that it may have: the fixed one, or the bounds."""
        return (self.lower, self.upper) if self.fixed is None else (self.fixed, self.fixed)

    @property
    def prior_upper(self) -> float:
        """Upper end of the default prior, finite."""
        return _prior_upper(self.lower, self.upper)

    @property
    def prior_sd(self) -> float:
        """Standard deviation of the default prior, uniform over the domain."""
        return (self.prior_upper - self.lower) / math.sqrt(12.0)

    @property
    def domain(self) -> Domain:
        """Values that it may have, a fixed value aside."""
        return Domain(self.lower, self.upper, self.prior_upper, self.passive_sd)

    @property
    def passive_sd(self) -> float:
        """Standard deviation of the default prior over the passive domain, whatever bounds the user set."""
        lower, upper = self.passive or (self.lower, self.upper)
        return (_prior_upper(lower, upper) - lower) / math.sqrt(12.0)

    @property
    def is_informed(self) -> bool:
        """Whether it is fixed, or a prior says more than its domain: sd below half of the default one."""
        return self.fixed is not None or (self.prior is not None and self.prior[1] < HALF * self.prior_sd)

    @property
    def is_confined(self) -> bool:
        """Whether bounds of the user leave less than half of the passive domain."""
        return self.fixed is None and self.prior_sd < HALF * self.passive_sd


_NONE = Parameter("", 0.0, 0.0, fixed=0.0)  # closure F has no constant of its own


@dataclass(frozen=True)
class Kappa:
    """kappa = mu (1 + e_n) of a series: what tangential data determine, whatever e_n is.

    Attributes
    ----------
    name : str
        "kappa", or "kappa[SERIES]" where e_n or mu is separate; a set of one series has one kappa. Empty
        where both are fixed.
    i_e_n, i_mu : int
        Places in theta of its e_n and mu.
    e_n, mu : Parameter
        What stands there.
    """

    name: str
    i_e_n: int
    i_mu: int
    e_n: Parameter
    mu: Parameter

    def value(self, theta: Array) -> float:
        """kappa at theta, (p,)."""
        return float(theta[self.i_mu] * (1.0 + theta[self.i_e_n]))

    @property
    def domain(self) -> Domain:
        """Its domain: kappa rises with both."""
        mu, (low_e, high_e) = self.mu, self.e_n.ends
        low, high, prior = mu.lower, mu.upper, mu.prior_upper
        if mu.fixed is not None:
            low = high = prior = mu.fixed
        return Domain(low * (1.0 + low_e), high * (1.0 + high_e), prior * (1.0 + high_e))


@dataclass(frozen=True)
class ParameterSet:
    """The parameters of a problem and the entries of its vector theta.

    theta holds one entry a parameter, or one a series where the parameter is separate, fixed ones included,
    in the order of `names`.

    Attributes
    ----------
    parameters : tuple of Parameter
        e_n first, then the closure's constant if it has one, mu last.
    series : tuple of str
    fixed_entries : tuple of (str, float)
        Single entries of a separate parameter that are fixed, by name, besides what the parameters say.
    """

    parameters: tuple[Parameter, ...]
    series: tuple[str, ...]
    fixed_entries: tuple[tuple[str, float], ...] = ()

    def __iter__(self) -> Iterator[Parameter]:
        return iter(self.parameters)

    def __len__(self) -> int:
        return len(self.parameters)

    def __contains__(self, name: object) -> bool:
        return any(p.name == name for p in self.parameters)

    def __getitem__(self, name: str) -> Parameter:
        """The parameter of this name.

        Raises
        ------
        KeyError
            If there is none.
        """
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        raise KeyError(name)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Name of each entry of theta: "mu", or "mu[series]" where the parameter is separate."""
        return tuple(
            entry_name(p.name, s) for p in self.parameters for s in (self.series if p.separate else ("",))
        )

    @cached_property
    def entries(self) -> tuple[Parameter, ...]:
        """The parameter behind each entry of theta; a fixed entry as a fixed parameter."""
        fixed = dict(self.fixed_entries)
        each = (p for p in self.parameters for _ in (self.series if p.separate else ("",)))
        return tuple(
            p.fixed_at(fixed[name]) if name in fixed else p for name, p in zip(self.names, each, strict=True)
        )

    @cached_property
    def free(self) -> NDArray[np.bool_]:
        """Which entries of theta are not fixed, (p,)."""
        free = np.array([p.fixed is None for p in self.entries]) & ~self.ties.tied
        free.flags.writeable = False
        return free

    @cached_property
    def ties(self) -> Ties:
        """Entries that follow from others, and are not fixed by that."""
        fixed = {name for name, p in zip(self.names, self.entries, strict=True) if p.fixed is not None}
        declared = {name: text for p in self.parameters for name, text in p.ties}
        return Ties(self.names, {name: text for name, text in declared.items() if name not in fixed})

    @property
    def is_tied(self) -> bool:
        """Whether any entry follows from others."""
        return bool(self.ties.expressions)

    @property
    def asked(self) -> tuple[Parameter, ...]:
        """The parameters as they were asked for: what a tie to fixed ones fixed is tied."""
        return tuple(replace(p, fixed=None) if p.name in dict(p.ties) else p for p in self.parameters)

    def with_ties_checked(self) -> ParameterSet:
        """The same set, in which entries that follow from fixed ones alone are fixed.

        Raises
        ------
        UsageError
            For ties that contradict, that name no entry, or that lead out of the domain.
        """
        ties = Ties(self.names, {name: text for p in self.parameters for name, text in p.ties})
        if not ties.expressions:
            return self
        pairs = list(zip(self.names, self.entries, strict=True))
        fixed = [name for name, entry in pairs if entry.fixed is not None]
        ties.check(fixed, [name for name, entry in pairs if entry.prior is not None])
        moving = ties.following(self.free_names)
        theta, found = ties.applied(self.fixed[None])[0], {}
        for (name, entry), value in zip(pairs, theta.tolist(), strict=True):
            if name not in ties.expressions or name in moving:
                continue
            if not entry.lower <= value <= entry.upper:
                what = "has no value" if math.isnan(value) else f"is {value:g}"
                raise UsageError(
                    f"--tie '{name}={ties.expressions[name]}': {what} at what is fixed, and the domain is "
                    f"[{entry.lower:g}, {entry.upper:g}]. Mend the expression, or widen the domain with "
                    f"--bounds {quantity_of(name)}=LO,HI."
                )
            found[name] = value
        return self.with_fixed(found)

    @property
    def tied_names(self) -> tuple[str, ...]:
        """Names of the entries of theta that follow from others."""
        return tuple(self.ties.expressions)

    @property
    def varied_names(self) -> tuple[str, ...]:
        """Names of the tied entries that follow from free ones, and not from fixed ones alone."""
        return self.ties.following(self.free_names)

    @property
    def moving_names(self) -> tuple[str, ...]:
        """Names of the entries of theta that are not fixed, tied ones among them."""
        return tuple(name for name, one in zip(self.names, self.entries, strict=True) if one.fixed is None)

    def tied_draws(self, draws: Mapping[str, Array]) -> dict[str, Array]:
        """Draws of the tied entries, from those of the free ones by name, each (m,)."""
        if not self.is_tied:
            return {}
        theta = self.theta(np.column_stack([draws[name] for name in self.free_names]))
        return {name: theta[:, self.names.index(name)] for name in self.tied_names}

    def ties_inside(self, theta: Array) -> NDArray[np.bool_]:
        """Whether every tied entry of theta, (m, p), lies in its domain, (m,)."""
        inside = np.ones(theta.shape[0], dtype=bool)
        for place in np.flatnonzero(self.ties.tied).tolist():
            own = self.entries[place]
            inside &= (theta[:, place] >= own.lower) & (theta[:, place] <= own.upper)
        return inside

    def by_free(self, theta: Array) -> Array:
        """Derivative of theta, (p,), by its free entries, (p, k)."""
        return self.ties.slopes(theta, self.free)

    @property
    def free_names(self) -> tuple[str, ...]:
        """Names of the entries of theta that are not fixed."""
        return tuple(name for name, free in zip(self.names, self.free, strict=True) if free)

    @cached_property
    def positions(self) -> Mapping[str, Index]:
        """Places in theta of each parameter by its name, one a series, (n_series,)."""
        places, start, n = {}, 0, len(self.series)
        for p in self.parameters:
            own = start + (np.arange(n) if p.separate else np.zeros(n, dtype=np.intp))
            own.flags.writeable = False
            places[p.name] = own
            start += n if p.separate else 1
        return places

    @cached_property
    def constants(self) -> tuple[Parameter, Parameter, Parameter]:
        """e_n, the closure's own constant and mu as they were asked for, whatever is fixed in one series."""
        return _three(self.parameters)

    @cached_property
    def constants_of_all(self) -> tuple[Parameter, Parameter, Parameter]:
        """e_n, the closure's own constant and mu of all rows: fixed where they are in the only series."""
        return self.constants if len(self.series) > 1 else _three(self.entries)

    def entry(self, constant: Parameter, number: int) -> Parameter:
        """A constant as it is in one series: fixed where its entry of theta is."""
        places = self.positions.get(constant.name)
        return constant if places is None else self.entries[places[number]]

    @cached_property
    def sources(self) -> tuple[Index, Index]:
        """Series and column of each entry of theta among the (e_n, c, mu) of every series, (p,) each."""
        column = {p.name: 1 for p in self.parameters} | {"e_n": 0, "mu": 2}
        each = [
            (number, column[p.name])
            for p in self.parameters
            for number in (range(len(self.series)) if p.separate else (0,))
        ]
        series, which = np.array(each, dtype=np.intp).T
        return series, which

    @property
    def differ_by_series(self) -> bool:
        """Whether series have constants of their own."""
        return len(self.series) > 1 and any(p.separate for p in self.parameters)

    @cached_property
    def kappas(self) -> tuple[Kappa, ...]:
        """kappa of each series."""
        found = []
        for number in range(len(self.series)):
            i_e_n, i_mu = int(self.positions["e_n"][number]), int(self.positions["mu"][number])
            e_n, mu = self.entries[i_e_n], self.entries[i_mu]
            free = [x for x in (e_n, mu) if x.fixed is None]
            is_separate = len(self.series) > 1 and any(x.separate for x in free)
            name = entry_name("kappa", self.series[number] if is_separate else "") if free else ""
            found.append(Kappa(name, i_e_n, i_mu, e_n, mu))
        return tuple(found)

    @cached_property
    def kappa_places(self) -> tuple[tuple[int, int], ...]:
        """Places in theta of each mu in whose place kappa can stand, and of its e_n.

        None where one mu goes with several e_n.
        """
        pairs = sorted({(kappa.i_mu, kappa.i_e_n) for kappa in self.kappas})
        return tuple(pairs) if len({i_mu for i_mu, _ in pairs}) == len(pairs) else ()

    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of the entries of theta, (p,) each."""
        return self._bounds

    @cached_property
    def _bounds(self) -> tuple[Array, Array]:
        lower, upper = np.array([(p.lower, p.upper) for p in self.entries]).reshape(-1, 2).T.copy()
        lower.flags.writeable = upper.flags.writeable = False
        return lower, upper

    @cached_property
    def prior_sd(self) -> Array:
        """Standard deviation of the default prior of each entry of theta, (p,)."""
        return np.array([p.prior_sd for p in self.entries])

    @cached_property
    def priors(self) -> tuple[Index, Array, Array]:
        """Places in theta of what is known before, with mean and sd, (k,) each."""
        known = [(i, *each.prior) for i, each in enumerate(self.entries) if each.prior is not None]
        place, mean, sd = np.array(known).reshape(-1, 3).T
        return place.astype(np.intp), mean, sd

    def prior_residuals(self, theta: Array) -> Array:
        """Standardised distance of each entry with a prior from the prior's mean, (..., p) to (..., k)."""
        place, mean, sd = self.priors
        return np.asarray((theta[..., place] - mean) / sd)

    @cached_property
    def fixed(self) -> Array:
        """Fixed value of each entry of theta, (p,); 0 of those that are free."""
        return np.array([0.0 if p.fixed is None else p.fixed for p in self.entries])

    @cached_property
    def free_places(self) -> Index:
        """Place of each entry of theta among the free ones, (p,); of fixed ones without meaning."""
        return np.asarray(np.cumsum(self.free) - 1)

    def theta(self, free: Array) -> Array:
        """Entries of theta, fixed ones included, (m, p), from the free ones, (m, k)."""
        theta = np.tile(self.fixed, (free.shape[0], 1))
        theta[:, self.free] = free
        return self.ties.applied(theta) if self.is_tied else theta

    @cached_property
    def free_kappas(self) -> tuple[tuple[int, int | None, float], ...]:
        """Of each free mu in whose place kappa can stand: its place among the free entries, and its e_n.

        Of e_n the place, None if it is fixed, and the fixed value.
        """
        found: list[tuple[int, int | None, float]] = []
        for mu, e_n in self.kappa_places:
            if self.free[mu] and not self.ties.tied[e_n]:
                value = self.entries[e_n].fixed
                own = (int(self.free_places[e_n]), 0.0) if value is None else (None, value)
                found.append((int(self.free_places[mu]), *own))
        return tuple(found)

    def with_parameters(self, parameters: Iterable[Parameter]) -> ParameterSet:
        """The same set with other parameters in the place of those of the same names."""
        new = {p.name: p for p in parameters}
        unknown = new.keys() - {p.name for p in self.parameters}
        if unknown:
            raise KeyError(", ".join(sorted(unknown)))
        return replace(self, parameters=tuple(new.get(p.name, p) for p in self.parameters))

    def of_series(self, number: int) -> ParameterSet:
        """Parameters of one series alone: none is separate."""
        name = self.series[number]
        shared = tuple(replace(p, separate=False) for p in self.parameters)
        own = {entry_name(p.name, name): p.name for p in self.parameters if p.separate}
        fixed = {own[entry]: value for entry, value in self.fixed_entries if entry in own}
        return ParameterSet(shared, (name,)).with_fixed(fixed)

    def with_fixed(self, values: Mapping[str, float]) -> ParameterSet:
        """The same set with parameters fixed at values, without their priors.

        Parameters
        ----------
        values : mapping of str to float
            By the name of a parameter, or of one entry of a separate one.
        """
        whole = [self[name].fixed_at(x) for name, x in values.items() if name in self]
        entries = {name: x for name, x in values.items() if name not in self}
        unknown = entries.keys() - set(self.names)
        if unknown:
            raise KeyError(", ".join(sorted(unknown)))
        fixed = tuple((dict(self.fixed_entries) | entries).items())
        return replace(self.with_parameters(whole), fixed_entries=fixed)


def _three(parameters: Sequence[Parameter]) -> tuple[Parameter, Parameter, Parameter]:
    e_n, *own, mu = parameters
    return e_n, own[0] if own else _NONE, mu
