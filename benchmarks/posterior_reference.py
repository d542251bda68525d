"""Reference of the posterior benchmark: dense Gauss-Legendre quadrature that shares nothing with the package.

With kappa = mu (1 + e_n) in the place of mu the density gets the Jacobian 1/(1 + e_n) a series; the
likelihood of beta depends on e_t and kappa alone, with kinks where a row changes its regime, at kappa =
J tan gamma.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from posterior_scenes import (
    E_N_DOMAIN,
    E_N_PRIOR,
    E_T_DOMAIN,
    MU_DOMAIN,
    NOISE_DOMAIN,
    SHARE,
    SIGMA_E_N,
    J,
    Scene,
)
from scipy.special import gammainc, gammaincc, gammaln, logsumexp, ndtr

Array = np.ndarray

NODES = 20  # of a piece, the finer of two resolutions
_KAPPA_END = MU_DOMAIN[1] * (1.0 + E_N_DOMAIN[1])
_WIDEST = {"kappa": 0.01, "e_t": 0.01, "e_n": 0.002}  # of a piece: a few sd
_NEGLECTED = 60.0  # below the largest log density
_HALF_LOG_2_PI = 0.5 * math.log(2.0 * math.pi)


@dataclass(frozen=True)
class Moments:
    """Means and standard deviations of the constants, and the log evidence."""

    mean: Array
    sd: Array
    log_evidence: float

    def error_of(self, mean: Array, sd: Array) -> float:
        """Largest error of a mean or a standard deviation, in standard deviations."""
        wrong = np.concatenate((np.asarray(mean) - self.mean, np.asarray(sd) - self.sd))
        return float(np.abs(wrong / np.tile(self.sd, 2)).max())


@dataclass(frozen=True)
class Reference(Moments):
    """The same with how far a coarser quadrature is away (in sd, and absolute for the log evidence)."""

    change: float
    change_evidence: float


def reference_of(scene: Scene) -> Reference:
    """Moments by quadrature with `NODES` nodes a piece, and their distance from half as many."""
    moments = _general if scene.observable == "delta_deg" else _separated
    coarse, fine = moments(scene, NODES // 2), moments(scene, NODES)
    change = fine.error_of(coarse.mean, coarse.sd)
    apart = abs(fine.log_evidence - coarse.log_evidence)
    return Reference(fine.mean, fine.sd, fine.log_evidence, change, apart)


def _rule(low: float, high: float, kinks: Array, widest: float, nodes: int) -> tuple[Array, Array]:
    """Composite Gauss-Legendre nodes and log weights; pieces end at kinks and are at most `widest`."""
    inside = kinks[(kinks > low) & (kinks < high)]
    even = np.linspace(low, high, math.ceil((high - low) / widest) + 1)
    edges = np.unique(np.concatenate((even, inside)))
    x, w = np.polynomial.legendre.leggauss(nodes)
    half = 0.5 * np.diff(edges)[:, None]
    middle = 0.5 * (edges[1:] + edges[:-1])[:, None]
    with np.errstate(divide="ignore"):  # kinks that touch leave pieces of no width
        return (middle + half * x).ravel(), np.log((half * w).ravel())


def _log_gauss(square: Array, n: int, sigma: float, unknown: bool) -> Array:
    """Log likelihood of n values with this sum of squared residuals, sigma known or integrated out."""
    if not unknown:
        return -0.5 * square / sigma**2 - n * (math.log(sigma) + _HALF_LOG_2_PI)
    low, high = NOISE_DOMAIN
    a, most, least = 0.5 * n, 0.5 * square / low**2, 0.5 * square / high**2
    # the integral of s^(-n-1) exp(-S/(2 s^2)) is (S/2)^(-n/2)/2 times a difference of incomplete gammas;
    # of the two ways to write the difference the one without cancellation
    with np.errstate(divide="ignore"):
        share = np.where(
            least > a, gammaincc(a, least) - gammaincc(a, most), gammainc(a, most) - gammainc(a, least)
        )
        log_integral = gammaln(a) - a * np.log(0.5 * square) - math.log(2.0) + np.log(share)
    return log_integral - n * _HALF_LOG_2_PI - math.log(math.log(high / low))


def _separated(scene: Scene, nodes: int) -> Moments:
    """Scenes of beta and e_n: e_n, and under each e_t every kappa, on their own."""
    e_t, log_w_t = _rule(*E_T_DOMAIN, np.empty(0), _WIDEST["e_t"], nodes)
    width_t = E_T_DOMAIN[1] - E_T_DOMAIN[0]
    log_t = log_w_t - math.log(width_t)
    conditional = []
    for s in range(scene.n_series):
        log_one, means, squares = _given_e_t(scene, scene.series == s, e_t, nodes)
        log_t = log_t + log_one
        conditional.append((means, squares))
    w_t = np.exp(log_t - logsumexp(log_t))

    e_n, log_w_n = _rule(*E_N_DOMAIN, np.empty(0), _WIDEST["e_n"], nodes)
    square = ((scene.e_n[:, None] - e_n) ** 2).sum(axis=0)
    log_n = log_w_n + _log_gauss(square, scene.e_n.size, SIGMA_E_N, scene.unknown_noise)
    log_n -= scene.n_series * np.log1p(e_n)  # the Jacobian
    w_n = np.exp(log_n - logsumexp(log_n))

    mean, second = [w_n @ e_n, w_t @ e_t], [w_n @ (e_n - E_N_PRIOR[0]) ** 2, w_t @ e_t**2]
    second[0] += 2.0 * E_N_PRIOR[0] * mean[0] - E_N_PRIOR[0] ** 2
    inverse, inverse2 = w_n @ (1.0 / (1.0 + e_n)), w_n @ (1.0 / (1.0 + e_n) ** 2)
    for means, squares in conditional:
        mean.append((w_t @ means) * inverse)
        second.append((w_t @ squares) * inverse2)
    evidence = logsumexp(log_t) + logsumexp(log_n) - scene.n_series * math.log(MU_DOMAIN[1])
    return Moments(np.array(mean), np.sqrt(np.array(second) - np.array(mean) ** 2), float(evidence))


def _given_e_t(scene: Scene, rows: Array, e_t: Array, nodes: int) -> tuple[Array, Array, Array]:
    """Log integral over one series' kappa, and its first two moments, at each e_t."""
    value, tan = scene.value[rows], scene.tan[rows]
    kappa, log_w = _rule(0.0, _KAPPA_END, J * tan, _WIDEST["kappa"], nodes)
    free = value[:, None] - np.minimum(J, kappa / tan[:, None]) / SHARE  # the residual is this less e_t
    centre = free.mean(axis=0)
    spread = ((free - centre) ** 2).sum(axis=0)
    square = spread + value.size * (centre - e_t[:, None]) ** 2
    log_f = log_w + _log_gauss(square, value.size, scene.sigma, scene.unknown_noise)
    total = logsumexp(log_f, axis=1)
    weight = np.exp(log_f - total[:, None])
    beyond = float((weight[np.argmax(total)] * (kappa > MU_DOMAIN[1])).sum())
    if beyond > 1e-15:
        raise ValueError("the bound mu <= 2 matters here, and this reference leaves it out")
    return total, weight @ kappa, weight @ kappa**2


def _general(scene: Scene, nodes: int) -> Moments:
    """The scene of delta: three dimensions at once, over the box where there is anything."""
    box = _box(scene)
    e_n, w_n = _rule(*box[0], np.empty(0), (box[0][1] - box[0][0]) / 5.0, nodes)
    e_t, w_t = _rule(*box[1], np.empty(0), (box[1][1] - box[1][0]) / 5.0, nodes)
    kappa, w_k = _rule(*box[2], J * scene.tan, (box[2][1] - box[2][0]) / 10.0, nodes)
    at = np.meshgrid(e_n, e_t, indexing="ij")
    log_plane = w_n[:, None] + w_t
    planes = [_log_density(scene, at[0], at[1], k) + log_plane + w for k, w in zip(kappa, w_k, strict=True)]
    top = max(float(plane.max()) for plane in planes)
    sums = np.zeros(7)
    for k, plane in zip(kappa, planes, strict=True):
        weight = np.exp(plane - top)
        mu = k / (1.0 + at[0])
        powers = (np.ones_like(mu), at[0], at[1], mu, at[0] ** 2, at[1] ** 2, mu**2)
        sums += [float((weight * p).sum()) for p in powers]
    mean, second = sums[1:4] / sums[0], sums[4:] / sums[0]
    below, above = (ndtr((end - E_N_PRIOR[0]) / E_N_PRIOR[1]) for end in E_N_DOMAIN)
    volume = (E_T_DOMAIN[1] - E_T_DOMAIN[0]) * MU_DOMAIN[1] * (above - below)
    evidence = top + math.log(sums[0]) - math.log(volume)
    return Moments(mean, np.sqrt(second - mean**2), float(evidence))


def _log_density(scene: Scene, e_n: Array, e_t: Array, kappa: Array | float) -> Array:
    """Log of likelihood, Gaussian prior of e_n and Jacobian, row by row to spare memory."""
    square = np.zeros(np.broadcast(e_n, e_t, kappa).shape)
    stick = 1.0 - SHARE * (1.0 + e_t)
    for value, tan in zip(scene.value, scene.tan, strict=True):
        model = np.degrees(np.arctan((stick - np.minimum(J, kappa / tan)) * tan / e_n))
        square += (value - model) ** 2
    z = (e_n - E_N_PRIOR[0]) / E_N_PRIOR[1]
    gauss = -0.5 * z**2 - math.log(E_N_PRIOR[1]) - _HALF_LOG_2_PI - np.log1p(e_n)
    return gauss + _log_gauss(square, scene.value.size, scene.sigma, False)


def _box(scene: Scene) -> list[tuple[float, float]]:
    """Ends of e_n, e_t and kappa beyond which the density is negligible."""
    domain = [E_N_DOMAIN, E_T_DOMAIN, (0.0, _KAPPA_END)]
    box = domain
    for _ in range(4):  # each look is closer than the one before
        axes = [np.linspace(low, high, 42)[1:-1] for low, high in box]
        density = _log_density(scene, axes[0][:, None, None], axes[1][:, None], axes[2])
        where = np.argwhere(density > density.max() - _NEGLECTED)
        steps = [axis[1] - axis[0] for axis in axes]
        box = [
            (max(low, axis[a] - step), min(high, axis[b] + step))
            for (low, high), axis, step, a, b in zip(
                box, axes, steps, where.min(axis=0), where.max(axis=0), strict=True
            )
        ]
    return box
