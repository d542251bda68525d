"""What chains of a given length say, and how long they take."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Iterator, Sequence

from ifrfit.cost.compared_estimates import Numbers, of_distribution
from ifrfit.cost.timing import Timing
from ifrfit.inference.distributions.draws import Draws
from ifrfit.inference.model.log_posterior import Density
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import least_squares

_FEWEST = 2  # seeds


def chains_measured(
    problem: Problem, lengths: Sequence[int], seeds: Iterable[int], enough: float = math.inf
) -> Iterator[tuple[int, tuple[Numbers, ...], Timing]]:
    """Walk as `--method mcmc` does, and look at the chains at given lengths.

    Chains of N steps are the beginning of those of 2 N, so each seed walks once; the time of a length is that
    of the walk up to it and of what is worked out from the chains there.

    Parameters
    ----------
    problem : Problem
    lengths : sequence of int
        Steps of each ensemble, growing.
    seeds : iterable of int
    enough : float
        Seconds after which no further seed begins; two walk in any case.

    Yields
    ------
    int
        The length.
    tuple of Numbers
        One a seed.
    Timing
        Over the seeds.
    """
    from ifrfit.inference import mcmc
    from ifrfit.inference.mcmc.ensemble import walk

    numbers: dict[int, list[Numbers]] = {length: [] for length in lengths}
    seconds: dict[int, list[float]] = {length: [] for length in lengths}
    spent: list[float] = []
    for seed in seeds:
        if len(spent) >= _FEWEST and sum(spent) > enough:
            break
        begin = time.perf_counter()
        coordinates = mcmc.Coordinates(Density(problem))
        chains = mcmc.fresh(coordinates, least_squares(problem), seed)
        walked = time.perf_counter() - begin
        for length in lengths:
            begin = time.perf_counter()
            more = length - chains.steps
            chains = chains.longer([walk(coordinates, rest, more) for rest in chains.ends])
            middle = time.perf_counter()
            walked += middle - begin
            kept = mcmc.Evidence(coordinates.quantities(chains.at)).kept
            law = Draws.of(problem, {name: x.reshape(-1) for name, x in kept.items()})
            numbers[length].append(of_distribution(problem, law))
            seconds[length].append(walked + time.perf_counter() - middle)
        spent.append(walked)
    for length in lengths:
        yield length, tuple(numbers[length]), Timing.of(seconds[length])


def affordable(problem: Problem, lengths: Sequence[int], longest: float) -> tuple[int, ...]:
    """The lengths that one seed walks within so many seconds, as far as the density alone tells."""
    from ifrfit.inference import mcmc

    coordinates = mcmc.Coordinates(Density(problem))
    ends = mcmc.fresh(coordinates, least_squares(problem), 0).ends
    begin = time.perf_counter()
    for rest in ends:
        coordinates(rest.at)
    step = time.perf_counter() - begin
    return tuple(length for length in lengths if length * step <= longest)
