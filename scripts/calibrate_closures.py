"""Recovery of closures by their evidence; writes docs/closure-recovery.md.

``python scripts/calibrate_closures.py [--repeats 500] [--controls 100] [--ties 100] [--workers N]``

Exit status 1 if the probabilities are not right as often as they say, or if a negative control passes.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

# first: it sets the number of threads
from studies import markdown, publish, render, study_parser, versions, watched

# isort: split
import numpy as np
from calibration_verdict import FAMILY
from closure_study import (
    BOUNDS,
    GAMMA,
    INERTIA,
    N_BETA,
    N_E_N,
    RIGHT,
    SIGMA,
    Seen,
    lines_of,
    run_many,
    seen_by,
    tasks_of,
)
from closure_ties import Tie, tie_lines, ties

from ifrfit.inference.comparison.verdict import SCALE
from ifrfit.physics.closures import get_closure

SEED = 20240229
CLOSE = 1e-3  # of a log Bayes factor to the integrals by hand


def main() -> int:
    """Run the study; exit status 1 if it does not come out as it must."""
    parser = study_parser(__doc__, SEED, "closure-recovery.md")
    parser.add_argument("--repeats", type=int, default=500, help="experiments of each closure")
    parser.add_argument("--controls", type=int, default=100, help="of these also seen with a wrong sigma")
    parser.add_argument("--ties", type=int, default=100, help="experiments in which two closures coincide")
    chosen = parser.parse_args()
    tasks = tasks_of(chosen.seed, chosen.repeats, chosen.controls)
    seen = seen_by(list(watched(run_many(tasks, chosen.workers), len(tasks), "Comparing")))
    found = ties(chosen.seed, chosen.ties)
    good = f"probabilities hold in {len(tasks)} experiments, every control fails"
    text = page(seen, found, chosen.seed)
    return publish(chosen.out / "closure-recovery.md", text, verdict(seen, found), good)


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


def page(seen: Sequence[Seen], found: Sequence[Tie], seed: int) -> str:
    """Return the page as text."""
    right = next(one for one in seen if one.method == RIGHT)
    lines = lines_of(right)
    bad = verdict(seen, found)
    good = "Probabilities of the closures are right as often as they say; every negative control fails."
    bins = [
        (
            get_closure(line.scene).title,
            line.name,
            line.n,
            f"{line.coverage[1]:.3f}",
            f"{line.coverage[0]:.3f}",
            f"{line.adjusted:.2g}",
        )
        for line in lines
    ]
    head = ("closure", "probability given", "experiments", "mean probability", "share right", "adjusted p")
    return render(
        "closure_recovery.md",
        result="Not as it must be: " + "; ".join(bad) + "." if bad else good,
        each=right.truth.size // len(right.closures),
        n_beta=N_BETA,
        n_e_n=N_E_N,
        sigma=SIGMA,
        gamma=GAMMA,
        bounds=BOUNDS,
        domains=", ".join(
            f"{c.constant} of {c.title} {c.domain(INERTIA)[0]:g} to {c.domain(INERTIA)[1]:g}"
            for c in map(get_closure, right.closures)
            if c.constant
        ),
        seed=seed,
        versions=versions(),
        family=f"{FAMILY:g}",
        recovery=_recovery(right),
        share=f"{100 * (right.picked == right.truth).mean():.1f}",
        expected=f"{100 * right.probability.max(axis=1).mean():.1f}",
        least=f"{min(line.adjusted for line in lines if line.name == 'picked'):.2g}",
        bins=markdown(head, bins),
        words=_words(right),
        controls=_controls(seen),
        ties="\n".join(tie_lines(found)),
    )


def _recovery(right: Seen) -> str:
    titles = [get_closure(name).title for name in right.closures]
    rows = []
    for i, title in enumerate(titles):
        own = right.truth == i
        counts = np.bincount(right.picked[own], minlength=len(titles))
        expected = right.probability[right.picked == i, i].sum() / own.sum()
        rows.append((title, *counts, f"{100 * counts[i] / own.sum():.1f} %", f"{100 * expected:.1f} %"))
    return markdown(("made by", *(f"{title} is best" for title in titles), "right", "expected"), rows)


def _words(right: Seen) -> str:
    """How often each word of the scale is wrong."""
    edges = [0.0, *(least for least, _ in reversed(SCALE)), np.inf]
    words = ["no preference", *(word for _, word in reversed(SCALE))]
    rows = []
    for low, high, word in zip(edges[:-1], edges[1:], words, strict=True):
        own = (right.log_bayes_factor > low) & (right.log_bayes_factor <= high)
        wrong = (right.picked != right.truth)[own]
        expected = (1.0 - right.probability.max(axis=1))[own]
        ends = f"over {low:g}" if np.isinf(high) else f"{low:g} to {high:g}"
        rows.append((f"{ends}: {word}", own.sum(), wrong.sum(), f"{expected.sum():.1f}"))
    return markdown(("log Bayes factor over the next best", "experiments", "wrong", "expected"), rows)


def _controls(seen: Sequence[Seen]) -> str:
    rows = []
    for one in seen:
        if one.method != RIGHT:
            least = min(line.adjusted for line in lines_of(one))
            word = "fails" if least <= FAMILY else "PASSES"
            rows.append((one.method, one.truth.size, f"{least:.1e}", word))
    return markdown(("method", "experiments", "smallest adjusted p", ""), rows)


if __name__ == "__main__":
    sys.exit(main())
