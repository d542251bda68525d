"""Angular momentum about the contact point: a check of measured velocities that no closure enters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.cells import Cells

TOLERANCE = 0.05

Array = NDArray[np.float64]


def momentum_note(
    cells: Cells,
    before: Mapping[str, Any],
    after: Mapping[str, Array],
    tangential: Array,
    inertia_factor: float,
) -> str | None:
    """Say how well v_t - J R Omega is conserved, in the paper's signs.

    The impulse acts at the contact point, so it changes v_t by p and R Omega by p/J: the difference stays,
    whatever the closure. A wrong inertia factor, size, sign or time of reading shows here.

    Parameters
    ----------
    cells : Cells
        For the names of lines.
    before : mapping
        ``spin_x``, ``spin_y``: R omega/u.
    after : mapping
        ``v_x``, ``spin_y_after`` and, where measured, ``v_y`` and ``spin_x_after``, per incoming speed.
    tangential : (n,) array
        Tangential speed before, over u.
    inertia_factor : float
        J = I/(m R^2).

    Returns
    -------
    str or None
        None if no impact has both.
    """
    if "v_x" not in after:
        return None
    dv, ds = _changes(before, after, tangential)
    miss = np.sqrt(np.sum((dv - inertia_factor * ds) ** 2, axis=0))
    contact = np.hypot(tangential + before["spin_y"], before["spin_x"])
    known = ~np.isnan(miss) & ~np.isnan(contact)
    if not np.any(contact[known] > 0):
        return None
    rms = float(np.sqrt(np.mean(miss[known] ** 2) / np.mean(contact[known] ** 2)))
    count = int(known.sum())
    text = (
        f"{cells.name}: angular momentum about the contact closes to {100 * rms:.2g} % of the contact speed "
        f"(rms over {count} impact{'s' if count > 1 else ''}, inertia factor {inertia_factor:.4g})"
    )
    beyond = np.flatnonzero(known & (miss > TOLERANCE * contact))
    if not beyond.size:
        return text + "."
    lines = ", ".join(str(cells.lines[row]) for row in beyond[:3]) + (", ..." if beyond.size > 3 else "")
    plural = "" if beyond.size == 1 else "s"
    text += f"; {beyond.size} of {count} miss by more than 5 % ({cells.word}{plural} {lines})."
    return text if rms <= TOLERANCE else text + _advice(dv[:, known], ds[:, known])


def _changes(before: Mapping[str, Any], after: Mapping[str, Array], tangential: Array) -> tuple[Array, Array]:
    """Return the changes of v_t and R Omega, (1 or 2, n): along x, and across where that was measured."""
    dv = [after["v_x"] - tangential]
    ds = [after["spin_y_after"] - before["spin_y"]]
    if "v_y" in after and "spin_x_after" in after:
        # an impact without the lateral pair is judged by the other alone
        both = ~np.isnan(after["v_y"] + after["spin_x_after"])
        dv.append(np.where(both, after["v_y"], 0.0))
        ds.append(np.where(both, after["spin_x_after"] - before["spin_x"], 0.0))
    return np.array(dv), np.array(ds)


def _advice(dv: Array, ds: Array) -> str:
    """Name the inertia factor that fits best (least squares of dv = J ds) if it could be one."""
    change = float(np.sum(ds**2))
    own = float(np.sum(dv * ds)) / change if change > 0 else float("nan")
    text = " Check signs, size and inertia factor."
    if 0.0 < own <= 1.0:
        return (
            f" The velocities themselves ask for an inertia factor of {own:.3f} (2/5 is a homogeneous ball, "
            f"2/3 a thin hollow one).{text}"
        )
    return text
