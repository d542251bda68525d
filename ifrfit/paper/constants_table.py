"""The printed table of `reproduce`, and the answers of real points to what the paper claims.

Stand-ins answer nothing: they were made with one set of constants. The same code answers from real points.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.errors import DataError, IfrfitError
from ifrfit.inference.diagnostics.nested_models import DECIDED, sharing
from ifrfit.inference.fit import fit
from ifrfit.inference.model.problem import Problem, make_problem
from ifrfit.inference.posterior import log_evidence
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.types import Estimate, is_quiet
from ifrfit.paper.recovered_constants import (
    LEVEL,
    FittedCase,
    Line,
    case_constants,
    case_named,
    chance,
    count_recovered,
    fit_case,
)
from ifrfit.physics import OBSERVABLES, rebound
from ifrfit.report.provenance import contents
from ifrfit.report.regimes import regime_counts
from ifrfit.report.sentences import places_of, value_text
from ifrfit.report.terminal import wrapped
from ifrfit.text import as_given, interval_text, joined, p_text, sd_text

OPEN = "not answerable until real points are installed"
_COLUMNS = f"  {'':<4} {'printed':>7} {'value':>9} {'sd':>7}  {'95 % interval':<18}  {'status':<14}  "
_WARNING = (
    "STAND-INS, generated from the constants the paper prints. That a fit recovers what was put in shows "
    "that the tool works; it says nothing about the experiments."
)
_QUESTION = (
    "DOES ONE SET OF CONSTANTS HOLD ACROSS BOTH REGIMES? And what else the paper leaves to real points."
)

_REFUTING = ("lack_of_fit", "normal_restitution")


@dataclass(frozen=True)
class Answer:
    """An answer about one dataset.

    Attributes
    ----------
    about : str
        Dataset, with what is asked of it where that is not the same for all.
    verdict : str
        yes, no, or not answerable.
    why : str
    """

    about: str
    verdict: str
    why: str = ""

    @property
    def sentence(self) -> str:
        """The answer in one line."""
        return f"{self.about}: {self.verdict}" + (f": {self.why}" if self.why else "")


def across_regimes(done: FittedCase) -> Answer | None:
    """Answer whether one set of constants holds in sticking and in sliding.

    "No" where the fit of one set shows lack of fit, where readings of e_n contradict one value, or where the
    evidence favours an e_t of its own for each regime by a factor of 20; impacts are sorted into regimes by
    the fit of one set.
    """
    if done.result is None:
        return None
    result = done.result
    blocked = _blocked(done)
    if blocked:
        return Answer(done.name, blocked)
    lack = result.facts["lack_of_fit"]
    for fact in (lack, result.facts.get("normal_restitution", lack)):
        if not fact.ok:
            return Answer(done.name, "no", fact.says)
    counts = [regime_counts(result, str(series)) for series in result.points["series"].unique()]
    stick, slide = (sum(count[i] for count in counts) for i in (0, 1))
    if not stick or not slide:
        which = "slide" if slide else "stick"
        return Answer(done.name, "not answerable", f"all impacts {which}, so one regime is seen only")
    by_regime = result.points["sticking"].map(lambda s: "sticking" if s else "sliding").to_numpy()
    return _by_evidence(done.name, result, by_regime, ("e_t", "beta0"), "both regimes", lack.says)


def across_spins(done: Mapping[str, FittedCase]) -> Answer | None:
    """Answer whether one mu holds without and with spin, for which the paper prints 0.12 and 0.14."""
    without, spun = done.get("cross-2019-no-spin"), done.get("cross-2019-spin")
    if without is None or spun is None or without.result is None or spun.result is None:
        return None
    about = "cross-2019, one mu without and with spin"
    blocked = _blocked(without) or _blocked(spun)
    if blocked:
        return Answer(about, blocked)
    case = case_named("cross-2019-no-spin")
    fixed = {name: float(without.result.flat_constants()[name].value or 0.0) for name in case.fixed}
    series = (*case.series, *case_named("cross-2019-spin").series)
    try:
        joint = fit(case.dataset, series=series, observable=case.observable, fix=fixed)
    except IfrfitError as error:
        return Answer(about, "not answerable", error.in_shell)
    labels = joint.points["series"].astype(str).to_numpy()
    return _by_evidence(about, joint, labels, ("mu",), "all spins", "")


def reading(done: FittedCase) -> Answer | None:
    """Answer whether the coefficient of Fig. 4a is that of the contact point, not that of the centre.

    With the printed constants held the two are different curves. With free constants both are a constant plus
    a multiple of cot gamma while impacts slide, so the values alone can hardly tell; their evidence is told
    beside the answer.
    """
    case = case_named("buck-2017")
    if done.result is None:
        return None
    about = "buck-2017, beta of the contact point by the printed constants"
    blocked = _blocked(done)
    if blocked:
        return Answer(about, blocked)
    fits = {name: fit_case(case, reading=name).result for name in case.readings}
    contact, centre = (fits[name] for name in case.readings)
    if contact is None or centre is None:
        return Answer(about, "not answerable", "one of the readings could not be fitted")
    constants = case_constants(case)
    misfits = [_misfit(done.result, name, constants) for name in case.readings]
    known, n = done.result.noise.policy == "known", len(done.result.points)
    gain = (misfits[1] - misfits[0]) / 2.0 if known else n / 2.0 * math.log(misfits[1] / misfits[0])
    verdict = "yes" if gain > _DECIDED else "no" if gain < -_DECIDED else "not decided"
    free = f"{contact.fit.log_evidence:.1f} against {centre.fit.log_evidence:.1f} for the centre's"
    chi2 = f"chi2 {misfits[0]:.4g} against {misfits[1]:.4g} for {n} points"
    why = f"{chi2}; log evidence of free constants {free}"
    return Answer(about, verdict, why)


_DECIDED = math.log(DECIDED)
_EVIDENCE = 1e-3  # of a log evidence: factors of it are told by two digits


def _misfit(result: FitResult, reading: str, constants: Mapping[str, float]) -> float:
    """Sum of squares over sigma at given constants, the values taken for an observable."""
    rows = result.points
    impact = rebound(rows["gamma_deg"], rows["spin_x"], rows["spin_y"], degrees=True, **constants)  # type: ignore[arg-type]
    expected = OBSERVABLES[reading].value(impact, np.asarray(constants["mu"]))
    return float(np.sum(((rows["value"] - expected) / rows["sigma_used"]) ** 2))


def _blocked(done: FittedCase) -> str:
    if done.stand_in:
        return OPEN
    kinds = {line.provenance for line in done.lines}
    return "not answerable from a simulation" if kinds == {"simulated"} else ""


def _by_evidence(
    about: str, result: FitResult, labels: NDArray[Any], names: tuple[str, ...], whom: str, besides: str
) -> Answer:
    """Weigh one constant for all rows against one for each label."""
    try:
        problem = _labelled(result, labels)
        evidence = partial(log_evidence, tolerance=_EVIDENCE)
        shared = sharing(problem, evidence(problem), evidence, names)
    except DataError as error:
        return Answer(about, "not answerable", error.in_shell)
    if shared is None:
        return Answer(about, "not answerable", "too few impacts of one kind")
    says = shared.says.partition(": ")[0].replace("all series", whom)
    why = "; ".join(words for words in (besides, says) if words)
    return Answer(about, "yes, as far as these points tell" if shared.ok else "no", why)


def _labelled(result: FitResult, labels: NDArray[Any]) -> Problem:
    """The same question with the rows labelled anew: labels take the place of series."""
    problem, _ = result.problem_and_optimum()
    observations = replace(problem.observations, table=problem.observations.table.assign(series=labels))
    return make_problem(
        observations, problem.closure, problem.inertia_factor, problem.parameters, problem.noise.policy
    )


def table_text(done: Sequence[FittedCase], answers: Sequence[Answer]) -> str:
    """Write the table, then the questions that only real points answer; at most 100 columns wide."""
    blocks: dict[bool, list[str]] = {False: [], True: []}
    for d in done:
        if d.result is not None:
            blocks[d.stand_in].append(_block(d, d.result))
    kinds = dict.fromkeys(line.provenance for d in done if not d.stand_in for line in d.lines)
    parts = [f"DATA, {joined(list(kinds))}", *blocks[False]] if blocks[False] else []
    parts += [
        "\n".join(wrapped(f"{d.name}: not fitted to your own data. {d.refusal}", 4))
        for d in done
        if d.refusal
    ]
    if blocks[True]:
        parts += ["\n".join(wrapped(_WARNING, 0)), *blocks[True], _score(done)]
    if answers:
        lines = [line for answer in answers for line in wrapped(answer.sentence, 4, "  ")]
        parts.append("\n".join([*wrapped(_QUESTION, 0), *lines]))
    return "\n\n".join(parts) + "\n" if parts else ""


def _score(done: Sequence[FittedCase]) -> str:
    hits, k = count_recovered(done)
    words = (
        f"{hits} of {k} identifiable 95 % intervals hold the value put in; {LEVEL * k:.1f} are expected, and "
        f"{hits} or fewer have the binomial probability {chance(hits, k):.2g}. Seeds are hashes of the "
        "datasets' names. Impacts fitted through another observable are not counted again; constants of one "
        "fit share their data, so the count is only roughly binomial."
    )
    return "\n".join(wrapped(words, 0))


def _block(done: FittedCase, result: FitResult) -> str:
    rows = [
        *wrapped(f"{done.name}   {contents(result, result.inputs[0])}", 4),
        *wrapped(done.case.reason, 4, "  "),
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
    rows += wrapped(_facts(result) if done.stand_in else f"verdict: {_verdict(result)}", 4, "  ")
    return "\n".join(rows)


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
