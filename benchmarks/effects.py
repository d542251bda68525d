"""What each effect of a simulation costs: nanoseconds an impact on one core, in numpy.

``python benchmarks/effects.py [--impacts 200000] [--out DIR] [--readme]``

The same impacts are computed without effects and with one effect more; the cost is the median over the
rounds of the difference within a round. The plan itself is timed on a scene of that many impacts.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable

from _common import benchmark_parser, cells, publish, rounds_of

# isort: split

import numpy as np

from ifrfit.physics import get_closure
from ifrfit.physics.angles import Incidence
from ifrfit.physics.effects import EFFECTS, Contact, Fluid, Impacts, compose, make_plan

CONTACT = Contact(
    density=2563.0,
    modulus=38.3e9,
    stiffness_ratio=0.875,
    fluid=Fluid("water", 1e-3),
).with_numbers(limiting_pressure=5.6e9, interface_energy=0.1, dissipation_time=1e-9, rolling_friction=1e-3)
OBSERVABLES = ("e_n", "beta", "delta_deg")
GIVEN = {"e_n": "constants.e_n", "tangential": "constants.e_t"}


def impacts_of(n: int) -> Impacts:
    """Glass spheres of 10 um to 1 mm at 0.1 to 10 m/s, with lateral spin."""
    rng = np.random.default_rng(1)
    incidence = Incidence.of(
        rng.uniform(0, 90, n), rng.normal(0, 0.3, n), rng.normal(0, 0.3, n), degrees=True
    )
    full = np.full(n, 1.0)
    return Impacts(
        incidence,
        10.0 ** rng.uniform(-1, 1, n),
        10.0 ** rng.uniform(-5, -3, n),
        get_closure("ifr"),
        0.95 * full,
        -0.95 * full,
        0.1 * full,
    )


def main() -> None:
    """Measure, print and keep."""
    parser = benchmark_parser(__doc__)
    parser.add_argument("--impacts", type=int, default=200_000)
    given = parser.parse_args()
    impacts = impacts_of(given.impacts)
    usable = [name for name, effect in EFFECTS.items() if not effect.lacks(CONTACT, impacts)]

    def run(on: list[str]) -> Callable[[], object]:
        return lambda: compose(CONTACT, impacts, on)

    calls = {"closure": run([])} | {name: run([name]) for name in usable}
    calls["plan"] = lambda: make_plan(CONTACT, impacts, OBSERVABLES, accuracy=1e-3, given=GIVEN)
    times = rounds_of(calls, budget=60.0, least=7)
    rows: list[dict[str, object]] = []
    for name, seconds in times.items():
        extra = [s - b for s, b in zip(seconds, times["closure"], strict=True)]
        cost = statistics.median(seconds if name in ("closure", "plan") else extra)
        unit = 1e3 if name == "plan" else 1e9 / given.impacts
        rows.append(
            {"what": name, "cost": cost * unit, "unit": "ms a scene" if name == "plan" else "ns an impact"}
        )
    publish(given, "effects", rows, cells(rows, {"what": "{what}", "cost": "{cost:.0f}", "": "{unit}"}))


if __name__ == "__main__":
    main()
