"""One ensemble of walkers: where it is, and where it goes in so many steps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import emcee
import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.mcmc.moves import moves
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
class Stretch:
    """What an ensemble walked.

    Attributes
    ----------
    at : ndarray, (steps, walkers, d)
    log_density : ndarray, (steps, walkers)
    accepted : int
        Proposals that were accepted.
    end : Rest
    """

    at: Array
    log_density: Array
    accepted: int
    end: Rest


def walk(target: Target, rest: Rest, steps: int) -> Stretch:
    """Walk so many steps with emcee.

    All that counts is in `rest`: however the steps are cut into stretches, the walk is the same bit for bit.

    Parameters
    ----------
    target : Target
    rest : Rest
    steps : int
        1 or more.

    References
    ----------
    Foreman-Mackey et al. (2013), PASP 125, 306; Goodman & Weare (2010), CAMCoS 5, 65.
    """
    walkers, dimensions = rest.at.shape
    sampler = emcee.EnsembleSampler(walkers, dimensions, target, moves=moves(), vectorize=True)
    start = emcee.State(rest.at, log_prob=rest.log_density, random_state=rest.random, copy=True)
    sampler.run_mcmc(start, steps, skip_initial_state_check=True)
    at, log_density = sampler.get_chain(), sampler.get_log_prob()
    end = Rest(at[-1], log_density[-1], tuple(sampler.random_state))
    return Stretch(at, log_density, int(sampler.backend.accepted.sum()), end)
