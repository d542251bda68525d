"""The command that repeats a fit from the rows it used."""

from __future__ import annotations

import math
import shlex

from ifrfit.inference.result.fit_result import FitResult
from ifrfit.physics.closures import CLOSURES


def from_points(result: FitResult, file: str) -> str:
    """The command line that fits the rows of `file`, the points of a result, as they were fitted.

    Parameters
    ----------
    result : FitResult
    file : str
        Name of the table of its points.

    Returns
    -------
    str
        Empty where the result does not say what was asked of the constants.
    """
    if not result.asked or result.closure not in CLOSURES:
        return ""
    words = ["ifrfit", "fit", file, "--closure", result.closure, "--method", result.method]
    words += ["--noise", result.noise.policy]
    words += _exactness(result)
    if result.inertia_factor != 0.4:
        words += ["--inertia-factor", repr(result.inertia_factor)]
    low, high = CLOSURES[result.closure].domain(result.inertia_factor)
    default = {"e_n": (0.0, 1.0), "mu": (0.0, math.inf)} | {CLOSURES[result.closure].constant: (low, high)}
    for constant in result.asked:
        bounds = constant.lower, constant.upper
        if bounds != default[constant.name]:
            words += ["--bounds", f"{constant.name}={bounds[0]!r},{bounds[1]!r}"]
        if constant.fixed is not None:
            words += ["--fix", f"{constant.name}={constant.fixed!r}"]
        if constant.prior is not None:
            words += ["--prior", f"{constant.name}={constant.prior[0]!r},{constant.prior[1]!r}"]
        if constant.separate:
            words += ["--separate", constant.name]
    if result.seed:
        words += ["--seed", str(result.seed)]
    return shlex.join(words)


def _exactness(result: FitResult) -> list[str]:
    """The accuracy to ask for, where one or a time was asked for."""
    if result.effort is None or result.effort.reached is None:
        return []
    tolerance = result.effort.tolerance
    return ["--accuracy", repr(result.effort.reached if tolerance is None else tolerance)]
