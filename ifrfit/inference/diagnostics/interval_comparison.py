"""Covariance, profile and exact intervals side by side, and what to believe where they disagree."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from ifrfit.inference.distributions.truncated_normal import half_width
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquares
from ifrfit.inference.profile.profile_all import profile_all
from ifrfit.inference.profile.types import Profile

if TYPE_CHECKING:
    import pandas as pd

FACTOR = 1.25  # between widths, from which on two methods disagree
SHARE = 0.25  # of the exact width, by which an end may be off
_LEVEL = 0.95
_FEW = 30.0  # degrees of freedom of the noise under which points are few
_METHODS = ("covariance", "profile")


class Marginals(Protocol):
    """What a posterior must give to be compared."""

    @property
    def names(self) -> tuple[str, ...]:
        """Quantities that have a marginal."""

    def quantile(self, name: str, p: ArrayLike) -> Any:
        """Where the posterior probability below is p."""


def intervals(
    problem: Problem,
    fit: LeastSquares,
    posterior: Marginals | None,
    profiles: Mapping[str, Profile] | None = None,
) -> pd.DataFrame:
    """Central 95 % intervals of every free constant and of kappa, by three methods.

    Parameters
    ----------
    problem : Problem
    fit : LeastSquares
    posterior : Posterior or None
        Its columns are nan without one, or where it has no such marginal.
    profiles : mapping, optional
        What `profile_all` returned, if it has been called before.

    Returns
    -------
    DataFrame
        One row a constant or kappa (index: name), with columns

        - covariance_low, covariance_high: value -+ z sd (Student's t where the noise comes from the misfit),
          symmetric and not cut at the bounds of the domain; infinite where the data do not see the constant;
        - profile_low, profile_high: all values that `Profile.central95` spans;
        - exact_low, exact_high: the 2.5 and 97.5 % quantiles of the posterior;
        - lower, upper: the domain; shape: of the profile; noise_dof: degrees of freedom of the noise
          behind the quantity (`Profile.dof`).
    """
    import pandas as pd

    found = profile_all(problem, fit, curves=False) if profiles is None else profiles
    rows: dict[str, dict[str, Any]] = {}
    for name, value, functional in _quantities(problem, fit):
        if name not in found:
            continue
        profile = found[name]
        sd = math.sqrt(fit.gaussian.variance(functional, 1.0))
        half = half_width(_LEVEL, fit.noise_dof) * sd
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


def _quantities(problem: Problem, fit: LeastSquares) -> list[tuple[str, float, Any]]:
    """Name, value and derivative by the local coordinates of each free constant and of kappa."""
    theta, to_theta = fit.optimum.theta, fit.gaussian.to_theta
    found = [
        (problem.parameters.names[i], float(theta[i]), to_theta[i])
        for i in np.flatnonzero(problem.parameters.free).tolist()
    ]
    places = problem.parameters.positions
    for series, i_e, i_mu in zip(problem.series, places["e_n"], places["mu"], strict=True):
        factor, mu = 1.0 + float(theta[i_e]), float(theta[i_mu])
        functional = factor * to_theta[i_mu] + mu * to_theta[i_e]
        separate = any(c.separate for c in problem.parameters if c.name in ("e_n", "mu"))
        name = f"kappa[{series}]" if separate else "kappa"
        if separate or series == problem.series[0]:
            found.append((name, mu * factor, functional))
    return found


def disagreements(table: pd.DataFrame, factor: float = FACTOR) -> tuple[str, ...]:
    """Sentences on intervals that differ from the exact ones, which to believe, and why.

    Parameters
    ----------
    table : DataFrame
        What `intervals` returned.
    factor : float
        Widths disagree beyond it; ends do where one is off by more than a quarter (`SHARE`) of the width of
        the exact interval.

    Returns
    -------
    tuple of str
        One sentence a quantity and at most; none where all agree, or without exact intervals.
    """
    said = []
    for name in table.index:
        row: dict[str, Any] = {str(column): table.at[name, column] for column in table.columns}
        exact = float(row["exact_low"]), float(row["exact_high"])
        if not exact[1] > exact[0]:
            continue
        differing = {}
        for method in _METHODS:
            interval = float(row[f"{method}_low"]), float(row[f"{method}_high"])
            how = _difference(interval, exact, factor)
            if how:
                differing[method] = f"the {method} interval {_text(interval)} {how}"
        if differing:
            said.append(
                f"{name}: {' and '.join(differing.values())}; believe the exact one, {_text(exact)}: "
                f"{_why(row, differing)}."
            )
    return tuple(said)


def _difference(interval: tuple[float, float], exact: tuple[float, float], factor: float) -> str:
    """How an interval differs from the exact one, or nothing."""
    width, right = interval[1] - interval[0], exact[1] - exact[0]
    if math.isinf(width):
        return "is open"
    if width > factor * right:
        return f"is {width / right:.2g} times as wide as the exact one"
    if width * factor < right:
        return f"has {100.0 * width / right:.0f} % of the width of the exact one"
    off = max(abs(a - b) for a, b in zip(interval, exact, strict=True)) / right
    if off > SHARE:
        return f"has an end off by {100.0 * off:.0f} % of the width"
    return ""


def _why(row: Mapping[str, Any], differing: Mapping[str, str]) -> str:
    """What the other methods do not know."""
    low, high = float(row["covariance_low"]), float(row["covariance_high"])
    reasons = []
    if row["shape"] == "flat" or math.isinf(high - low):
        return "the data alone leave it open, so its ends come from the domain and the prior"
    if row["shape"] == "multimodal":
        reasons.append("several optima describe the data, and it weighs them")
    bounds = [
        b for b, out in ((row["lower"], low < row["lower"]), (row["upper"], high > row["upper"])) if out
    ]
    near = row["profile_low"] <= row["lower"] or row["profile_high"] >= row["upper"]
    if "covariance" in differing and bounds:
        reasons.append(f"the covariance goes on beyond the bound {bounds[0]:g}")
    elif near and row["shape"] == "one_sided":
        reasons.append("the data do not tell it from the bound of its domain")
    if float(row["noise_dof"]) < _FEW:
        reasons.append(f"the noise rests on few points ({float(row['noise_dof']):.0f} degrees of freedom)")
    if not reasons:
        reasons.append("the misfit is no parabola: it bends where impacts begin to slide")
    return ", and ".join(reasons)


def _text(interval: tuple[float, float]) -> str:
    """An interval to as many digits as its width gives sense to."""
    width = interval[1] - interval[0]
    digits = max(0, 2 - math.floor(math.log10(width))) if 0.0 < width < math.inf else 3
    return f"[{interval[0]:.{digits}f}, {interval[1]:.{digits}f}]"
