"""Effective draws a second: our chains, lmfit's emcee wrapper, and plain vectorised emcee.

``python benchmarks/posterior_ess.py [--only i,ii] [--out DIR] [--readme]``

All are judged alike: the least effective number of draws in the bulk over the constants, by
`ifrfit.inference.mcmc.stopping`, over the wall time of the whole run. Ours stop by themselves, and
their time holds the looks at the chains; the others get a fixed number of steps, of which the
first fifth is discarded.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable
from typing import Any

# first: it sets the number of threads
from _common import cells, machine, publish, ratio_of, seconds_of, verdict

# isort: split
import numpy as np
from posterior_peers import DISCARDED, EMCEE, LMFIT, emcee_chain, lmfit_chain, quietly
from posterior_scenes import Scene, make_scene, scene_options

from ifrfit.inference.optimize.least_squares import least_squares

Array = np.ndarray

OURS = "ifrfit mcmc"
SEEDS = 3
GOAL = 5.0  # times lmfit's wrapper


def _ours(scene: Scene, seed: int) -> Array:
    """(ensembles, steps, walkers, constants)."""
    from ifrfit.inference.mcmc import sample

    drawn = sample(scene.problem, least_squares(scene.problem), seed)
    if not drawn.verdict.ok:
        print(f"scene {scene.key}, seed {seed}: {drawn.verdict.says}")
    return np.stack([drawn.evidence.kept[name] for name in scene.constants], axis=-1)


def _of_peer(chain: Callable[[Scene, int, int], Array]) -> Callable[[Scene, int], Array]:
    def run(scene: Scene, seed: int) -> Array:
        walked = chain(scene, seed, 1000)
        return walked[None, ..., : len(scene.constants)]

    return run


SAMPLERS: dict[str, Callable[[Scene, int], Array]] = {
    OURS: _ours,
    LMFIT: _of_peer(lmfit_chain),
    EMCEE: _of_peer(emcee_chain),
}


def speeds(key: str) -> list[dict[str, Any]]:
    """All samplers on one scene, in turns, so that whatever else the machine does meets all alike."""
    from ifrfit.inference.mcmc.stopping import effective_bulk

    scene = make_scene(key)
    seconds: dict[str, list[float]] = {name: [] for name in SAMPLERS}
    effective: dict[str, list[float]] = {name: [] for name in SAMPLERS}
    for seed in range(1, SEEDS + 1):
        for name, sampler in SAMPLERS.items():
            got: list[Array] = []
            with quietly():
                seconds[name].append(seconds_of(lambda: got.append(sampler(scene, seed))))  # noqa: B023
            chains = np.moveaxis(got[0], -1, 0)
            effective[name].append(min(effective_bulk(constant) for constant in chains))
    rates = {name: [e / s for e, s in zip(effective[name], seconds[name], strict=True)] for name in SAMPLERS}
    return [
        {
            "scene": key,
            "method": name,
            "time_s": statistics.median(seconds[name]),
            "effective": statistics.median(effective[name]),
            "per_second": statistics.median(rates[name]),
            "of_wrapper": ratio_of(rates[name], rates[LMFIT]),
            "seeds": SEEDS,
        }
        for name in SAMPLERS
    ]


COLUMNS = {
    "scene": "{scene}",
    "method": "{method}",
    "time": "{time_s:.2f} s",
    "effective draws": "{effective:,.0f}",
    "a second": "{per_second:,.0f}",
    "times the wrapper": "{of_wrapper:.1f}",
    "of it": "{seeds} seeds",
}


def main() -> None:
    options = scene_options(__doc__)
    print(machine("emcee"))
    rows = [row for key in options.only for row in speeds(key)]
    least = min((row for row in rows if row["method"] == OURS), key=lambda row: row["of_wrapper"])
    times = least["of_wrapper"]
    goal = (
        f"effective draws a second at least {GOAL:g} times those of lmfit's wrapper: {times:.1f} in scene "
        f"{least['scene']}, the least: {verdict(times >= GOAL)}"
    )
    print(f"the first {100 * DISCARDED:g} % of the peers' steps are discarded\n")
    publish(options, "effective draws", rows, cells(rows, COLUMNS), [goal], machine("emcee"))


if __name__ == "__main__":
    main()
