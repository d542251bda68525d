"""How walkers move: emcee's differential evolution, and a move of our own."""

from __future__ import annotations

from typing import Any

import numpy as np
from emcee.moves import DEMove, RedBlueMove
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

Array = NDArray[np.float64]

_HEAVY = 8.0  # most degrees of freedom: tails heavier than those of a posterior
_SOLID = 1e-10  # of the unit diagonal: walkers on one line must not stop the move


def moves() -> list[tuple[Any, float]]:
    """Moves and how often each is taken.

    Student's move for what is nearly normal; differential evolution, which follows any shape; the same with
    the whole difference of two walkers, which leads from one mode to another. None of them is good at a thin
    arm beside a broad region: walkers stay in it for long, and the autocorrelation time does not settle.

    References
    ----------
    ter Braak (2006), Statistics and Computing 16, 239; Nelson et al. (2014), ApJS 210, 11.
    """
    return [(StudentMove(), 0.6), (DEMove(), 0.3), (DEMove(gamma0=1.0), 0.1)]


class StudentMove(RedBlueMove):  # type: ignore[misc]
    """Propose independently from Student's law of the other half of the ensemble.

    The law is what m walkers of the other half, taken as independent draws of a normal law, predict for
    one more draw: their mean, their scatter matrix times (m + 1)/(m (m - d)), m - d degrees of freedom (at
    most 8). A proposal does not depend on where its walker is: a posterior that is nearly normal is
    forgotten in a step or two, where the stretch move takes 30.
    """

    def get_proposal(self, s: Array, c: Any, random: Any) -> tuple[Array, Array]:
        """Places, (n, d), and the log density of proposing the way back over that of the way there, (n,).

        Parameters
        ----------
        s : ndarray, (n, d)
            Walkers that are to move.
        c : list of ndarray, (m, d)
            The others.
        random : numpy.random.RandomState
            Of emcee.
        """
        law = _Student(np.concatenate(c, axis=0))
        q = law.draw(s.shape[0], random)
        return q, law.log_density(s) - law.log_density(q)


class _Student:
    """Student's law that walkers, (m, d), predict."""

    def __init__(self, walkers: Array) -> None:
        m, d = walkers.shape
        self.mean = walkers.mean(axis=0)
        size = np.maximum(walkers.std(axis=0), np.finfo(float).tiny)
        unit = (walkers - self.mean) / size
        scatter = unit.T @ unit / m + _SOLID * np.eye(d)
        left = max(m - d, 1)
        self.root = size[:, None] * np.linalg.cholesky(scatter * ((m + 1.0) / left))
        self.freedom = min(float(left), _HEAVY)

    def draw(self, n: int, random: Any) -> Array:
        normal = random.standard_normal((n, self.mean.size))
        width = np.sqrt(self.freedom / random.chisquare(self.freedom, n))
        return np.asarray(self.mean + width[:, None] * (normal @ self.root.T))

    def log_density(self, at: Array) -> Array:
        """Up to a constant."""
        z = solve_triangular(self.root, (at - self.mean).T, lower=True, check_finite=False)
        square = np.einsum("ij,ij->j", z, z)
        return np.asarray(-0.5 * (self.freedom + self.mean.size) * np.log1p(square / self.freedom))
