"""The plainest question to a posterior: one transition for all rows, and e_n apart."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.model.noise import noise_name
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.posterior.noise_scale import NoiseScale
from ifrfit.physics.impulse_laws import Coefficients

Array = NDArray[np.float64]

MOST_PANELS = 400  # of an integral
NO_SHARE = 1e-7  # of the tolerance: probability of a node that is left out of a mean
_FEWEST = 12  # rows of unknown noise below which tails are too long for even panels
_HALF_LOG_2PI = 0.5 * math.log(2.0 * math.pi)


@dataclass(frozen=True)
class PlainQuestion:
    """What the integral needs of a plain problem.

    Attributes
    ----------
    law : Coefficients
        With b1 = 0.
    e_n, c, mu : FreeParameter
    tau, factor, weight : ndarray, (n,)
        Of the tangential rows, in the order of tau: the slip ratio, the impulse factor that the value stands
        for, and s^2/sigma^2 with s the slope of the value by that factor.
    e_value, e_weight : ndarray, (m,)
        What the other rows and a prior say of e_n, with sigma^-2.
    log_scale : float
        Log of what stands before the integrals: of the likelihood and the priors.
    noises : tuple of (str, NoiseScale)
        The unknown noise of the tangential rows, then that of e_n, each with its name; empty where it is
        known.
    """

    law: Coefficients
    e_n: FreeParameter
    c: FreeParameter
    mu: FreeParameter
    tau: Array
    factor: Array
    weight: Array
    e_value: Array
    e_weight: Array
    log_scale: float
    noises: tuple[tuple[str, NoiseScale], ...] = ()

    @property
    def highest_kappa(self) -> float:
        """Below which the domain of kappa does not depend on e_n, eq. (8)."""
        return self.mu.upper * (1.0 + self.e_n.lower)

    @classmethod
    def of(cls, problem: Problem) -> PlainQuestion | None:
        """None where the problem is not plain."""
        law = problem.closure.law(problem.inertia_factor)
        if not (isinstance(law, Coefficients) and law.b1 == 0.0 and law.a1 != 0.0 and law.b0 > 0.0):
            return None
        noise, parameters = problem.noise, problem.parameters
        # rows that stand for many have a scale of their own; errors in proportion to sigma are none of these
        if not (noise.is_known or noise.is_unknown) or (noise.scale is not None and noise.counts is None):
            return None
        if not problem.error_model.is_plain or problem.common is not None:
            return None
        if problem.offset is not None or any(one.separate for one in parameters):
            return None
        free = {one.name: one for one in problem.free_parameters}
        if len(free) != 3 or problem.closure.constant not in free:
            return None
        e_n, c, mu = free["e_n"], free[problem.closure.constant], free["mu"]
        if mu.prior is not None or mu.lower > 0.0:
            return None
        rows = _rows_of(problem)
        if rows is None:
            return None
        (tau, factor, weight), (e_value, e_weight) = rows
        if e_n.prior is not None:
            e_value, e_weight = np.append(e_value, e_n.prior[0]), np.append(e_weight, e_n.prior[1] ** -2.0)
        if not (tau.size and e_value.size and tau.min() > 0.0 and math.isfinite(float(tau.max()))):
            return None
        noises = _noises_of(problem, tau.size)
        if noises is None:
            return None
        scale = -float(np.log(noise.base).sum())
        if not noises:
            scale -= noise.sigma.size * _HALF_LOG_2PI
        for one in (e_n, c, mu):
            scale += one.log_scale - (0.0 if one.prior is None else math.log(one.prior[1]) + _HALF_LOG_2PI)
        order = np.argsort(tau, kind="stable")
        rows_of = tau[order], factor[order], weight[order]
        return cls(law, e_n, c, mu, *rows_of, e_value, e_weight, scale, noises)


def _rows_of(problem: Problem) -> tuple[list[Array], list[Array]] | None:
    """tau, impulse factor and weight of tangential rows; value and weight of those of e_n.

    None where a row is of neither kind, ties e_n to the impulse factor, or knows neither.
    """
    rows, sigma = problem.rows, problem.noise.base
    tangential, normal = [], []
    for observable, at, incidence in rows.by_observable:
        if observable.linear is not None and not observable.ties_e_n:
            offset, slope = observable.linear(incidence, problem.inertia_factor)
            if not slope.all():
                return None
            value = (rows.value[at] - offset) / slope
            tangential.append((rows.tau[at], value, (slope / sigma[at]) ** 2))
        elif observable.by_e_n is not None:
            per = observable.by_e_n(incidence)
            if not np.all(per):
                return None
            normal.append((rows.value[at] / per, (per / sigma[at]) ** 2 * np.ones(at.size)))
        else:
            return None
    if not tangential:
        return None
    of_e_n = [np.concatenate(part) for part in zip(*normal, strict=True)] if normal else [np.empty(0)] * 2
    return [np.concatenate(part) for part in zip(*tangential, strict=True)], of_e_n


def _noises_of(problem: Problem, n_tangential: int) -> tuple[tuple[str, NoiseScale], ...] | None:
    """Unknown noises: of the tangential rows, then of those of e_n; empty where they are known.

    None where there are others, few rows of one, or a prior beside them.
    """
    if problem.noise.is_known:
        return ()
    groups, bounds = problem.noise_groups(), problem.noise_bounds()
    if len(groups) != 2 or any(one.prior is not None for one in problem.free_parameters):
        return None
    normal = problem.rows.of_kind("normal")
    (first, one), (second, other) = sorted(groups.items(), key=lambda item: bool(normal[item[1]].any()))
    counts = [problem.noise.count(rows) for rows in (one, other)]
    if one.size != n_tangential or not normal[other].all() or min(counts) < _FEWEST:
        return None
    return tuple(
        (noise_name(name), NoiseScale(count, *bounds[name]))
        for name, count in zip((first, second), counts, strict=True)
    )
