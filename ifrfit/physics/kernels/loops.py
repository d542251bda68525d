"""The loops themselves: one pass over memory, no temporaries. Importing this module imports numba.

Operations stand in the order of `ifrfit.physics.rebound`: but for the slip of three dimensions, which is a
square root here and a hypot there, and the table, whose factors are multiplied beforehand, results are equal.
"""
# mypy: disable-error-code="untyped-decorator"

from __future__ import annotations

from typing import Any

import numba
import numpy as np

_jit = numba.njit(cache=True, error_model="numpy", inline="always")
_loop = numba.njit(cache=True, error_model="numpy", parallel=True)


@_jit
def _bilinear(law: Any, friction: Any) -> Any:
    return law[0] + min(law[1], friction)


@_jit
def _compliant(law: Any, table: Any, push: Any, size: Any) -> Any:
    """k by the table at a sliding impulse kappa U_n and a slip.

    law: psi1 over slip and 1/push, gross slip, intervals below psi1 = 1, 1, intervals per psi1 beyond; table:
    cubics of k. Without branches, which a processor would guess wrong every so often, and with one division:
    of psi1 where the contact sticks, of the sliding k where it does not.
    """
    reach = law[0] * size
    inside = (reach < law[1] * push) | (size == 0.0)
    below = push if inside else size
    load = (reach if inside else push) / (below if below > 0.0 else law[3])
    x = load * law[2] if load < law[3] else law[2] + (load - law[3]) * law[4]
    i = min(np.int32(x if inside else law.dtype.type(0.0)), np.int32(table.shape[0] - 1))
    u = x - law.dtype.type(i)
    k = table[i, 0] + u * (table[i, 1] + u * (table[i, 2] + u * table[i, 3]))
    return k if inside else load


@_loop
def planar(sine: Any, cosine: Any, spin: Any, law: Any, rest: Any, v_x: Any, v_n: Any, after: Any) -> None:
    """Impacts without lateral spin, k = a + min(b, kappa U_n/|U_t|); law: a, b, kappa; rest: e_n, J."""
    for i in numba.prange(sine.size):
        slip = sine[i] + spin[i]
        size = abs(slip)
        friction = law[2] * cosine[i] / size if size > 0.0 else law.dtype.type(np.inf)
        push = _bilinear(law, friction) * slip
        v_x[i] = sine[i] - push
        v_n[i] = rest[0] * cosine[i]
        after[i] = spin[i] - push / rest[1]


@_loop
def spatial(
    sine: Any, cosine: Any, spin_x: Any, spin_y: Any, law: Any, rest: Any,
    v_x: Any, v_y: Any, v_n: Any, after_x: Any, after_y: Any,
) -> None:  # fmt: skip
    """Impacts with lateral spin, otherwise as `planar`."""
    for i in numba.prange(sine.size):
        along, across = sine[i] + spin_y[i], spin_x[i]
        size = np.sqrt(along * along + across * across)
        friction = law[2] * cosine[i] / size if size > 0.0 else law.dtype.type(np.inf)
        k = _bilinear(law, friction)
        push_x, push_y = k * along, k * across
        v_x[i] = sine[i] - push_x
        v_y[i] = 0.0 - push_y
        v_n[i] = rest[0] * cosine[i]
        after_x[i] = spin_x[i] - push_y / rest[1]
        after_y[i] = spin_y[i] - push_x / rest[1]


@_loop
def planar_compliant(
    sine: Any, cosine: Any, spin: Any, law: Any, table: Any, rest: Any, v_x: Any, v_n: Any, after: Any
) -> None:
    """Impacts without lateral spin by the table; rest: e_n, J, kappa."""
    for i in numba.prange(sine.size):
        slip = sine[i] + spin[i]
        size = abs(slip)
        push = _compliant(law, table, rest[2] * cosine[i], size) * slip
        v_x[i] = sine[i] - push
        v_n[i] = rest[0] * cosine[i]
        after[i] = spin[i] - push / rest[1]


@_loop
def spatial_compliant(
    sine: Any, cosine: Any, spin_x: Any, spin_y: Any, law: Any, table: Any, rest: Any,
    v_x: Any, v_y: Any, v_n: Any, after_x: Any, after_y: Any,
) -> None:  # fmt: skip
    """Impacts with lateral spin by the table; rest: e_n, J, kappa."""
    for i in numba.prange(sine.size):
        along, across = sine[i] + spin_y[i], spin_x[i]
        size = np.sqrt(along * along + across * across)
        k = _compliant(law, table, rest[2] * cosine[i], size)
        push_x, push_y = k * along, k * across
        v_x[i] = sine[i] - push_x
        v_y[i] = 0.0 - push_y
        v_n[i] = rest[0] * cosine[i]
        after_x[i] = spin_x[i] - push_y / rest[1]
        after_y[i] = spin_y[i] - push_x / rest[1]
