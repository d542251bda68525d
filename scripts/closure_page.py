"""The page on recovery of closures: docs/closure-recovery.md as text."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from importlib.metadata import version

import numpy as np
from calibration_verdict import FAMILY, Line
from closure_study import BOUNDS, GAMMA, INERTIA, N_BETA, N_E_N, RIGHT, SIGMA, Seen, lines_of
from closure_ties import Tie, tie_lines

from ifrfit.inference.comparison.verdict import SCALE
from ifrfit.physics.closures import get_closure

CLOSE = 1e-3  # of a log Bayes factor to the integrals by hand


def verdict(seen: Sequence[Seen], ties: Sequence[Tie]) -> list[str]:
    """Sentences on what went wrong; none where the evidence is calibrated and every control fails."""
    wrong = []
    for one in seen:
        bad = [line for line in lines_of(one) if not line.holds]
        if one.method == RIGHT:
            wrong += [f"{line.scene}, {line.name}: adjusted p {line.adjusted:.1e}" for line in bad]
        elif not bad:
            wrong.append(f"control passes: {one.method}")
    off = max(abs(one.exact - one.by_hand) for one in ties)
    if off > CLOSE:
        wrong.append(f"a tie is off by {off:.1e}")
    return wrong


def page(seen: Sequence[Seen], ties: Sequence[Tie], seed: int) -> str:
    """Return the page as text."""
    right = next(one for one in seen if one.method == RIGHT)
    lines = lines_of(right)
    bad = verdict(seen, ties)
    good = "Probabilities of the closures are right as often as they say; every negative control fails."
    return "\n".join(
        [
            _head("Not as it must be: " + "; ".join(bad) + "." if bad else good, right, seed),
            *_recovery(right, lines),
            *_bins(lines),
            *_scale(right),
            *_controls(seen),
            "## Where closures coincide",
            "",
            *tie_lines(ties),
            "",
        ]
    )


def _head(result: str, right: Seen, seed: int) -> str:
    each = right.truth.size // len(right.closures)
    domains = ", ".join(
        f"{c.constant} of {c.title} {c.domain(INERTIA)[0]:g} to {c.domain(INERTIA)[1]:g}"
        for c in map(get_closure, right.closures)
        if c.constant
    )
    packages = ", ".join(f"{name} {version(name)}" for name in ("ifrfit", "numpy", "scipy"))
    return f"""# Recovery of closures by their evidence

If the evidence says that a closure has made the data with probability p, is it so in a share p of them?
Constants are drawn from the prior, an experiment is simulated with each closure in turn, and the log evidence
of every closure is integrated. All closures are equally probable before.

**{result}**

{each} experiments of each closure: {N_BETA} values of beta (sigma {SIGMA["beta"]:g}) at {GAMMA[0]:g} to
{GAMMA[1]:g} degrees and {N_E_N} of e_n (sigma {SIGMA["e_n"]:g}). Priors, uniform: e_n
{BOUNDS["e_n"][0]:g} to {BOUNDS["e_n"][1]:g}, mu {BOUNDS["mu"][0]:g} to {BOUNDS["mu"][1]:g}, {domains}.
Seed {seed}; Python {platform.python_version()}, {packages}. All data here are simulated. Written by
`make calibrate`.

Tests: the number of experiments that are right in each bin, against the exact law of so many independent
events with the probabilities given (Poisson-binomial). As many experiments of each closure are made, so these
laws are a little wide. Holm's rule over all tests keeps the chance of a false alarm below {FAMILY:g}.
"""


def _recovery(right: Seen, lines: Sequence[Line]) -> list[str]:
    titles = [get_closure(name).title for name in right.closures]
    rows = [
        "## How often the right closure has the largest evidence",
        "",
        "| made by | " + " | ".join(f"{title} is best" for title in titles) + " | right | expected |",
        "|---" * (len(titles) + 3) + "|",
    ]
    for i, title in enumerate(titles):
        own = right.truth == i
        counts = [int((right.picked[own] == j).sum()) for j in range(len(titles))]
        expected = right.probability[right.picked == i, i].sum() / own.sum()
        rows.append(
            f"| {title} | {' | '.join(map(str, counts))} | {100 * counts[i] / own.sum():.1f} % "
            f"| {100 * expected:.1f} % |"
        )
    share, theory = (right.picked == right.truth).mean(), right.probability.max(axis=1).mean()
    least = min(line.adjusted for line in lines if line.name == "picked")
    return [
        *rows,
        "",
        f"*Expected* is what the probabilities themselves say. Over all: {100 * share:.1f} % right,",
        f"{100 * theory:.1f} % expected (smallest adjusted p of these {least:.2g}).",
        "",
    ]


def _bins(lines: Sequence[Line]) -> list[str]:
    rows = [
        "## Probabilities and shares",
        "",
        "| closure | probability given | experiments | mean probability | share right | adjusted p |",
        "|---|---|---|---|---|---|",
    ]
    rows += [
        f"| {get_closure(line.scene).title} | {line.name} | {line.n} | {line.coverage[1]:.3f} "
        f"| {line.coverage[0]:.3f} | {line.adjusted:.2g} |"
        for line in lines
    ]
    return [*rows, ""]


def _scale(right: Seen) -> list[str]:
    """How often each word of the scale is wrong."""
    rows = [
        "## The words of the verdict",
        "",
        "| log Bayes factor over the next best | experiments | wrong | expected |",
        "|---|---|---|---|",
    ]
    edges = [0.0, *(least for least, _ in reversed(SCALE)), np.inf]
    words = ["no preference", *(word for _, word in reversed(SCALE))]
    for low, high, word in zip(edges[:-1], edges[1:], words, strict=True):
        own = (right.log_bayes_factor > low) & (right.log_bayes_factor <= high)
        wrong = (right.picked != right.truth)[own]
        expected = (1.0 - right.probability.max(axis=1))[own]
        ends = f"over {low:g}" if np.isinf(high) else f"{low:g} to {high:g}"
        rows.append(f"| {ends}: {word} | {own.sum()} | {wrong.sum()} | {expected.sum():.1f} |")
    return [*rows, ""]


def _controls(seen: Sequence[Seen]) -> list[str]:
    rows = ["## Negative controls, which must fail", "", "| method | experiments | smallest adjusted p | |"]
    rows.append("|---|---|---|---|")
    for one in seen:
        if one.method != RIGHT:
            least = min(line.adjusted for line in lines_of(one))
            word = "fails" if least <= FAMILY else "PASSES"
            rows.append(f"| {one.method} | {one.truth.size} | {least:.1e} | {word} |")
    return [*rows, ""]
