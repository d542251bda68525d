"""For those who live in lmfit: our model as an lmfit.Model, our optimum as a MinimizerResult."""

from __future__ import annotations

import inspect
from typing import TYPE_CHECKING, Any

import numpy as np

from ifrfit.errors import UsageError
from ifrfit.physics.closures import get_closure
from ifrfit.physics.observables import OBSERVABLES
from ifrfit.physics.rebound import rebound

if TYPE_CHECKING:
    from ifrfit.inference.result.findings import Findings


def lmfit_model(observable: str, closure: str = "ifr", inertia_factor: float = 0.4) -> Any:
    """Make an ``lmfit.Model`` of one observable against the incidence angle.

    Parameters
    ----------
    observable : str
        Name in the common schema.
    closure : str
    inertia_factor : float

    Returns
    -------
    lmfit.Model
        Independent variables gamma (degrees), spin_x, spin_y (default 0); parameters are the constants of
        the closure with hints for the passive domain.

    Examples
    --------
    >>> import ifrfit
    >>> model = ifrfit.lmfit_model("beta")
    >>> model.param_names
    ['e_n', 'e_t', 'mu']
    >>> model.eval(gamma=20.0, e_n=0.9, e_t=-0.7, mu=0.15).round(3).item()
    0.7
    """
    import lmfit

    chosen, wanted = get_closure(closure), OBSERVABLES[observable]

    def model(gamma: Any, spin_x: Any = 0.0, spin_y: Any = 0.0, **constants: float) -> Any:
        state = rebound(
            gamma, spin_x, spin_y, closure=closure, inertia_factor=inertia_factor, degrees=True, **constants
        )
        return wanted.value(state, np.asarray(constants["mu"]))

    # lmfit reads the names of the parameters off the signature
    kind = inspect.Parameter.POSITIONAL_OR_KEYWORD
    inputs = [inspect.Parameter("gamma", kind)]
    inputs += [inspect.Parameter(name, kind, default=0.0) for name in ("spin_x", "spin_y")]
    inputs += [inspect.Parameter(name, kind, default=1.0) for name in chosen.constants]
    model.__signature__ = inspect.Signature(inputs)  # type: ignore[attr-defined]
    made = lmfit.Model(
        model, independent_vars=["gamma", "spin_x", "spin_y"], name=observable, spin_x=0.0, spin_y=0.0
    )
    made.set_param_hint("e_n", value=0.8, min=0.0, max=1.0)
    made.set_param_hint("mu", value=0.15, min=0.0)
    if chosen.constant:
        low, high = chosen.domain(inertia_factor)
        made.set_param_hint(chosen.constant, value=low + 0.1 * (high - low), min=low, max=high)
    return made


def constants_from(params: Any) -> dict[str, dict[str, Any]]:
    """Read fix and bounds out of ``lmfit.Parameters``.

    Raises
    ------
    UsageError
        For a parameter that is no constant, in an expression.
    """
    tie: dict[str, str] = {}
    fix: dict[str, float] = {}
    bounds: dict[str, tuple[float, float]] = {}
    for name, parameter in params.items():
        if parameter.expr:
            if any(other in parameter.expr for other in params if other != name):
                tie[name] = str(parameter.expr)
            else:
                fix[name] = float(parameter.value)
        elif not parameter.vary:
            fix[name] = float(parameter.value)
        elif np.isfinite(parameter.min) or np.isfinite(parameter.max):
            bounds[name] = (float(parameter.min), float(parameter.max))
    return {"fix": fix, "bounds": bounds, "tie": tie}


def minimizer_result(result: Findings) -> Any:
    """Polish the result's own optimum with lmfit and hand out lmfit's account of it.

    Only constants that the data determine vary; the others are held at the optimum.

    Raises
    ------
    UsageError
        For a result that was read from a file: it keeps no problem to evaluate.
    """
    import lmfit

    problem, optimum = result.problem, result.least_squares
    if problem is not None and problem.parameters.is_tied:
        raise UsageError("lmfit_result does not know constants that are tied.")
    if problem is None or optimum is None:
        raise UsageError(
            "lmfit_result needs the fit itself; a result read from a file holds only its findings."
        )
    sigma = result.points["sigma_used"].to_numpy(dtype=float)
    params = lmfit.Parameters()
    labels = [_label(name) for name in problem.parameters.names]
    theta = optimum.optimum.theta
    lower, upper = problem.parameters.bounds()
    determined = {
        name for name, each in result.flat_constants().items() if each.status in ("determined", "prior")
    }
    for label, name, value, low, high, free in zip(
        labels, problem.parameters.names, theta, lower, upper, problem.parameters.free, strict=True
    ):
        varies = bool(free) and name in determined
        params.add(
            label, value=value, vary=varies, min=low if varies else -np.inf, max=high if varies else np.inf
        )

    def residual(p: Any) -> Any:
        at = np.array([p[label].value for label in labels])
        data = problem.residual(at) / sigma
        return np.concatenate((data, problem.parameters.prior_residuals(at)))

    return lmfit.minimize(residual, params, method="least_squares", scale_covar=False, xtol=1e-14, ftol=1e-14)


def _label(name: str) -> str:
    return "".join(ch if ch.isalnum() or ch == "_" else "_" for ch in name).strip("_")
