"""psi2 of psi1: one function over all the ways to find it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ifrfit.errors import UsageError
from ifrfit.physics.angles import Array
from ifrfit.physics.compliance.annuli import ANNULI, annuli_ratio
from ifrfit.physics.compliance.memory import STEPS, memory_ratio
from ifrfit.physics.compliance.stronge import stronge_ratio
from ifrfit.physics.compliance.table import compliance_table

METHODS = ("table", "memory", "annuli", "stronge")


def rebound_ratio(
    psi1: ArrayLike,
    chi: ArrayLike,
    *,
    method: str = "table",
    e_n: ArrayLike = 1.0,
    steps: int | None = None,
) -> Array:
    """Scaled tangential velocity of the contact point after an impact with tangential compliance.

    Parameters
    ----------
    psi1 : array_like
        khat/mu times |U_t|/U_n, where khat is the tangential over the normal stiffness. Signed: the result
        is odd in it.
    chi : array_like
        Compliance number khat (1 + 1/J)/2, see `ifrfit.physics.compliance.chi_of`.
    method : {"table", "memory", "annuli", "stronge"}
        table: the solution of Maw, Barber & Fawcett, tabulated (chi 0.65 to 3; error of psi2 below 1e-3,
        below 1e-4 for solid spheres). memory: the same by the memory function, for any chi. annuli: the same
        by a contact of concentric annuli. stronge: one spring and one slider.
    e_n : array_like
        Normal restitution. The elastic solutions are scaled, psi2 = s psi2(psi1/s) with s = (1 + e_n)/2;
        Stronge's model takes it as it is.
    steps : int, optional
        Of method memory: time steps (4000). Of method annuli: annuli (80).

    Returns
    -------
    ndarray
        psi2 = khat/mu times V_t/U_n along U_t; beta is -psi2/psi1. Of the broadcast shape; nan where an input
        is nan.

    Raises
    ------
    UsageError
        For an unknown method, a chi that the method does not cover, and steps that make no sense.

    Notes
    -----
    Maw, Barber & Fawcett (1976), Wear 38, 101; Stronge, James & Ravani (2001), Phil. Trans. R. Soc. A 359,
    2447; scaling: Wu, Thornton & Li (2003), Adv. Powder Technol. 14, 435. From psi1 = s (4 chi - 1) on the
    contact slips throughout and psi2 = psi1 - 4 chi s.
    """
    if method not in METHODS:
        raise UsageError(f"There is no method '{method}'. Choose one of {', '.join(METHODS)}.")
    if steps is not None and (method not in ("memory", "annuli") or steps < 2):
        raise UsageError("steps belongs to the methods memory and annuli, and must be 2 or more.")
    signed, number, e = np.broadcast_arrays(
        np.asarray(psi1, dtype=float), np.asarray(chi, dtype=float), np.asarray(e_n, dtype=float)
    )
    if (number <= 0.0).any():
        raise UsageError(f"chi = {float(number.min()):g}: it must be positive.")
    out = np.full(signed.shape, np.nan)
    at = ~np.isnan(signed + number + e)
    size, number, e = np.abs(signed[at]), number[at], e[at]
    scale = np.ones_like(e) if method == "stronge" else 0.5 * (1.0 + e)
    scaled = size / scale
    if method == "stronge":
        found = stronge_ratio(size, number, e)
    elif method == "memory":
        found = memory_ratio(scaled, number, STEPS if steps is None else steps)
    elif method == "annuli":
        found = annuli_ratio(scaled, number, ANNULI if steps is None else steps)
    else:
        gross = scaled >= 4.0 * number - 1.0
        beta = compliance_table().beta(scaled, number)
        found = np.where(gross, scaled - 4.0 * number, -beta * np.where(gross, 0.0, scaled))
    out[at] = np.copysign(1.0, signed[at]) * scale * found
    return out[()]
