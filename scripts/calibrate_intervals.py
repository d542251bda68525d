"""Simulation-based calibration of the intervals; writes docs/calibration.md and its figures.

``python scripts/calibrate_intervals.py [--repeats 2000] [--profile 400] [--workers N] [--seed S]``

Exit status 1 if the exact posterior fails, or if a negative control passes. One experiment again, by its
scene and number: ``--only "near a bound" 17``.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence

# first: it sets the number of threads
from studies import bold, markdown, publish, render, study_parser, versions, watched

# isort: split
import numpy as np
from calibration_methods import BOUNDED, COVARIANCE, EXACT, NARROW, PROFILE, WRONG
from calibration_plots import coverage, ranks
from calibration_scenes import SCENES, Scene
from calibration_study import CONTROLLED, Study, Task, gather, run, run_many, tasks_of
from calibration_verdict import BINS, EVERYWHERE, FAMILY, LEVELS, Line, p_words, passes, table_of

from ifrfit.report.style import save_figure

SEED = 20240229
CONTROLS = (NARROW, *WRONG)
PEERS = {
    COVARIANCE: (
        "Covariance intervals",
        "The symmetric local Gaussian at the certified optimum, Student's t where sigma comes from the "
        "misfit; blind to bounds and kinks. Most fitting programs print this.",
    ),
    BOUNDED: (
        "Least squares with its bounds",
        "The intervals of `--method lsq`: the local law cut at the bounds, one-sided where it reaches one, "
        "and a profile where the data leave a constant open.",
    ),
    PROFILE: ("Profile intervals", "The intervals of the profile likelihood (`--method profile`)."),
}


def main() -> int:
    """Run the study; exit status 1 if it does not come out as it must."""
    parser = study_parser(__doc__, SEED, "calibration.md")
    parser.add_argument("--repeats", type=int, default=2000, help="experiments in each scene")
    parser.add_argument("--profile", type=int, default=40, help="of these also profiled, which is slower")
    parser.add_argument("--controls", type=int, default=100, help="of one scene, seen wrongly")
    parser.add_argument("--scene", action="append", help="only this one (repeatable); the page needs all")
    parser.add_argument("--only", nargs=2, metavar=("SCENE", "NUMBER"), help="one experiment")
    chosen = parser.parse_args()
    if chosen.only:
        scene, number = chosen.only[0], int(chosen.only[1])
        task = Task(scene, number, chosen.seed, profile=True, controls=scene == CONTROLLED)
        print(dict(task.simulate().truth))
        print(run(task))
        return 0
    scenes = tuple(chosen.scene or SCENES)
    tasks = tasks_of(chosen.seed, chosen.repeats, chosen.profile, chosen.controls, scenes=scenes)
    study = gather(watched(run_many(tasks, chosen.workers), len(tasks), "Calibrating"))
    figures = chosen.out / "calibration"
    figures.mkdir(parents=True, exist_ok=True)
    save_figure(ranks(study.lines), figures / "ranks.svg")
    save_figure(coverage(study.lines), figures / "coverage.svg")
    text = page(study, chosen.seed, chosen.repeats, chosen.profile)
    good = f"exact holds in {len(tasks)} experiments, every control fails"
    return publish(chosen.out / "calibration.md", text, verdict(study), good)


def verdict(study: Study) -> list[str]:
    """Sentences on what went wrong; none where exact passes and every control fails."""
    wrong = study.faults(EXACT)
    if not any(line.method == EXACT for line in study.lines):
        wrong.append("exact was not tested")
    tried = controls_of(study)
    wrong += [f"control passes: {m}" for m in tried if passes(study.lines, m)]
    wrong += [f"control was not tested: {m}" for m in CONTROLS if m not in tried]
    return wrong


def controls_of(study: Study) -> list[str]:
    """Negative controls that were tried; each must fail."""
    return [m for m in CONTROLS if any(line.method == m for line in study.lines)]


def page(study: Study, seed: int, repeats: int, n_profile: int) -> str:
    """Return the page as text."""
    wrong = verdict(study)
    exact = [line for line in study.lines if line.method == EXACT]
    return render(
        "calibration.md",
        result="Not as it must be: " + "; ".join(wrong) + "."
        if wrong
        else f"The exact posterior is calibrated in all {len(study.errors)} scenes; "
        "every negative control fails.",
        seed=seed,
        repeats=repeats,
        n_profile=n_profile,
        versions=versions("pandas"),
        bins=BINS,
        levels=", ".join(f"{100 * x:.0f}" for x in LEVELS[:-1]) + f" and {100 * LEVELS[-1]:.0f}",
        n_tests=sum(len(line.tests) for line in exact),
        family=f"{FAMILY:g}",
        scenes=_scenes(study),
        exact=table_of(exact, ranks=True),
        stated=list(_stated(study)),
        peers=[_peer(study, method) for method in PEERS if any(x.method == method for x in study.lines)],
        tried=max((study.asked.get((CONTROLLED, method), 0) for method in WRONG), default=0),
        controlled=CONTROLLED,
        controls=_controls(study),
        everywhere=EVERYWHERE,
    )


def _scenes(study: Study) -> str:
    rows = []
    for name in study.errors:
        scene, share = SCENES[name], study.sliding[name]
        prior = ", ".join(f"{c} {a:g} to {b:g}" for c, (a, b) in scene.bounds.items())
        measured = (
            f"{scene.n_beta} beta at {scene.gamma[0]:g} to {scene.gamma[1]:g} degrees, {scene.n_e_n} e_n"
        )
        each = " in each series" if len(scene.series) > 1 else ""
        both = float(((share > 0.0) & (share < 1.0)).mean())
        slides = f"{100 * share.mean():.0f} %; both regimes in {100 * both:.0f} % of experiments"
        rows.append((f"**{name}**: {scene.says}", prior, measured + each, _noise(scene), slides))
    return markdown(("scene", "prior, uniform", "rows", "noise", "rows that slide"), rows)


def _noise(scene: Scene) -> str:
    known = ", ".join(f"{o} {s:g}" for o, s in scene.sigma.items())
    ends = ", ".join(f"{o} {a:g} to {b:g}" for o, (a, b) in scene.noise_bounds.items())
    if scene.policy == "scaled":
        return f"{known}, times a factor that is log-uniform from{ends}"
    return f"unknown, log-uniform: {ends}" if scene.noise_bounds else f"known: {known}"


def _stated(study: Study) -> Iterator[str]:
    """What the posterior says of its own error, a sentence a scene."""
    for scene, errors in study.errors.items():
        known = errors[np.isfinite(errors)]
        if known.size:
            said = f"{scene}: error that the posterior states of itself at most {known.max():.1e}, "
            said += f"above 1e-4 in {int((known > 1e-4).sum())} of {known.size}"
            if died := study.troubles.get((scene, EXACT)):
                number, message = died[0]
                said += f"; no answer in {len(died)}, the first (experiment {number}): {message}"
            yield said


def _peer(study: Study, method: str) -> dict[str, object]:
    title, says = PEERS[method]
    own = [line for line in study.lines if line.method == method]
    bad = [line for line in own if not line.holds]
    failed = "No line fails."
    if bad:
        where = _grouped([line for line in bad if line.scene != EVERYWHERE] or bad)
        failed = f"{len(bad)} of {len(own)} lines fail: {where}."
    refused = [
        f"No answer in {len(found)} experiments of {scene}; the first: {found[0][1]}"
        for (scene, m), found in study.troubles.items()
        if m == method
    ]
    table = table_of(own, ranks=any(line.histogram for line in own))
    return {"title": title, "says": says, "failed": failed, "refused": refused, "table": table}


def _grouped(lines: Sequence[Line]) -> str:
    scenes: dict[str, list[str]] = {}
    for line in lines:
        scenes.setdefault(line.scene, []).append(f"{line.name} ({line.verdict.removeprefix('FAILS: ')})")
    return "; ".join(f"{scene}: {', '.join(names)}" for scene, names in scenes.items())


def _controls(study: Study) -> str:
    rows = []
    for method in controls_of(study):
        own = [line for line in study.lines if line.method == method]
        failed = sum(not line.holds for line in own)
        worst = min(own, key=lambda line: line.coverage[-1])
        least = f"{100 * worst.coverage[-1]:.1f} % ({worst.scene}, {worst.name})"
        word = "fails" if failed else bold("passes: the test is blind", when=True)
        rows.append((method, f"{failed} of {len(own)}", p_words(min(x.adjusted for x in own)), least, word))
    head = ("control", "lines that fail:", "smallest adjusted p:", "lowest coverage at 95 %:", "must fail")
    return markdown(head, rows)


if __name__ == "__main__":
    sys.exit(main())
