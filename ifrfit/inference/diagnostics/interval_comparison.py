"""Covariance, profile and exact intervals side by side."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ifrfit.inference.distributions.protocol import Distribution
from ifrfit.inference.distributions.truncated_normal import half_width
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, dof_of_functional
from ifrfit.inference.profile.profile_all import profile_all
from ifrfit.inference.profile.types import ProfileLikelihood
from ifrfit.inference.summary.gaussian import local_quantities

if TYPE_CHECKING:
    import pandas as pd

_LEVEL = 0.95


def intervals(
    problem: Problem,
    fit: LeastSquaresFit,
    posterior: Distribution | None,
    profiles: Mapping[str, ProfileLikelihood] | None = None,
) -> pd.DataFrame:
    """Central 95 % intervals of every free constant and of kappa, by three methods.

    Parameters
    ----------
    problem : Problem
    fit : LeastSquaresFit
    posterior : Distribution or None
        Its columns are nan without one, or where it has no such marginal.
    profiles : mapping, optional
        What `profile_all` returned, if it has been called before.

    Returns
    -------
    DataFrame
        One row a constant or kappa (index: name), with columns

        - covariance_low, covariance_high: value -+ z sd (Student's t where the noise comes from the misfit),
          symmetric and not cut at the bounds of the domain; infinite where the data do not see the constant;
        - profile_low, profile_high: all values that `ProfileLikelihood.central95` spans;
        - exact_low, exact_high: the 2.5 and 97.5 % quantiles of the posterior;
        - lower, upper: the domain; shape: of the profile; noise_dof: degrees of freedom of the noise
          behind the quantity (`ProfileLikelihood.dof`).
    """
    import pandas as pd

    found = profile_all(problem, fit, curves=False) if profiles is None else profiles
    rows: dict[str, dict[str, Any]] = {}
    for name, (value, functional, domain) in local_quantities(problem, fit).items():
        profile = found[name]
        sd = math.sqrt(fit.gaussian.variance(functional, domain.prior_sd))
        half = half_width(_LEVEL, dof_of_functional(problem, fit, functional)) * sd
        exact = (math.nan, math.nan)
        if posterior is not None and name in posterior.names:
            tails = (0.5 - 0.5 * _LEVEL, 0.5 + 0.5 * _LEVEL)
            low, high = np.asarray(posterior.quantile(name, np.array(tails)), dtype=float)
            exact = float(low), float(high)
        rows[name] = {
            "covariance_low": value - half,
            "covariance_high": value + half,
            "profile_low": profile.central95[0],
            "profile_high": profile.central95[1],
            "exact_low": exact[0],
            "exact_high": exact[1],
            "lower": profile.lower,
            "upper": profile.upper,
            "shape": profile.shape,
            "noise_dof": profile.dof,
        }
    return pd.DataFrame.from_dict(rows, orient="index")
