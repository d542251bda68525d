"""Ensembles that walk side by side until the evidence suffices, or the budget ends."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

import emcee
import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.mcmc.moves import moves
from ifrfit.inference.mcmc.stopping import Evidence, is_met
from ifrfit.inference.workers.worker_processes import interrupts_deferred, worker_processes

Array = NDArray[np.float64]

Progress = Callable[[int, int], None]
Halt = Callable[[Evidence], bool]
Keep = Callable[["Chains"], None]

MAX_STEPS = 10_000

_FIRST, _GROWTH = 200, 1.25  # steps before the first look, and from one look to the next
_PIECE, _SECONDS = 20, 0.4  # steps of the first piece of a stretch, and time that the later ones are to take


class Each(Protocol):
    """`map`, here or in other processes."""

    def __call__(self, task: Callable[[Rest], Chains], ends: Iterable[Rest], /) -> Iterable[Chains]:
        """What the task makes of each end, in order."""
        ...


class Target(Protocol):
    """A density over real coordinates, and the quantities that it is asked for."""

    def __call__(self, at: Array) -> Array:
        """Log density up to a constant, (m,), at places (m, d); -inf outside the domain, never nan."""
        ...

    def quantities(self, at: Array) -> Mapping[str, Array]:
        """Named quantities, each (...), at places (..., d): convergence is judged on them."""
        ...


@dataclass(frozen=True)
class Rest:
    """Everything that the next step depends on.

    Attributes
    ----------
    at : ndarray, (walkers, d)
    log_density : ndarray, (walkers,)
    random : tuple
        State of the random numbers: "MT19937", key (624,), pos, has_gauss, cached_gaussian.
    """

    at: Array
    log_density: Array
    random: tuple[Any, ...]

    @classmethod
    def begin(cls, target: Target, at: Array, seed: np.random.SeedSequence) -> Rest:
        """An ensemble before its first step, with random numbers of its own."""
        state = np.random.MT19937(seed).state["state"]
        return cls(at, target(at), ("MT19937", state["key"], int(state["pos"]), 0, 0.0))


@dataclass(frozen=True)
class Chains:
    """What the ensembles walked, from the first step on.

    Attributes
    ----------
    at : ndarray, (ensembles, steps, walkers, d)
        Coordinates; read-only.
    log_density : ndarray, (ensembles, steps, walkers)
    accepted : ndarray of int, (ensembles,)
        Proposals that were accepted.
    ends : tuple of Rest
        From where each ensemble goes on.
    """

    at: Array
    log_density: Array
    accepted: NDArray[np.int64]
    ends: tuple[Rest, ...]

    def __post_init__(self) -> None:
        for array in (self.at, self.log_density, self.accepted):
            array.flags.writeable = False

    @property
    def steps(self) -> int:
        """Steps that each ensemble has walked."""
        return int(self.at.shape[1])

    @property
    def acceptance(self) -> float:
        """Share of the proposals that were accepted."""
        ensembles, steps, walkers = self.log_density.shape
        return float(self.accepted.sum() / max(ensembles * steps * walkers, 1))


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
    # in emcee's own wrapping the density would print whatever interrupts it, on standard output
    sampler.log_prob_fn = target
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
    keep: Keep | None = None,
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
        Called with the steps walked and the budget after every look, and some times a second.
    halt : callable
        Whether to stop, asked at every look; by default whether every rule holds.
    keep : callable, optional
        Given the chains so far where the walk is interrupted.

    Returns
    -------
    chains : Chains
    evidence : Evidence
    """
    workers = min(workers, len(chains.ends))
    walked = [chains]
    with worker_processes(workers) if workers > 1 else contextlib.nullcontext() as pool:
        each: Each = map if pool is None else pool.map
        try:
            for look in _looks(max_steps):
                if look < chains.steps:
                    continue
                for steps in _walk_to(target, walked, look, each):
                    if progress is not None and steps < look:
                        progress(steps, max_steps)
                walked[:] = [chains := _one_after_the_other(walked)]
                if progress is not None:
                    progress(chains.steps, max_steps)
                evidence = Evidence(target.quantities(chains.at))
                if halt(evidence):
                    return chains, evidence
        except KeyboardInterrupt:
            if keep is not None:
                with interrupts_deferred():
                    keep(_one_after_the_other(walked))
            raise
    return chains, Evidence(target.quantities(chains.at))


def _walk_to(target: Target, walked: list[Chains], look: int, each: Each) -> Iterator[int]:
    """Walk to a look, piece by piece, put behind `walked`: an interrupt takes no more than the last of them.

    Yields
    ------
    int
        Steps walked, after every piece.
    """
    steps, piece = sum(part.steps for part in walked), _PIECE
    while steps < look:
        begin = time.perf_counter()
        further = partial(walk, target, steps=min(piece, look - steps))
        walked.append(joined(list(each(further, walked[-1].ends))))
        steps += walked[-1].steps
        elapsed = time.perf_counter() - begin
        piece = max(_PIECE, int(walked[-1].steps * min(2.0, _SECONDS / max(elapsed, 1e-9))))
        yield steps


def joined(parts: Sequence[Chains]) -> Chains:
    """Chains of several ensembles side by side."""
    return Chains(
        np.concatenate([part.at for part in parts]),
        np.concatenate([part.log_density for part in parts]),
        np.concatenate([part.accepted for part in parts]),
        tuple(end for part in parts for end in part.ends),
    )


def _one_after_the_other(pieces: Sequence[Chains]) -> Chains:
    """Stretches of the same ensembles as one."""
    if len(pieces) == 1:
        return pieces[0]
    return Chains(
        np.concatenate([piece.at for piece in pieces], axis=1),
        np.concatenate([piece.log_density for piece in pieces], axis=1),
        np.sum([piece.accepted for piece in pieces], axis=0),
        pieces[-1].ends,
    )


def _looks(max_steps: int) -> Iterator[int]:
    """Steps at which the chains are looked at; the budget's end is the last of them."""
    look = _FIRST
    while look < max_steps:
        yield look
        look = int(look * _GROWTH)
    yield max_steps
