"""What an ensemble walks on."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Target(Protocol):
    """A density over real coordinates, and the quantities that it is asked for."""

    def __call__(self, at: Array) -> Array:
        """Log density up to a constant, (m,), at places (m, d); -inf outside the domain, never nan."""
        ...

    def quantities(self, at: Array) -> Mapping[str, Array]:
        """Named quantities, each (...), at places (..., d): convergence is judged on them."""
        ...
