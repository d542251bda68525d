"""What accuracy costs, as text for a terminal: tables, and what follows from the measurements alone."""

from __future__ import annotations

import math
import platform
import textwrap
from collections.abc import Iterable, Sequence
from html import escape

import numpy as np

from ifrfit.cost.arithmetic_costs import DOUBLE, GIVEN, SINGLE, VELOCITIES
from ifrfit.cost.inference_costs import BOOTSTRAP, LSQ, OTHER_QUESTION, PROFILE, Reference
from ifrfit.cost.result import Choice, Costs, best_for, cheapest
from ifrfit.cost.timing import Cost, Kind, machine
from ifrfit.inference.estimators import title_of
from ifrfit.physics import CLOSURES
from ifrfit.report.sentences import noise_words
from ifrfit.report.terminal import aligned, finding_lines, source_lines, wrapped
from ifrfit.text import duration, joined, power_of_ten

ACCURACY = 1e-3
TARGETS = tuple(10.0**-k for k in range(1, 17))
_ASIDE = {LSQ: "least squares with its covariance", PROFILE: "profiles", BOOTSTRAP: "replicates"}
_ACCURACY = {"inference": "of an sd", "physics": "in beta"}
_MUCH = 3.0  # times the time of another from which on a method is worth a word
FRONT = "*"
_NAMES = 52  # columns of a method with its setting
_HEADS = {VELOCITIES: "v, spin", "interval95": "95 % ends"}


def precision_table(costs: Sequence[Cost], precision: str) -> list[list[str]]:
    """Largest errors in one precision: a row a kind of impacts, a column a quantity.

    Parameters
    ----------
    costs : sequence of Cost
        From `ifrfit.cost.arithmetic_costs.arithmetic_costs`.
    precision : {"float32", "float64"}

    Returns
    -------
    list of list of str
        The first row holds the heads. Velocities and spins over 1 + |s|, angles in radians; empty where a
        quantity makes no sense.
    """
    own = [cost for cost in costs if cost.method == precision]
    quantities = list(dict.fromkeys(cost.quantity for cost in own if cost.setting != GIVEN))
    found = {(cost.setting, cost.quantity): _digit(cost.error) for cost in own}
    rows = [["impacts", *(_HEADS.get(name, name) for name in quantities)]]
    for kind in dict.fromkeys(cost.setting for cost in own):
        rows.append([kind, *(found.get((kind, name), "") for name in quantities)])
    return rows


def precision_lines(costs: Sequence[Cost]) -> list[str]:
    """Both tables for a terminal, at most 100 columns."""
    lines: list[str] = []
    for precision in (SINGLE, DOUBLE):
        head, *rows = precision_table(costs, precision)
        head[0] = precision
        lines += aligned([head, *rows], "<".ljust(len(head), ">"))
        lines.append("")
    return lines[:-1]


def precision_sentences(
    costs: Sequence[Cost], accuracy: float = ACCURACY, *, times: bool = True
) -> list[str]:
    """Where which precision is enough.

    Parameters
    ----------
    costs : sequence of Cost
        From `ifrfit.cost.arithmetic_costs.arithmetic_costs`.
    accuracy : float
        Error of an observable that is allowed; angles in radians.
    times : bool
        Whether to say how much faster single precision is.

    Returns
    -------
    list of str
        Without a full stop.
    """
    single, double = ([cost for cost in costs if cost.method == name] for name in (SINGLE, DOUBLE))
    worst = max(cost.error for cost in single if cost.quantity == VELOCITIES)
    statements = [
        f"Single precision keeps velocities and spins to {_digit(worst)} of 1 + |s| in all of these"
    ]
    lost = [cost for cost in single if cost.quantity != VELOCITIES and cost.error > accuracy]
    kinds = dict.fromkeys(cost.setting for cost in lost)
    others = "everything else" if kinds else "everything"
    if kinds:
        parts = [f"{kind} ({_named(cost for cost in lost if cost.setting == kind)})" for kind in kinds]
        statements.append(f"What is read off them loses more than {accuracy:g} there: {'; '.join(parts)}")
    statements.append(f"Single precision is enough for {accuracy:g} of {others} that is read off them")
    deepest = max((cost for cost in double if cost.quantity != VELOCITIES), key=lambda cost: cost.error)
    statements.append(
        f"Double precision loses at most {_digit(deepest.error)}: {deepest.quantity}, {deepest.setting}"
    )
    if times:
        ns = [1e9 * part[0].time.median for part in (single, double)]
        statements.append(f"An impact takes {ns[0]:.2g} ns in single and {ns[1]:.2g} ns in double precision")
    return statements


def _named(costs: Iterable[Cost]) -> str:
    return ", ".join(f"{cost.quantity} {_digit(cost.error)}" for cost in costs)


def _digit(error: float) -> str:
    """One digit and its power of ten, as 8e-8."""
    return "lost" if math.isinf(error) else power_of_ten(error)


def sentences(costs: Costs, kind: Kind) -> tuple[str, ...]:
    """Which choice is best for which accuracy; what the others come to; and what is no comparison."""
    if kind == "arithmetic":
        return tuple(precision_sentences([cost for cost in costs.costs if cost.kind == kind]))
    choices = [choice for choice in costs.of(kind) if not math.isnan(choice.error)]
    rivals = [choice for choice in choices if choice.method not in OTHER_QUESTION]
    if not rivals:
        return ()
    found = best_for(rivals, TARGETS)
    lines = [_best(found, kind)] if found else []
    winners = [choice for _, _, choice in found]
    fastest = min(rivals, key=lambda c: c.time.median)
    if fastest not in winners:
        lines.append(
            f"The fastest, {choice_name(fastest)} ({duration(fastest.time.median)}), comes to "
            f"{error_text(fastest.error)} {_ACCURACY[kind]}"
        )
    others = dict.fromkeys(c.method for c in rivals if c.method not in {w.method for w in winners})
    behind = (_behind(method, rivals, kind) for method in others)
    return (*lines, *filter(None, behind), *_other_question(choices))


def choice_name(choice: Choice) -> str:
    """Method and setting."""
    name = method_name(choice.method)
    return f"{name}, {choice.setting}" if choice.setting else name


def method_name(method: str) -> str:
    """A method in words; those that approach the posterior by their short names."""
    return title_of(method) if method in OTHER_QUESTION else method


def error_text(error: float) -> str:
    """An error with two digits and its power of ten, as 1.2e-5."""
    if math.isnan(error) or error == 0.0:
        return "-" if error else "0"
    digits, _, exponent = f"{error:.1e}".partition("e")
    return f"{digits}e{int(exponent)}" if exponent else "infinite"


def _best(found: Sequence[tuple[float, float, Choice]], kind: Kind) -> str:
    parts = []
    for loose, tight, choice in found:
        span = power_of_ten(loose) if loose == tight else f"{power_of_ten(loose)} to {power_of_ten(tight)}"
        parts.append(f"{span}: {choice_name(choice)} ({duration(choice.time.median)})")
    return f"Cheapest for an error of at most so much {_ACCURACY[kind]}: {'; '.join(parts)}"


def _behind(method: str, rivals: Sequence[Choice], kind: Kind) -> str:
    """What a method that is best for no accuracy comes to, and what would have been much cheaper."""
    own = min((c for c in rivals if c.method == method), key=lambda c: (c.error, c.time.median))
    better = cheapest([c for c in rivals if c.method != method], own.error)
    if better is None or own.time.median < _MUCH * better.time.median:
        return ""
    ratio = ratio_text(own.time.median / better.time.median)
    return (
        f"{choice_name(own)} comes to {error_text(own.error)} {_ACCURACY[kind]} in "
        f"{duration(own.time.median)}, {ratio} the time of {choice_name(better)}, which is no less exact"
    )


def ratio_text(ratio: float) -> str:
    """How many times, with two digits."""
    return f"{ratio:.2g} times" if ratio < 100.0 else f"{float(f'{ratio:.2g}'):,.0f} times"


def _other_question(choices: Sequence[Choice]) -> list[str]:
    """What least squares, profiles and replicates are from the posterior: a floor, not a failure."""
    found = {}
    for method in OTHER_QUESTION:
        own = [c for c in choices if c.method == method and not math.isnan(c.error)]
        if own:
            last = own[-1]  # the longest: what is left there is not chance
            found[method] = f"{last.error:.2g} sd ({title_of(method)}, {duration(last.time.median)})"
    if not found:
        return []
    names = joined([_ASIDE[method] for method in found]).capitalize()
    return [
        f"{names} answer{'s' if len(found) == 1 else ''} another question than the posterior: however "
        "exactly computed, a mean, an sd or an end of an interval differs from it by up to "
        f"{joined(list(found.values()))}"
    ]


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
        own = [cost for cost in costs.costs if cost.kind == kind]
        lines += precision_lines(own) if kind == "arithmetic" else _table(costs.of(kind))
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
