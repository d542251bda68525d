"""The printed table of `reproduce`: constants with what they say, data proper first, then stand-ins."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.types import Estimate
from ifrfit.paper.claims import Answer
from ifrfit.paper.recovered_constants import LEVEL, FittedCase, Line, chance, count_recovered
from ifrfit.report.provenance import contents
from ifrfit.report.rounding import places_of, value_text
from ifrfit.report.sentences import is_quiet
from ifrfit.text import as_given, interval_text, joined, p_text, sd_text

WIDTH = 100
_COLUMNS = f"  {'':<4} {'printed':>7} {'value':>9} {'sd':>7}  {'95 % interval':<18}  {'status':<14}  "
_WARNING = (
    "STAND-INS, generated from the constants the paper prints. That a fit recovers what was put in shows "
    "that the tool works; it says nothing about the experiments."
)
_QUESTION = (
    "DOES ONE SET OF CONSTANTS HOLD ACROSS BOTH REGIMES? And what else the paper leaves to real points."
)


_REFUTING = ("lack_of_fit", "normal_restitution")


def table_text(done: Sequence[FittedCase], answers: Sequence[Answer]) -> str:
    """Write the table, then the questions that only real points answer; at most 100 columns wide."""
    blocks: dict[bool, list[str]] = {False: [], True: []}
    for d in done:
        if d.result is not None:
            blocks[d.stand_in].append(_block(d, d.result))
    kinds = dict.fromkeys(line.provenance for d in done if not d.stand_in for line in d.lines)
    parts = [f"DATA, {joined(list(kinds))}", *blocks[False]] if blocks[False] else []
    parts += [
        "\n".join(_wrapped(f"{d.name}: not fitted to your own data. {d.refusal}", ""))
        for d in done
        if d.refusal
    ]
    if blocks[True]:
        parts += ["\n".join(_wrapped(_WARNING, "", "")), *blocks[True], _score(done)]
    if answers:
        lines = [line for answer in answers for line in _wrapped(answer.sentence)]
        parts.append("\n".join([*_wrapped(_QUESTION, "", ""), *lines]))
    return "\n\n".join(parts) + "\n" if parts else ""


def _score(done: Sequence[FittedCase]) -> str:
    hits, k = count_recovered(done)
    words = (
        f"{hits} of {k} identifiable 95 % intervals hold the value put in; {LEVEL * k:.1f} are expected, and "
        f"{hits} or fewer have the binomial probability {chance(hits, k):.2g}. Seeds are hashes of the "
        "datasets' names. Impacts fitted through another observable are not counted again; constants of one "
        "fit share their data, so the count is only roughly binomial."
    )
    return "\n".join(_wrapped(words, "", ""))


def _block(done: FittedCase, result: FitResult) -> str:
    rows = [
        *_wrapped(f"{done.name}   {contents(result, result.inputs[0])}", "", "    "),
        *_wrapped(done.case.reason),
        _COLUMNS + ("what it says" if done.stand_in else "reading"),
    ]
    estimates = result.flat_constants()
    valid = all(result.facts[name].ok for name in _REFUTING if name in result.facts)
    for line in done.lines:
        found = estimates[line.constant]
        printed = "" if line.printed is None else as_given(line.printed)
        span = "" if found.status == "fixed" else interval_text(found.interval95, places_of(found))
        sd = "-" if found.stderr is None or found.value is None else sd_text(found.stderr)
        says = _recovery(line) if done.stand_in else _reading(line, found, valid=valid)
        rows.append(
            f"  {line.constant:<5} {printed:>6} {value_text(found):>9} {sd:>7}  {span:<18}  "
            f"{found.status.replace('_', ' '):<14}  {says}"
        )
    rows += _wrapped(_facts(result) if done.stand_in else f"verdict: {_verdict(result)}")
    return "\n".join(rows)


def _wrapped(sentence: str, indent: str = "  ", hang: str = "    ") -> list[str]:
    return textwrap.wrap(
        sentence, WIDTH, initial_indent=indent, subsequent_indent=hang, break_on_hyphens=False
    )


def _recovery(line: Line) -> str:
    """What a constant of a stand-in says: whether it is what was put in, never more."""
    if line.status == "fixed":
        return "given to the fit"
    if line.recovers is None:
        return "not told by these rows"
    return "recovers what was put in" if line.recovers else "misses what was put in"


def _reading(line: Line, found: Estimate, *, valid: bool) -> str:
    if found.status == "fixed":
        return "given to the fit"
    if not valid:
        return "not valid, see verdict"
    if line.recovers is not None:
        return "agrees with print" if line.recovers else "differs from print"
    plain = {
        "determined": "found",
        "prior": "rests on the prior",
        "not_determined": "these data do not tell",
    }
    return plain.get(found.status, found.reason)


def _facts(result: FitResult) -> str:
    """Identifiability and lack of fit of a stand-in, in a line."""
    lack = result.facts["lack_of_fit"]
    p = lack.figures.get("p")
    fit = ("no lack of fit" if lack.ok else "lack of fit") + (f" (p = {p_text(p)})" if p is not None else "")
    known = "identifiable" if result.facts["identifiable"].ok else "not all constants identifiable"
    return f"{known}; {fit}"


def _verdict(result: FitResult) -> str:
    failing = [fact.says for name, fact in result.facts.items() if not fact.ok and not is_quiet(name, fact)]
    return "; ".join(failing) or result.facts["lack_of_fit"].says
