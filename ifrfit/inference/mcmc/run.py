"""Walk until the evidence suffices, or the budget ends."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from functools import partial

import emcee
import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.mcmc.chain_diagnostics import Evidence
from ifrfit.inference.mcmc.chains import Chains, Rest
from ifrfit.inference.mcmc.moves import moves
from ifrfit.inference.mcmc.stopping import is_met
from ifrfit.inference.mcmc.target import Target
from ifrfit.inference.worker_processes import worker_processes

Array = NDArray[np.float64]
Progress = Callable[[int, int], None]
Halt = Callable[[Evidence], bool]

MAX_STEPS = 10_000

_FIRST, _GROWTH = 200, 1.25  # steps before the first look, and from one look to the next


def begin(target: Target, starts: Array, seed: np.random.SeedSequence) -> Chains:
    """Ensembles at their starts, each with random numbers of its own.

    Parameters
    ----------
    target : Target
    starts : ndarray, (ensembles, walkers, d)
    seed : numpy.random.SeedSequence
    """
    ensembles, walkers, dimensions = starts.shape
    ends = [Rest.begin(target, at, own) for at, own in zip(starts, seed.spawn(ensembles), strict=True)]
    shape = (ensembles, 0, walkers)
    return Chains(np.empty((*shape, dimensions)), np.empty(shape), np.zeros(ensembles, np.int64), tuple(ends))


def walk(target: Target, rest: Rest, steps: int) -> Chains:
    """The chain of one ensemble that walks so many steps with emcee.

    All that counts is in `rest`: however the steps are cut into stretches, the walk is the same bit for bit.

    Parameters
    ----------
    target : Target
    rest : Rest
    steps : int
        1 or more.

    References
    ----------
    Foreman-Mackey et al. (2013), PASP 125, 306; Goodman & Weare (2010), CAMCoS 5, 65.
    """
    walkers, dimensions = rest.at.shape
    sampler = emcee.EnsembleSampler(walkers, dimensions, target, moves=moves(), vectorize=True)
    start = emcee.State(rest.at, log_prob=rest.log_density, random_state=rest.random, copy=True)
    sampler.run_mcmc(start, steps, skip_initial_state_check=True)
    at, log_density = sampler.get_chain(), sampler.get_log_prob()
    end = Rest(at[-1], log_density[-1], tuple(sampler.random_state))
    accepted = np.array([sampler.backend.accepted.sum()], dtype=np.int64)
    return Chains(at[None], log_density[None], accepted, (end,))


def run(
    target: Target,
    chains: Chains,
    *,
    max_steps: int = MAX_STEPS,
    workers: int = 1,
    progress: Progress | None = None,
    halt: Halt = is_met,
) -> tuple[Chains, Evidence]:
    """Walk on until every rule of `stopping` holds, or until `max_steps`.

    The looks at the chains come at steps that are fixed beforehand, whoever interrupts the walk where: a walk
    that was resumed ends where the uninterrupted one does, with the same chains bit for bit. So does one with
    any number of workers, because ensembles share nothing.

    Parameters
    ----------
    target : Target
        Picklable, if there are several workers.
    chains : Chains
        What `begin` made, or what an earlier run gave.
    max_steps : int
        Of each ensemble, counted from its very first.
    workers : int
        Processes; more than there are ensembles are of no use.
    progress : callable, optional
        Called with the steps walked and the budget after every look.
    halt : callable
        Whether to stop, asked at every look; by default whether every rule holds.

    Returns
    -------
    chains : Chains
    evidence : Evidence
    """
    workers = min(workers, len(chains.ends))
    with worker_processes(workers) if workers > 1 else contextlib.nullcontext() as pool:
        each = map if pool is None else pool.map
        for look in _looks(max_steps):
            if look > chains.steps:
                further = partial(walk, target, steps=look - chains.steps)
                chains = chains.longer(list(each(further, chains.ends)))
            elif look < chains.steps:
                continue
            if progress is not None:
                progress(chains.steps, max_steps)
            evidence = Evidence(target.quantities(chains.at))
            if halt(evidence):
                return chains, evidence
    return chains, Evidence(target.quantities(chains.at))


def _looks(max_steps: int) -> Iterator[int]:
    """Steps at which the chains are looked at; the budget's end is the last of them."""
    look = _FIRST
    while look < max_steps:
        yield look
        look = int(look * _GROWTH)
    yield max_steps
