"""Single and double precision of the compiled loops against 50 digits, where it is hard."""

from __future__ import annotations

import mpmath
import numpy as np

from ifrfit.cost.impulse_balance import balance, ifr
from ifrfit.physics.angles import sincos
from ifrfit.physics.kernels import rebound_many

DIGITS = 50
N = 400  # impacts a case

# name to angles (low, high), spin_x and spin_y as (mean, sd), mu
CASES: dict[str, tuple[tuple[float, float], tuple[float, float], tuple[float, float], float]] = {
    "ordinary impacts": ((5.0, 80.0), (0.0, 0.3), (0.0, 0.3), 0.2),
    "near the normal, below 1e-4 degrees": ((1e-8, 1e-4), (0.0, 0.0), (0.0, 0.0), 0.2),
    "grazing, the last 1e-4 degrees": ((89.9999, 90.0), (0.0, 0.0), (0.0, 0.0), 0.2),
    "rolling on, slip cancels to 1e-6": ((44.9999, 45.0001), (0.0, 1e-7), (-np.sqrt(0.5), 1e-6), 0.2),
    "spin of 1e6": ((5.0, 80.0), (0.0, 1e6), (0.0, 1e6), 0.2),
    "friction of 1e6 at grazing": ((89.0, 90.0), (0.0, 0.3), (0.0, 0.3), 1e6),
    "near the transition, to 1e-7": ((43.5311, 43.5313), (0.0, 0.0), (0.0, 0.0), 0.2),
}
CLOSURE, CONSTANT, E_N = "ifr", -0.93, 0.9
STATE = ("v_x", "v_y", "v_n", "spin_x", "spin_y")


def precision_rows() -> list[dict[str, object]]:
    """Largest error of each case over 1 + |spin|, for single and for double precision."""
    return [{"case": name} | {d: _error(name, np.dtype(d)) for d in ("float32", "float64")} for name in CASES]


def _error(name: str, dtype: np.dtype) -> float:
    """Inputs are those of the precision itself: its rounding of angles and spins is no error of the loop."""
    (low, high), x, y, mu = CASES[name]
    rng = np.random.default_rng(7)
    sine, cosine = sincos(rng.uniform(low, high, N), degrees=True)
    s_x, s_y = rng.normal(*x, N), rng.normal(*y, N)
    given = [part.astype(dtype) for part in (sine, cosine, s_y, s_x)]
    found = rebound_many(*given, e_n=E_N, e_t=CONSTANT, mu=mu, closure=CLOSURE)
    got = np.stack([getattr(found, name) for name in STATE])
    with mpmath.workdps(DIGITS):
        worst = mpmath.mpf(0)
        constants = {name: mpmath.mpf(x) for name, x in (("constant", CONSTANT), ("e_n", E_N), ("mu", mu))}
        constants |= {"law": ifr, "inertia_factor": mpmath.mpf(2) / 5}
        for i in range(N):
            before = (mpmath.mpf(float(part[i])) for part in (given[0], given[1], given[3], given[2]))
            exact = balance(*before, **constants)
            scale = 1 + abs(float(given[2][i])) + abs(float(given[3][i]))
            worst = max(
                worst,
                *(abs(float(g) - exact[name]) / scale for name, g in zip(STATE, got[:, i], strict=True)),
            )
    return float(worst)
