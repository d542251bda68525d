"""Effective draws a second: our chains, lmfit's emcee wrapper, and plain vectorised emcee.

All are judged alike: the least effective number of draws in the bulk over the constants, by
`ifrfit.inference.mcmc.chain_diagnostics`, over the wall time of the whole run. Ours stop by themselves, and
their time holds the looks at the chains; the others get a fixed number of steps, of which the
first fifth is discarded.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from _common import print_table, seconds_of, verdict
from posterior_peers import DISCARDED, EMCEE, LMFIT, emcee_chain, lmfit_chain, quietly
from posterior_scenes import Scene, make_scene

from ifrfit.inference.optimize.least_squares import least_squares

Array = np.ndarray

OURS = "ifrfit mcmc"
SEEDS = 3
GOAL = 5.0  # times lmfit's wrapper


@dataclass(frozen=True)
class Speed:
    """One sampler on one scene: medians over the seeds."""

    scene: str
    method: str
    time_s: float
    effective: float
    per_second: float
    of_wrapper: float
    seeds: int


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


def speeds(key: str) -> list[Speed]:
    """All samplers on one scene, in turns, so that whatever else the machine does meets all alike."""
    from ifrfit.inference.mcmc.chain_diagnostics import effective_bulk

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
        Speed(
            key,
            name,
            statistics.median(seconds[name]),
            statistics.median(effective[name]),
            statistics.median(rates[name]),
            statistics.median(a / b for a, b in zip(rates[name], rates[LMFIT], strict=True)),
            SEEDS,
        )
        for name in SAMPLERS
    ]


def table_of(rows: list[Speed]) -> list[list[str]]:
    """What is shown, the head first."""
    shown = [["scene", "method", "time", "effective draws", "a second", "times the wrapper", "of it"]]
    for row in rows:
        shown.append(
            [
                row.scene,
                row.method,
                f"{row.time_s:.2f} s",
                f"{row.effective:,.0f}",
                f"{row.per_second:,.0f}",
                f"{row.of_wrapper:.1f}",
                f"{row.seeds} seeds",
            ]
        )
    return shown


def goal_of(rows: list[Speed]) -> str:
    """Whether ours is 5 times as fast as the wrapper in every scene."""
    least = min((row for row in rows if row.method == OURS), key=lambda row: row.of_wrapper)
    return (
        f"effective draws a second at least {GOAL:g} times those of lmfit's wrapper: "
        f"{least.of_wrapper:.1f} in scene {least.scene}, the least: {verdict(least.of_wrapper >= GOAL)}"
    )


def measure(keys: list[str]) -> tuple[list[Speed], str]:
    """Every scene, printed."""
    rows = [row for key in keys for row in speeds(key)]
    print_table(table_of(rows))
    said = goal_of(rows)
    print(f"\nthe first {100 * DISCARDED:g} % of the peers' steps are discarded\ngoal: {said}")
    return rows, said
