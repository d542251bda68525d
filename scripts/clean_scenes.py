"""Experiments without a slip and without an effect, drawn at random over the space of ordinary questions."""

from __future__ import annotations

import numpy as np
from slips_scenes import Scene

from ifrfit.physics.observables import OBSERVABLES

CLOSURES = ("ifr", "fr", "f", "ifr-contact", "maw")
POLICIES = ("known", "scaled", "unknown", "mixed")
TOGETHER = (
    ("v_x", "v_n", "spin_y_after"),
    ("v_x", "v_n"),
    ("beta_cm", "spin_y_after"),
    ("delta_deg", "e_n"),
    ("beta", "e_n"),
    ("mu_app", "e_n"),
    ("beta",),
    ("beta_cm",),
    ("delta_deg",),
    ("tan_psi_after",),
)
_WRAPS = "lambda_deg"  # errors turn its readings about 180 degrees to the other side
_DIRECT = ("v_n", "e_n")  # observables that know e_n alone
_MOST_ROWS = 300


def clean_scene(seed: int, number: int) -> Scene:
    """A scene at random; the same for the same seed and number.

    Six in ten measure what experiments measure together, the others up to four observables of any kind.
    Impacts are 8 to 100, of one to five series. e_n is fixed or known before where nothing measures it, and
    else in four of ten.
    """
    rng = np.random.default_rng([seed, number])
    names = [name for name in OBSERVABLES if name not in ("mu", _WRAPS)]
    some = rng.choice(names, int(rng.integers(1, 5)), replace=False)
    usual = TOGETHER[int(rng.integers(len(TOGETHER)))]
    observables = usual if rng.uniform() < 0.6 else tuple(str(name) for name in some)
    series = int(rng.choice([1, 2, 3, 5], p=[0.5, 0.25, 0.15, 0.1]))
    repeats = int(rng.choice([1, 2, 6], p=[0.7, 0.15, 0.15]))
    most = min(100, _MOST_ROWS // len(observables))
    n = round(8.0 * (most / 8.0) ** rng.uniform())
    n = max(n, 4 * series)
    n += -n % repeats
    policies = POLICIES if len(observables) > 1 or series > 1 else POLICIES[:3]
    seen = any(name in _DIRECT for name in observables)
    way = rng.uniform() if seen else 0.4 * rng.uniform()
    e_n = round(float(rng.uniform(0.6, 0.95)), 3)
    closure = str(rng.choice(CLOSURES, p=[0.4, 0.2, 0.15, 0.15, 0.1]))
    # a friction of each of many series takes the search many seconds
    separate = ("mu",) if 1 < series <= (2 if closure == "fr" else 3) and rng.uniform() < 0.1 else ()
    return Scene(
        observables,
        n,
        noise=0.003 * 10.0 ** rng.uniform(0.0, 1.2),
        policy=str(rng.choice(policies)),
        spins=bool(rng.uniform() < 0.5),
        lateral=bool(rng.uniform() < 0.25),
        closure=closure,
        fixed={"e_n": e_n} if way < 0.2 else {},
        prior={"e_n": (e_n, 0.02)} if 0.2 <= way < 0.4 else {},
        separate=separate,
        ordered=bool(rng.uniform() < 0.5),
        series=series,
        repeats=repeats,
    )
