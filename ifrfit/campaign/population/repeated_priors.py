"""Knowledge of the user's that stands in every group's posterior, and that a population would count anew.

A population takes what each group says as its data alone. A prior that n groups share is one measurement, and
enters n times (its sd looks sqrt(n) smaller); it moves the other constants through their correlation, so that
it cannot be divided out of one of them. Bounds that cut what the data say do the same; wide ones do not.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from ifrfit.campaign.group_fit import FAILURE
from ifrfit.inference.model.parameters import PRIOR_MU, Parameter
from ifrfit.inference.options import Model, Noise
from ifrfit.text import joined

HALF_WIDTHS = 3.0  # of 68 %, from the middle, beyond which a bound cuts nothing that matters
# of the standard error of the median group: k of n groups, moved by one sd, move it by k/sqrt(n)
SHIFT = 0.25


def prior_reason(model: Model, noise: Noise, parameters: Sequence[Parameter]) -> str:
    """Why priors of the user leave no population; empty where there are none."""
    names = [each.name for each in parameters if each.prior is not None or each.name in model.prior]
    if names:
        given = [name for name in names if name in model.prior]
        options = [
            *(["--prior"] if given else []),
            *(["--prior-from"] if len(given) < len(names) else []),
        ]
        stand = (
            f"the prior of {names[0]} stands" if len(names) == 1 else f"the priors of {joined(names)} stand"
        )
        return (
            f"No population is pooled: {stand} in the posterior of every group, and would count once for "
            f"each. Leave {joined(options)} out for a population; --fix is no prior."
        )
    if noise.error_model.offset is not None:
        return (
            "No population is pooled: the prior of the angles' offset stands in the posterior of every "
            "group, and would count once for each. Leave --angle-offset out for a population."
        )
    return ""


def bounds_reason(rows: Sequence[Mapping[str, Any]], parameters: Sequence[Parameter]) -> str:
    """Why bounds of the user leave no population; empty where they cut nothing, or too few to move it.

    Parameters
    ----------
    rows : sequence of mapping
        Of the campaign's table, see `ifrfit.campaign.group_fit.fit_group`.
    parameters : sequence of Parameter
    """
    fitted = [row for row in rows if not row[FAILURE]]
    for each in parameters:
        cut = sum(_is_cut(row, each) for row in fitted)
        if cut > SHIFT * math.sqrt(len(fitted)):
            return (
                f"No population is pooled: the bounds of {each.name} cut what {cut} of {len(fitted)} groups "
                f"say, and would count once for each. Leave --bounds {each.name} out for a population, or "
                "widen them until they cut none."
            )
    return ""


def _is_cut(row: Mapping[str, Any], parameter: Parameter) -> bool:
    """Whether an end that the user set within the default domain is near what a group says."""
    name = parameter.name
    if parameter.passive is None or parameter.fixed is not None or row.get(f"{name}_lo68") is None:
        return False
    low, high = row[f"{name}_lo68"], row[f"{name}_hi68"]
    middle, near = 0.5 * (low + high), HALF_WIDTHS * 0.5 * (high - low)
    lower, upper = parameter.passive
    widest = upper if math.isfinite(upper) else max(PRIOR_MU, 2.0 * lower)
    return (parameter.lower > lower and middle - parameter.lower < near) or (
        parameter.upper < widest and parameter.upper - middle < near
    )
