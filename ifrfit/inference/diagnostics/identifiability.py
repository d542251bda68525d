"""Which constants the data determine, which they leave loose, and what would settle the rest, in words."""

from __future__ import annotations

import math

import numpy as np

from ifrfit.inference.diagnostics.thresholds import FACTS
from ifrfit.inference.model.entry_names import quantity_of
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.result.types import Constants, Fact, by_entry

_SHARE = 0.1  # of the largest loading below which a constant is not named in a combination


def identifiable(
    problem: Problem,
    fit: LeastSquaresFit,
    constants: Constants,
    n_sticking: int,
    n_sliding: int,
    *,
    slip: bool = False,
) -> Fact:
    """Whether the data determine every free constant; names the loose combinations and the remedy.

    With a slip in the table nothing is advised but to mend that first.
    """
    local = fit.gaussian
    n_free = int(problem.parameters.free.sum())
    loose = [
        _combination(local.names, local.vectors[:, i] / problem.parameters.prior_sd)
        for i in np.flatnonzero(~local.tight)
    ]
    figures = {"rank": local.rank, "free": n_free, "loose": loose}
    if slip and (local.rank < n_free or _limits(problem, constants)):
        says = "the data do not determine every constant as the table stands: mend the slip in it first"
        return Fact(False, says, figures, FACTS["identifiable"])
    if local.rank == n_free:
        limits = _limits(problem, constants)
        says = limits or "the data determine every free constant"
        return Fact(not limits, says, figures, FACTS["identifiable"])
    return Fact(False, _advice(problem, loose, n_sticking, n_sliding), figures, FACTS["identifiable"])


def _limits(problem: Problem, constants: Constants) -> str:
    """What to say where the optimum looks determined, but the data go on beyond it nearly as well."""
    says = []
    for name, estimate in by_entry(constants).items():
        if estimate.value is not None:
            continue
        if quantity_of(name) == "mu" and math.isinf(estimate.interval95[1]):
            says.append(
                f"no impact surely slides, so the data set only a lower limit to {name}: "
                f"measure beyond {_steepest(problem):.0f} degrees"
            )
        else:
            says.append(f"{name}: {estimate.reason}; add impacts at other angles, or a sigma that is smaller")
    return "; ".join(says)


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


def _advice(problem: Problem, loose: list[str], n_sticking: int, n_sliding: int) -> str:
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
            f"give e_n a value (--fix e_n=...) or measure it (a drop test){mu}"
        )
    elif "e_n" in alone:
        says.append("nothing here fixes e_n: give it a value (--fix e_n=...) or measure it (a drop test)")
    if n_sliding == 0 and n_sticking > 0 and closure.bilinear:
        steepest = _steepest(problem)
        says.append(
            "no impact slides, and sticking impacts say only how large mu must at least be: "
            f"measure beyond {steepest:.0f} degrees"
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
            says.append(f"{kind}{' and '.join(loose)} {verb} loose: add impacts at other angles")
    if not says:
        says.append(f"loose: {', '.join(loose)}")
    return "; ".join(says)


def only_kappa_is_seen(problem: Problem) -> bool:
    """Whether friction enters through kappa alone: tangential rows, and nothing that knows e_n or mu."""
    rows = all(
        (each.kind == "tangential" and each.scale == "one") or each.without_e_n
        for each in problem.rows.observables
    )
    free = not any(c.is_informed for c in problem.parameters if c.name in ("e_n", "mu"))
    mu = problem.parameters["mu"]
    return rows and free and mu.lower == 0.0 and math.isinf(mu.upper)


def _steepest(problem: Problem) -> float:
    gamma = problem.observations.table["gamma_deg"].to_numpy(dtype=float)
    return float(np.nanmax(gamma)) if np.isfinite(gamma).any() else math.nan


def _one_angle(problem: Problem) -> bool:
    tau = problem.rows.tau[problem.rows.is_oblique]
    return tau.size > 0 and float(np.ptp(tau)) <= 1e-9 * (1.0 + float(tau.max()))
