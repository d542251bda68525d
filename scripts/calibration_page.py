"""The page of the calibration: docs/calibration.md as text."""

from __future__ import annotations

import math
import platform
from collections.abc import Iterable, Sequence
from importlib.metadata import version

import numpy as np
from calibration_methods import BOUNDED, COVARIANCE, EXACT, NARROW, PROFILE, WRONG
from calibration_scenes import SCENES, Scene
from calibration_study import CONTROLLED, Study
from calibration_verdict import BINS, EVERYWHERE, FAMILY, LEVELS, Line, passes

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


READING = f"""## How to read this

- **Coverage** ± its binomial standard error at the stated level. Below the level: intervals too narrow, the
  method is too sure of itself. Above: too wide.
- **p of ranks**: chi2 of the histogram of ranks. A bulge in the middle is a posterior too wide, a valley
  one too narrow, a slope a bias.
- **Adjusted p**: the smallest of the line's p values after Holm's rule over all tests of the method; the line
  fails at {FAMILY:g} and below.
- **{EVERYWHERE}**: the experiments of all scenes together, which shows faults too small for one scene.
- Coverage is an average over truths drawn from the prior, not a promise for each single truth.
- Covariance, least squares and profile do not know the prior. Where they miss their level, at a bound, at a
  kink or with few points, is where the exact posterior is needed.
- *n (m without)*: in m experiments the method has no interval; they are left out of the line.
- *noise[run/beta]* is the unknown sigma of the rows of beta.
"""


def page(study: Study, seed: int, repeats: int, n_profile: int) -> str:
    """Return the page as text."""
    parts = [
        _head(study, seed, repeats, n_profile),
        _scenes(study),
        _exact(study),
        *(_peer(study, method) for method in PEERS),
        _controls(study),
        READING,
    ]
    return "\n".join(parts)


def controls_of(study: Study) -> list[str]:
    """Negative controls that were tried; each must fail."""
    return [m for m in CONTROLS if any(line.method == m for line in study.lines)]


def verdict(study: Study) -> list[str]:
    """Sentences on what went wrong; none where exact passes and every control fails."""
    wrong = [
        f"exact fails: {line.scene}, {line.name} (adjusted p {line.adjusted:.1e})"
        for line in study.lines
        if line.method == EXACT and not line.holds
    ]
    if study.died(EXACT):
        wrong.append(f"exact gave no answer to {study.died(EXACT)} experiments")
    if not any(line.method == EXACT for line in study.lines):
        wrong.append("exact was not tested")
    tried = controls_of(study)
    wrong += [f"control passes: {m}" for m in tried if passes(study.lines, m)]
    wrong += [f"control was not tested: {m}" for m in CONTROLS if m not in tried]
    return wrong


def _head(study: Study, seed: int, repeats: int, n_profile: int) -> str:
    bad = verdict(study)
    n_tests = sum(len(line.tests) for line in study.lines if line.method == EXACT)
    good = (
        f"The exact posterior is calibrated in all {len(study.errors)} scenes; every negative control fails."
    )
    packages = ", ".join(f"{name} {version(name)}" for name in ("ifrfit", "numpy", "scipy", "pandas"))
    return f"""# Calibration of the intervals

Does a 95 % interval hold the truth in 95 % of experiments? Constants are drawn from the prior, an experiment
is simulated with them and fitted, and the truth is looked up in the posterior. If the posterior is right, the
rank of the truth in it is uniform (Cook, Gelman & Rubin 2006; Talts et al. 2018).

**{"Not as it must be: " + "; ".join(bad) + "." if bad else good}**

{repeats} experiments in each of the first four scenes (a twentieth of that in the others, which take longer),
the first {n_profile} of each profiled; seed {seed}; Python
{platform.python_version()}, {packages}. All data here are simulated. Written by `make calibrate`.

A method passes if none of its tests fails: chi2 of {BINS} bins of ranks, and the exact binomial tests of the
coverage of the {_levels()} % intervals, for every quantity in every scene and for all scenes together.
Holm's rule over all of them (exact: {n_tests} tests) keeps the chance that a right method fails anywhere
below {FAMILY:g}. The thresholds follow from that and from the number of experiments.
"""


def _levels() -> str:
    return ", ".join(f"{100 * level:.0f}" for level in LEVELS[:-1]) + f" and {100 * LEVELS[-1]:.0f}"


def _scenes(study: Study) -> str:
    rows = [
        "## Scenes\n",
        "| scene | prior, uniform | rows | noise | rows that slide |",
        "|---|---|---|---|---|",
    ]
    for name in study.errors:
        scene = SCENES[name]
        prior = ", ".join(f"{c} {a:g} to {b:g}" for c, (a, b) in scene.bounds.items())
        measured = (
            f"{scene.n_beta} beta at {scene.gamma[0]:g} to {scene.gamma[1]:g} degrees, {scene.n_e_n} e_n"
            + (" in each series" if len(scene.series) > 1 else "")
        )
        share = study.sliding[name]
        both = float(((share > 0.0) & (share < 1.0)).mean())
        rows.append(
            f"| **{name}**: {scene.says} | {prior} | {measured} | {_noise(scene)} "
            f"| {100 * share.mean():.0f} %; both regimes in {100 * both:.0f} % of experiments |"
        )
    return "\n".join(rows) + "\n"


def _noise(scene: Scene) -> str:
    known = ", ".join(f"{o} {s:g}" for o, s in scene.sigma.items())
    ends = ", ".join(f"{o} {a:g} to {b:g}" for o, (a, b) in scene.noise_bounds.items())
    if scene.policy == "scaled":
        return f"{known}, times a factor that is log-uniform from{ends}"
    return f"unknown, log-uniform: {ends}" if scene.noise_bounds else f"known: {known}"


def _exact(study: Study) -> str:
    parts = ["## Exact posterior\n", *table_of([x for x in study.lines if x.method == EXACT], ranks=True), ""]
    for scene, errors in study.errors.items():
        known = errors[np.isfinite(errors)]
        died = study.troubles.get((scene, EXACT), [])
        if known.size:
            parts.append(
                f"- {scene}: error that the posterior states of itself at most {known.max():.1e}, "
                f"above 1e-4 in {int((known > 1e-4).sum())} of {known.size}"
                + (
                    f"; no answer in {len(died)}, the first (experiment {died[0][0]}): {died[0][1]}"
                    if died
                    else ""
                )
            )
    parts += ["", f"![Histograms of the ranks in {BINS} bins](calibration/ranks.svg)", ""]
    return "\n".join(parts)


def table_of(lines: Iterable[Line], *, ranks: bool) -> list[str]:
    """Coverage, ranks and verdict of each line."""
    some = list(lines)
    shown = [i for i in range(len(LEVELS)) if any(not math.isnan(line.coverage[i]) for line in some)]
    titles = " | ".join(f"{100 * LEVELS[i]:.0f} %" for i in shown)
    head = (
        f"| scene | quantity | n | {titles} |"
        + (" p of ranks |" if ranks else "")
        + " adjusted p | verdict |"
    )
    rows = [head, "|---|---|---:|" + "---:|" * (len(shown) + ranks + 1) + "---|"]
    for line in some:
        coverage = " | ".join(f"{100 * line.coverage[i]:.1f} ± {100 * line.errors[i]:.1f}" for i in shown)
        p = f" {_p(line.p_ranks)} |" if ranks else ""
        n = f"{line.n}" + (f" ({line.absent} without)" if line.absent else "")
        verdict = line.verdict if line.holds else f"**{line.verdict}**"
        rows.append(f"| {line.scene} | {line.name} | {n} | {coverage} |{p} {_p(line.adjusted)} | {verdict} |")
    return rows


def _p(p: float) -> str:
    if math.isnan(p):
        return "–"
    return f"{p:.3f}" if p >= 1e-3 else f"{p:.0e}" if p > 1e-99 else "< 1e-99"


def _peer(study: Study, method: str) -> str:
    title, says = PEERS[method]
    own = [line for line in study.lines if line.method == method]
    if not own:
        return ""
    failed = [line for line in own if not line.holds]
    parts = [f"## {title}\n", says, ""]
    if failed:
        where = _grouped([line for line in failed if line.scene != EVERYWHERE] or failed)
        parts.append(f"Published as measured. {len(failed)} of {len(own)} lines fail: {where}.")
    else:
        parts.append("Published as measured. No line fails.")
    refused = {scene: found for (scene, m), found in study.troubles.items() if m == method}
    for scene, found in refused.items():
        parts.append(f"No answer in {len(found)} experiments of {scene}; the first: {found[0][1]}")
    ranked = any(line.histogram for line in own)
    return "\n".join([*parts, "", *table_of(own, ranks=ranked), ""])


def _grouped(lines: Sequence[Line]) -> str:
    scenes: dict[str, list[str]] = {}
    for line in lines:
        scenes.setdefault(line.scene, []).append(f"{line.name} ({line.verdict.removeprefix('FAILS: ')})")
    return "; ".join(f"{scene}: {', '.join(names)}" for scene, names in scenes.items())


def _tried(study: Study) -> int:
    return max((study.asked.get((CONTROLLED, method), 0) for method in WRONG), default=0)


def _controls(study: Study) -> str:
    parts = [
        "## Negative controls\n",
        "Deliberately wrong, through the same test: if one of them passed, the test would be worth nothing. "
        f"The wrong likelihoods are tried on the first {_tried(study)} experiments of *{CONTROLLED}*.\n",
        "| control | lines that fail | smallest adjusted p | lowest coverage at 95 % | must fail |",
        "|---|---:|---:|---:|---|",
    ]
    for method in controls_of(study):
        own = [line for line in study.lines if line.method == method]
        failed = [line for line in own if not line.holds]
        worst = min(own, key=lambda line: line.coverage[-1])
        parts.append(
            f"| {method} | {len(failed)} of {len(own)} | {_p(min(line.adjusted for line in own))} "
            f"| {100 * worst.coverage[-1]:.1f} % ({worst.scene}, {worst.name}) "
            f"| {'fails' if failed else '**passes: the test is blind**'} |"
        )
    return "\n".join([*parts, ""])
