"""Intervals of tau: equal steps of tau/(1 + tau), some of them parted again where a transition may lie.

The more impacts there are, the more closely they tell where a transition lies, and the narrower the
intervals are whose impacts have to be held. All places are dyadic numbers, so that no rounding moves an
impact across an edge that a proof takes for granted.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ifrfit.physics.angles import Incidence
from ifrfit.physics.compiled_incidence import PARTS, intervals_of

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]
Place = NDArray[np.int32]

_NARROWEST = 2.0**-34  # of tau/(1 + tau): a place within such a step still has digits to tell


@dataclass(frozen=True)
class Intervals:
    """Neighbouring intervals from tau = 0 to infinity, numbered in their order.

    Attributes
    ----------
    steps : int
        Equal ones of tau/(1 + tau), a power of two.
    parted : tuple of int
        Nodes of a tree that are parted into `PARTS` equal ones: the first nodes are the steps, after them
        come the parts of the first of these, and so on.
    """

    steps: int
    parted: tuple[int, ...] = ()

    @property
    def count(self) -> int:
        """How many there are."""
        return self.steps + (PARTS - 1) * len(self.parted)

    @property
    def edges(self) -> Array:
        """Values of tau between the intervals, (count + 1,); the last is infinite."""
        low, _ = _leaves(self)
        share = np.append(low, 1.0)
        with np.errstate(divide="ignore"):
            return np.asarray(share / (1.0 - share))

    @property
    def middles(self) -> Array:
        """1/tau in the middle of each interval, (count,): about it 1/tau keeps its digits."""
        return _middles(self)

    def places(self, incidence: Incidence) -> tuple[Place, Array]:
        """Interval of each impact, and its 1/tau less that of the middle of the interval, (n,) each."""
        return intervals_of(incidence, self.steps, self.middles, *_tree(self))

    def part(self, requested: Mask) -> tuple[Intervals, Index]:
        """Some of the intervals parted, but for those that are too narrow.

        Parameters
        ----------
        requested : ndarray of bool, (count,)

        Returns
        -------
        intervals : Intervals
        former : ndarray of int, (intervals.count,)
            The interval here in which each of them lies.
        """
        nodes, (low, width) = _leaf_nodes(self), _leaves(self)
        finer = Intervals(
            self.steps, self.parted + tuple(nodes[requested & (width > PARTS * _NARROWEST)].tolist())
        )
        return finer, np.searchsorted(low, _leaves(finer)[0], side="right") - 1


@lru_cache(maxsize=8)
def _nodes(of: Intervals) -> tuple[Array, Array, Index]:
    """Least tau/(1 + tau) and width of all nodes of the tree, and the first part of each, or -1."""
    n = of.steps + PARTS * len(of.parted)
    low, width, first = np.empty(n), np.empty(n), np.full(n, -1)
    low[: of.steps], width[: of.steps] = np.arange(of.steps) / of.steps, 1.0 / of.steps
    for number, node in enumerate(of.parted):
        at = of.steps + PARTS * number
        first[node] = at
        width[at : at + PARTS] = width[node] / PARTS
        low[at : at + PARTS] = low[node] + np.arange(PARTS) * width[at]
    return low, width, first


def _leaf_nodes(of: Intervals) -> Index:
    """Nodes that are not parted, in the order of tau."""
    low, _, first = _nodes(of)
    leaves = np.flatnonzero(first < 0)
    return leaves[np.argsort(low[leaves], kind="stable")]


def _leaves(of: Intervals) -> tuple[Array, Array]:
    """Least tau/(1 + tau) and width of each interval."""
    low, width, _ = _nodes(of)
    nodes = _leaf_nodes(of)
    return low[nodes], width[nodes]


@lru_cache(maxsize=8)
def _middles(of: Intervals) -> Array:
    low, width = _leaves(of)
    share = low + 0.5 * width
    found = np.asarray((1.0 - share) / share)
    found.flags.writeable = False
    return found


@lru_cache(maxsize=8)
def _tree(of: Intervals) -> tuple[Place, Place]:
    """First part of each node or -1, and the number of its interval where it is not parted."""
    first = _nodes(of)[2].astype(np.int32)
    number = np.full(first.size, -1, dtype=np.int32)
    number[_leaf_nodes(of)] = np.arange(of.count, dtype=np.int32)
    for each in (first, number):
        each.flags.writeable = False
    return first, number
