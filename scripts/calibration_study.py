"""Run many simulated experiments; the answer does not depend on how many processes do it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from calibration_methods import (
    BOUNDED,
    COVARIANCE,
    EXACT,
    PROFILE,
    WRONG,
    Score,
    score_bounded,
    score_covariance,
    score_exact,
    score_profile,
    score_wrong,
)
from calibration_scenes import SCATTERED, SCENES, Experiment, share_sliding, simulate
from calibration_verdict import Array, Line, lines_of
from studies import in_order

from ifrfit.errors import DataError
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, least_squares

ALL = SCENES | SCATTERED
CONTROLLED = "both regimes"  # the scene in which wrong likelihoods are tried


@dataclass(frozen=True)
class Task:
    """One experiment to do.

    Attributes
    ----------
    scene : str
    number : int
    seed : int
        Of the whole study; (scene's place, number) is the spawn key.
    peers, profile, controls : bool
        Whether covariance and least squares, profile, and wrong likelihoods are asked.
    """

    scene: str
    number: int
    seed: int
    peers: bool = True
    profile: bool = False
    controls: bool = False

    def simulate(self) -> Experiment:
        """Return the experiment, the same in whatever process."""
        key = (list(ALL).index(self.scene), self.number)
        return simulate(
            ALL[self.scene], np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=key))
        )


@dataclass(frozen=True)
class Outcome:
    """What came of one experiment.

    Attributes
    ----------
    task : Task
    scores : mapping
        Method to quantity to score.
    error : float
        That exact states.
    sliding : float
        Share of the rows of beta that slide at the truth.
    troubles : mapping
        Method to the message it died with.
    """

    task: Task
    scores: Mapping[str, Mapping[str, Score]]
    error: float
    sliding: float
    troubles: Mapping[str, str]


def run(task: Task) -> Outcome:
    """Do one experiment; a method that dies is on record, and the study goes on."""
    experiment = task.simulate()
    scores: dict[str, Mapping[str, Score]] = {}
    troubles: dict[str, str] = {}
    fit: LeastSquaresFit | None = None
    try:
        fit = least_squares(experiment.problem)
    except DataError as error:
        troubles[COVARIANCE] = troubles[BOUNDED] = str(error)
    error_of_exact = float("inf")

    def attempt(method: str, ask: Callable[[], Mapping[str, Mapping[str, Score]]]) -> None:
        try:
            scores.update(ask())
        except Exception as error:  # noqa: BLE001 - whatever it is, it is the finding
            troubles[method] = f"{type(error).__name__}: {error}"

    def exact() -> Mapping[str, Mapping[str, Score]]:
        nonlocal error_of_exact
        found, error_of_exact = score_exact(experiment, fit)
        return found

    attempt(EXACT, exact)
    if task.controls:
        for control in WRONG:
            attempt(control, lambda control=control: {control: score_wrong(experiment, control)})  # type: ignore[misc]
    if fit is not None:
        known = fit
        if task.peers:
            attempt(COVARIANCE, lambda: {COVARIANCE: score_covariance(experiment, known)})
            attempt(BOUNDED, lambda: {BOUNDED: score_bounded(experiment, known)})
        if task.profile:
            attempt(PROFILE, lambda: {PROFILE: score_profile(experiment, known)})
    return Outcome(task, scores, error_of_exact, share_sliding(experiment), troubles)


def tasks_of(
    seed: int,
    repeats: int,
    n_profile: int,
    n_controls: int,
    *,
    peers: bool = True,
    scenes: Sequence[str] = tuple(SCENES),
) -> list[Task]:
    """List the experiments of a study.

    The first `n_profile` of each scene are profiled, too, and the first `n_controls` of one scene are seen
    through wrong likelihoods.
    """
    return [
        Task(scene, i, seed, peers, i < n_profile, scene == CONTROLLED and i < n_controls)
        for scene in scenes
        for i in range(max(1, round(repeats * ALL[scene].share)))
    ]


def run_many(tasks: Sequence[Task], workers: int) -> Iterator[Outcome]:
    """Do the experiments, in order; the same for any number of workers."""
    return in_order(run, tasks, workers)


@dataclass(frozen=True)
class Study:
    """All that was found.

    Attributes
    ----------
    lines : list of Line
    asked : mapping
        (scene, method) to the number of experiments given.
    troubles : mapping
        (scene, method) to (number of the experiment, message), one each time it died.
    errors : mapping
        Scene to the errors that exact states, one an experiment.
    sliding : mapping
        Scene to the share of sliding rows, one an experiment.
    """

    lines: list[Line]
    asked: Mapping[tuple[str, str], int]
    troubles: Mapping[tuple[str, str], list[tuple[int, str]]] = field(default_factory=dict)
    errors: Mapping[str, Array] = field(default_factory=dict)
    sliding: Mapping[str, Array] = field(default_factory=dict)

    def died(self, method: str) -> int:
        """How often the method gave no answer."""
        return sum(len(found) for (_, m), found in self.troubles.items() if m == method)

    def faults(self, method: str) -> list[str]:
        """Sentences on lines of the method that fail, and on experiments that it gave no answer to."""
        wrong = [
            f"{method} fails: {line.scene}, {line.name} (adjusted p {line.adjusted:.1e})"
            for line in self.lines
            if line.method == method and not line.holds
        ]
        died = self.died(method)
        return [*wrong, f"{method} gave no answer to {died} experiments"] if died else wrong


def gather(outcomes: Iterable[Outcome]) -> Study:
    """Collect and judge."""
    scores: dict[tuple[str, str, str], list[Score]] = {}
    asked: dict[tuple[str, str], int] = {}
    troubles: dict[tuple[str, str], list[tuple[int, str]]] = {}
    errors: dict[str, list[float]] = {}
    sliding: dict[str, list[float]] = {}
    for outcome in outcomes:
        scene = outcome.task.scene
        errors.setdefault(scene, []).append(outcome.error)
        sliding.setdefault(scene, []).append(outcome.sliding)
        for method in {*outcome.scores, *outcome.troubles}:
            asked[scene, method] = asked.get((scene, method), 0) + 1
        for method, message in outcome.troubles.items():
            troubles.setdefault((scene, method), []).append((outcome.task.number, message))
        for method, found in outcome.scores.items():
            for name, score in found.items():
                scores.setdefault((scene, method, name), []).append(score)
    arrays = {key: np.array(found, dtype=float) for key, found in scores.items()}
    return Study(
        lines_of(arrays, asked),
        asked,
        troubles,
        {scene: np.array(found) for scene, found in errors.items()},
        {scene: np.array(found) for scene, found in sliding.items()},
    )
