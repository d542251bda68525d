"""How the chains of a sampler mixed, where one ran."""

from __future__ import annotations

from collections.abc import Sequence

from ifrfit.report.page.blocks import Block, Findings, Table
from ifrfit.report.page.plugins import ReportSection
from ifrfit.report.page.report_input import ReportInput

_WORDS = {
    "rhat": "R-hat",
    "ess_bulk": "bulk ESS",
    "ess_tail": "tail ESS",
    "tau": "autocorrelation time, steps",
    "walkers": "walkers of each",
    "discarded": "steps discarded at first",
    "acceptance": "share of moves accepted",
    "rhat_max": "largest R-hat",
    "ess_bulk_min": "smallest bulk ESS",
    "ess_tail_min": "smallest tail ESS",
    "tau_max": "longest autocorrelation time, steps",
    "steps_more": "further steps needed",
    "change": "last relative change of the noise",
}


def build(given: ReportInput) -> Sequence[Block] | None:
    """R-hat, effective sample sizes and the rule they meet or miss; None where no chain ran."""
    fact = given.result.facts.get("converged")
    each = None if fact is None else fact.figures.get("each")
    if fact is None or not each:
        return None
    plain = {key: value for key, value in fact.figures.items() if isinstance(value, int | float)}
    blocks: list[Block] = [Findings((("ok" if fact.ok else "LOOK", fact.says),))]
    keys = list(dict.fromkeys(key for column in each.values() for key in column))
    rows = tuple((name, *(_cell(own.get(key)) for key in keys)) for name, own in each.items())
    head = ("quantity", *(_words(key) for key in keys))
    blocks.append(Table("By quantity.", head, rows, frozenset(range(1, len(head)))))
    if plain:
        rows = tuple((_words(key), _cell(value)) for key, value in plain.items())
        blocks.append(Table(f"Overall. Rule: {fact.threshold}.", ("figure", "value"), rows, frozenset({1})))
    return blocks


def _words(key: str) -> str:
    return _WORDS.get(key, key.replace("_", " "))


def _cell(value: object) -> str:
    if value is None:
        return "-"
    return f"{value:.5g}" if isinstance(value, int | float) and not isinstance(value, bool) else str(value)


SECTION = ReportSection("chains", "Chains", build)
