"""Whether an optimum is the best and the only one, and which constants the data determine there."""

from __future__ import annotations

import math

import numpy as np

from ifrfit.inference.diagnostics.thresholds import FACTS, FEW_DOF, PULL, RIVAL, TINY_FRICTION
from ifrfit.inference.model.entry_names import quantity_of
from ifrfit.inference.model.error_model import ITERATED
from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.model.noise import resolution
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array
from ifrfit.inference.optimize.angle_offset import AngleOffset
from ifrfit.inference.optimize.laplace import gaussian_approximation
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, group_dof
from ifrfit.inference.optimize.noise_modes import noise_at_mode
from ifrfit.inference.optimize.tied_search import TIED
from ifrfit.inference.result.types import Constants, Fact, by_entry
from ifrfit.physics.observable import Observable
from ifrfit.physics.observables import OBSERVABLES
from ifrfit.text import joined, plus_minus

# of methods that failed, which say nothing of the data
ALL_ALIKE = "every replicate is the same: there is too little to draw from"
NO_INTEGRAL = "the integral of the posterior did not converge"

_ROOM = 1e-3  # degrees to the end of its domain within which an offset lies on it
_DISTANCE = 3.0  # sd between modes, in at least one constant, that are no kinks of one hill
_COVERED, _MANY = (20.0, 70.0), 8  # degrees between which lie all angles, and of how many
_VELOCITIES = ("v_x", "v_n")
_UNROUNDED = 1e-6  # last decimal of numbers that are made of others
_SPREAD, _NARROW = 5.0, 3.0  # times the scatter of velocities, or degrees, that angles made of them differ by
_SHARE = 0.1  # of the largest loading below which a constant is not named in a combination


def noise_converged(found: LeastSquaresFit) -> Fact:
    """Whether the iteration over the noise, or the weights, of least squares came to rest."""
    is_known = math.isinf(found.noise_dof)
    if found.converged:
        says = "least squares converged" if is_known else "the noise has settled"
    else:
        what = "weights of least squares have" if is_known else "noise has"
        says = f"the {what} not settled: the last step was still one of {100.0 * found.change:.2g} %"
    return Fact(found.converged, says, {"change": found.change}, FACTS["converged"])


def few_degrees_of_freedom(problem: Problem, found: LeastSquaresFit) -> Fact | None:
    """Unknown noises that rest on one degree of freedom: no sd tells what they may be; None without any."""
    if not problem.error_model.is_plain:
        return None
    each = zip(problem.noise_groups(), group_dof(problem, found).tolist(), strict=True)
    few = {name: dof for name, dof in each if dof < FEW_DOF}
    if not few:
        return None
    several = len(problem.series) > 1
    named = [f"of {name if several else name.rpartition('/')[2]}" if name else "over sigma" for name in few]
    says = (
        f"the noise {joined(named)} rests on 1 degree of freedom: its size is a guess, and so is every sd "
        "that rests on it. Go by the 95 % intervals, which have the tails of Student's t; a sigma, or more "
        "impacts, would tell more"
    )
    return Fact(False, says, {"dof": few}, FACTS["noise_dof"])


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
        what += "" if found.common is None else ", errors in common included"
        return Fact(optimum.n_same == 1, f"global optimum certified{what}, {alone}", figures, rule)
    if optimum.gap is not None:
        proof = f"gap {optimum.gap:.1e}"
    elif found.common is not None:
        proof = "the best of each place is certified where the closure allows it, the search over them is not"
    elif optimum.method.endswith(ITERATED):
        proof = "each set of weights has a certified optimum, but the weights may settle elsewhere, too"
    elif optimum.method.endswith(TIED):
        proof = "no bound is known for constants that are tied"
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


def tiny_friction(problem: Problem, constants: Constants) -> Fact | None:
    """A mu that no dry contact has: a slip in the units of the angles or velocities that fits as well.

    Tangents for angles, or one unit for all velocities but another for spins, divide every slip ratio by the
    same number, and mu with it.

    Returns
    -------
    Fact or None
        None unless some mu of readings that are not simulated is surely below `TINY_FRICTION`.
    """
    if (problem.observations.table["provenance"] == "simulated").all():
        return None
    tiny = {
        name: each.interval95[1]
        for name, each in by_entry(constants).items()
        if quantity_of(name) == "mu" and each.status != "fixed" and each.interval95[1] < TINY_FRICTION
    }
    if not tiny:
        return None
    says = (
        f"{joined(list(tiny))} comes out below {max(tiny.values()):.2g}; sliding contacts have 0.01 (ice, a "
        "film of oil) to 1.5 (rubber). Are the angles degrees, and no tangents? Are velocities and spins in "
        "the units that their headers say?"
    )
    return Fact(False, says, {"mu": list(tiny)}, FACTS["tiny_friction"])


def several_modes(problem: Problem, found: LeastSquaresFit) -> Fact | None:
    """Modes of the posterior that lie apart, each with its weight; None where there is one.

    The weight is Laplace's: the height of the mode times the volume of the Gaussian about it.

    Parameters
    ----------
    problem : Problem
    found : LeastSquaresFit
        Its rivals, or where noise is known its other minima.
    """
    optimum = found.optimum
    rivals = found.rivals or tuple((value - optimum.objective, theta) for value, theta in optimum.minima[1:])
    kept: list[tuple[float, Array, Array]] = []
    for rise, theta in ((0.0, optimum.theta), *rivals):
        if not np.isfinite(theta).all():
            continue
        sigma = noise_at_mode(problem, theta, rise).sigma if found.rivals else found.sigma
        covariance = gaussian_approximation(problem, sigma, theta).covariance(capped=True)
        sd = np.sqrt(np.diag(covariance))
        if all(_differ(theta - other, np.maximum(sd, spread)) for _, other, spread in kept):
            free = problem.parameters.free
            volume = 0.5 * float(np.linalg.slogdet(covariance[np.ix_(free, free)])[1])
            if math.isfinite(volume):  # none where the data do not see a constant at all
                kept.append((-0.5 * rise + volume, theta, sd))
    log = np.array([height for height, _, _ in kept])
    weights = np.exp(log - log.max()) / np.exp(log - log.max()).sum() if log.size else log
    modes = [(float(w), theta) for w, (_, theta, _) in zip(weights, kept, strict=True) if w >= RIVAL]
    if len(modes) < 2:
        return None
    modes.sort(key=lambda mode: -mode[0])
    free = problem.parameters.free
    names = np.array(problem.parameters.names)[free].tolist()
    told = [
        {"weight": weight, "constants": dict(zip(names, theta[free].tolist(), strict=True))}
        for weight, theta in modes
    ]
    words = [_words(theta[free], names, weight) for weight, theta in modes]
    says = f"{len(modes)} sets of constants explain the data: {joined(words)}"
    return Fact(False, says, {"modes": told}, FACTS["noise_modes"])


def _differ(difference: Array, sd: Array) -> bool:
    return bool((np.abs(difference) > _DISTANCE * sd).any())


def _words(values: Array, names: list[str], weight: float) -> str:
    each = ", ".join(f"{name} {value:.3g}" for name, value in zip(names, values.tolist(), strict=True))
    return f"{each} (weight {weight:.2g})"


def identifiable(
    problem: Problem,
    fit: LeastSquaresFit,
    constants: Constants,
    n_sticking: int,
    n_sliding: int,
    *,
    slip: bool = False,
    too_large: float = 1.0,
    misfit: bool = False,
) -> Fact:
    """Whether the data determine every free constant; names the loose combinations and the remedy.

    With a slip in the table nothing is advised but to mend that first; nor with a sigma that is too large,
    by a factor, where nothing else leaves them open; nor, with a `misfit`, further angles beside many.
    """
    local = fit.gaussian
    n_free = int(problem.parameters.free.sum())
    loose = [
        _combination(local.names, local.vectors[:, i] / problem.parameters.prior_sd)
        for i in np.flatnonzero(~local.tight)
    ]
    figures = {"rank": local.rank, "free": n_free, "loose": loose}
    within_errors = "" if slip else _within_errors(problem, fit)
    if within_errors:
        return Fact(False, within_errors, figures, FACTS["identifiable"])
    if slip and (local.rank < n_free or _limits(problem, constants, misfit=misfit)):
        says = "the data do not determine every constant as the table stands: mend the slip in it first"
        return Fact(False, says, figures, FACTS["identifiable"])
    if too_large > 1.0 and local.rank < n_free:
        narrow = gaussian_approximation(problem, fit.sigma / too_large, fit.optimum.theta)
        if narrow.rank == n_free:
            says = "the data do not determine every constant with sigma as given: mend sigma first"
            return Fact(False, says, figures, FACTS["identifiable"])
    if local.rank == n_free:
        limits = _limits(problem, constants, misfit=misfit)
        says = limits or "the data determine every free constant"
        return Fact(not limits, says, figures, FACTS["identifiable"])
    advice = _advice(problem, loose, n_sticking, n_sliding, misfit=misfit)
    return Fact(False, advice, figures, FACTS["identifiable"])


def _within_errors(problem: Problem, fit: LeastSquaresFit) -> str:
    """What to say where angles that are made of velocities differ by little more than these scatter."""
    rows = problem.rows
    velocities = np.isin(rows.which, [rows.names.index(name) for name in _VELOCITIES if name in rows.names])
    numbers = (problem.speeds, rows.gamma_deg)
    if not (velocities & rows.is_oblique).any() or not all(
        (x > 0.0).any() and resolution(x) <= _UNROUNDED for x in numbers
    ):
        return ""
    spread = float(np.std(rows.gamma_deg[rows.is_oblique]))
    scatter = math.degrees(float(np.sqrt((fit.sigma[velocities] ** 2).mean())))
    if spread >= min(_SPREAD * scatter, _NARROW):  # what the law misses scatters, too
        return ""
    return (
        f"the angles of incidence, made of velocities, differ by {spread:.2g} degrees (sd), and the "
        f"velocities after impact scatter by {scatter:.2g} degrees: too much of the spread is errors, and "
        "e_t and mu that rest on it are not to be believed. Vary the angle, or give the angle as it was set"
    )


def _limits(problem: Problem, constants: Constants, *, misfit: bool) -> str:
    """What to say where the optimum looks determined, but the data go on beyond it nearly as well."""
    says = []
    for name, estimate in by_entry(constants).items():
        if estimate.value is not None or estimate.reason in (ALL_ALIKE, NO_INTEGRAL):
            continue
        if quantity_of(name) == "mu" and math.isinf(estimate.interval95[1]):
            says.append(
                f"no impact surely slides, so the data set only a lower limit to {name}: "
                f"{_beyond(problem, misfit=misfit)}"
            )
        else:
            more = _more(problem, ", or a sigma that is smaller", misfit)
            says.append(f"{name}: {estimate.reason}; {more}")
    return "; ".join(says)


def _beyond(problem: Problem, *, misfit: bool) -> str:
    """What to measure where no impact slides."""
    if misfit and _covers_angles(problem):
        return _more(problem, "", misfit)
    return f"measure beyond {_steepest(problem):.0f} degrees"


def _more(problem: Problem, also: str, misfit: bool) -> str:
    """What to measure where constants stay open: no other angles where all are there."""
    if not _covers_angles(problem):
        return f"add impacts at other angles{also}"
    gamma = problem.rows.gamma_deg[problem.rows.is_oblique]
    there = f"angles from {gamma.min():.0f} to {gamma.max():.0f} degrees are there already"
    if misfit:
        return f"{there}, so see first why the law does not describe them"
    return f"{there}: more impacts or smaller errors would tell"


def _covers_angles(problem: Problem) -> bool:
    """Whether there are so many angles, near the normal and far from it, that others would tell no more."""
    gamma = np.unique(problem.rows.gamma_deg[problem.rows.is_oblique])
    low, high = _COVERED
    return gamma.size >= _MANY and bool(gamma[0] <= low and gamma[-1] >= high)


def _combination(names: tuple[str, ...], vector: np.ndarray) -> str:
    """A direction as text; the largest part first."""
    size = np.abs(vector)
    named = [int(i) for i in np.argsort(-size, kind="stable") if size[i] > _SHARE * size.max()]
    if len(named) == 1:
        return names[named[0]]
    lead = float(vector[named[0]])
    parts = [names[named[0]]]
    for i in named[1:]:
        factor = float(vector[i]) / lead
        text = f"{abs(factor):.2g}"
        parts.append(f"{'+' if factor > 0 else '-'} {'' if text == '1' else text + ' '}{names[i]}")
    return " ".join(parts)


def _advice(problem: Problem, loose: list[str], n_sticking: int, n_sliding: int, *, misfit: bool) -> str:
    """What is open, why, and what to measure."""
    observed = ", ".join(problem.rows.names)
    says = []
    alone = {quantity_of(name) for name in loose if " " not in name}
    closure, j = problem.closure, problem.inertia_factor
    own = closure.constant
    if "e_n" in alone and only_kappa_is_seen(problem):
        mu = "" if n_sliding == 0 else " to get mu"
        says.append(
            f"{observed} alone determine{'s' if len(problem.rows.names) == 1 else ''} "
            f"{'' if own is None else own + ' and '}kappa = mu (1 + e_n), never e_n and mu apart: "
            f"give e_n a value (--fix e_n=...) or measure it (a drop test){mu}{_left_out(problem)}"
        )
    elif "e_n" in alone:
        says.append("nothing here fixes e_n: give it a value (--fix e_n=...) or measure it (a drop test)")
    if n_sliding == 0 and n_sticking > 0 and closure.bilinear:
        says.append(
            "no impact slides, and sticking impacts say only how large mu must at least be: "
            f"{_beyond(problem, misfit=misfit)}"
        )
    elif n_sticking == 0 and n_sliding > 0 and own and not closure.acts_in_sliding(j):
        says.append(f"no impact sticks, and {own} shows only in sticking: measure nearer to the normal")
    elif (alone & {"kappa", "mu", own}) or any(" " in name for name in loose):
        if n_sticking + n_sliding == 0:
            says.append("no oblique impact is among the rows: e_n and mu alone say nothing of the rest")
        elif _one_angle(problem):
            says.append(
                "all impacts have one slip ratio, which cannot tell the constants apart: vary the angle"
            )
        elif not says:
            kind = "the combination " if any(" " in name for name in loose) else ""
            verb = "stays" if len(loose) == 1 else "stay"
            says.append(f"{kind}{' and '.join(loose)} {verb} loose: {_more(problem, '', misfit)}")
    if not says:
        says.append(f"loose: {', '.join(loose)}")
    return "; ".join(says)


def _left_out(problem: Problem) -> str:
    """Observables that are left out, as they would count impacts twice, and that know e_n; empty without."""
    left = problem.observations.redundant
    names = [] if left is None else dict.fromkeys(left["observable"].to_numpy(dtype=object).tolist())
    telling = [name for name in names if not _sees_only_kappa(OBSERVABLES[name])]
    if not telling:
        return ""
    one, several = telling[0], len(telling) > 1
    together = " ".join(f"--observable {name}" for name in (*problem.rows.names, one))
    return (
        f". {joined(telling)} of the same impacts, left out so that none counts twice, "
        f"{'tell' if several else 'tells'} e_n, too: fit {'one of them' if several else 'it'} alone "
        f"(--observable {one}), or with {joined(problem.rows.names)} ({together} --independent) "
        "where their errors have nothing in common"
    )


def _sees_only_kappa(observable: Observable) -> bool:
    return (observable.kind == "tangential" and observable.scale == "one") or observable.without_e_n


def only_kappa_is_seen(problem: Problem) -> bool:
    """Whether friction enters through kappa alone: tangential rows, and nothing that knows e_n or mu.

    A tie that names one of them does: what tells another constant tells it, too.
    """
    if problem.parameters.ties.involved & {"e_n", "mu"}:
        return False
    rows = all(_sees_only_kappa(each) for each in problem.rows.observables)
    free = not any(c.is_informed for c in problem.parameters if c.name in ("e_n", "mu"))
    mu = problem.parameters["mu"]
    return rows and free and mu.lower == 0.0 and math.isinf(mu.upper)


def _steepest(problem: Problem) -> float:
    gamma = problem.observations.table["gamma_deg"].to_numpy(dtype=float)
    return float(np.nanmax(gamma)) if np.isfinite(gamma).any() else math.nan


def _one_angle(problem: Problem) -> bool:
    tau = problem.rows.tau[problem.rows.is_oblique]
    return tau.size > 0 and float(np.ptp(tau)) <= 1e-9 * (1.0 + float(tau.max()))
