"""How often a table of two balls passes without a word, and how often a clean one is said to be of two.

Tables of `two_balls`, fitted by least squares with all their facts. A constant is confidently wrong where it
lies more than three standard deviations off that of the ball that most impacts are of.
"""

from __future__ import annotations

import json
import warnings
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from studies import in_order, study_parser, watched

SEED = 5
WRONG = 3.0
OF_DESIGN = ("identifiable", "at_bound", "noise_dof", "noise_modes", "global_optimum", "converged")


def fitted(task: tuple[int, int, str, bool]) -> dict[str, Any]:
    """What the facts of one table say, and how far its constants are off."""
    from two_balls import two_balls

    import ifrfit

    seed, number, errors, clean = task
    made = two_balls(seed, number, errors, clean=clean)
    warnings.simplefilter("ignore")
    try:
        fit = ifrfit.fit(made.frames, **made.options)
    except (ifrfit.UsageError, ifrfit.DataError) as refused:
        return made.scene | {"number": number, "clean": clean, "refused": str(refused)}
    failing = [name for name, fact in fit.facts.items() if fact.ok is False and name not in OF_DESIGN]
    off = {
        name: abs(one.value - made.truth[name]) / one.stderr
        for name, one in fit.constants.items()
        if one.status in ("determined", "one_sided") and one.stderr
    }
    kinds = fit.facts.get("mixture")
    says = {} if kinds is None else dict(kinds.figures)
    return made.scene | {"number": number, "clean": clean, "failing": failing, "off": off, "mixture": says}


def main() -> None:
    """Run the study and print its tables."""
    parser = study_parser(__doc__, SEED)
    parser.add_argument("--clean", type=int, default=1000, help="tables of one ball, errors in turn")
    parser.add_argument("--mixed", type=int, default=1000, help="tables of two balls")
    parser.add_argument("--json", type=Path, help="file for every fit")
    asked = parser.parse_args()
    from two_balls import ERRORS

    tasks = [(asked.seed, i, ERRORS[i % len(ERRORS)], True) for i in range(asked.clean)]
    tasks += [(asked.seed, i, "", False) for i in range(asked.mixed)]
    fits = list(watched(in_order(fitted, tasks, asked.workers), len(tasks), "tables"))
    if asked.json:
        asked.json.write_text(json.dumps(fits, default=float), encoding="utf-8")
    print("\n".join(tables([one for one in fits if "refused" not in one])))


def tables(fits: Sequence[dict[str, Any]]) -> list[str]:
    """Lines of text: clean tables by errors, those of two balls by what is measured and what differs."""
    lines = ["clean tables: fits, named a mixture, any fact"]
    for name, own in _grouped([one for one in fits if one["clean"]], "errors"):
        lines.append(f"  {name:28s} {len(own):5d} {_named(own):5d} {sum(map(_fails, own)):5d}")
    lines.append("two balls: fits, named a mixture, wrong by 3 sd, of these without a word, all well")
    mixed = [one for one in fits if not one["clean"]]
    for key in ("", "observables", "differs", "place", "order", "known", "series"):
        for name, own in _grouped(mixed, key):
            wrong = [one for one in own if max(one["off"].values(), default=0.0) > WRONG]
            counts = (
                len(own),
                _named(own),
                len(wrong),
                *(sum(not _fails(x) for x in of) for of in (wrong, own)),
            )
            lines.append(f"  {key} {name:26s} {' '.join(f'{count:5d}' for count in counts)}")
    lines.append(f"  said: {Counter(name for one in mixed for name in one['failing']).most_common(14)}")
    return lines


def _fails(one: dict[str, Any]) -> bool:
    return bool(one["failing"])


def _named(fits: Sequence[dict[str, Any]]) -> int:
    return sum("mixture" in one["failing"] for one in fits)


def _grouped(fits: Sequence[dict[str, Any]], key: str) -> list[tuple[str, list[dict[str, Any]]]]:
    groups: dict[str, list[dict[str, Any]]] = {}
    for one in fits:
        groups.setdefault(str(one[key]) if key else "all", []).append(one)
    return sorted(groups.items())


if __name__ == "__main__":
    main()
