"""Simulation-based calibration of the intervals; writes docs/calibration.md and its figures.

``python scripts/calibrate_intervals.py [--repeats 2000] [--profile 400] [--workers N] [--seed S]``

Exit status 1 if the exact posterior fails, or if a negative control passes. One experiment again, by its
scene and number: ``--only "near a bound" 17``.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from studies import study_parser

if TYPE_CHECKING:
    from calibration_study import Outcome

SEED = 20240229


def watched(outcomes: Iterable[Outcome], total: int) -> Iterator[Outcome]:
    """Pass the outcomes on, with a progress bar where somebody looks."""
    from rich.console import Console
    from rich.progress import track

    console = Console(stderr=True)
    yield from track(outcomes, "Calibrating", total, console=console, disable=not console.is_terminal)


def main() -> int:
    """Run the study; exit status 1 if it does not come out as it must."""
    parser = study_parser(__doc__, SEED, "calibration.md")
    parser.add_argument("--repeats", type=int, default=2000, help="experiments in each scene")
    parser.add_argument("--profile", type=int, default=40, help="of these also profiled, which is slower")
    parser.add_argument("--controls", type=int, default=100, help="of one scene, seen wrongly")
    parser.add_argument("--scene", action="append", help="only this one (repeatable); the page needs all")
    parser.add_argument("--only", nargs=2, metavar=("SCENE", "NUMBER"), help="one experiment")
    chosen = parser.parse_args()
    from calibration_page import page, verdict
    from calibration_plots import coverage, ranks
    from calibration_scenes import SCENES
    from calibration_study import CONTROLLED, Task, gather, run, run_many, tasks_of

    from ifrfit.report.style import save_figure

    if chosen.only:
        scene, number = chosen.only[0], int(chosen.only[1])
        task = Task(scene, number, chosen.seed, profile=True, controls=scene == CONTROLLED)
        print(dict(task.simulate().truth))
        print(run(task))
        return 0
    scenes = tuple(chosen.scene or SCENES)
    tasks = tasks_of(chosen.seed, chosen.repeats, chosen.profile, chosen.controls, scenes=scenes)
    study = gather(watched(run_many(tasks, chosen.workers), len(tasks)))
    figures = chosen.out / "calibration"
    figures.mkdir(parents=True, exist_ok=True)
    save_figure(ranks(study.lines), figures / "ranks.svg")
    save_figure(coverage(study.lines), figures / "coverage.svg")
    text = page(study, chosen.seed, chosen.repeats, chosen.profile)
    (chosen.out / "calibration.md").write_text(text, encoding="utf-8")
    wrong = verdict(study)
    print("\n".join(wrong) or f"exact holds in {len(tasks)} experiments, every control fails")
    print(f"written: {chosen.out / 'calibration.md'}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
