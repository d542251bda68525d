"""What accuracy costs, as text for a terminal: a table a kind, and what follows from it."""

from __future__ import annotations

import platform
import textwrap
from collections.abc import Sequence
from html import escape

import numpy as np

from ifrfit.cost.inference_costs import Reference
from ifrfit.cost.pareto_front import Choice
from ifrfit.cost.report.sentences import choice_name, error_text, sentences
from ifrfit.cost.result import Costs
from ifrfit.cost.timing import Kind, machine
from ifrfit.physics import CLOSURES
from ifrfit.report.sentences import noise_words
from ifrfit.report.terminal import aligned, finding_lines, source_lines, wrapped
from ifrfit.text import duration, joined, power_of_ten

FRONT = "*"
_NAMES = 52  # columns of a method with its setting
_HEADS = {"mean": "mean", "sd": "sd", "interval95": "95 % ends"}


def summary(costs: Costs) -> str:
    """Tables and sentences.

    Returns
    -------
    str
        At most 100 columns; ends without a line feed.
    """
    lines = source_lines(costs.fit)
    lines += wrapped(_model(costs), 2)
    front = f"{FRONT}: nothing here is both as fast and as exact"
    lines += wrapped(f"measured now, on {machine_words()}; {front}", 2)
    for kind in costs.kinds:
        lines += ["", *wrapped(heading(costs, kind), 4), ""]
        lines += _precisions(costs) if kind == "arithmetic" else _table(costs.of(kind))
        lines.append("")
        for says in sentences(costs, kind):
            lines += finding_lines("", says)
    if costs.notes:
        lines.append("")
    for note in costs.notes:
        lines += finding_lines("note", note)
    return "\n".join(line.rstrip() for line in lines).rstrip("\n")


def html(costs: Costs) -> str:
    """The summary as an HTML fragment for notebooks; what comes from data is escaped."""
    return f"<pre>{escape(summary(costs))}</pre>"


def machine_words() -> str:
    """Processors and versions."""
    own = machine()
    cores = f"{own['cores']} core{'s' if own['cores'] != 1 else ''}"
    where = f"{own['architecture']}, {own['system']}"
    return f"{cores} ({where}), Python {platform.python_version()}, numpy {np.__version__}"


def heading(costs: Costs, kind: Kind) -> str:
    """What was measured, and against what."""
    if kind == "inference":
        reference = costs.reference
        assert reference is not None
        names = joined(costs.fit.problem_and_optimum()[0].parameters.free_names)
        return (
            f"inference: from data in memory to mean, sd and 95 % interval of {names}; errors in posterior "
            f"sd, against {reference_words(reference)}; of draws the root mean square over seeds"
        )
    at = costs.about.get(kind, "")
    what = {
        "physics": "time an impact, and error of beta against the converged solution of Maw, Barber and "
        "Fawcett",
        "arithmetic": "time an impact, and error against 50 digits",
    }[kind]
    return f"{kind}: {what}" + (f"; {at}" if at else "")


def reference_words(reference: Reference) -> str:
    """The posterior that errors are measured against."""
    reached = (
        f"which reached {power_of_ten(reference.error)}" if reference.error > 0.0 else "which moved no more"
    )
    return f"exact at tolerance {power_of_ten(reference.tolerance)} ({reached})"


def _model(costs: Costs) -> str:
    fit = costs.fit
    clauses = [f"closure {CLOSURES[fit.closure].title}", noise_words(fit), fit.noise.error_model.words]
    return ", ".join(filter(None, clauses))


def _precisions(costs: Costs) -> list[str]:
    from ifrfit.cost.report.precision import precision_lines

    return precision_lines([cost for cost in costs.costs if cost.kind == "arithmetic"])


def _table(choices: Sequence[Choice]) -> list[str]:
    quantities = list(dict.fromkeys(name for choice in choices for name in choice.errors))
    cells = [["", "time", "from", "to", *(_HEADS.get(name, name) for name in quantities)]]
    for choice in choices:
        # a long name is wrapped: the lines under it hold nothing else
        first, *more = textwrap.wrap(
            choice_name(choice), _NAMES, subsequent_indent="  ", break_on_hyphens=False
        )
        times = (duration(s) for s in (choice.time.median, choice.time.low, choice.time.high))
        errors = (error_text(choice.errors[name]) if name in choice.errors else "" for name in quantities)
        cells.append([f"{FRONT if choice.on_front else ' '} {first}", *times, *errors])
        cells += [[f"  {part}", *[""] * (len(cells[0]) - 1)] for part in more]
    return aligned(cells, "<".ljust(len(cells[0]), ">"))
