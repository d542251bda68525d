"""Groups of which a population takes neither a value nor a limit: their own values may be why.

Groups that leave a constant open on both sides are not pooled. The others, taken for all, may be a truncated
sample, whose mean and sd are at most as far off as those of a normal law that is cut off at the quantiles of
the shares left out (Johnson, Kotz & Balakrishnan 1994, Continuous Univariate Distributions 1, section
13.10.1). Those that give a limit are in the population (`limits`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import special

from ifrfit.campaign.population.coordinate import Coordinate
from ifrfit.campaign.population.normal_hierarchy import NormalHierarchy
from ifrfit.campaign.population.repeated_priors import SHIFT

_LEAST = 1e-15  # share left out that moves nothing
_LOW, _HIGH = 1, 3  # places of the 68 % interval among the quantiles


@dataclass(frozen=True)
class GroupsLeftOut:
    """Groups left out of a population that may move it.

    Attributes
    ----------
    below, above, two_sided : int
        Groups that leave the constant open to this side alone, or to neither or each.
    shift : float
        By how much the median group may lie above what was found, in its standard errors; negative: below.
        As if values alone decided which groups are left out, and not, say, their angles; groups open to two
        sides count on the side that has more.
    """

    below: int
    above: int
    two_sided: int
    shift: float

    @property
    def groups(self) -> int:
        """All that leave it open."""
        return self.below + self.above + self.two_sided


def groups_left_out(
    name: str,
    by: Coordinate,
    left_out: Sequence[Mapping[str, Any]],
    pooled: NormalHierarchy,
) -> GroupsLeftOut | None:
    """Groups left out, where they may move the median group by more than a quarter of its standard error.

    Parameters
    ----------
    name : str
        The constant, or kappa.
    by : Coordinate
    left_out : sequence of mapping
        Rows of the campaign's table that have the constant, and give neither a value nor a limit.
    pooled : NormalHierarchy
        Of those that do, limits included.
    """
    if not left_out:
        return None
    ends = np.array([[row.get(f"{name}_{end}95") for end in ("lo", "hi")] for row in left_out], dtype=float)
    is_open = ~np.isfinite(by.to(ends))
    below, above = (int((is_open[:, side] & ~is_open[:, 1 - side]).sum()) for side in (0, 1))
    two_sided = len(left_out) - below - above
    counts = (below + two_sided, above) if below > above else (below, above + two_sided)
    total = len(left_out) + pooled.y.size + pooled.limits.groups
    mean, sd = _truncated(*(count / total for count in counts))
    centre = pooled.centre_quantiles()
    error = 0.5 * (centre[_HIGH] - centre[_LOW])
    shift = float(-mean / sd * pooled.tau_quantiles()[2] / error)
    return GroupsLeftOut(below, above, two_sided, shift) if abs(shift) > SHIFT else None


def _truncated(below: float, above: float) -> tuple[float, float]:
    """Mean and sd of the standard normal law without these shares at its ends."""
    low, high = special.ndtri(max(below, _LEAST)), -special.ndtri(max(above, _LEAST))
    of_low, of_high = (math.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi) for z in (low, high))
    mass = 1.0 - below - above
    mean = (of_low - of_high) / mass
    return mean, math.sqrt(1.0 + (low * of_low - high * of_high) / mass - mean**2)
