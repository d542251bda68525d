"""Named findings about a fit, each with its number and its rule."""

from __future__ import annotations

import math
from collections.abc import Mapping

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
from ifrfit.inference.diagnostics.series_compared import unequal_noise
from ifrfit.inference.diagnostics.slips.nuisances import directions_of, nuisances
from ifrfit.inference.diagnostics.thresholds import ALIKE, FACTS, PULL
from ifrfit.inference.model.error_model import ITERATED
from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.angle_offset import AngleOffset
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.result.types import Constants, Fact, by_entry
from ifrfit.text import plus_minus

_ROOM = 1e-3  # degrees to the end of its domain within which an offset lies on it
_OF_RESTITUTION = {*LAWS, "restitution-by-angle"}


def misfit_facts(
    problem: Problem,
    found: LeastSquaresFit,
    residuals: Residuals,
    effects: Mapping[str, Fact],
    *,
    brief: bool = False,
) -> dict[str, Fact]:
    """What the residuals of least squares say; `effects` holds the causes they call for, where tested.

    Brief, it leaves out outliers, and the search for a remedy of a misfit.
    """
    shared = effects.get("pooling")
    effects = {name: fact for name, fact in effects.items() if name != "pooling"}
    called = [name for fact in effects.values() for name in fact.figures["called"]]
    slipped = "slips" in effects and not effects["slips"].ok
    momentum = _angular_momentum(problem, effects.get("slips")) if problem.observations.momentum else None
    if called[:1] == ["inertia-factor"] and momentum is not None and not momentum.ok:
        effects = {}  # velocities and spins say it themselves
    restitution = normal_restitution(problem, found, advise=not slipped)
    laws_fail = restitution is not None and "p_laws_of_speed" in restitution.figures
    if laws_fail and called and set(called) <= _OF_RESTITUTION:
        # the readings of e_n say it themselves: a rise with the angle feigns a law of the speed
        effects = {name: fact for name, fact in effects.items() if name == "slips"}
    noises = None if brief else unequal_noise(problem, found)
    if shared is not None and not shared.ok:
        called = ["series"]
    conflict = None if brief or (shared is not None and not shared.ok) else prior_conflict(problem, found)
    if conflict is not None:
        # so does a value that is wrong
        effects = {name: fact for name, fact in effects.items() if name == "slips"}
        called = ["known"]
    beyond = beyond_closure(problem, found)
    double = None if brief else duplicates(problem, found)
    copied = None if brief else repeated_number(problem)
    # microslip is no remedy where something else is called for
    remedy = not brief and (not called or "compliance" in called) and (restitution is None or restitution.ok)
    # a law that misses something is no reason to doubt the repeats, but for one that goes with the angle
    by_angle = called == ["friction-by-load"]
    doubted = beyond is None and (by_angle or not called)
    scatter = settings_scatter(problem, found, residuals) if doubted else None
    if by_angle and scatter is not None:
        effects = {name: fact for name, fact in effects.items() if name == "slips"}
        called = []
    fitting = lack_of_fit(problem, found, residuals, remedy=remedy, scatter=scatter)
    alike = None
    if not brief:
        slip = _sized_slip(problem, found, effects.get("slips"))
        # whatever fails before may make residuals alike
        before = (fitting, scatter, beyond, restitution, noises)
        explained = any(fact is not None and not fact.ok for fact in before) or bool(called and slip is None)
        alike = independence(problem, found, residuals, explained=explained, also=slip)
        if (
            alike is not None
            and copied is not None
            and alike.figures["observable"] in copied.figures["observables"]
        ):
            alike = None  # one number for all is alike enough
    # a scatter that is no noise of single readings is no yardstick
    small = (
        None
        if copied is not None
        else scatter_too_small(problem, found, residuals, advise=alike is None and not slipped)
    )
    # rows that the closure cannot give are no outliers: left out one by one, none would be left
    rows = None if brief or beyond is not None else outliers(problem, found, residuals)
    rounded = None if brief else rounded_readings(problem, found)
    if rounded is not None and rows is not None and not rows.ok:
        of_rounded = f"({rounded.figures['observable']})"
        if all(row.endswith(of_rounded) for row in rows.figures["rows"]):
            rows = None  # the next step of few readings is no outlier
    clipped = None if brief else censoring(problem, found)
    growing = None if brief or called or beyond is not None else growing_scatter(problem, found, residuals)
    if growing is not None:
        rows = growing.outliers
    others = (rounded, clipped, beyond, rows, fitting, scatter, restitution, noises, alike, momentum, copied)
    fine = not called and all(fact is None or fact.ok for fact in others)
    # readings in few cells look like impacts of as many kinds
    kinds = mixture(problem, found) if fine and not brief and not is_coarse(problem, found) else None
    if growing is not None and kinds is not None:
        # what scatters more where a constant acts may be impacts of two kinds
        more = kinds.figures["drop"] - growing.fact.figures["drop"]
        kinds, growing = (kinds, None) if more > ALIKE else (None, growing)
    cut = truncation(problem, found) if fine and not brief and kinds is None and growing is None else None
    facts = {
        **({} if beyond is None else {"beyond_closure": beyond}),
        **({} if shared is None else {"pooling": shared}),
        **({} if conflict is None else {"prior_conflict": conflict}),
        **({} if double is None else {"duplicates": double}),
        **({} if copied is None else {"repeated_number": copied}),
        **({} if noises is None else {"unequal_noise": noises}),
        **({} if rounded is None else {"rounded_readings": rounded}),
        **({} if clipped is None else {"censoring": clipped}),
        **({} if cut is None else {"truncation": cut}),
        **({} if scatter is None else {"repeats": scatter}),
        "lack_of_fit": fitting,
        **({} if alike is None else {"independence": alike}),
        **({} if kinds is None else {"mixture": kinds}),
        **({} if growing is None else {"growing_scatter": growing.fact}),
        **({} if small is None else {"scatter_too_small": small}),
        **({} if restitution is None else {"normal_restitution": restitution}),
        **({} if rows is None else {"outliers": rows}),
        **effects,
    }
    if momentum is not None:
        facts["angular_momentum"] = momentum
    return facts


def _sized_slip(problem: Problem, found: LeastSquaresFit, slips: Fact | None) -> Array | None:
    """Change of the values along the slip that is named first, where it has a size and is in all series."""
    called = [] if slips is None else slips.figures["called"]
    named = [each for each in nuisances(problem) if called[:1] == [each.name]]
    return directions_of(problem, named, found.optimum.theta)[0].change if named else None


def noise_converged(found: LeastSquaresFit) -> Fact:
    """Whether the iteration over the noise of least squares came to rest."""
    if math.isinf(found.noise_dof):
        says = "least squares converged"
    else:
        says = f"the noise has {'' if found.converged else 'not '}settled"
    return Fact(found.converged, says, {"change": found.change}, FACTS["converged"])


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


def global_optimum(found: LeastSquaresFit, *, bilinear: bool) -> Fact:
    """Whether the optimum is proven to be the best, and the only one."""
    optimum = found.optimum
    figures = {
        "gap": optimum.gap,
        "n_optima_same": optimum.n_same,
        "n_optima_near": optimum.n_near,
        "road": optimum.method,
    }
    rule = FACTS["global_optimum"]
    rivals = optimum.n_near - 1
    if optimum.certified:
        alone = "the only one" if rivals == 0 else f"with {rivals} other within 4 of its chi2"
        what = "" if optimum.tolerance is None else ", unknown noise included"
        what += "" if found.angle_offset is None else ", at the fitted angle offset"
        return Fact(optimum.n_same == 1, f"global optimum certified{what}, {alone}", figures, rule)
    if optimum.gap is not None:
        proof = f"gap {optimum.gap:.1e}"
    elif optimum.method.endswith(ITERATED):
        proof = "each set of weights has a certified optimum, but the weights may settle elsewhere, too"
    else:
        proof = f"no bound is known for {'these observables' if bilinear else 'this closure'}"
    return Fact(False, f"the optimum is not proven to be global ({optimum.method}; {proof})", figures, rule)


def angle_offset(found: AngleOffset, domain: FreeParameter) -> Fact:
    """Whether the offset of the set angles at the optimum is one that its prior and its domain allow."""
    figures = {"value": found.value, "sd": found.sd, "prior_sd": found.prior_sd, "pull": found.pull}
    says = f"the angle offset is {plus_minus(found.value, found.sd)} degrees, prior 0 +- {found.prior_sd:g}"
    room = min(found.value - domain.lower, domain.upper - found.value)
    ok = abs(found.pull) <= PULL and room > _ROOM
    if room <= _ROOM:
        says += (
            ", where an impact would cross the wall or its normal: no offset is the reason. Leave it out, "
            "and let ifrfit compare look for another law"
        )
    elif not ok:
        says += f", {abs(found.pull):.1f} sd off: look for what turned the angles, or widen --angle-offset"
    elif not found.is_determined:
        says += ": the data tell it no better than the prior does"
    return Fact(ok, says, figures, FACTS["angle_offset"])


def at_bound(constants: Constants) -> Fact:
    """Constants that lie on a bound, and those that the data do not tell from it."""
    on: list[str] = []
    near: list[str] = []
    for name, estimate in by_entry(constants).items():
        if estimate.status == "one_sided" and estimate.value is not None:
            (on if "lies on" in estimate.reason else near).append(name)
    parts = [f"{', '.join(on)} on the bound of the domain"] if on else []
    parts += [f"{', '.join(near)} not told from the bound of the domain"] if near else []
    says = "; ".join(parts) or "no constant lies on a bound"
    return Fact(not parts, says, {"on": on, "near": near}, FACTS["at_bound"])
