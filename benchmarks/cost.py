"""What accuracy costs in time, on the bundled data that the README shows.

``python benchmarks/cost.py [--quick] [--kind inference] [--out DIR] [--readme]``
"""

from __future__ import annotations

import argparse
import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import Any

# first: it sets the number of threads
from _common import RESULTS, machine, put_into_readme

# isort: split
from ifrfit.cost.measure import KINDS, measure_costs
from ifrfit.cost.result import Costs
from ifrfit.report.provenance import is_stand_in, kinds_of, provenance_words

ROOT = Path(__file__).resolve().parents[1]
SHOWN = ROOT / "docs" / "cost"  # what the README shows
# dataset, and what is known of it: e_n of a drop test, or of the paper
QUESTIONS: Mapping[str, Mapping[str, Any]] = {
    "kharaz-2001": {"prior": {"e_n": (0.98, 0.01)}},
    "cross-2019": {"fix": {"e_n": 0.94}},
}


def measure(name: str, kinds: list[str], quick: bool) -> Costs:
    found = measure_costs(name, kinds=kinds or KINDS, quick=quick, **QUESTIONS[name])
    print(f"\n{found.summary()}\n", flush=True)
    return found


def shown(found: Mapping[str, Costs]) -> list[str]:
    """The diagrams of inference and their sentences, for the README."""
    names = list(found)
    pictures = [
        f"![{name}: error against time of every method of inference](cost/{name}/cost-inference.svg)"
        for name in names
    ]
    heads = [f"{name}, {_provenance(found[name])}" for name in names]
    lines = [_row(heads), "|" + "---|" * len(names), _row(pictures), ""]
    for name in names:
        said = f"- {name}: {'. '.join(found[name].sentences('inference'))}."
        lines += textwrap.wrap(said, 118, subsequent_indent="  ", break_on_hyphens=False)
    return [*lines, "", f"Measured on {machine('emcee')}."]


def _row(cells: list[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _provenance(costs: Costs) -> str:
    if is_stand_in(costs.fit):
        return "**STAND-IN data**"
    return provenance_words(kinds_of(costs.fit, costs.fit.inputs[0]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kind", action="append", default=[], choices=KINDS, help="by default all")
    parser.add_argument("--quick", action="store_true", help="fewer settings and repeats")
    parser.add_argument("--out", type=Path, help="folder; benchmarks/results/cost if not given")
    parser.add_argument(
        "--readme", action="store_true", help="results to docs/cost, sentences to docs/cost.md"
    )
    options = parser.parse_args()
    if options.readme and (options.out or (options.kind and "inference" not in options.kind)):
        parser.error("--readme shows inference, from docs/cost: leave --out out, and --kind or add inference")
    out = options.out or (SHOWN if options.readme else RESULTS / "cost")
    print(machine("emcee"))
    found = {}
    for name in QUESTIONS:
        found[name] = measure(name, options.kind, options.quick)
        found[name].save(out / name, force=True)
    if options.readme:
        put_into_readme("cost", shown(found), ROOT / "docs" / "cost.md")


if __name__ == "__main__":
    main()
