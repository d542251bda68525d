"""The groups of a campaign as members of one population: partial pooling of each constant.

Each group's constant, in a coordinate without ends, is drawn from a normal distribution over groups. What its
data say is a normal likelihood, its posterior without the prior (`group_likelihood`, `normal_hierarchy`). A
group is shrunk towards the mean by what its own data leave open.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.campaign.group_fit import FAILURE, KAPPA, constants_of
from ifrfit.campaign.population.coordinate import Coordinate
from ifrfit.campaign.population.domain_ends import CutByEnd, cuts_of, cuts_of_limits, moved_by_ends
from ifrfit.campaign.population.group_likelihood import joint_likelihoods
from ifrfit.campaign.population.groups_left_out import GroupsLeftOut, groups_left_out
from ifrfit.campaign.population.leave_one_out import (
    FEWEST_OF_SEVERAL,
    below_threshold,
    limit_p_values,
    membership_p_values,
)
from ifrfit.campaign.population.limits import Limits, MostlyOpen
from ifrfit.campaign.population.normal_hierarchy import FEWEST, NormalHierarchy
from ifrfit.campaign.population.two_populations import TwoPopulations, two_populations
from ifrfit.inference.diagnostics.thresholds import REFUTED
from ifrfit.inference.model.parameters import Parameter

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Quantiles:
    """Median and central 68 and 95 % intervals, (n,) each."""

    lo95: Array
    lo68: Array
    median: Array
    hi68: Array
    hi95: Array

    @classmethod
    def of(cls, five: Array) -> Quantiles:
        """From an array (5, n)."""
        return cls(*five)


@dataclass(frozen=True)
class Population:
    """What the groups have in common in one constant.

    Attributes
    ----------
    name : str
        The constant.
    by : Coordinate
        In which it is normal over groups.
    groups : ndarray of int, (n,)
        Which rows of the table were pooled: those that determine the constant.
    limits : int
        Further groups, which leave it open on one side and count as limits.
    left_out : int
        Groups with a fit that say nothing of it.
    centre, new, tau : Quantiles
        One number each: of the median group, of a group that is not among these, and of the standard
        deviation over groups in the coordinate.
    members : Quantiles
        Of each group, shrunk, (n,).
    shrinkage : ndarray, (n,)
        Share of the way to the population's mean, 0 to 1.
    membership_p : ndarray, (n,), or None
        Of each group to lie so far from the others, times the number of groups; None where there are too few
        groups to look, see `ifrfit.campaign.population.leave_one_out`.
    limit_p : mapping of int to float
        The same of the groups that count as limits, by row.
    two : TwoPopulations or None
        What describes the groups better than one population.
    cut : tuple of CutByEnd
        Ends of domains that may have moved it.
    missed : GroupsLeftOut or None
        Groups left out that may have moved it.
    """

    name: str
    by: Coordinate
    groups: NDArray[np.intp]
    limits: int
    left_out: int
    centre: Quantiles
    new: Quantiles
    tau: Quantiles
    members: Quantiles = field(repr=False)
    shrinkage: Array = field(repr=False)
    membership_p: Array | None = field(default=None, repr=False)
    limit_p: Mapping[int, float] = field(default_factory=dict, repr=False)
    two: TwoPopulations | None = None
    cut: tuple[CutByEnd, ...] = ()
    missed: GroupsLeftOut | None = None

    @property
    def outlying(self) -> dict[int, float] | None:
        """Rows that are not of the population of the others, by their p-values; None: not looked."""
        if self.membership_p is None:
            return None
        members = {int(self.groups[at]): p for at, p in below_threshold(self.membership_p).items()}
        return members | {row: p for row, p in self.limit_p.items() if p < REFUTED}

    @property
    def medians_of_two(self) -> tuple[float, float]:
        """The constant of the median group of each of the two populations."""
        assert self.two is not None
        low, high = self.by.back(np.array([self.two.lower, self.two.upper])).tolist()
        return low, high


def populations(
    rows: Sequence[Mapping[str, Any]], parameters: Sequence[Parameter]
) -> tuple[list[Population], list[MostlyOpen]]:
    """The population of each constant that enough groups determine, and of kappa.

    What a group says is its likelihood in the coordinate, see `group_likelihood`; of one that leaves the
    constant open on one side, see `limits`. Where these are more than those that determine it, what is said
    of the median would rest on the shape of the population alone: there is none.

    Parameters
    ----------
    rows : sequence of mapping
        Of the campaign's table, see `ifrfit.campaign.group_fit.fit_group`.
    parameters : sequence of Parameter
        Of the model, whose domains make the coordinates.
    """
    domains = {p.name: Coordinate(p.lower, p.upper) for p in parameters} | {KAPPA: Coordinate(0.0, math.inf)}
    names = constants_of(rows)
    said = joint_likelihoods(rows, {name: domains[name.partition("[")[0]] for name in names})
    ends = moved_by_ends(rows, parameters)
    found: list[Population] = []
    mostly_open: list[MostlyOpen] = []
    for name in names:
        by = domains[name.partition("[")[0]]
        limits = Limits.of(name, rows, by)
        determined = int(np.isfinite(said[name][0]).sum())
        if limits.groups > determined:
            mostly_open.append(MostlyOpen(name, determined, limits.groups))
            continue
        one = _population(name, rows, by, *said[name], limits)
        if one is not None:
            of_limits = cuts_of_limits(name, by, limits, one.groups.size, float(np.median(one.shrinkage)))
            found.append(replace(one, cut=(*cuts_of(name, one.groups, rows, ends), *of_limits)))
    return found, mostly_open


def _population(
    name: str, rows: Sequence[Mapping[str, Any]], by: Coordinate, mean: Array, sd: Array, limits: Limits
) -> Population | None:
    fitted = [number for number, row in enumerate(rows) if not row[FAILURE] and f"{name}_status" in row]
    groups = np.flatnonzero(np.isfinite(mean) & np.isfinite(sd) & (sd > 0.0))
    if groups.size < FEWEST:
        return None
    hierarchy = NormalHierarchy.of(mean[groups], sd[groups], limits)
    known = {*groups.tolist(), *(number for each in limits.rows for number in each)}
    left_out = [rows[number] for number in fitted if number not in known]

    def values(five: Array, to: Callable[[Array], Array] = by.back) -> Quantiles:
        return Quantiles.of(to(five))

    return Population(
        name,
        by,
        groups,
        limits.groups,
        len(left_out),
        values(hierarchy.centre_quantiles()),
        values(hierarchy.new_quantiles()),
        values(hierarchy.tau_quantiles(), np.asarray),
        values(hierarchy.member_quantiles()),
        hierarchy.shrinkage(),
        membership_p_values(hierarchy),
        limit_p_values(hierarchy),
        two_populations(hierarchy.y, hierarchy.s) if groups.size >= FEWEST_OF_SEVERAL else None,
        missed=groups_left_out(name, by, left_out, hierarchy),
    )
