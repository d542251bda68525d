"""Counts and misfit of a fit."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from ifrfit.inference.diagnostics.residuals import Residuals
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.optimize.noise_modes import likely_sigma
from ifrfit.inference.result.types import FitStatistics


def statistics_of(
    problem: Problem, found: LeastSquaresFit, residuals: Residuals, sticks: NDArray[np.bool_]
) -> FitStatistics:
    """Count rows and sum up the misfit; the most likely noise goes into the likelihood."""
    r = residuals.raw
    n = r.size
    dof = n - round(float(found.gaussian.leverage.sum()))
    yardstick = problem.noise.sigma if problem.noise.is_scaled else found.sigma
    chi2 = float(((r / yardstick) ** 2).sum())
    is_chi2 = problem.noise.is_known and problem.error_model.is_plain
    prior = problem.parameters.prior_residuals(found.optimum.theta)
    offset = found.angle_offset
    likely = likely_sigma(problem, found.optimum.theta)
    log_l = float(-0.5 * ((r / likely) ** 2).sum() - np.log(likely).sum() - 0.5 * n * math.log(2.0 * math.pi))
    if not problem.error_model.is_plain:
        log_l = math.nan  # not Gaussian; the posterior's evidence is what compares
    k = found.gaussian.rank + len(problem.noise_groups()) + (offset is not None and offset.is_determined)
    regime = problem.rows.is_oblique
    return FitStatistics(
        n=n,
        n_sliding=int((regime & ~sticks).sum()),
        n_sticking=int((regime & sticks).sum()),
        rank=found.gaussian.rank,
        prior_chi2=float(prior @ prior) + (0.0 if offset is None else offset.pull**2),
        chi2=chi2,
        dof=dof,
        reduced_chi2=chi2 / dof if dof > 0 and not problem.noise.has_unknown else None,
        p_value=float(chdtrc(dof, chi2)) if dof > 0 and is_chi2 else None,
        rmse=float(np.sqrt((r * r).mean())),
        log_likelihood=log_l,
        aic=2.0 * k - 2.0 * log_l,
        bic=k * math.log(n) - 2.0 * log_l,
    )
