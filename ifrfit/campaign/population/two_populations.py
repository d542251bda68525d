"""Whether groups are two populations rather than one: two normal laws of one width, in place of one.

Twice the log-likelihood ratio is compared with chi2 of four degrees of freedom, which is cautious: the two
constants more are no regular ones (McLachlan & Peel 2000, Finite Mixture Models, section 6.5), and simulated
ratios lie lower, see docs/campaigns.md. A population that is one but not normal is none of two either: the
two laws must describe the groups better than any single-peaked one, a mixture of uniform laws that all begin
at one mode (Khintchine; Stephens 2017, Biostatistics 18, 275).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, expit, ndtr

from ifrfit.campaign.population.leave_one_out import FEWEST_OF_SEVERAL
from ifrfit.inference.diagnostics.thresholds import REFUTED

Array = NDArray[np.float64]

_DOF = 4.0
_MOST = 400  # groups, of which all are looked at; of more so many, drawn
_FLAT, _LOPSIDED = -0.6, 0.5  # excess kurtosis and skewness within which two peaks do not stand apart
_CUTS = (0.1, 0.25, 0.5, 0.75, 0.9)  # shares of the lower law, where the search begins
_ROUNDS, _STILL = 300, 1e-3
_CLEARLY = 0.5  # of log-likelihood above any single peak; their fits are some tenths short of the best
_MODES, _WIDTHS, _WEIGHINGS = 5, 16, 150


@dataclass(frozen=True)
class TwoPopulations:
    """Two normal laws with one standard deviation over groups, each group known with an error.

    Attributes
    ----------
    p_value : float
        Of one law.
    lower, upper : float
        Their means.
    tau : float
        Their standard deviation.
    share : float
        Of the upper one.
    is_upper : ndarray, (n,)
        Probability of each group to be of the upper one.
    """

    p_value: float
    lower: float
    upper: float
    tau: float
    share: float
    is_upper: Array = field(repr=False)

    @property
    def sizes(self) -> tuple[int, int]:
        """How many groups are rather of the lower and of the upper one."""
        upper = int((self.is_upper > 0.5).sum())
        return self.is_upper.size - upper, upper


def two_populations(y: Array, s: Array, *, seed: int = 0) -> TwoPopulations | None:
    """The two populations that describe groups better than one; None where one does.

    Parameters
    ----------
    y, s : ndarray, (n,)
        What each group says by itself, and with which standard deviation; at least `FEWEST_OF_SEVERAL`.
    seed : int
        Draws the groups that are looked at where they are many.
    """
    if y.size < FEWEST_OF_SEVERAL:
        raise ValueError(f"two populations are told from {FEWEST_OF_SEVERAL} groups on, not from {y.size}")
    rng = np.random.default_rng(seed)
    chosen = np.arange(y.size) if y.size <= _MOST else rng.choice(y.size, _MOST, replace=False)
    seen, error = y[chosen], s[chosen]
    if np.ptp(seen) == 0.0:
        return None
    z = (seen - seen.mean()) / seen.std()
    skewness, kurtosis = float((z**3).mean()), float((z**4).mean()) - 3.0
    if kurtosis > _FLAT and abs(skewness) < _LOPSIDED:
        return None
    log_likelihood, laws = _two_laws(seen, error)
    ratio = 2.0 * (log_likelihood - _one_law(seen, error))
    p = float(chdtrc(_DOF, max(ratio, 0.0)))
    if p >= REFUTED or log_likelihood < _one_peak(seen, error, laws) + _CLEARLY:
        return None
    share, lower, upper, variance = laws
    # log odds of the upper law; those of groups that were not looked at, too
    odds = np.log(share) - np.log1p(-share)
    odds = odds + (upper - lower) * (y - 0.5 * (lower + upper)) / (s**2 + variance)
    found = TwoPopulations(p, lower, upper, math.sqrt(variance), share, expit(odds))
    return found if min(found.sizes) > 1 else None


def _one_law(y: Array, s: Array) -> float:
    """Greatest log-likelihood of one normal law, without 2 pi."""
    scale = math.log(math.sqrt(float(np.var(y) + np.mean(s**2))))
    low, high = scale - 8.0, scale + 1.0
    best = -math.inf
    for _ in range(3):
        log_tau = np.linspace(low, high, 37)
        total = s**2 + np.exp(2.0 * log_tau)[:, None]
        mean = (y / total).sum(axis=1) / (1.0 / total).sum(axis=1)
        found = -0.5 * ((y - mean[:, None]) ** 2 / total + np.log(total)).sum(axis=1)
        top, step = int(found.argmax()), log_tau[1] - log_tau[0]
        best, low, high = max(best, float(found[top])), log_tau[top] - step, log_tau[top] + step
    return best


def _two_laws(y: Array, s: Array) -> tuple[float, tuple[float, float, float, float]]:
    """Greatest log-likelihood of two, without 2 pi; share of the upper, means, and variance.

    Expectation and maximization from several starts at once, the groups' own values being missing, too.
    """
    below = y <= np.quantile(y, _CUTS)[:, None]
    low, high = (np.where(one, y, 0.0).sum(axis=1) / one.sum(axis=1) for one in (below, ~below))
    share = np.clip((~below).mean(axis=1), 0.02, 0.98)
    within = np.where(below, y - low[:, None], y - high[:, None]).var(axis=1)
    variance = np.maximum(within - np.median(s) ** 2, 0.05 * within)
    last = np.full(len(_CUTS), -np.inf)
    for _ in range(_ROUNDS):
        total = s**2 + variance[:, None]
        one = np.log1p(-share)[:, None] - 0.5 * (y - low[:, None]) ** 2 / total
        other = np.log(share)[:, None] - 0.5 * (y - high[:, None]) ** 2 / total
        each = np.logaddexp(one, other)
        found = (each - 0.5 * np.log(total)).sum(axis=1)
        if (found - last < _STILL).all():
            break
        last, of_upper = found, np.exp(other - each)
        weights = (1.0 - of_upper) / total, of_upper / total
        low, high = ((w * y).sum(axis=1) / w.sum(axis=1) for w in weights)
        off = (1.0 - of_upper) * (y - low[:, None]) ** 2 + of_upper * (y - high[:, None]) ** 2
        pull = variance[:, None] / total
        variance = np.maximum((pull**2 * off + variance[:, None] * (1.0 - pull)).mean(axis=1), 1e-300)
        share = np.clip(of_upper.mean(axis=1), 1e-9, 1.0 - 1e-9)
    top = int(found.argmax())
    laws = float(share[top]), float(low[top]), float(high[top]), float(variance[top])
    return float(found[top]), laws if laws[1] <= laws[2] else (1.0 - laws[0], laws[2], laws[1], laws[3])


def _one_peak(y: Array, s: Array, laws: tuple[float, float, float, float]) -> float:
    """Greatest log-likelihood of a population with one peak between the two means, without 2 pi."""
    _, lower, upper, _ = laws
    farthest = float(np.abs(y - 0.5 * (lower + upper)).max()) + upper - lower
    widths = farthest * np.linspace(1.0 / _WIDTHS, 1.0, _WIDTHS) ** 1.5
    best = -math.inf
    for mode in np.linspace(lower, upper, _MODES):
        z = ((y - mode) / s)[:, None]
        right = ndtr(z) - ndtr(z - widths / s[:, None])
        left = ndtr(z + widths / s[:, None]) - ndtr(z)
        peak = np.exp(-0.5 * z**2) / s[:, None]
        boxes = math.sqrt(2.0 * math.pi) * np.concatenate((left / widths, right / widths), axis=1)
        density = np.concatenate((peak, boxes), axis=1) + 1e-300
        weight = np.full(density.shape[1], 1.0 / density.shape[1])
        for _ in range(_WEIGHINGS):
            weight = weight * (density / (density @ weight)[:, None]).mean(axis=0)
        best = max(best, float(np.log(density @ weight).sum()))
    return best
