"""Single and double precision of the compiled loops against 50 digits, where it is hard."""

from __future__ import annotations

import mpmath
import numpy as np

from ifrfit.physics.angles import sincos
from ifrfit.physics.closures import get_closure
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
    assert found.v_y is not None
    assert found.spin_x is not None
    got = np.stack((found.v_x, found.v_y, found.v_n, found.spin_x, found.spin_y))
    with mpmath.workdps(DIGITS):
        worst = mpmath.mpf(0)
        for i in range(N):
            exact = _exact(*(mpmath.mpf(float(part[i])) for part in given), mu)
            scale = 1 + abs(float(given[2][i])) + abs(float(given[3][i]))
            worst = max(
                worst, *(abs(mpmath.mpf(float(g)) - e) / scale for g, e in zip(got[:, i], exact, strict=True))
            )
    return float(worst)


def _exact(
    sine: mpmath.mpf, cosine: mpmath.mpf, s_y: mpmath.mpf, s_x: mpmath.mpf, mu: float
) -> list[mpmath.mpf]:
    law = get_closure(CLOSURE).coefficients(0.4)
    share = mpmath.mpf(2) / 7
    a, b = share * (1 + mpmath.mpf(CONSTANT)), mpmath.mpf(law.b0)
    kappa = mpmath.mpf(mu) * (1 + mpmath.mpf(E_N))
    u_x, u_y = sine + s_y, s_x
    slip = mpmath.sqrt(u_x**2 + u_y**2)
    k = a + (b if slip == 0 else min(b, kappa * cosine / slip))
    five = mpmath.mpf(5) / 2
    return [
        sine - k * u_x,
        -k * u_y,
        mpmath.mpf(E_N) * cosine,
        s_x - five * k * u_y,
        s_y - five * k * u_x,
    ]
