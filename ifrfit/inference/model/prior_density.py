"""Densities of priors: of a constant, and of kappa = mu (1 + e_n), which follows from those of e_n and mu."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ifrfit.inference.model.parameters import Parameter

Array = NDArray[np.float64]

_NODES = 1024  # of equal probability, over e_n


def prior_density(parameter: Parameter, at: Array) -> Array:
    """Density of the prior at values (n,): uniform over the domain, or of its law and cut to it.

    Parameters
    ----------
    parameter : Parameter
        Free.
    at : ndarray, (n,)
    """
    if parameter.shape is not None:
        inside = (at >= parameter.lower) & (at <= parameter.upper)
        clipped = np.clip(at, parameter.lower, parameter.upper)
        density = np.exp(parameter.shape.log_density(clipped, parameter.lower, parameter.upper))
        return np.where(inside, density, 0.0)
    if parameter.prior is None:
        inside = (at >= parameter.lower) & (at <= parameter.prior_upper)
        return np.where(inside, 1.0 / (parameter.prior_upper - parameter.lower), 0.0)
    mean, sd = parameter.prior
    low, high = _tails(parameter)
    z = (at - mean) / sd
    inside = (at >= parameter.lower) & (at <= parameter.upper)
    normal = np.exp(-0.5 * z**2) / (sd * math.sqrt(2.0 * math.pi))
    return np.where(inside, normal / (high - low), 0.0)


def kappa_prior_density(e_n: Parameter, mu: Parameter, at: Array) -> Array:
    """Density of kappa = mu (1 + e_n) at values (n,): that of mu given e_n, averaged over the prior of e_n.

    One of the two may be fixed.
    """
    if mu.fixed is not None:
        if mu.fixed == 0.0:
            return np.zeros(at.shape)
        return prior_density(e_n, at / mu.fixed - 1.0) / abs(mu.fixed)
    factor = 1.0 + _prior_nodes(e_n)
    given = prior_density(mu, at[:, None] / factor) / factor
    return np.asarray(given.mean(axis=1))


def _prior_nodes(parameter: Parameter) -> Array:
    """Quantiles of the prior at the middles of parts of equal probability."""
    if parameter.fixed is not None:
        return np.array([parameter.fixed])
    p = (np.arange(_NODES) + 0.5) / _NODES
    if parameter.shape is not None:
        at = np.linspace(parameter.lower, parameter.upper, 4 * _NODES)
        density = prior_density(parameter, at)
        mass = np.concatenate(([0.0], np.cumsum(0.5 * (density[1:] + density[:-1]))))
        return np.asarray(np.interp(p * mass[-1], mass, at))
    if parameter.prior is None:
        return parameter.lower + p * (parameter.prior_upper - parameter.lower)
    mean, sd = parameter.prior
    low, high = _tails(parameter)
    return np.clip(mean + sd * special.ndtri(low + p * (high - low)), parameter.lower, parameter.upper)


def _tails(parameter: Parameter) -> tuple[float, float]:
    """Probability of the normal prior below each end of the domain."""
    assert parameter.prior is not None
    mean, sd = parameter.prior
    low, high = (float(special.ndtr((end - mean) / sd)) for end in (parameter.lower, parameter.upper))
    return low, high
