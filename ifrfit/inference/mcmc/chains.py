"""All ensembles side by side: the chains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.mcmc.target import Target

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Rest:
    """Everything that the next step depends on.

    Attributes
    ----------
    at : ndarray, (walkers, d)
    log_density : ndarray, (walkers,)
    random : tuple
        State of the random numbers: "MT19937", key (624,), pos, has_gauss, cached_gaussian.
    """

    at: Array
    log_density: Array
    random: tuple[Any, ...]

    @classmethod
    def begin(cls, target: Target, at: Array, seed: np.random.SeedSequence) -> Rest:
        """An ensemble before its first step, with random numbers of its own."""
        state = np.random.MT19937(seed).state["state"]
        return cls(at, target(at), ("MT19937", state["key"], int(state["pos"]), 0, 0.0))


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

    def longer(self, stretches: Sequence[Chains]) -> Chains:
        """The same with what each ensemble walked since."""
        return Chains(
            np.concatenate((self.at, np.concatenate([s.at for s in stretches])), axis=1),
            np.concatenate((self.log_density, np.concatenate([s.log_density for s in stretches])), axis=1),
            self.accepted + np.concatenate([s.accepted for s in stretches]),
            tuple(end for s in stretches for end in s.ends),
        )
