"""A sample of a problem's posterior: chains, their diagnostics, and the distribution they stand for."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from ifrfit.errors import UsageError
from ifrfit.inference.diagnostics.thresholds import FACTS
from ifrfit.inference.distributions.draws import Draws
from ifrfit.inference.mcmc.checkpoint import keep_chains, kept_chains, load_chains, question_of, save_chains
from ifrfit.inference.mcmc.run import MAX_STEPS, Chains, Halt, Progress, begin, run
from ifrfit.inference.mcmc.starts import Coordinates, starts
from ifrfit.inference.mcmc.stopping import Evidence, Verdict, is_met, verdict_of
from ifrfit.inference.model.log_posterior import Density
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.result.types import Fact
from ifrfit.inference.unfinished_run import KEPT


@dataclass(frozen=True)
class Sample:
    """Chains of a posterior.

    Attributes
    ----------
    coordinates : Coordinates
    chains : Chains
    evidence : Evidence
    seed : int
    """

    coordinates: Coordinates
    chains: Chains
    evidence: Evidence
    seed: int

    @cached_property
    def verdict(self) -> Verdict:
        """What the rules say."""
        return verdict_of(self.evidence)

    @cached_property
    def distribution(self) -> Draws:
        """All draws that are kept, as a distribution."""
        values = {name: x.reshape(-1) for name, x in self.evidence.kept.items()}
        return Draws.of(self.coordinates.problem, values)

    def converged(self, noise: Fact) -> Fact:
        """Whether the chains met every rule; if not, which not, and how many more steps it would take."""
        chains, evidence, verdict = self.chains, self.evidence, self.verdict
        ensembles, steps, walkers, _ = chains.at.shape
        figures = {
            "ensembles": ensembles,
            "walkers": walkers,
            "steps": steps,
            "discarded": evidence.discarded,
            "acceptance": chains.acceptance,
            "rhat_max": max(evidence.rhat.values()),
            "ess_bulk_min": min(evidence.bulk.values()),
            "ess_tail_min": min(evidence.tail.values()),
            "tau_max": max(evidence.tau.values()),
            "failed": list(verdict.failed),
            "steps_more": 0 if verdict.ok else verdict.steps_more,
            "each": {
                name: {
                    "rhat": evidence.rhat[name],
                    "ess_bulk": evidence.bulk[name],
                    "ess_tail": evidence.tail[name],
                    "tau": evidence.tau[name],
                }
                for name in evidence.tau
            },
        } | dict(noise.figures)
        if verdict.ok and noise.ok:
            says = (
                f"{ensembles} ensembles of {walkers} walkers agree after {steps:,} steps: R-hat "
                f"{figures['rhat_max']:.4f}, at least {figures['ess_bulk_min']:,.0f} effective draws in the "
                f"bulk and {figures['ess_tail_min']:,.0f} in the tails"
            )
        elif verdict.ok:
            says = noise.says
        else:
            says = (
                f"the chains did not converge in {steps:,} steps: {verdict.says}; {_remedy(verdict, steps)}"
            )
        return Fact(verdict.ok and noise.ok, says, figures, FACTS["converged"])

    def save(self, path: Path) -> None:
        """Write the chains to a file, to walk on from."""
        save_chains(path, self.chains, question_of(self.coordinates.problem, self.seed))


def sample(
    problem: Problem,
    found: LeastSquaresFit,
    seed: int,
    *,
    max_steps: int = MAX_STEPS,
    workers: int = 1,
    resume: Path | None = None,
    keep: Path | None = None,
    progress: Progress | None = None,
    halt: Halt | None = None,
) -> Sample:
    """Sample the posterior of a problem.

    Parameters
    ----------
    problem : Problem
    found : LeastSquaresFit
        The optima that ensembles start from.
    seed : int
    max_steps : int
        Of each ensemble, counted from its very first.
    workers : int
    resume : Path, optional
        Chains to walk on with, or their folder.
    keep : Path, optional
        Folder for the chains of a walk that is interrupted, and of one that is done. Chains of this question
        that are there already are walked on with.
    progress : callable, optional
    halt : callable, optional
        Whether to stop, asked at every look at the chains; by default when every rule holds.

    Raises
    ------
    UsageError
        If nothing is free, or the chains to resume are not there or not of this problem.
    DataError
        If their file is damaged.
    """
    coordinates = Coordinates(Density(problem))
    if coordinates.dimensions == 0:
        raise UsageError(
            "Every constant is fixed and the noise is known: there is nothing to sample. Use --method lsq."
        )
    question = question_of(problem, seed)
    kept = None if keep is None else kept_chains(keep, question)
    if resume is not None:
        chains = load_chains(resume, question)
    else:
        chains = fresh(coordinates, found, seed)
    if kept is not None and kept.steps > chains.steps:
        chains = kept

    def put_away(so_far: Chains) -> None:
        if keep is not None and so_far.steps:
            keep_chains(keep, so_far, question)
            raise KeyboardInterrupt(f"{so_far.steps:,} steps of the chains {KEPT.format(keep)}")

    chains, evidence = run(
        coordinates,
        chains,
        max_steps=max_steps,
        workers=workers,
        progress=progress,
        halt=is_met if halt is None else halt,
        keep=put_away,
    )
    if keep is not None:  # until the results are written
        with contextlib.suppress(UsageError):
            keep_chains(keep, chains, question)
    return Sample(coordinates, chains, evidence, seed)


def fresh(coordinates: Coordinates, found: LeastSquaresFit, seed: int) -> Chains:
    """Chains before their first step, about every optimum within reach."""
    spread, walks = np.random.SeedSequence(seed).spawn(2)
    return begin(coordinates, starts(coordinates, found, np.random.default_rng(spread)), walks)


def _remedy(verdict: Verdict, steps: int) -> str:
    if verdict.steps_more is None:
        return "how many more it would take cannot be told: --method exact needs none"
    total = steps + verdict.steps_more
    return f"some {verdict.steps_more:,} more steps would do: --resume DIR --max-steps {total}"
