"""What fits of replicates give, and why some of them give nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Bool = NDArray[np.bool_]

# why a replicate has no answer; the first one that applies is told
NO_SLIDING = "no impact slides in it"
NO_STICKING = "no impact sticks in it"
NO_E_N = "nothing in it measures e_n"
TOO_FEW = "its impacts do not tell the constants apart"
NO_NOISE = "its rows cannot tell their own noise"
NOISE_NOT_CONVERGED = "its noise does not settle"


@dataclass(frozen=True)
class ReplicateFits:
    """Fits of some replicates.

    Attributes
    ----------
    theta : ndarray, (m, p)
        Entries as in `Problem.names`.
    noise : ndarray, (m, groups)
        Sigma of each group where it is unknown, the common factor where it is scaled; no columns where known.
    reason : tuple of str
        Why a replicate has no answer; empty where it has one.
    undetermined : ndarray of bool, (m, p)
        Which entries it leaves open although the data do not.
    certified : ndarray of bool, (m,)
        Whether its optimum is proven to be global.
    """

    theta: Array
    noise: Array
    reason: tuple[str, ...]
    undetermined: Bool
    certified: Bool


def concatenate_fits(parts: Sequence[ReplicateFits]) -> ReplicateFits:
    """Several lots as one."""
    return ReplicateFits(
        np.concatenate([part.theta for part in parts]),
        np.concatenate([part.noise for part in parts]),
        tuple(reason for part in parts for reason in part.reason),
        np.concatenate([part.undetermined for part in parts]),
        np.concatenate([part.certified for part in parts]),
    )
