"""What the data of a group say of a constant, in the coordinate of the population: mean and sd.

The posterior of a group holds the default prior, uniform over each domain. In the coordinate y that is dx/dy:
exp(y) where y is a logarithm. It moves a group by s^2, and the mean over n groups of error s by s sqrt(n) of
its standard error, because it counts once a group. So the marginal posterior over y is divided by dx/dy of
its own constant, and e_n and e_t are moved by what dividing by that of mu does, to first order its slope
times the covariance. The prior of e_t is left in mu and kappa: that shift, to first order, was measured to
make them worse where e_t is known weakly (docs/campaigns.md). Mean and variance of the likelihood are what a
population takes without bias of the order of s: skewness enters the mean over groups with the square of a
residual less its expectation.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from ifrfit.campaign.group_fit import KAPPA, correlation_column
from ifrfit.campaign.population.columns import column
from ifrfit.campaign.population.coordinate import Coordinate

Array = NDArray[np.float64]

MU = "mu"
PARTS = ("_lo95", "_lo68", "", "_hi68", "_hi95")
_Z = np.array([-1.959964, -0.994458, 0.0, 0.994458, 1.959964])  # of `PARTS`, on a normal scale
_NODES = np.linspace(-4.0, 4.0, 33)
_LOG_MASS = -0.5 * _NODES**2
_SEEN = np.clip(_NODES, _Z[0], _Z[-1])


def likelihood_moments(quantiles: Array, by: Coordinate) -> tuple[Array, Array]:
    """Mean and sd of the likelihood over the coordinate, (n,) each, from a posterior under a uniform prior.

    Parameters
    ----------
    quantiles : ndarray, (5, n)
        Of `PARTS` in the coordinate. Outer ones that are not finite go on as the inner ones do.
    by : Coordinate
    """
    y = quantiles.copy()
    for outer, inner in ((0, 1), (4, 3)):
        farther = y[2] + (y[inner] - y[2]) * _Z[outer] / _Z[inner]
        y[outer] = np.where(np.isfinite(y[outer]), y[outer], farther)
    nodes = PchipInterpolator(_Z, y, axis=0)(_SEEN)
    below, above = ((y[k + 1] - y[k]) / (_Z[k + 1] - _Z[k]) for k in (0, 3))
    nodes += (np.minimum(_NODES - _Z[0], 0.0))[:, None] * below
    nodes += (np.maximum(_NODES - _Z[-1], 0.0))[:, None] * above
    log_mass = _LOG_MASS[:, None] - by.log_jacobian(nodes)
    mass = np.exp(log_mass - log_mass.max(axis=0))
    mass /= mass.sum(axis=0)
    mean = (mass * nodes).sum(axis=0)
    return mean, np.sqrt((mass * (nodes - mean) ** 2).sum(axis=0))


@dataclass(frozen=True)
class GroupLikelihoods:
    """What each row of a campaign's table says of one constant by itself; (n,), nan where it determines none.

    Attributes
    ----------
    mean, sd : ndarray, (n,)
        In the coordinate, the priors of the other constants still within.
    tilt : ndarray, (n,)
        Slope of the constant's own prior there.
    """

    mean: Array
    sd: Array
    tilt: Array

    @classmethod
    def of(cls, name: str, rows: Sequence[Mapping[str, Any]], by: Coordinate) -> GroupLikelihoods:
        """From the intervals of the rows that determine the constant."""
        mean, sd = (np.full(len(rows), np.nan) for _ in range(2))
        status = f"{name}_status"
        chosen = np.array([n for n, row in enumerate(rows) if row.get(status) == "determined"], dtype=int)
        keys = [f"{name}{part}" for part in PARTS]
        x = np.array([[rows[n][key] for key in keys] for n in chosen], dtype=float).reshape(-1, 5).T
        quantiles = by.to(x)
        fine = np.isfinite(quantiles[1:4]).all(axis=0) & (quantiles[3] > quantiles[1])
        mean[chosen[fine]], sd[chosen[fine]] = likelihood_moments(quantiles[:, fine], by)
        return cls(mean, sd, by.tilt(mean))


def joint_likelihoods(
    rows: Sequence[Mapping[str, Any]], coordinates: Mapping[str, Coordinate]
) -> dict[str, tuple[Array, Array]]:
    """Mean and sd in its coordinate of what each row says of each constant, without its prior and that of mu.

    Parameters
    ----------
    rows : sequence of mapping
        Of the campaign's table, see `ifrfit.campaign.group_fit.fit_group`.
    coordinates : mapping of str to Coordinate
        Of each constant and of kappa.

    Returns
    -------
    dict of str to (ndarray, ndarray), (n,) each
        nan in rows that do not determine the constant.
    """
    alone = {name: GroupLikelihoods.of(name, rows, by) for name, by in coordinates.items()}
    shift = {name: np.zeros(len(rows)) for name in alone}
    if MU in alone:
        mu = alone[MU]
        for name, one in alone.items():
            if name in (MU, KAPPA):
                continue
            told = column(rows, correlation_column(name, MU))
            shift[name] -= np.nan_to_num(told * one.sd * mu.sd * mu.tilt)
    return {name: (each.mean + shift[name], each.sd) for name, each in alone.items()}
