"""Impacts a second by the compiled loops, by numpy as one writes it, and by what the memory allows.

``python benchmarks/kernels.py [--quick] [--out DIR] [--readme]``

STREAM's triad, a = b + s c over arrays of the same length, runs in the same rounds: it says how many bytes a
second this machine moves. A loop that moves its own bytes at that pace cannot be made faster. Neither count
holds the reads that a processor makes before it writes.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Sequence
from typing import Any

from _common import Row, benchmark_parser, cells, machine, publish, ratio_of, rounds_of, verdict

# isort: split

import numba
import numpy as np

from ifrfit.physics.angles import sincos
from ifrfit.physics.closures import get_closure
from ifrfit.physics.kernels import rebound_many

E_N, MU, J = 0.9, 0.2, 0.4
CLOSURES: dict[str, dict[str, float]] = {
    "f": {},
    "fr": {"beta0": 0.45},
    "ifr": {"e_t": -0.93},
    "ifr-contact": {"e_t": -0.6},
    "maw": {"chi": 1.44},
}
BYTES = {"planar": 48, "spatial": 72, "triad": 24}
BANDWIDTH_GOAL, NUMPY_GOAL, TABLE_GOAL = 0.5, 10.0, 3.0


@numba.njit(parallel=True)
def triad(a: np.ndarray, b: np.ndarray, c: np.ndarray, s: float) -> None:
    for i in numba.prange(a.size):
        a[i] = b[i] + s * c[i]


def by_numpy(name: str, constant: float) -> Callable[..., tuple[np.ndarray, ...]]:
    """The same impacts as one writes them in numpy."""
    law = get_closure(name).coefficients(J)
    a, b = law.a0 + law.a1 * constant, law.b0 + law.b1 * constant
    kappa = MU * (1.0 + E_N)

    def spatial(sine, cosine, s_x, s_y):  # type: ignore[no-untyped-def]
        u_x, u_y = sine + s_y, s_x
        slip = np.sqrt(u_x**2 + u_y**2)
        k = a + np.where(slip <= kappa * cosine / b, b, kappa * cosine / slip)
        v_x, v_y, v_n = sine - k * u_x, -k * u_y, E_N * cosine
        return v_x, v_y, v_n, s_x - 2.5 * k * u_y, s_y - 2.5 * k * u_x

    def planar(sine, cosine, s_y):  # type: ignore[no-untyped-def]
        u_x = sine + s_y
        slip = np.abs(u_x)
        k = a + np.where(slip <= kappa * cosine / b, b, kappa * cosine / slip)
        return sine - k * u_x, E_N * cosine, s_y - 2.5 * k * u_x

    return lambda *x: (planar if len(x) == 3 else spatial)(*x)


def measured(n: int, budget: float) -> tuple[list[dict[str, Any]], list[str]]:
    """Rows of the table, and whether the goals are met."""
    rng = np.random.default_rng(20230101)
    sine, cosine = sincos(rng.uniform(0.0, 90.0, n), degrees=True)
    s_x, s_y = rng.normal(0.0, 0.3, n), rng.normal(0.0, 0.3, n)
    out = [np.empty(n) for _ in range(5)]
    calls: dict[str, Callable[[], object]] = {"triad": lambda: triad(out[0], sine, cosine, 0.3)}
    for name, own in CLOSURES.items():
        given = {"e_n": E_N, "mu": MU, "closure": name, "inertia_factor": J} | own
        calls[f"planar {name}"] = lambda given=given: rebound_many(sine, cosine, s_y, **given, out=out[:3])
        calls[f"spatial {name}"] = lambda given=given: rebound_many(sine, cosine, s_y, s_x, **given, out=out)
    plain = by_numpy("ifr", CLOSURES["ifr"]["e_t"])
    calls["planar ifr, numpy"] = lambda: plain(sine, cosine, s_y)
    calls["spatial ifr, numpy"] = lambda: plain(sine, cosine, s_x, s_y)
    times = rounds_of(calls, budget, least=3, most=15)
    rows: list[dict[str, Any]] = []
    for name, each in times.items():
        kind = name.split()[0]
        moved, seconds = BYTES[kind], statistics.median(each)
        pace = moved / BYTES["triad"] / ratio_of(each, times["triad"])
        rows.append(
            {
                "loop": name,
                "million_per_s": 1e-6 * n / seconds,
                "ns": 1e9 * seconds / n,
                "bytes": moved,
                "gb_per_s": moved * n / seconds / 1e9,
                "of_triad": pace,
                "spread": (max(each) - min(each)) / seconds,
                "rounds": len(each),
            }
        )
    return rows, goals(rows, times)


COLUMNS = {
    "loop": "{loop}",
    "million impacts/s": "{million_per_s:.0f}",
    "ns an impact": "{ns:.2f}",
    "bytes": "{bytes}",
    "GB/s": "{gb_per_s:.1f}",
    "of triad": "{of_triad:.2f}",
}


def goals(rows: Sequence[Row], times: dict[str, list[float]]) -> list[str]:
    """One sentence a goal."""
    paces = {row["loop"]: row["of_triad"] for row in rows}
    slowest = min((p, name) for name, p in paces.items() if name.startswith("spatial") and "," not in name)
    bilinear = min(
        (p, name)
        for name, p in paces.items()
        if name.startswith("spatial") and name[8:] in CLOSURES and name != "spatial maw"
    )
    gain = ratio_of(times["spatial ifr, numpy"], times["spatial ifr"])
    table = ratio_of(times["spatial maw"], times["spatial ifr"])
    flat = ratio_of(times["planar maw"], times["planar ifr"])
    return [
        f"closed forms with lateral spin, share of the triad's pace: at least {bilinear[0]:.2f} "
        f"({bilinear[1]}), goal {BANDWIDTH_GOAL}: {verdict(bilinear[0] >= BANDWIDTH_GOAL)}",
        f"over plain numpy, IFR with lateral spin: {gain:.1f} times, goal {NUMPY_GOAL:g}: "
        f"{verdict(gain >= NUMPY_GOAL)}",
        f"table of MAW over IFR: {table:.2f} times with lateral spin, {flat:.2f} without, goal at most "
        f"{TABLE_GOAL:g}: {verdict(max(table, flat) <= TABLE_GOAL)}",
        f"slowest loop of all: {slowest[1]}, {slowest[0]:.2f} of the triad's pace",
    ]


def main() -> None:
    options = benchmark_parser(__doc__, "a million impacts instead of ten").parse_args()
    n = 10**6 if options.quick else 10**7
    rows, said = measured(n, 5.0 if options.quick else 60.0)
    about = f"{machine('numba')}, {numba.get_num_threads()} threads, {n:.0e} impacts"
    print(about)
    publish(options, "kernels", rows, cells(rows, COLUMNS), said, about)


if __name__ == "__main__":
    main()
