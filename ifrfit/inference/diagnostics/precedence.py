"""What the residuals say, and which finding speaks where several tests see the same cause.

One wrong angle makes chi2 too large, residuals alike and rows outliers. Told one beside the other, each with
its remedy, these would be three faults. So the questions are asked one after the other, each behind the
findings that leave it out, and a finding, once made, may take the place of another.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from ifrfit.inference.diagnostics.beyond_closure import beyond_closure
from ifrfit.inference.diagnostics.copied_readings import duplicates, repeated_number
from ifrfit.inference.diagnostics.ends_of_scale import censoring
from ifrfit.inference.diagnostics.growing_scatter import growing_scatter
from ifrfit.inference.diagnostics.independence import independence
from ifrfit.inference.diagnostics.lack_of_fit import lack_of_fit, scatter_too_small
from ifrfit.inference.diagnostics.left_out_readings import left_out_readings
from ifrfit.inference.diagnostics.mixture import mixture
from ifrfit.inference.diagnostics.nested_models import prior_conflict, unequal_noise
from ifrfit.inference.diagnostics.normal_restitution import normal_restitution
from ifrfit.inference.diagnostics.omitted_effects.effect_signatures import LAWS
from ifrfit.inference.diagnostics.one_velocity import one_velocity
from ifrfit.inference.diagnostics.quadratic_forms import Array
from ifrfit.inference.diagnostics.recorded_values import is_coarse, rounded_readings
from ifrfit.inference.diagnostics.repeats import settings_scatter
from ifrfit.inference.diagnostics.residuals import Residuals, are_all_that_misfits, outliers
from ifrfit.inference.diagnostics.scatter_by_angle import scatter_by_angle
from ifrfit.inference.diagnostics.second_readings import second_readings
from ifrfit.inference.diagnostics.sigma_of_few import sigma_of_few
from ifrfit.inference.diagnostics.slips.nuisances import nuisances
from ifrfit.inference.diagnostics.thresholds import ALIKE, FACTS
from ifrfit.inference.diagnostics.truncation import truncation, truncation_at_zero
from ifrfit.inference.diagnostics.unrelated_readings import unrelated_readings
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.result.types import Fact
from ifrfit.text import p_text

_TREND = "restitution-by-angle"
_OF_RESTITUTION = {*LAWS, _TREND}
_OF_MOMENTUM = "inertia-factor"
_BY_ANGLE = {"friction-by-load", "sticking-by-angle"}  # causes that go with it, as repeats at one setting do
# findings that leave no residuals for which only impacts of two kinds or a cut would be a reason
_MISFIT = ("lack_of_fit", "repeats", "beyond_closure", "normal_restitution", "unequal_noise")
_OF_WRITING = ("rounded_readings", "censoring", "independence", "angular_momentum", "repeated_number")
_OF_THE_TABLE = (*_OF_WRITING, "outliers")
_OF_SCATTER = ("angle_scatter", "growing_scatter", "scatter_too_small")
_SHARED_IMPACTS = ("duplicates", "second_readings")  # by which an impact counts more than once
_CAUSES = ("slips", "effects")
_FEIGNED = ("slips", "effects")  # causes that readings which end at 0 look like
_OF_A_CUT = (
    "pooling",
    "prior_conflict",
    "normal_restitution",
    "lack_of_fit",
    "predictive",
    "repeats",
    "independence",
    "outliers",
    "unequal_noise",
    "scatter_too_small",
    "scatter_too_large",
)
_OF_COPIES = ("lack_of_fit", "predictive", "normal_restitution", "repeats", "independence", "effects")
_OF_SLIPS = ("outliers", "scatter_too_small", "scatter_too_large")
_DECISIVE = 100.0  # fall of -2 log L by a slip, beyond which outliers are of the slip rather than it of them
# as the report tells them
_ORDER = (
    "left_out_readings",
    "unrelated_readings",
    "beyond_closure",
    "pooling",
    "friction_beyond_prior",
    "prior_conflict",
    "duplicates",
    "second_readings",
    "repeated_number",
    "angle_scatter",
    "unequal_noise",
    "rounded_readings",
    "censoring",
    "truncation",
    "repeats",
    "normal_restitution",  # says which constant it is that the data contradict
    "lack_of_fit",
    "independence",
    "mixture",
    "growing_scatter",
    "scatter_by_angle",
    "sigma_of_few",
    "scatter_too_small",
    "scatter_too_large",
    "outliers",
    "slips",
    "effects",
    "angular_momentum",
)


@dataclass
class _Findings:
    """What has been found of one fit so far.

    Attributes
    ----------
    facts : dict of str to Fact
        By name; a question that found nothing to say has none.
    causes : list of str
        What explains the residuals: effects, slips, "series" that differ, a "known" value that is wrong,
        the "order" of the readings.
    """

    facts: dict[str, Fact]
    causes: list[str]

    def fails(self, *names: str) -> bool:
        """Whether any of these facts is there and is not ok."""
        return any(name in self.facts and not self.facts[name].ok for name in names)

    def tell(self, name: str, fact: Fact | None) -> bool:
        """Keep what a test says, if it says anything; whether that is a failure."""
        if fact is not None:
            self.facts[name] = fact
        return fact is not None and not fact.ok

    def withdraw(self, *names: str) -> None:
        """Take out facts whose place another one takes."""
        for name in names:
            self.facts.pop(name, None)

    def most_explained(self, *names: str) -> float:
        """What these facts take off -2 log likelihood at most; without any, nothing is less."""
        drops = [self.facts[name].figures["drop"] for name in names if name in self.facts]
        return max(drops, default=-math.inf)

    @property
    def of_momentum(self) -> bool:
        """Whether velocities and spins do not close, and another inertia factor is called for."""
        return self.fails("angular_momentum") and self.causes[:1] == [_OF_MOMENTUM]

    @property
    def has_slipped(self) -> bool:
        """Whether a slip is called for, told by itself or by velocities and spins that do not close."""
        return self.fails("slips") or self.of_momentum


def misfit_facts(
    problem: Problem,
    found: LeastSquaresFit,
    residuals: Residuals,
    causes: Mapping[str, Fact],
    *,
    brief: bool = False,
) -> dict[str, Fact]:
    """What the residuals of least squares say, in the order of the report.

    Parameters
    ----------
    problem : Problem
    found : LeastSquaresFit
    residuals : Residuals
    causes : mapping of str to Fact
        What they call for, where tested: ``pooling``, ``slips``, ``effects``; ``angle_scatter`` where the
        noise has errors of the angles in it.
    brief : bool
        Leave out what is no misfit of all rows (outliers, doubles, mixtures), and the search for a remedy.
    """
    named = [name for key, fact in causes.items() if key in _CAUSES for name in fact.figures["called"]]
    so_far = _Findings(dict(causes), named)
    if not brief:
        _before_what_a_cut_feigns(so_far, truncation_at_zero(problem, found))
    _of_constants(so_far, problem, found, brief)
    if not brief:
        so_far.tell("left_out_readings", left_out_readings(problem, found))
        # errors of the angles, by which impacts are paired, would be alike where these are
        if not so_far.tell("duplicates", duplicates(problem, found)) and not so_far.fails("angle_scatter"):
            so_far.tell("second_readings", second_readings(problem, found, residuals))
        so_far.tell("repeated_number", repeated_number(problem, found))
        so_far.tell("unequal_noise", unequal_noise(problem, found))
        so_far.tell("sigma_of_few", sigma_of_few(problem))
    # a law that misses something is no reason to doubt the repeats, but for one that goes with the angle
    doubted = _BY_ANGLE.issuperset(so_far.causes)
    if doubted and not so_far.fails("beyond_closure"):
        fails = so_far.tell("repeats", settings_scatter(problem, found, residuals))
        if fails and so_far.causes:
            so_far.withdraw("effects")
            so_far.causes = []
    # microslip is no remedy where something else is called for
    microslip = not so_far.causes or "compliance" in so_far.causes
    remedy = not brief and microslip and not so_far.fails("normal_restitution", *_SHARED_IMPACTS)
    scatter = so_far.facts.get("repeats")
    so_far.tell("lack_of_fit", lack_of_fit(problem, found, residuals, remedy=remedy, scatter=scatter))
    if not brief:
        # what the law misses it misses in every observable
        if not so_far.fails(*_MISFIT, *_SHARED_IMPACTS, "slips"):
            so_far.tell("duplicates", one_velocity(problem, found))
        so_far.tell("independence", _independence(so_far, problem, found, residuals))
    if not so_far.fails("repeated_number"):
        advise = not (so_far.fails("independence") or so_far.has_slipped)
        so_far.tell("scatter_too_small", scatter_too_small(problem, found, residuals, advise=advise))
    if not brief:
        _of_rows(so_far, problem, found, residuals)
    return in_order(so_far.facts)


def subordinate(facts: Mapping[str, Fact]) -> dict[str, Fact]:
    """Facts of a fit; those that may follow from copied rows, or a slip that explains much, say so.

    Rows that count twice make residuals alike and errors too small; no scatter behind a slip is of sigma.
    """
    found = dict(facts)
    slips = facts.get("slips")
    decisive = slips is not None and not slips.ok and bool(slips.figures["called"])
    if decisive and slips is not None:
        first = slips.figures["tests"].get(slips.figures["called"][0], {})
        decisive = first.get("drop", 0.0) > _DECISIVE
    copied, again = (name in facts and not facts[name].ok for name in ("duplicates", "second_readings"))
    cut = "truncation" in facts and "constant" in facts["truncation"].figures
    for holds, names, words in (
        (cut, _OF_A_CUT, "may follow from the readings below 0 that look left out: give these first"),
        (copied, _OF_COPIES, "may follow from the rows that count twice: leave these out first"),
        (again, _OF_COPIES, "may follow from impacts that were read twice: give one reading of each first"),
        (decisive, _OF_SLIPS, "may follow from the slip: mend it first"),
    ):
        for name in names if holds else ():
            if name in found and not found[name].ok:
                # the remedy of an effect, its last sentence, would mend nothing
                says = found[name].says.partition(". Try ")[0]
                found[name] = replace(found[name], says=f"{says}; {words}")
    return found


def in_order(facts: Mapping[str, Fact]) -> dict[str, Fact]:
    """Facts of the residuals as the report tells them."""
    return {name: facts[name] for name in sorted(facts, key=_ORDER.index)}


def _of_constants(so_far: _Findings, problem: Problem, found: LeastSquaresFit, brief: bool) -> None:
    """What refutes or explains all rows together, and takes the place of effects."""
    if problem.observations.momentum:
        so_far.tell("angular_momentum", _angular_momentum(problem, so_far.facts.get("slips")))
    if so_far.of_momentum:  # velocities and spins say it themselves
        so_far.withdraw("slips", "effects")
    normal = normal_restitution(problem, found, advise=not so_far.has_slipped)
    so_far.tell("normal_restitution", normal)
    of_angle = normal is not None and "p_laws_of_speed" in normal.figures
    # so do readings of e_n: a rise with the angle feigns a law of the speed
    feigned = of_angle and so_far.causes and set(so_far.causes) <= _OF_RESTITUTION
    if feigned or (so_far.fails("normal_restitution") and so_far.causes == [_TREND]):
        so_far.withdraw("effects")
    if so_far.fails("pooling"):
        so_far.causes = ["series"]
    elif not brief and so_far.tell("prior_conflict", prior_conflict(problem, found)):
        so_far.withdraw("effects")
        so_far.causes = ["known"]
        _before_slip(so_far)
    so_far.tell("beyond_closure", beyond_closure(problem, found))
    if not so_far.has_slipped and so_far.tell("unrelated_readings", unrelated_readings(problem, found)):
        so_far.withdraw("effects", "pooling")
        so_far.causes = ["order"]


def _before_what_a_cut_feigns(so_far: _Findings, cut: Fact | None) -> None:
    """Tell readings that end at 0 before a slip or an effect that explains no more than the end does.

    What explains as much is named beside it; what explains more is told in its place.
    """
    if cut is None:
        return
    fall = cut.figures["drop"]
    rivals = {name: _fall_of(so_far.facts[name]) for name in _FEIGNED if so_far.fails(name)}
    if max(rivals.values(), default=-math.inf) > fall + ALIKE:
        return
    alike = [so_far.facts[name].says for name, other in rivals.items() if other > fall - ALIKE]
    so_far.withdraw(*rivals)
    so_far.facts["truncation"] = replace(cut, says="; else ".join([cut.says, *alike]))
    so_far.causes = ["cut"]


def _fall_of(fact: Fact) -> float:
    """What the cause that a fact names first takes off -2 log likelihood."""
    figures = fact.figures
    if "drop" in figures:
        return float(figures["drop"])
    called = figures.get("called", [])
    return max((float(figures["tests"][name]["drop"]) for name in called[:1]), default=0.0)


def _before_slip(so_far: _Findings) -> None:
    """Tell what was taken for known before a slip that explains no more than its being wrong does."""
    conflict, slips = so_far.facts["prior_conflict"], so_far.facts.get("slips")
    if slips is None or slips.ok:
        return
    if slips.figures["tests"][slips.figures["called"][0]]["drop"] <= conflict.figures["drop"] + ALIKE:
        so_far.withdraw("slips")
        so_far.facts["prior_conflict"] = replace(conflict, says=f"{conflict.says}; else {slips.says}")


def _angular_momentum(problem: Problem, slips: Fact | None) -> Fact:
    """Whether velocities and spins of raw impacts close, source by source.

    Where a slip explains the residuals and another inertia factor does not, none is advised.
    """
    checks = problem.observations.momentum
    figures = {
        "sources": [
            {name: getattr(c, name) for name in ("source", "n", "rms", "n_violating", "suggested")}
            for c in checks
        ]
    }
    bad = [check for check in checks if not check.ok]
    if bad and slips is not None and not slips.ok and "inertia-factor" not in slips.figures["called"]:
        misses = "; ".join(f"{check.source}: {check.miss}{check.unit_of_spins}" for check in bad)
        says = f"{misses}. Mend the slip in the table first, and see whether it closes then"
    else:
        says = " ".join(check.says for check in (bad or checks)).rstrip(".")
    return Fact(not bad, says, figures, FACTS["angular_momentum"])


def _independence(
    so_far: _Findings, problem: Problem, fit: LeastSquaresFit, residuals: Residuals
) -> Fact | None:
    slip = _sized_slip(problem, fit, so_far.facts.get("slips"))
    # whatever fails before may make residuals alike
    explained = so_far.fails(*_MISFIT) or bool(so_far.causes and slip is None)
    alike = independence(problem, fit, residuals, explained=explained, also=slip)
    copied = so_far.facts.get("repeated_number")
    if alike is not None and copied is not None:
        # one number for all is alike enough
        return None if alike.figures["observable"] in copied.figures["observables"] else alike
    return alike


def _of_rows(so_far: _Findings, problem: Problem, found: LeastSquaresFit, residuals: Residuals) -> None:
    """What is wrong with some rows, or with all in a way that the tests before do not see."""
    # rows that the closure cannot give are no outliers: left out one by one, none would be left
    lies_beyond = so_far.fails("beyond_closure")
    if not lies_beyond:
        so_far.tell("outliers", outliers(problem, found, residuals))
    lack = so_far.facts.get("lack_of_fit")
    if lack is not None and not lack.ok and are_all_that_misfits(so_far.facts.get("outliers")):
        so_far.tell("lack_of_fit", _of_outliers(lack, so_far.facts["outliers"]))
    rounded = rounded_readings(problem, found)
    so_far.tell("rounded_readings", rounded)
    far = so_far.facts.get("outliers")
    if rounded and far and far.figures["observables"] == [rounded.figures["observable"]]:
        so_far.withdraw("outliers")  # the next step of few readings is no outlier
    cut = censoring(problem, found)
    # a code for "not measured" piles up, too
    if cut is None or f"code-for-missing {cut.figures['observable']}" not in so_far.causes:
        so_far.tell("censoring", cut)
    if so_far.causes:
        return
    if not lies_beyond:
        _of_uneven_scatter(so_far, problem, found, residuals)
    by_scatter = so_far.most_explained("growing_scatter", "scatter_by_angle")
    # readings in few cells look like impacts of as many kinds
    not_of_kinds = (*_MISFIT, *_OF_THE_TABLE, *_SHARED_IMPACTS, "angle_scatter")
    if not (so_far.fails(*not_of_kinds) or is_coarse(problem, found)):
        kinds = mixture(problem, found)
        # what scatters more where a constant acts may be impacts of two kinds
        if kinds is not None and kinds.figures["drop"] > by_scatter + ALIKE:
            so_far.tell("mixture", kinds)
            so_far.withdraw("growing_scatter", "scatter_by_angle")
    if not so_far.fails(*_MISFIT, *_OF_THE_TABLE, *_OF_SCATTER, "mixture", "truncation"):
        sharp = truncation(problem, found)
        # beyond the cut of a plateau is less scatter than beside it; and a noise that grows is skewed
        more = math.inf if sharp is None else sharp.figures["drop"] - by_scatter
        if more > -ALIKE:
            so_far.tell("truncation", sharp)
        if more > ALIKE and sharp is not None:
            so_far.withdraw("scatter_by_angle")


def _of_outliers(lack: Fact, far: Fact) -> Fact:
    """A lack of fit that some rows make alone."""
    count = len(far.figures["rows"])
    rows, them = (
        (f"the {count} outliers alone contradict", "them")
        if count > 1
        else ("the outlier alone contradicts", "it")
    )
    p, p_rest = p_text(lack.figures["p"]), p_text(far.figures["p_of_rest"])
    says = f"{rows} the fit (p = {p}, chi2): without {them} p = {p_rest}"
    return replace(lack, says=says, figures={**lack.figures, "by_outliers": count})


def _of_uneven_scatter(
    so_far: _Findings, problem: Problem, found: LeastSquaresFit, residuals: Residuals
) -> None:
    """Noises that change with the angle; outliers are those under such a noise."""
    growing = growing_scatter(problem, found, residuals)
    if growing is not None:
        so_far.facts |= {"outliers": growing.outliers, "growing_scatter": growing.fact}
    if so_far.fails(*_MISFIT, *_OF_WRITING):
        return
    uneven = scatter_by_angle(problem, found, residuals)
    if uneven is not None and uneven.fact.figures["drop"] > so_far.most_explained("growing_scatter") + ALIKE:
        so_far.facts |= {"outliers": uneven.outliers, "scatter_by_angle": uneven.fact}
        so_far.withdraw("growing_scatter")


def _sized_slip(problem: Problem, found: LeastSquaresFit, slips: Fact | None) -> Array | None:
    """Change of the values along the slip that is named first, where it has a size and is in all series."""
    called = [] if slips is None else slips.figures["called"]
    named = [each for each in nuisances(problem) if called[:1] == [each.name]]
    return named[0].slope(found.optimum.theta) if named else None
