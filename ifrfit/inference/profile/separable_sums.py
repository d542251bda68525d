"""Sums of squares of rows that know the tangential impulse, T(c, kappa), and of those that know e_n, E(e_n).

Where nothing but kappa = mu (1 + e_n) ties both, chi2 is T + E: a quadratic in (c, kappa) in each cell
between neighbouring transitions, and one in e_n.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ifrfit.inference.model.rows import Index
from ifrfit.inference.optimize.linear_families import kappa_form
from ifrfit.inference.optimize.optimum import Array
from ifrfit.inference.optimize.parameter_group import (
    Constants,
    ParameterGroup,
    direct_sums,
    without_normal_rows,
)
from ifrfit.inference.optimize.piecewise import PiecewiseBatch, PiecewiseProblem
from ifrfit.inference.optimize.piecewise_profile import BoundedParabolas, PiecewiseParabola, PiecewiseProfile
from ifrfit.inference.optimize.piecewise_quadratic import quadratic_of
from ifrfit.inference.optimize.transition_cells import lowest_on_wall, value_at
from ifrfit.physics.impulse_laws import Coefficients

_LOW = 100.0  # of chi2 above the least, up to where a profile is of interest
_ROUNDED = 1e-14  # relative, by which an end of an interval may be off
_EXACT = 1e-6  # rounding error of chi2 that a curve does not take for a lower optimum


@dataclass(frozen=True)
class SeparableSums:
    """T and E of the rows that share one set of constants.

    Attributes
    ----------
    group : ParameterGroup
    rows : ndarray of int
        Which rows of the problem they are.
    tangential : PiecewiseProblem
        T, in c and kappa, as far as they are free.
    center : ndarray, (q,)
        Of c and kappa: where sums are taken about.
    e_n : float
        Likewise.
    restitution : (float, float, float)
        E = w d^2 - 2 r d + s in d = e_n less that value; of a fixed e_n its s alone.
    """

    group: ParameterGroup
    rows: Index
    tangential: PiecewiseProblem
    center: Array
    e_n: float
    restitution: tuple[float, float, float]

    @classmethod
    def of(cls, group: ParameterGroup, rows: Index, constants: Constants) -> SeparableSums | None:
        """Of a group, about constants near its optimum.

        None where rows or priors tie e_n to the others in another way, and where rounding would show.

        Parameters
        ----------
        group : ParameterGroup
        rows : ndarray of int
        constants : (float, float, float)
            e_n, c and mu, finite.
        """
        if not _is_separable(group):
            return None
        e_n, own, mu = constants
        # what mu leaves of kappa depends on e_n, unless that is known
        is_known = group.e_n.fixed is not None
        mu_of_rows = group.mu if is_known else replace(group.mu, fixed=None, lower=0.0, upper=math.inf)
        others = without_normal_rows(replace(group, mu=mu_of_rows), e_n)
        unknowns = (own, group.c), (mu * (1.0 + e_n), mu_of_rows)
        center = np.array([value for value, constant in unknowns if constant.fixed is None])
        if not center.size:
            return None
        found = cls(group, rows, kappa_form(others).problem, center, e_n, _restitution(group, e_n))
        return found if found._is_exact else None

    @property
    def mu(self) -> tuple[float, float]:
        """Ends of mu."""
        return self.group.mu.ends

    @property
    def is_c_free(self) -> bool:
        """Whether c is an unknown of T."""
        return self.group.c.fixed is None

    @cached_property
    def of_c(self) -> PiecewiseParabola:
        """T at given c, the first unknown, with kappa at its best."""
        return PiecewiseProfile(self.tangential, self.center, 0).parabolas()

    @cached_property
    def of_kappa(self) -> PiecewiseParabola:
        """T at given kappa, the last unknown, with c at its best."""
        return PiecewiseProfile(self.tangential, self.center, self.center.size - 1).parabolas()

    def along_e_n(self, mu: Array) -> BoundedParabolas:
        """T at given mu, with c at its best, as parabolas in e_n less `e_n` over its domain, (n, k)."""
        low, high = (np.array(end - self.e_n) for end in self.ends)
        return self.of_kappa.along(mu, 1.0 + self.e_n).within(low, high)

    def at_transition(self, tau: Array) -> Array:
        """T where impacts begin to slide at a given slip ratio, with c at its best."""
        form, high = self._cells
        form = form[:, np.searchsorted(high, tau)]
        law, (c, kappa) = self.group.coefficients, self.center.tolist()
        centered = Coefficients(law.a0 + law.a1 * c, law.a1, law.b0 + law.b1 * c, law.b1)
        domain = self.group.c.lower - c, self.group.c.upper - c
        return value_at(form, *lowest_on_wall(form, tau, centered, domain, kappa))

    @cached_property
    def _cells(self) -> tuple[Array, Array]:
        """Coefficients of T in each cell as those of `transition_cells`, (6, m), and its upper end, (m,)."""
        quadratic = quadratic_of(PiecewiseBatch(self.tangential.sorted_by_tau().about(self.center)))
        gram, slope = quadratic.gram[:, :, 0], quadratic.slope[:, 0]
        form = np.stack((gram[0, 0], gram[0, 1], gram[1, 1], *slope, quadratic.square[0]))
        return form, quadratic.high

    @property
    def ends(self) -> tuple[float, float]:
        """Of e_n."""
        return self.group.e_n.ends

    def of_e_n(self, e_n: Array) -> Array:
        """E."""
        w, r, s = self.restitution
        d = e_n - self.e_n
        return np.asarray((w * d - 2.0 * r) * d + s)

    def least_of_e_n(self, low: Array, high: Array) -> Array:
        """Least E with e_n in its domain and between two ends, (n,); infinite where nothing is left."""
        low, high = np.maximum(low, self.ends[0]), np.minimum(high, self.ends[1])
        w, r, _ = self.restitution
        best = self.e_n + r / w if w > 0.0 else self.e_n
        value = self.of_e_n(np.minimum(np.maximum(best, low), high))
        return np.where(low <= high + _ROUNDED * (1.0 + np.abs(high)), value, np.inf)

    @property
    def _is_exact(self) -> bool:
        """Whether no sum has lost digits that a profile would show."""
        value, error = self.of_kappa.minima
        return bool(value.size and error[value <= value.min() + _LOW].max() < _EXACT)


def _is_separable(group: ParameterGroup) -> bool:
    """Whether e_n and (c, kappa) are measured by different rows, all of them linear."""
    rows, (lower, upper) = group.rows, group.e_n.ends
    if rows.measures("curved") or not (math.isfinite(lower) and math.isfinite(upper)):
        return False
    if group.e_n.fixed is not None:
        return True
    ties = rows.measures_scale("impulse") or rows.measures_scale("rebound") or rows.measures("friction")
    return not ties and group.mu.prior is None


def _restitution(group: ParameterGroup, e_n: float) -> tuple[float, float, float]:
    """Sums (w, w d, w d^2) of what measures e_n, less a value of it."""
    at = group.rows.of_kind("normal")
    factor = group.rows.normal_factor(at) * group.weight[at]
    left = group.rows.value[at] * group.weight[at] - e_n * factor
    if group.e_n.fixed is not None:
        return 0.0, 0.0, float(left @ left)
    prior = group.e_n.prior
    shifted = group.e_n if prior is None else replace(group.e_n, prior=(prior[0] - e_n, prior[1]))
    return direct_sums(shifted, factor, left)
