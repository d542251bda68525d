"""Likelihood of rows whose scatter is not plain, at the nodes of a part of the integral."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.row_likelihood import At, RowLaw
from ifrfit.physics.impulse_laws import Coefficients
from ifrfit.physics.observables import OBSERVABLES

Array = NDArray[np.float64]


def error_model_log_likelihood(
    law: RowLaw, k: Coefficients, e_n: Array, x: Array, c: Array, mu: Array, noise: Array | None
) -> Array:
    """Log likelihood, broadcast over (m, n_e, n_x, n_c) as far as the rows see these axes.

    Parameters
    ----------
    law : RowLaw
    k : Coefficients
    e_n, x : ndarray, (m, n_e, n_x), broadcastable
    c, mu : ndarray, (m, n_e, n_x, n_c), broadcastable
    noise : ndarray or None
        Common factor on sigma, (m, 1, 1, 1).
    """
    seen = [OBSERVABLES[law.names[which]] for which in np.unique(law.which)]
    by_x = any(o.kind in ("tangential", "curved") for o in seen)
    by_mu = any(o.kind == "friction" for o in seen)
    by_e = any(o.kind == "normal" or o.ties_e_n for o in seen)
    nothing = np.zeros((1, 1, 1, 1))
    e_n, mu = (e_n[..., None] if by_e else nothing), (mu if by_mu else nothing)
    x, c = (x[..., None], c) if by_x else (nothing, nothing)
    factor = nothing + 1.0 if noise is None else noise
    shape = np.broadcast_shapes(e_n.shape, x.shape, c.shape, mu.shape, factor.shape)
    flat = [
        np.broadcast_to(part, (*shape[:3], part.shape[3])).reshape(-1, part.shape[3])
        for part in (c, e_n, mu, factor)
    ]
    along_x = np.broadcast_to(x, (*shape[:3], 1)).reshape(-1)
    own_c, own_e, own_mu, own_factor = flat
    at = At(along_x, k.a0 + k.a1 * own_c, k.b0 + k.b1 * own_c, own_e, own_mu, own_factor)
    return law.log_likelihood(at).reshape(*shape[:3], -1)
