"""Discrete laws of very many values, in parts, so that no array is as large as the law."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class DiscreteLaw:
    """Values with their probabilities.

    Attributes
    ----------
    size : int
        Number of values.
    parts : callable
        Gives at each call all parts in turn: values (n,), and their probabilities by the rules and the coarse
        ones, (2, n).
    """

    size: int
    parts: Callable[[], Iterable[tuple[Array, Array]]]

    @classmethod
    def of(cls, values: Array, probabilities: Array) -> DiscreteLaw:
        """A law in one part."""
        return cls(values.size, lambda: [(values, probabilities)])
