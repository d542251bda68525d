"""Named findings about a fit, each with its number and its rule."""

from __future__ import annotations

import math

from ifrfit.inference.diagnostics.thresholds import FACTS, PULL
from ifrfit.inference.model.error_model import ITERATED
from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.optimize.angle_offset import AngleOffset
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.result.types import Constants, Fact, by_entry
from ifrfit.text import plus_minus

_ROOM = 1e-3  # degrees to the end of its domain within which an offset lies on it


def noise_converged(found: LeastSquaresFit) -> Fact:
    """Whether the iteration over the noise of least squares came to rest."""
    if math.isinf(found.noise_dof):
        says = "least squares converged"
    else:
        says = f"the noise has {'' if found.converged else 'not '}settled"
    return Fact(found.converged, says, {"change": found.change}, FACTS["converged"])


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
