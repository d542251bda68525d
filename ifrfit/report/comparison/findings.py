"""What a comparison of closures needs to say beside its numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ifrfit.inference.comparison import Comparison
from ifrfit.inference.comparison.result import HOPELESS
from ifrfit.inference.comparison.verdict import rivals_with_flaws, title
from ifrfit.inference.diagnostics.omitted_effects.score_tests import called_title
from ifrfit.physics import get_closure
from ifrfit.report.sentences import scene_notes
from ifrfit.text import as_given, joined

_SURE = 2.0  # standard errors beyond which cross-validation is heard


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
    alarms += [f"{title(n)}: {fits[n].says.rstrip('.')}" for n in leading if not fits[n].ok]
    alarms += _of_effects(comparison, leading)
    alarms += _of_slopes(comparison)
    alarms += _of_cross_validation(comparison)
    notes = [
        *comparison.notes,
        *_called(comparison, leading),
        *scene_notes(comparison.best),
        *_of_flaws(comparison),
        *_of_plane(comparison),
        *_of_data(comparison),
    ]
    return [
        *(("LOOK", says) for says in alarms),
        *(("ok", says) for says in fine),
        *(("note", says) for says in notes),
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
    own = found[best]
    if own.difference < -_SURE * own.se_difference:
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
