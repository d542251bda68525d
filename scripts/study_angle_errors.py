"""What errors of the angle do to a fit, and what each treatment makes of them; writes docs/angle-errors.md.

``python scripts/study_angle_errors.py [--repeats 200] [--calibrate 200] [--workers N] [--seed S]``

Exit status 1 if the exact posterior is not calibrated under a scatter that it is told.
"""

from __future__ import annotations

import sys

from studies import study_parser

SEED = 20260514


def main() -> int:
    """Run both parts; exit status 1 if a calibration fails."""
    parser = study_parser(__doc__, SEED, "angle-errors.md")
    parser.add_argument("--repeats", type=int, default=200, help="experiments of each kind of angle")
    parser.add_argument("--calibrate", type=int, default=200, help="experiments of each scatter")
    chosen = parser.parse_args()
    from angle_errors_page import page
    from angle_errors_study import summarise, treat_many
    from calibration_scenes import SCATTERED
    from calibration_study import gather, run_many, tasks_of

    treated = summarise(treat_many(chosen.seed, chosen.repeats, chosen.workers))
    tasks = tasks_of(chosen.seed, chosen.calibrate, 0, 0, peers=False, scenes=tuple(SCATTERED))
    study = gather(run_many(tasks, chosen.workers))
    text, wrong = page(treated, study, chosen.seed, chosen.repeats, chosen.calibrate)
    (chosen.out / "angle-errors.md").write_text(text, encoding="utf-8")
    print("\n".join(wrong) or "exact is calibrated under every scatter")
    print(f"written: {chosen.out / 'angle-errors.md'}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
