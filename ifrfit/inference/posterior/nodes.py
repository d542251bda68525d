"""The nodes of an integral over the parameters of one series, and what a parameter is there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.posterior.closure_constant import ConditionalCoordinate
from ifrfit.inference.posterior.series_integral import TransitionRole, Values
from ifrfit.inference.posterior.slabs import Slab

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Nodes:
    """Values of the parameters at the nodes.

    Those of the closure constant, and of mu where it follows from that, are made when they are asked for:
    kept, each would take as much as the density.

    Attributes
    ----------
    role : TransitionRole
    values : Values
    x : ndarray, (m, n_e, n_x), broadcastable
        The transition.
    coordinate : ConditionalCoordinate or None
        Of the closure constant, where it is integrated over.
    c_order : int
        Order of the rules for that.
    """

    role: TransitionRole
    values: Values
    x: Array
    coordinate: ConditionalCoordinate | None
    c_order: int

    @property
    def e_n(self) -> Array:
        """(m, n_e, n_x), broadcastable."""
        return self.values.e_n

    @property
    def c(self) -> Array:
        """The closure constant, (m, n_e, n_x, n_c), broadcastable."""
        return self.values.c[..., None] if self.coordinate is None else self.coordinate.nodes(self.c_order)

    @property
    def mu(self) -> Array:
        """(m, n_e, n_x, n_c), broadcastable."""
        c = self.c if self.role.k.b1 else np.zeros((1, 1, 1, 1))
        return self.role.friction(self.values, self.x, c)

    def at_modes(self) -> Nodes:
        """The conditional modes of the closure constant in the place of its nodes."""
        if self.coordinate is None:
            return self
        return replace(self, values=replace(self.values, c=self.coordinate.mode), coordinate=None)

    def part(self, slab: Slab) -> Nodes:
        """Some of the nodes."""
        own = self.values
        return Nodes(
            self.role,
            Values(slab.of(own.e_n), slab.of(own.c), slab.of(own.mu)),
            slab.of(self.x),
            None if self.coordinate is None else self.coordinate.part(slab),
            self.c_order,
        )


# What a parameter, or what follows from some, is at nodes: (m, n_e, n_x, n_c), broadcastable
Quantity = Callable[[Nodes], Array]
