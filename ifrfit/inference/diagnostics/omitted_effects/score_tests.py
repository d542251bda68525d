"""Do the residuals lie along an effect's direction? Score tests of one degree of freedom each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from ifrfit.inference.diagnostics.omitted_effects.effect_signatures import Direction
from ifrfit.inference.diagnostics.quadratic_forms import orthonormal
from ifrfit.inference.model.rows import Array

# a direction of which the constants take all but this share is none
_SPANNED = 1e-4
_FEWEST = 3  # degrees of freedom left, below which no test is made


@dataclass(frozen=True)
class Score:
    """Test of one direction.

    Attributes
    ----------
    direction : Direction
    strength, sd : float
        Estimate to first order and its standard deviation; 1 is the whole effect where the direction says so.
    drop : float
        Fall of -2 log likelihood with the strength free.
    drop_whole : float
        The same at strength 1.
    p : float
        Before correction for the number of tests; one-sided where the effect has a sign. The larger one of
        that of all rows and that without the row which speaks for it most, so that no outlier is an effect.
    weight : ndarray, (n,)
        Share of each row in the direction.
    chi2 : tuple of float, or None
        What the constants leave, and what the direction leaves of that; None where sigma is not known.
    dof : int
        Degrees of freedom with the direction.
    """

    direction: Direction
    strength: float
    sd: float
    drop: float
    drop_whole: float
    p: float
    weight: Array
    chi2: tuple[float, float] | None
    dof: int

    @property
    def towards(self) -> float:
        """1, or -1 where the residuals point against the effect."""
        return 1.0 if self.direction.two_sided or self.strength > 0.0 else -1.0


def scores(directions: Sequence[Direction], jacobian: Array, residual: Array, *, known: bool) -> list[Score]:
    """Test every direction that the constants cannot imitate.

    Parameters
    ----------
    directions : sequence of Direction
        With changes in units of sigma.
    jacobian : ndarray, (n, p)
        Of the values over sigma, by every constant: also by fixed ones, so that an effect is not blamed for
        a constant that was fixed wrongly, and by those at a bound.
    residual : ndarray, (n,)
        Over sigma.
    known : bool
        Whether sigma is known; the scatter of the residuals is the yardstick where not, and where it is
        larger than sigma says.

    Returns
    -------
    list of Score
        Empty where too few rows are left.

    Notes
    -----
    With d the part of a direction and r the part of the residuals that no constant can take, d.r/|d| is
    normal with variance 1, and Student's t over the scatter of what is left (Rao 1948, Proc. Camb. Phil.
    Soc. 44, 50).
    """
    own = orthonormal(jacobian)
    left = residual - own @ (own.T @ residual)
    dof = residual.size - own.shape[1]
    if dof < _FEWEST:
        return []
    found = []
    for direction in directions:
        size = float(np.linalg.norm(direction.change))
        d = direction.change - own @ (own.T @ direction.change)
        d -= own @ (own.T @ d)
        if size == 0.0 or not np.linalg.norm(d) > _SPANNED * size:
            continue
        found.append(_score(direction, d, left, dof, known))
    return found


def _score(direction: Direction, d: Array, left: Array, dof: int, known: bool) -> Score:
    norm = float(np.linalg.norm(d))
    t = float(d @ left) / norm
    total = float(left @ left)
    rest = max(total - t * t, 1e-300)
    scale = math.sqrt(rest / (dof - 1))
    weight = (d / norm) ** 2
    p = _p(t, total, dof, known, direction.two_sided)
    share = d * left * math.copysign(1.0, t)
    top = int(np.argmax(share))
    without = math.copysign((share.sum() - share[top]) / (norm * math.sqrt(max(1.0 - weight[top], 1e-12))), t)
    p = max(p, _p(without, total - float(left[top]) ** 2, dof - 1, known, direction.two_sided))
    at_one = (t * t - (norm - t) ** 2) / (1.0 if known else scale**2)
    drop = t * t if known else dof * math.log1p(t * t / rest)
    yardstick = 1.0 if known else scale
    chi2 = (total, rest) if known else None
    return Score(direction, t / norm, yardstick / norm, drop, at_one, p, weight, chi2, dof - 1)


def _p(t: float, total: float, dof: int, known: bool, two_sided: bool) -> float:
    size = abs(t) if two_sided else t
    rest = max(total - t * t, 1e-300)
    p = float(special.stdtr(dof - 1, -size / math.sqrt(rest / (dof - 1)))) if dof > 1 else 1.0
    if known:
        p = max(p, float(special.ndtr(-size)))
    return min(2.0 * p, 1.0) if two_sided else p


def holm(p: Sequence[float]) -> list[float]:
    """P-values corrected for their number, in the order given (Holm 1979, Scand. J. Statist. 6, 65)."""
    order = np.argsort(p)
    corrected = np.asarray(p, dtype=float)[order] * np.arange(len(p), 0, -1)
    out = np.empty(len(p))
    out[order] = np.minimum(np.maximum.accumulate(corrected), 1.0)
    return [float(x) for x in out]
