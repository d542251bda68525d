"""The page of the study: docs/angle-errors.md as text."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from importlib.metadata import version

from angle_errors_study import ANGLES, KINDS, LEVEL, SIGMA, SIGMA_GAMMA, TRUTH, N, Summary
from calibration_methods import EXACT
from calibration_page import table_of
from calibration_scenes import SCATTERED
from calibration_study import Study
from calibration_verdict import FAMILY

_WORDS = {
    "set": "Angles were set; the true ones scatter about them",
    "measured": "Angles were measured; they scatter about the true ones",
}
_SEEN = 3.0  # standard errors beyond which a bias or a miscoverage is called one


def page(
    treated: Sequence[Summary], study: Study, seed: int, repeats: int, calibrated: int
) -> tuple[str, list[str]]:
    """Return the page, and what went wrong: scatter under which the exact posterior is not calibrated."""
    lines = [line for line in study.lines if line.method == EXACT]
    wrong = [
        f"exact fails under {line.scene}: {line.name} (adjusted p {line.adjusted:.1e})"
        for line in lines
        if not line.holds
    ]
    if study.died(EXACT):
        wrong.append(f"exact gave no answer to {study.died(EXACT)} experiments")
    packages = ", ".join(f"{name} {version(name)}" for name in ("ifrfit", "numpy", "scipy"))
    parts = [
        "# Errors of the angle\n",
        "What errors of the angle do to a fit across the transition, and what each treatment "
        "([noise.md](noise.md)) makes of them. All data here are simulated; "
        f"seed {seed}; Python {platform.python_version()}, {packages}. Written by `make calibrate`.\n",
        "## Bias and coverage\n",
        f"{N} values of beta with sigma {SIGMA:g} between {ANGLES[0]:g} and {ANGLES[1]:g} degrees, "
        f"angles uncertain by {SIGMA_GAMMA:g} degrees, closure IFR with "
        + ", ".join(f"{name} = {value:g}" for name, value in TRUTH.items())
        + f", e_n held; {repeats} experiments of each kind, the exact posterior's mean and "
        f"{100 * LEVEL:g} % interval. **Bold**: more than {_SEEN:g} standard errors from none, or from "
        f"{100 * LEVEL:g} %.\n",
    ]
    for kind in KINDS:
        parts += [f"### {_WORDS[kind]}\n", *_treatments([one for one in treated if one.kind == kind]), ""]
    parts += [
        "## Calibration\n",
        f"Constants are drawn from the prior and {calibrated} experiments of each scatter simulated; the "
        "exact posterior is told the scatter. The test is that of [calibration.md](calibration.md): a right "
        f"method fails anywhere with a chance below {FAMILY:g}.\n",
        *(f"- **{name}**: {SCATTERED[name].says}" for name in study.errors),
        "",
        "**"
        + ("Not as it must be: " + "; ".join(wrong) if wrong else "Calibrated under every scatter")
        + ".**\n",
        *table_of(lines, ranks=True),
        "",
    ]
    return "\n".join(parts), wrong


def _treatments(own: Sequence[Summary]) -> list[str]:
    rows = [
        "| treatment | constant | bias | spread of means | stated sd | in the 95 % interval |",
        "|---|---|---:|---:|---:|---:|",
    ]
    for one in own:
        bias = f"{one.bias:+.4f} ± {one.error:.4f}"
        covered = f"{100 * one.coverage:.1f} ± {100 * one.coverage_error:.1f} %"
        if abs(one.bias) > _SEEN * one.error:
            bias = f"**{bias}**"
        if abs(one.coverage - LEVEL) > _SEEN * one.coverage_error:
            covered = f"**{covered}**"
        rows.append(
            f"| {one.treatment} | {one.constant} | {bias} | {one.spread:.4f} | {one.stated:.4f} | {covered} |"
        )
    return rows
