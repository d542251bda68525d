"""Recovery of closures by their evidence; writes docs/closure-recovery.md.

``python scripts/calibrate_closures.py [--repeats 500] [--controls 100] [--ties 100] [--workers N]``

Exit status 1 if the probabilities are not right as often as they say, or if a negative control passes.
"""

from __future__ import annotations

import sys

from studies import study_parser

SEED = 20240229


def main() -> int:
    """Run the study; exit status 1 if it does not come out as it must."""
    parser = study_parser(__doc__, SEED, "closure-recovery.md")
    parser.add_argument("--repeats", type=int, default=500, help="experiments of each closure")
    parser.add_argument("--controls", type=int, default=100, help="of these also seen with a wrong sigma")
    parser.add_argument("--ties", type=int, default=100, help="experiments in which two closures coincide")
    chosen = parser.parse_args()
    from closure_page import page, verdict
    from closure_study import run_many, seen_by, tasks_of
    from closure_ties import ties
    from rich.console import Console
    from rich.progress import track

    console = Console(stderr=True)
    tasks = tasks_of(chosen.seed, chosen.repeats, chosen.controls)
    outcomes = run_many(tasks, chosen.workers)
    shown = track(outcomes, "Comparing", len(tasks), console=console, disable=not console.is_terminal)
    seen = seen_by(list(shown))
    found = ties(chosen.seed, chosen.ties)
    chosen.out.mkdir(parents=True, exist_ok=True)
    path = chosen.out / "closure-recovery.md"
    path.write_text(page(seen, found, chosen.seed), encoding="utf-8")
    wrong = verdict(seen, found)
    print("\n".join(wrong) or f"probabilities hold in {len(tasks)} experiments, every control fails")
    print(f"written: {path}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
