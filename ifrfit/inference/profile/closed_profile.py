"""Profiles in closed form, where chi2 is T(c, kappa) + E(e_n).

T is a parabola along each of some lines in each cell between neighbouring transitions, so the least rise at a
value of a quantity is the least of some parabolas between two ends: section 8 of docs/theory/certificate.md.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ifrfit.inference.optimize.optimum import Array
from ifrfit.inference.optimize.piecewise_profile import BoundedParabolas
from ifrfit.inference.profile.objective import Misfit
from ifrfit.inference.profile.searched_profile import Constraint
from ifrfit.inference.profile.separable_sums import SeparableSums

Profile = Callable[[Array], Array]

_AT_ONCE = 300_000  # parabolas


def closed_profile(misfit: Misfit, constraint: Constraint) -> Profile | None:
    """Least rise at values of a quantity, (n,) to (n,); None where only a search can tell.

    Parameters
    ----------
    misfit : Misfit
    constraint : Constraint
        What the quantity leaves free.
    """
    parameters = misfit.problem.parameters
    if constraint.mu is None:
        assert constraint.place is not None
        name, places = parameters.entries[constraint.place].name, [constraint.place]
    else:
        name = "kappa" if constraint.mu.i_c is None else "transition"
        places = [constraint.mu.i_mu, constraint.mu.i_e_n]
    table = np.array(list(parameters.positions.values()))
    number = int(np.flatnonzero(np.isin(table, places).sum(axis=0) == len(places))[0])
    separable = SeparableMisfit.of(misfit, number)
    if separable is None:
        return None
    if name == "e_n":
        return lambda x: separable.of_e_n(constraint.value_at(x))
    of = {"mu": separable.of_mu, "kappa": separable.of_kappa, "transition": separable.of_transition}
    return of.get(name, separable.of_c) if separable.has_form_of(name) else None


@dataclass(frozen=True)
class SeparableMisfit:
    """The rise of a misfit as a function of T and E.

    Attributes
    ----------
    misfit : Misfit
    sums : SeparableSums
    groups : tuple of (int or None)
        Number of the unknown noise of T, and of E; None where it is known.
    rest : float
        chi2 of the rows of other series.
    """

    misfit: Misfit
    sums: SeparableSums
    groups: tuple[int | None, int | None]
    rest: float

    @classmethod
    def of(cls, misfit: Misfit, number: int) -> SeparableMisfit | None:
        """For the constants of a series; None where the rise is no function of T and E."""
        problem, search = misfit.problem, misfit.search
        if len(misfit.modes) > 1:
            return None
        sums = misfit.separable(number)
        if sums is None:
            return None
        groups = _groups(misfit, sums)
        if groups is None:
            return None
        rest = 0.0
        if sums.rows.size < len(problem.rows):
            if search.groups:
                return None
            rest = _chi2_of_others(misfit, sums, number)
        return cls(misfit, sums, groups, rest)

    def has_form_of(self, name: str) -> bool:
        """Whether there is a closed form for a quantity."""
        sums = self.sums
        if name == "mu":
            return True
        if name == "kappa":
            return sums.mu[1] > 0.0
        # kappa is free then, whatever e_n is
        is_free = sums.group.e_n.fixed is not None or sums.mu == (0.0, np.inf)
        return sums.is_c_free and (is_free or name == "transition")

    def rises(self, tangential: Array, restitution: Array) -> Array:
        """Rise at T and E, (n,) each."""
        squares = np.zeros((tangential.size, len(self.misfit.search.groups)))
        total = np.full(tangential.size, self.rest)
        for part, group in zip((tangential, restitution), self.groups, strict=True):
            if group is None:
                total += part
            else:
                squares[:, group] += part
        return self.misfit.rises_of(np.maximum(squares, self.misfit.search.least_squares), total)

    def of_e_n(self, e_n: Array) -> Array:
        """Rise at given e_n: kappa lies between the ends of mu, times 1 + e_n."""
        low, high = self.sums.mu
        tangential = self.sums.of_kappa.least_between(low * (1.0 + e_n), high * (1.0 + e_n))
        return self.rises(tangential, self.sums.of_e_n(e_n))

    def of_kappa(self, kappa: Array) -> Array:
        """Rise at given kappa: the ends of mu limit e_n."""
        low, high = self.sums.mu
        ends = kappa / high - 1.0, kappa / low - 1.0 if low > 0.0 else np.full(kappa.size, np.inf)
        return self.rises(self.sums.of_kappa(kappa), self.sums.least_of_e_n(*ends))

    def of_c(self, c: Array) -> Array:
        """Rise at a given closure constant, where kappa is free."""
        return self.rises(self.sums.of_c(c), self._least_e_n(c.size))

    def of_transition(self, tau: Array) -> Array:
        """Rise where the transition lies at a given slip ratio, whatever bounds mu has."""
        return self.rises(self.sums.at_transition(tau), self._least_e_n(tau.size))

    def _least_e_n(self, n: int) -> Array:
        anywhere = np.full(n, np.inf)
        return self.sums.least_of_e_n(-anywhere, anywhere)

    def of_mu(self, mu: Array) -> Array:
        """Rise at given mu: kappa = mu (1 + e_n) is linear in e_n."""
        sums, (low, high) = self.sums, self.sums.ends
        if sums.restitution[0] == 0.0:  # nothing measures e_n
            tangential = sums.of_kappa.least_between(mu * (1.0 + low), mu * (1.0 + high))
            return self.rises(tangential, np.full(mu.size, sums.restitution[2]))
        step = max(1, _AT_ONCE // sums.of_kappa.pieces.a.size)
        of = self._joint if self.groups[0] == self.groups[1] else self._of_noises
        return np.concatenate([of(mu[i : i + step]) for i in range(0, mu.size, step)])

    def _joint(self, mu: Array) -> Array:
        """Rise at given mu where one noise, or none, belongs to T and E: their sum is a parabola in e_n."""
        w, r, s = self.sums.restitution
        value, _ = self.sums.along_e_n(mu).plus(w, -r, s).lowest()
        return self.rises(value.min(axis=1, initial=np.inf), np.zeros(mu.size))

    def _of_noises(self, mu: Array) -> Array:
        """Rise at given mu where T and E have different noises.

        Between the ends of a piece T and E are each least somewhere. The rise is least at one of these two
        places, or where its slope vanishes, at a root of a cubic: eq. (20). Only pieces whose least T and E
        together would be lower than what is met at the two places are looked at for roots.
        """
        own, (w, r, _) = self.sums.along_e_n(mu), self.sums.restitution
        least, at_t = own.lowest()
        at_e = np.clip(r / w, own.low, own.high)
        is_nowhere = own.low > own.high
        met = np.minimum(self._rises_along(own, at_t), self._rises_along(own, at_e))
        best = np.where(is_nowhere, np.inf, met).min(axis=1, initial=np.inf)
        bound = self._rises_of(least, self.sums.of_e_n(self.sums.e_n + at_e))
        mu_number, piece = np.nonzero(~is_nowhere & (bound <= best[:, None]))
        some = own.take((mu_number, piece))
        for d in self._stationary(some):
            np.minimum.at(best, mu_number, self._rises_along(some, np.clip(d, some.low, some.high)))
        return np.asarray(best)

    def _rises_along(self, tangential: BoundedParabolas, d: Array) -> Array:
        """Rise at e_n less that about which sums are taken."""
        return self._rises_of(tangential.at(d), self.sums.of_e_n(self.sums.e_n + d))

    def _rises_of(self, tangential: Array, restitution: Array) -> Array:
        shape = tangential.shape
        return np.reshape(self.rises(tangential.ravel(), restitution.ravel()), shape)

    def _stationary(self, own: BoundedParabolas) -> Array:
        """Where the slope of the rise vanishes, by pieces, (3, k): the roots of the cubic of eq. (20)."""
        w, r, s = self.sums.restitution
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            low, high = -own.b / own.a, r / w
            span = high - low
            p, p0, p2 = self._share(0, own.a * span**2, own.s - own.b**2 / own.a)
            q, q0, q2 = self._share(1, w * span**2, s - r * r / w)
            # p y (q0 + q2 (1 - y)^2) = q (1 - y) (p0 + p2 y^2), from the constant on
            cubic = -q * p0, p * (q0 + q2) + q * p0, -2.0 * p * q2 - q * p2, p * q2 + q * p2
            monic = np.array(np.broadcast_arrays(*cubic[:3])) / cubic[3]
        is_cubic = np.isfinite(monic).all(axis=0)
        companion = np.zeros((own.a.size, 3, 3))
        companion[:, 1, 0] = companion[:, 2, 1] = 1.0
        companion[is_cubic, :, 2] = -monic.T[is_cubic]
        y = np.linalg.eigvals(companion).real.T
        # of two equal places, or of a flat T, those that were met will do
        return np.where(is_cubic, low + np.where(is_cubic, span, 0.0) * y, high)

    def _share(
        self, part: int, unit: Array, least: Array | float
    ) -> tuple[Array | float, Array | float, float]:
        """p, p0 and p2 of the slope p y/(p0 + p2 y^2) of what a part adds, least + unit y^2."""
        group = self.groups[part]
        if group is None:
            return unit, 1.0, 0.0
        return float(self.misfit.modes[0].dof[group]), least / unit, 1.0


def _groups(misfit: Misfit, sums: SeparableSums) -> tuple[int | None, int | None] | None:
    """Number of the noise of T, and of E; None where one of them has several, or a prior beside it."""
    problem, group = misfit.problem, sums.group
    normal = group.rows.of_kind("normal")
    parts = sums.rows[~normal], sums.rows[normal]
    priors = group.c.prior is not None or group.mu.prior is not None, group.e_n.prior is not None
    number = np.full(len(problem.rows), -1)
    for i, rows in enumerate(misfit.search.groups):
        number[rows] = i
    found = []
    for rows, has_prior in zip(parts, priors, strict=True):
        own = set(number[rows].tolist())
        if len(own) > 1 or (has_prior and own - {-1}):
            return None
        found.append(own.pop() if own else -1)
    first, second = (None if one == -1 else one for one in found)
    return first, second


def _chi2_of_others(misfit: Misfit, sums: SeparableSums, number: int) -> float:
    """chi2 of the rows and the priors of other series at the optimum."""
    problem, theta = misfit.problem, misfit.fit.optimum.theta
    z = misfit.search.residuals(theta[None])[0]
    z[sums.rows] = 0.0
    place, *_ = problem.parameters.priors
    own = np.isin(place, [places[number] for places in problem.parameters.positions.values()])
    priors = problem.parameters.prior_residuals(theta)[~own]
    return float(z @ z + priors @ priors)
