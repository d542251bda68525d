"""All ensembles side by side: the chains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.mcmc.ensemble import Rest, Stretch

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Chains:
    """What the ensembles walked, from the first step on.

    Attributes
    ----------
    at : ndarray, (ensembles, steps, walkers, d)
        Coordinates; read-only.
    log_density : ndarray, (ensembles, steps, walkers)
    accepted : ndarray of int, (ensembles,)
        Proposals that were accepted.
    ends : tuple of Rest
        From where each ensemble goes on.
    """

    at: Array
    log_density: Array
    accepted: NDArray[np.int64]
    ends: tuple[Rest, ...]

    def __post_init__(self) -> None:
        for array in (self.at, self.log_density, self.accepted):
            array.flags.writeable = False

    @property
    def steps(self) -> int:
        """Steps that each ensemble has walked."""
        return int(self.at.shape[1])

    @property
    def acceptance(self) -> float:
        """Share of the proposals that were accepted."""
        ensembles, steps, walkers = self.log_density.shape
        return float(self.accepted.sum() / max(ensembles * steps * walkers, 1))

    def longer(self, stretches: Sequence[Stretch]) -> Chains:
        """The same with what each ensemble walked since."""
        return Chains(
            np.concatenate((self.at, np.stack([s.at for s in stretches])), axis=1),
            np.concatenate((self.log_density, np.stack([s.log_density for s in stretches])), axis=1),
            self.accepted + np.array([s.accepted for s in stretches]),
            tuple(s.end for s in stretches),
        )
