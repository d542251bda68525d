"""Closures side by side as text: criteria, findings, the terminal and notebooks."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Mapping, Sequence
from html import escape

from ifrfit.inference.comparison import Comparison
from ifrfit.inference.comparison.reservations import reservations
from ifrfit.inference.comparison.result import HOPELESS, Entry, PsiPlane, Slope
from ifrfit.inference.comparison.verdict import rivals_with_flaws, title
from ifrfit.inference.diagnostics.omitted_effects.score_tests import called_title
from ifrfit.inference.result.types import Interval
from ifrfit.option_words import in_python
from ifrfit.physics import get_closure
from ifrfit.report.sentences import assumed_line, noise_words, scene_notes
from ifrfit.report.terminal import aligned, finding_lines, source_lines, text_width, wrapped
from ifrfit.text import as_given, decimals, fixed, interval_text, joined, p_text, plus_minus, sd_text

Column = tuple[str, Callable[[Entry], str]]
_SURE = 2.0  # standard errors beyond which cross-validation is heard


def cross_validated(comparison: Comparison) -> bool:
    """Whether impacts were left out of the fit of any closure, with a number."""
    return any(entry.loo is not None for entry in comparison.entries.values())


def criteria(comparison: Comparison) -> list[Column]:
    """Columns that say something of these data: chi2 does not where sigma follows from the scatter."""
    columns: list[Column] = [("constants", lambda e: f"{e.fit.fit.rank} of {e.free}")]
    if comparison.best.noise.policy not in ("unknown", "mixed"):
        columns.append(("chi2", lambda e: _short(e.fit.fit.chi2)))
    columns.append(("p of fit", lambda e: _p_of_fit(comparison.p_of_fit(e))))
    if comparison.best.noise.error_model.is_plain:  # criteria are of a Gaussian likelihood
        columns.append(("AIC", lambda e: fixed(e.fit.fit.aic, 1)))
        if any(entry.aicc is not None for entry in comparison.entries.values()):
            columns.append(("AICc", lambda e: "-" if e.aicc is None else fixed(e.aicc, 1)))
        columns.append(("BIC", lambda e: fixed(e.fit.fit.bic, 1)))
    return [
        *columns,
        ("log evidence", lambda e: fixed(e.log_evidence, 2)),
        ("log BF", lambda e: fixed(e.log_bayes_factor, 2)),
        ("probability", lambda e: _probability(e.probability)),
    ]


def _p_of_fit(p: float | None) -> str:
    return "-" if p is None else "< 1e-300" if p < 1e-300 else p_text(p)


def _probability(p: float) -> str:
    if p < 0.001:
        return "< 0.001"
    return "> 0.999" if p > 0.999 else f"{p:.3f}"


def _short(x: float) -> str:
    return f"{x:.0f}" if abs(x) >= 1e4 else f"{x:.4g}" if abs(x) >= 1.0 else f"{x:.2g}"


def _difference(entry: Entry) -> str:
    loo = entry.loo
    if loo is None:
        return "-"
    if loo.difference == 0.0:
        return "the best"
    if not loo.se_difference > 0.0:
        return fixed(loo.difference, 1)
    return plus_minus(loo.difference, loo.se_difference)


def _refits(entry: Entry) -> str:
    loo = entry.loo
    if loo is None:
        return "-"
    parts = [f"{len(loo.refitted)} refitted"] if loo.refitted else []
    parts += [f"{len(loo.doubtful)} doubtful"] if loo.doubtful else []
    return ", ".join(parts) or "none"


CROSS_VALIDATION: list[Column] = [
    ("leave-one-impact-out", lambda e: fixed(e.loo.elpd, 2) if e.loo else "-"),
    ("difference", _difference),
    ("p_loo", lambda e: fixed(e.loo.p_loo, 1) if e.loo else "-"),
    ("largest Pareto k", lambda e: _k_text(e.loo.largest_k) if e.loo else "-"),
    ("k too large", _refits),
]


def _k_text(k: float) -> str:
    return "< 0" if k == -math.inf else "-" if math.isnan(k) else f"{k:.2f}"


def prior_line(comparison: Comparison) -> str:
    """The priors that the evidence rests on, in one sentence."""
    groups: dict[str, dict[str, list[str]]] = {}
    for name, entry in comparison.entries.items():
        for constant, prior in entry.prior.items():
            groups.setdefault(constant, {}).setdefault(_prior_words(prior), []).append(title(name))
    parts = []
    for constant, by_words in groups.items():
        for words, names in by_words.items():
            whose = "" if len(names) == len(comparison.entries) else f" ({joined(names)})"
            parts.append(f"{constant} {words}{whose}")
    noise = "" if comparison.best.noise.policy == "known" else "; the noise log-uniform, the same for all"
    rest = f"uniform unless said: {', '.join(parts)}" if parts else "every constant is fixed"
    return f"log BF and probability: natural logarithms, equal odds before. Priors: {rest}{noise}."


def _prior_words(prior: Mapping[str, float]) -> str:
    if "mean" in prior:
        return f"{as_given(prior['mean'])} +- {as_given(prior['sd'])}"
    return f"{prior['lower']:.5g} to {prior['upper']:.5g}"


def findings(comparison: Comparison) -> list[tuple[str, str]]:
    """Facts and notes as (kind, sentence); kind is LOOK, ok or note, LOOK first."""
    alarms, fine = [], []
    loose = {n: e.fit.facts["converged"] for n, e in comparison.entries.items()}
    bad = [f"{title(name)}: {fact.says}" for name, fact in loose.items() if not fact.ok]
    alarms += bad
    if not bad:
        fine.append("the evidence of every closure converged")
    fits = {n: e.fit.facts["lack_of_fit"] for n, e in comparison.entries.items()}
    # the p of the others stands in the table
    leading = comparison.verdict.tied or comparison.ranked[:1]
    alarms += _of_tables(comparison, leading)
    alarms += [f"{title(n)}: {fits[n].says.rstrip('.')}" for n in leading if not fits[n].ok]
    alarms += _of_effects(comparison, leading)
    alarms += _of_slopes(comparison)
    alarms += _of_cross_validation(comparison)
    notes = [
        *comparison.notes,
        *_called(comparison, leading),
        *scene_notes(comparison.best),
        *_of_tests(comparison),
        *_of_flaws(comparison),
        *_of_plane(comparison),
        *_of_data(comparison),
    ]
    found = [
        *(("LOOK", says) for says in alarms),
        *(("ok", says) for says in fine),
        *(("note", says) for says in notes),
    ]
    return found if comparison.best.command else [(kind, in_python(says)) for kind, says in found]


def _of_tables(comparison: Comparison, leading: Sequence[str]) -> list[str]:
    """What has to be settled before the verdict is believed: slips, outliers, series that differ."""
    refuted = comparison.verdict.kind == "refuted"
    found = reservations(comparison.entries, leading, refuted=refuted)
    return [f"{title(name)}: {fact.says.rstrip('.')}" for name, own in found.items() for fact in own.values()]


def _of_tests(comparison: Comparison) -> list[str]:
    """Whose p of fit is of another test than chi2, where that of others is of chi2."""
    groups: dict[str, list[str]] = {}
    for name, entry in comparison.entries.items():
        lack = entry.fit.facts["lack_of_fit"]
        if comparison.p_of_fit(entry) == lack.figures["p"]:
            groups.setdefault(lack.figures.get("test") or "", []).append(title(name))
    if "chi2" not in groups:
        return []
    return [
        f"p of fit of {joined(names)} is of {test}, not of chi2, which is too large for sigma without a trend"
        for test, names in groups.items()
        if test not in ("chi2", "")
    ]


def _of_effects(comparison: Comparison, leading: Sequence[str]) -> list[str]:
    """Which effects the residuals of the leading closures call for."""
    facts = {name: comparison.entries[name].fit.facts.get("effects") for name in leading}
    return [f"{title(name)}: {fact.says}" for name, fact in facts.items() if fact and not fact.ok]


def _called(comparison: Comparison, leading: Sequence[str]) -> list[str]:
    """Which effect the others lack, where a closure that holds one leads alone.

    Where a constant closure describes the data, what the residuals of its rivals call for is that closure.
    """
    if comparison.verdict.kind == "stand_in" or any(get_closure(name).bilinear for name in leading):
        return []
    groups: dict[str, list[str]] = {}
    for name in comparison.ranked:
        fact = comparison.entries[name].fit.facts.get("effects")
        if fact is not None and not fact.ok and name not in leading:
            groups.setdefault(called_title(fact.figures["called"][0]), []).append(title(name))
    parts = [f"those of {joined(names)} for {what}" for what, names in groups.items()]
    return [f"what the residuals call for: {'; '.join(parts)}"] if parts else []


def _of_slopes(comparison: Comparison) -> list[str]:
    """Whether the slopes contradict the closure that the evidence favours."""
    best, plane, lines = comparison.ranked[0], comparison.psi_plane, []
    for words, slope in (
        ("slope of sliding", plane.sliding),
        ("slope of sliding less that of sticking", plane.difference),
    ):
        if slope is not None and best in slope.contradicts:
            lines.append(
                f"the {words} in the psi plane contradicts {title(best)}, which the evidence favours"
            )
    return lines


def _of_cross_validation(comparison: Comparison) -> list[str]:
    found = {n: e.loo for n, e in comparison.entries.items() if e.loo is not None}
    if not found:
        return []
    lines = []
    best = comparison.ranked[0]
    own = found.get(best)
    if own is not None and own.difference < -_SURE * own.se_difference:
        first = max(found, key=lambda name: found[name].elpd)
        lines.append(
            f"cross-validation favours {title(first)}, the evidence {title(best)}: the priors' widths or a "
            "few impacts decide; look at both fits"
        )
    for name, loo in found.items():
        if loo.doubtful and comparison.entries[name].log_bayes_factor > -HOPELESS:
            count, more = len(loo.doubtful), ", ..." if len(loo.doubtful) > 1 else ""
            lines.append(
                f"cross-validation of {title(name)} is not to be trusted: Pareto k over {loo.threshold:.2g} "
                f"in {count} impact{'s' if count > 1 else ''} ({loo.doubtful[0]}{more})"
            )
    return lines


def _of_flaws(comparison: Comparison) -> list[str]:
    """Which small flaws of the measurement would let another closure describe the data as well."""
    if comparison.verdict.kind != "preferred":
        return []
    found = rivals_with_flaws(comparison.entries, comparison.ranked)
    each = [f"{title(name)} with {words} comes to within {left:.1f}" for name, (words, left) in found.items()]
    if not each:
        return []
    best = title(comparison.ranked[0])
    return [
        f"the verdict rests on the measurement: by log Bayes factors, {joined(each)} of {best} (its own best "
        "flaw is fitted, too)"
    ]


def _of_plane(comparison: Comparison) -> list[str]:
    plane = comparison.psi_plane
    if plane.reason or not plane.left_out:
        return []
    return [
        "not in the psi plane: " + "; ".join(f"{name}, which {why}" for name, why in plane.left_out.items())
    ]


def _of_data(comparison: Comparison) -> list[str]:
    """What the fits say of the data; that they are a stand-in is said above."""
    stand_ins = tuple(f"{source.name} is a STAND-IN" for source in comparison.inputs)
    warnings = dict.fromkeys(w for e in comparison.entries.values() for w in e.fit.warnings)
    return [warning for warning in warnings if not warning.startswith(stand_ins)]


def summary(comparison: Comparison) -> str:
    """The comparison for a terminal, at most 100 columns; ends without a line feed."""
    best = comparison.best
    model = f"{len(comparison.entries)} closures, exact posterior, {noise_words(best)}"
    blocks = [
        [*source_lines(best), *wrapped(model, 2)],
        textwrap.wrap(
            comparison.verdict.says, text_width(), initial_indent="VERDICT  ", subsequent_indent=" " * 9
        ),
        [*_table(comparison, criteria(comparison)), *wrapped("  " + prior_line(comparison), 4)],
        _prior_lines(comparison),
        _table(comparison, CROSS_VALIDATION) if cross_validated(comparison) else [],
        _plane_lines(comparison),
        wrapped(f"  {assumed_line(comparison.best)}", 4) if comparison.best.assumed else [],
        [line for kind, says in findings(comparison) for line in finding_lines(kind, says)],
    ]
    lines = [line for block in blocks if block for line in (*block, "")]
    return "\n".join(line.rstrip() for line in lines).rstrip("\n")


def html(comparison: Comparison) -> str:
    """The comparison as an HTML fragment for notebooks; what comes from data is escaped."""
    table = comparison.table().rename(index=title).dropna(axis="columns", how="all")
    notes = "".join(f"<li>{escape(f'{kind}: {says}')}</li>" for kind, says in findings(comparison))
    return (
        f'<div class="ifrfit-comparison"><p><strong>{escape(comparison.verdict.says)}</strong></p>'
        f"{table.to_html(float_format='{:.4g}'.format)}<p>{escape(prior_line(comparison))}</p>"
        f"<ul>{notes}</ul></div>"
    )


def _table(comparison: Comparison, columns: Sequence[Column]) -> list[str]:
    """One line a closure, the best first."""
    ranked = comparison.ranked
    head = ["closure", *(head for head, _ in columns)]
    rows = [[title(name), *(cell(comparison.entries[name]) for _, cell in columns)] for name in ranked]
    return aligned([head, *rows], "<".ljust(len(head), ">"))


def _prior_lines(comparison: Comparison) -> list[str]:
    """How the evidence moves with the priors: log Bayes factors against the best."""
    if len(comparison.priors) == 1:
        return []
    best, *others = comparison.ranked
    rows = [[f"log BF against {title(best)}", *(title(name) for name in others)]]
    for row in comparison.priors:
        found = [row.log_bayes_factor(name, best) for name in others]
        rows.append([row.varied or "priors as stated", *("-" if x is None else fixed(x, 2) for x in found)])
    return aligned(rows, "<".ljust(len(rows[0]), ">"))


def _plane_lines(comparison: Comparison) -> list[str]:
    plane = comparison.psi_plane
    if plane.reason:
        return wrapped(f"  psi plane: not available, as {plane.reason}", 4)
    head = (
        f"  psi plane, V_t/U_n over U_t/U_n with free slopes: {plane.n} rows, {plane.n_sticking} stick, "
        f"{plane.n_sliding} slide"
    )
    slopes = _slopes(plane)
    cells = aligned([(words, *_slope_cells(slope)) for words, slope in slopes], "<>><", indent="    ")
    lines = wrapped(head, 4)
    for line, (_, slope) in zip(cells, slopes, strict=True):
        lines += [line, *wrapped(_expected(slope), 8, " " * 6)]
    return lines


def _slopes(plane: PsiPlane) -> list[tuple[str, Slope]]:
    assert plane.sliding is not None
    assert plane.difference is not None
    return [("slope of sliding", plane.sliding), ("slope of sliding less sticking", plane.difference)]


def _slope_cells(slope: Slope) -> tuple[str, str, str]:
    if not slope.determined:
        return "-", "-", _open(slope.interval95)
    width = slope.interval95[1] - slope.interval95[0]
    places = decimals(slope.stderr or width / 4.0)
    error = "-" if slope.stderr is None else f"+- {sd_text(slope.stderr)}"
    return fixed(slope.value, places), error, f"95 % {interval_text(slope.interval95, places)}"


def _open(interval: Interval) -> str:
    finite = [abs(end) for end in interval if math.isfinite(end)]
    if not finite:
        return "not determined"
    return f"not determined, 95 % {interval_text(interval, decimals(0.1 * finite[0]) if finite[0] else 2)}"


def _expected(slope: Slope) -> str:
    """What the closures want, those that agree on it together."""
    wants: dict[str, list[str]] = {}
    for name, ends in slope.expected.items():
        if ends is None:
            words = "no straight line"
        elif ends[1] - ends[0] < 1e-6:
            words = fixed(ends[0], 3).rstrip("0").rstrip(".")
        else:
            low, high = (fixed(end, 3).rstrip("0").rstrip(".") for end in ends)
            words = f"{low} to {high}"
        against = f" (p = {p_text(slope.p[name])})" if name in slope.contradicts else ""
        wants.setdefault(words, []).append(title(name) + against)
    return "; ".join(f"{joined(names)}: {words}" for words, names in wants.items())
