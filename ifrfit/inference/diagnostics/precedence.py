"""What the residuals say, and which finding speaks where several tests see the same cause.

One wrong angle makes chi2 too large, residuals alike and rows outliers. Told one beside the other, each with
its remedy, these would be three faults. So the questions stand in a table, in the order in which they are
asked, each with the findings behind which it is left out; a second table says which finding, once made, takes
the place of another.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from ifrfit.inference.diagnostics.angular_momentum import angular_momentum
from ifrfit.inference.diagnostics.beyond_closure import beyond_closure
from ifrfit.inference.diagnostics.censoring import censoring, truncation
from ifrfit.inference.diagnostics.duplicates import duplicates
from ifrfit.inference.diagnostics.growing_scatter import growing_scatter
from ifrfit.inference.diagnostics.independence import independence
from ifrfit.inference.diagnostics.lack_of_fit import lack_of_fit, scatter_too_small
from ifrfit.inference.diagnostics.mixture import mixture
from ifrfit.inference.diagnostics.normal_restitution import normal_restitution
from ifrfit.inference.diagnostics.omitted_effects.restitution_laws import LAWS
from ifrfit.inference.diagnostics.outliers import outliers
from ifrfit.inference.diagnostics.prior_conflict import prior_conflict
from ifrfit.inference.diagnostics.quadratic_forms import Array
from ifrfit.inference.diagnostics.repeated_number import repeated_number
from ifrfit.inference.diagnostics.repeats import settings_scatter
from ifrfit.inference.diagnostics.residuals import Residuals
from ifrfit.inference.diagnostics.rounded_readings import is_coarse, rounded_readings
from ifrfit.inference.diagnostics.scatter_by_angle import scatter_by_angle
from ifrfit.inference.diagnostics.series_compared import unequal_noise
from ifrfit.inference.diagnostics.slips.nuisances import directions_of, nuisances
from ifrfit.inference.diagnostics.thresholds import ALIKE
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.result.types import Fact

_OF_RESTITUTION = {*LAWS, "restitution-by-angle"}
_OF_MOMENTUM = "inertia-factor"
_BY_ANGLE = ["friction-by-load"]  # a cause that goes with the angle, as repeats at one setting do
# findings that leave no residuals for which only impacts of two kinds or a cut would be a reason
_MISFIT = ("lack_of_fit", "repeats", "beyond_closure", "normal_restitution", "unequal_noise")
_OF_WRITING = ("rounded_readings", "censoring", "independence", "angular_momentum", "repeated_number")
_OF_THE_TABLE = (*_OF_WRITING, "outliers")
_UNEVEN = ("growing_scatter", "scatter_by_angle")
_OF_SCATTER = ("angle_scatter", "growing_scatter", "scatter_too_small")
_CAUSES = ("slips", "effects")
# as the report tells them
_ORDER = (
    "beyond_closure",
    "pooling",
    "prior_conflict",
    "duplicates",
    "repeated_number",
    "angle_scatter",
    "unequal_noise",
    "rounded_readings",
    "censoring",
    "truncation",
    "repeats",
    "lack_of_fit",
    "independence",
    "mixture",
    *_UNEVEN,
    "scatter_too_small",
    "scatter_too_large",
    "normal_restitution",
    "outliers",
    "slips",
    "effects",
    "angular_momentum",
)


@dataclass
class Findings:
    """What has been found of one fit so far.

    Attributes
    ----------
    problem : Problem
    fit : LeastSquaresFit
    residuals : Residuals
    facts : dict of str to Fact
        By name; a question that found nothing to say has none.
    causes : list of str
        What explains the residuals: effects, slips, "series" that differ, a "known" value that is wrong.
    brief : bool
        Whether the fit is one of many: no remedy is searched.
    """

    problem: Problem
    fit: LeastSquaresFit
    residuals: Residuals
    facts: dict[str, Fact]
    causes: list[str]
    brief: bool

    def fails(self, *names: str) -> bool:
        """Whether any of these facts is there and is not ok."""
        return any(name in self.facts and not self.facts[name].ok for name in names)


@dataclass(frozen=True)
class _Question:
    """One test of the residuals.

    Attributes
    ----------
    name : str
        Of the fact.
    ask : callable
        The fact, or None where there is nothing to say.
    behind : tuple of str
        Findings that, where they fail, leave it out.
    behind_causes : bool
        Whether any cause that is named leaves it out.
    in_brief : bool
        Whether it is asked of a fit that is one of many, too.
    """

    name: str
    ask: Callable[[Findings], Fact | None]
    behind: tuple[str, ...] = ()
    behind_causes: bool = False
    in_brief: bool = False


@dataclass(frozen=True)
class _Precedence:
    """A finding that takes the place of others.

    Attributes
    ----------
    finding : str
        Of the fact that fails.
    over : tuple of str
        Facts that are withdrawn.
    where : callable
        Condition beyond the failure.
    causes : list of str or None
        What is named in place of the causes before; None leaves them.
    """

    finding: str
    over: tuple[str, ...]
    where: Callable[[Findings], bool] = lambda _: True
    causes: list[str] | None = None


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
    findings = Findings(problem, found, residuals, dict(causes), named, brief)
    for question in _QUESTIONS:
        if (brief and not question.in_brief) or findings.fails(*question.behind):
            continue
        if question.behind_causes and findings.causes:
            continue
        fact = question.ask(findings)
        if fact is not None:
            findings.facts[question.name] = fact
            _withdraw(findings, question.name)
    return in_order(findings.facts)


def in_order(facts: Mapping[str, Fact]) -> dict[str, Fact]:
    """Facts of the residuals as the report tells them."""
    return {name: facts[name] for name in _ORDER if name in facts}


def _withdraw(findings: Findings, new: str) -> None:
    """Take out what a new finding takes the place of."""
    for rule in _PRECEDENCES:
        if rule.finding == new and findings.fails(new) and rule.where(findings):
            for name in rule.over:
                findings.facts.pop(name, None)
            if rule.causes is not None:
                findings.causes = rule.causes


def _angular_momentum(findings: Findings) -> Fact | None:
    if not findings.problem.observations.momentum:
        return None
    return angular_momentum(findings.problem, findings.facts.get("slips"))


def _normal_restitution(findings: Findings) -> Fact | None:
    return normal_restitution(findings.problem, findings.fit, advise=not _has_slipped(findings))


def _has_slipped(findings: Findings) -> bool:
    """Whether a slip is called for, told by itself or by velocities and spins that do not close."""
    return findings.fails("slips") or (
        findings.fails("angular_momentum") and findings.causes[:1] == [_OF_MOMENTUM]
    )


def _repeats(findings: Findings) -> Fact | None:
    # a law that misses something is no reason to doubt the repeats, but for one that goes with the angle
    if findings.causes and findings.causes != _BY_ANGLE:
        return None
    return settings_scatter(findings.problem, findings.fit, findings.residuals)


def _lack_of_fit(findings: Findings) -> Fact:
    # microslip is no remedy where something else is called for
    microslip = not findings.causes or "compliance" in findings.causes
    return lack_of_fit(
        findings.problem,
        findings.fit,
        findings.residuals,
        remedy=not findings.brief and microslip and not findings.fails("normal_restitution"),
        scatter=findings.facts.get("repeats"),
    )


def _independence(findings: Findings) -> Fact | None:
    problem, fit = findings.problem, findings.fit
    slip = _sized_slip(problem, fit, findings.facts.get("slips"))
    # whatever fails before may make residuals alike
    explained = findings.fails(*_MISFIT) or bool(findings.causes and slip is None)
    alike = independence(problem, fit, findings.residuals, explained=explained, also=slip)
    copied = findings.facts.get("repeated_number")
    if alike is not None and copied is not None:
        # one number for all is alike enough
        return None if alike.figures["observable"] in copied.figures["observables"] else alike
    return alike


def _scatter_too_small(findings: Findings) -> Fact | None:
    advise = not (findings.fails("independence") or _has_slipped(findings))
    return scatter_too_small(findings.problem, findings.fit, findings.residuals, advise=advise)


def _growing_scatter(findings: Findings) -> Fact | None:
    growing = growing_scatter(findings.problem, findings.fit, findings.residuals)
    if growing is None:
        return None
    findings.facts["outliers"] = growing.outliers
    return growing.fact


def _scatter_by_angle(findings: Findings) -> Fact | None:
    uneven = scatter_by_angle(findings.problem, findings.fit, findings.residuals)
    if uneven is None or _explained(findings) + ALIKE >= uneven.fact.figures["drop"]:
        return None
    findings.facts["outliers"] = uneven.outliers
    return uneven.fact


def _mixture(findings: Findings) -> Fact | None:
    # readings in few cells look like impacts of as many kinds
    if is_coarse(findings.problem, findings.fit):
        return None
    kinds = mixture(findings.problem, findings.fit)
    # what scatters more where a constant acts may be impacts of two kinds
    return kinds if kinds is not None and kinds.figures["drop"] > _explained(findings) + ALIKE else None


def _truncation(findings: Findings) -> Fact | None:
    cut = truncation(findings.problem, findings.fit)
    # beyond the cut of a plateau there is less scatter than beside it; and a noise that grows is skewed there
    return None if cut is None or _against_uneven(findings, cut) < -ALIKE else cut


def _against_uneven(findings: Findings, cut: Fact) -> float:
    """What a cut takes off -2 log likelihood beyond a scatter that changes with the angle."""
    uneven = findings.facts.get("scatter_by_angle")
    return math.inf if uneven is None else float(cut.figures["drop"] - uneven.figures["drop"])


def _explained(findings: Findings) -> float:
    """What an uneven scatter takes off -2 log likelihood."""
    drops = [findings.facts[name].figures["drop"] for name in _UNEVEN if name in findings.facts]
    return max(drops, default=-math.inf)


def _are_rounded(findings: Findings) -> bool:
    """Whether all outliers are readings of the observable whose rounding is coarse."""
    rounded, rows = findings.facts["rounded_readings"], findings.facts["outliers"]
    return set(rows.figures["observables"]) == {rounded.figures["observable"]}


def _sized_slip(problem: Problem, found: LeastSquaresFit, slips: Fact | None) -> Array | None:
    """Change of the values along the slip that is named first, where it has a size and is in all series."""
    called = [] if slips is None else slips.figures["called"]
    named = [each for each in nuisances(problem) if called[:1] == [each.name]]
    return directions_of(problem, named, found.optimum.theta)[0].change if named else None


# in the order in which they are asked
_QUESTIONS = (
    _Question("angular_momentum", _angular_momentum, in_brief=True),
    _Question("normal_restitution", _normal_restitution, in_brief=True),
    _Question("pooling", lambda f: f.facts.get("pooling"), in_brief=True),
    _Question("prior_conflict", lambda f: prior_conflict(f.problem, f.fit), behind=("pooling",)),
    _Question("beyond_closure", lambda f: beyond_closure(f.problem, f.fit), in_brief=True),
    _Question("duplicates", lambda f: duplicates(f.problem, f.fit)),
    _Question("repeated_number", lambda f: repeated_number(f.problem)),
    _Question("unequal_noise", lambda f: unequal_noise(f.problem, f.fit)),
    _Question("repeats", _repeats, behind=("beyond_closure",), in_brief=True),
    _Question("lack_of_fit", _lack_of_fit, in_brief=True),
    _Question("independence", _independence),
    _Question("scatter_too_small", _scatter_too_small, behind=("repeated_number",), in_brief=True),
    # rows that the closure cannot give are no outliers: left out one by one, none would be left
    _Question("outliers", lambda f: outliers(f.problem, f.fit, f.residuals), behind=("beyond_closure",)),
    _Question("rounded_readings", lambda f: rounded_readings(f.problem, f.fit)),
    _Question("censoring", lambda f: censoring(f.problem, f.fit)),
    _Question("growing_scatter", _growing_scatter, behind=("beyond_closure",), behind_causes=True),
    _Question(
        "scatter_by_angle",
        _scatter_by_angle,
        behind=(*_MISFIT, *(set(_OF_THE_TABLE) - {"outliers"})),
        behind_causes=True,
    ),
    _Question("mixture", _mixture, behind=(*_MISFIT, *_OF_THE_TABLE, "angle_scatter"), behind_causes=True),
    _Question(
        "truncation",
        _truncation,
        behind=(*_MISFIT, *_OF_THE_TABLE, *_OF_SCATTER, "mixture"),
        behind_causes=True,
    ),
)
_PRECEDENCES = (
    # velocities and spins say it themselves
    _Precedence("angular_momentum", ("slips", "effects"), lambda f: f.causes[:1] == [_OF_MOMENTUM]),
    # so do readings of e_n: a rise with the angle feigns a law of the speed
    _Precedence(
        "normal_restitution",
        ("effects",),
        lambda f: (
            "p_laws_of_speed" in f.facts["normal_restitution"].figures
            and bool(f.causes)
            and set(f.causes) <= _OF_RESTITUTION
        ),
    ),
    _Precedence("pooling", (), causes=["series"]),
    _Precedence("prior_conflict", ("effects",), causes=["known"]),
    _Precedence("repeats", ("effects",), lambda f: f.causes == _BY_ANGLE, causes=[]),
    # the next step of few readings is no outlier
    _Precedence("rounded_readings", ("outliers",), lambda f: f.fails("outliers") and _are_rounded(f)),
    _Precedence("scatter_by_angle", ("growing_scatter",)),
    _Precedence("mixture", _UNEVEN),
    _Precedence(
        "truncation",
        ("scatter_by_angle",),
        lambda f: _against_uneven(f, f.facts["truncation"]) > ALIKE,
    ),
)
