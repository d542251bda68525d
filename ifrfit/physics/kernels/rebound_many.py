"""Rebounds of very many impacts with one set of constants, by compiled loops on all threads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.errors import UsageError
from ifrfit.physics.closure import Closure, rotational_share
from ifrfit.physics.closures import get_closure
from ifrfit.physics.compiling import available
from ifrfit.physics.compliance.law import Compliance, compliance_table
from ifrfit.physics.impulse_laws import Coefficients
from ifrfit.physics.rebound import closure_constant

Real = NDArray[Any]

MISSING = (
    "The compiled kernels need numba, which is not installed: pip install 'ifrfit[fast]'. "
    "ifrfit.rebound computes the same without it."
)


@dataclass(frozen=True)
class Many:
    """State after many impacts, per incoming speed; arrays of the type of the incoming ones.

    Attributes
    ----------
    v_x, v_n, spin_y : ndarray, (n,)
        As in `ifrfit.Rebound`.
    v_y, spin_x : ndarray, (n,), or None
        None where no lateral spin was given: both are zero.
    """

    v_x: Real
    v_n: Real
    spin_y: Real
    v_y: Real | None = None
    spin_x: Real | None = None


def rebound_many(
    sine: Real,
    cosine: Real,
    spin_y: Real,
    spin_x: Real | None = None,
    *,
    e_n: float,
    mu: float,
    e_t: float | None = None,
    beta0: float | None = None,
    chi: float | None = None,
    closure: str = "ifr",
    inertia_factor: float = 0.4,
    out: Sequence[Real] | None = None,
    **constants: float,
) -> Many:
    """Velocities and spins after many impacts: as `ifrfit.rebound`, one set of constants, compiled.

    Parameters
    ----------
    sine, cosine : ndarray, (n,)
        Of the incidence angle, see `ifrfit.physics.angles.sincos`.
    spin_y, spin_x : ndarray, (n,)
        R omega_y/u and R omega_x/u before, below 1e150 (1e15 in single precision). Without spin_x the planar
        loop runs.
    e_n, mu, e_t, beta0, chi, closure, inertia_factor, **constants
        As in `ifrfit.rebound`, numbers.
    out : sequence of ndarray, optional
        Where to write: (v_x, v_n, spin_y), or (v_x, v_y, v_n, spin_x, spin_y) with lateral spin.

    Returns
    -------
    Many

    Raises
    ------
    UsageError
        Without numba, for arrays that differ in shape or type, for constants that do not belong to the
        closure, and for a closure whose law has no loop, see `has_loop`.

    Notes
    -----
    Within 4 units in the last place of the largest term of the reference, `ifrfit.rebound`. Single and double
    precision; the bytes moved an impact are 48 (planar) or 72 (spatial) in double precision.
    """
    if not available():
        raise UsageError(MISSING)
    from ifrfit.physics.kernels import loops

    chosen = get_closure(closure)
    given = {"e_t": e_t, "beta0": beta0, "chi": chi, **constants}
    own = float(np.asarray(closure_constant(chosen, given)))
    inputs = [sine, cosine, *([] if spin_x is None else [spin_x]), spin_y]
    outputs = [np.empty_like(sine) for _ in range(3 if spin_x is None else 5)] if out is None else list(out)
    _check(inputs, outputs, 3 if spin_x is None else 5)
    law, rest = _constants(chosen, own, e_n, mu, inertia_factor, sine.dtype)
    loop: Any
    if spin_x is None:
        loop = loops.planar if chosen.bilinear else loops.planar_compliant
    else:
        loop = loops.spatial if chosen.bilinear else loops.spatial_compliant
    loop(*inputs, *law, rest, *outputs)
    if spin_x is None:
        return Many(*outputs)
    v_x, v_y, v_n, after_x, after_y = outputs
    return Many(v_x, v_n, after_y, v_y, after_x)


def has_loop(closure: Closure, inertia_factor: float = 0.4) -> bool:
    """Whether there is a compiled loop for the closure's law: bilinear, or that of closure MAW."""
    return isinstance(closure.law(inertia_factor), Coefficients | Compliance)


def _check(inputs: Sequence[Real], outputs: Sequence[Real], count: int) -> None:
    first = inputs[0]
    if len(outputs) != count:
        raise UsageError(f"out needs {count} arrays, not {len(outputs)}.")
    for each in (*inputs, *outputs):
        if each.ndim != 1 or each.shape != first.shape or each.dtype != first.dtype:
            raise UsageError("Sines, cosines, spins and out must be vectors of one length and one type.")
    if first.dtype not in (np.float64, np.float32):
        raise UsageError(f"The compiled kernels take float64 or float32, not {first.dtype}.")


def _constants(
    closure: Closure, own: float, e_n: float, mu: float, j: float, dtype: np.dtype[Any]
) -> tuple[tuple[Real, ...], Real]:
    """What the loops take: the law (with its table, where it has one), and the rest."""
    kappa = min(mu * (1.0 + e_n), float(np.finfo(dtype).max))
    law = closure.law(j)
    if isinstance(law, Coefficients):
        numbers = [law.a0 + law.a1 * own, law.b0 + law.b1 * own, kappa]
        return (np.array(numbers, dtype),), np.array([e_n, j], dtype)
    if not isinstance(law, Compliance):
        raise UsageError(
            f"The law of closure {closure.title} has no compiled loop: take ifrfit.rebound, which knows all."
        )
    share = rotational_share(j)
    table = compliance_table()
    cubics = share * table.cubics(own)
    cubics[:, 0] += share
    gross = 4.0 * own - 1.0
    first = table.first
    second = cubics.shape[0] - first
    numbers = [4.0 * own * share, gross, first, 1.0, second / (gross - 1.0)]
    return (np.array(numbers, dtype), cubics.astype(dtype)), np.array([e_n, j, kappa], dtype)
