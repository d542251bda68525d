"""What is known of a quantity beside its distribution: whether the data see it, and what narrows it."""

from __future__ import annotations

import math
from collections.abc import Mapping

from ifrfit.inference.diagnostics.optimum_facts import only_kappa_is_seen
from ifrfit.inference.model.parameters import Parameter
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.summary.status import KAPPA, ON_BOUNDS, Known


def known_of(
    problem: Problem, fit: LeastSquaresFit, name: str, sd: float, reasons: Mapping[str, str]
) -> Known:
    """What the rule of statuses asks of a free entry of theta, or of kappa.

    Parameters
    ----------
    problem : Problem
    fit : LeastSquaresFit
    name : str
    sd : float
        By the covariance; infinite where the data do not see the quantity.
    reasons : mapping
        As `ifrfit.inference.summary.gaussian.prior_reasons`.
    """
    prior = reasons.get(name, "") if math.isfinite(sd) else ""
    unique = fit.optimum.n_same == 1
    seen = math.isfinite(sd) and reasons.get(name) != ""
    if name not in problem.parameters.names:
        return Known(seen, unique, prior, plain=KAPPA)
    constant = problem.parameters.entries[problem.parameters.names.index(name)]
    if constant.name in ("e_n", "mu") and only_kappa_is_seen(problem):
        loose = f"the data fix kappa = {KAPPA} only" if constant.name == "mu" else Known.loose
        return Known(False, True, prior, loose=loose, bounds=_bounds(problem, constant))
    return Known(seen and not too_few(problem, constant), unique, prior, bounds=_bounds(problem, constant))


def _bounds(problem: Problem, constant: Parameter) -> str:
    """The reason where bounds of the user confine a constant, or its partner in kappa; else nothing."""
    partners = ("e_n", "mu") if constant.name in ("e_n", "mu") else (constant.name,)
    named = [name for name in partners if problem.parameters[name].is_confined]
    return f"{ON_BOUNDS} of {' and '.join(named)}" if named else ""


def too_few(problem: Problem, constant: Parameter) -> bool:
    """Whether there are no more oblique rows than constants that only they know: then nothing is tested."""
    kinds = problem.rows.kinds
    oblique = int(problem.rows.is_oblique.sum())
    direct = {"e_n": "normal", "mu": "friction"}
    if oblique == 0 or constant.is_informed or direct.get(constant.name) in kinds:
        return False
    known = {name for name, kind in direct.items() if kind in kinds}
    unknown = [c for c in problem.parameters.entries if not c.is_informed and c.name not in known]
    return oblique <= len(unknown)
