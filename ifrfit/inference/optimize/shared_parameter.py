"""One parameter shared by series that otherwise have their own: a decomposition over it, certified.

At a given value of the shared parameter (c, or kappa in the place of mu) every series is solved exactly on
its own, see `ifrfit.inference.optimize.decomposition`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.decomposition import Decomposition, PiecewiseMember
from ifrfit.inference.optimize.linear_families import LinearForm, kappa_form
from ifrfit.inference.optimize.optimum import Array, Optimum, thetas_of
from ifrfit.inference.optimize.parameter_group import (
    Constants,
    ParameterGroup,
    is_separable,
    kappa_range,
    restitution_optimum,
    without_normal_rows,
)
from ifrfit.inference.optimize.piecewise import NEAR


def solve_shared(
    problem: Problem,
    groups: Sequence[ParameterGroup],
    whole: ParameterGroup,
    near: Array | None = None,
    *,
    proven: bool = True,
    slack: float = 0.0,
) -> Optimum | None:
    """Optimum of series under one shared parameter; None if more than one ties them together.

    Parameters
    ----------
    problem : Problem
    groups : sequence of ParameterGroup
        One a series, without the priors of shared parameters.
    whole : ParameterGroup
        All rows, with all priors.
    near : ndarray, optional
        theta beside which alone the optimum is looked for, without a proof.
    proven : bool
        Whether a proof is needed.
    slack : float
        Gap that is small enough.
    """
    if not problem.closure.bilinear or any(group.rows.of_kind("curved").any() for group in groups):
        return None
    fixed = fix_restitution(groups, whole)
    if fixed is None:
        return None
    shared = [x.name for x in (whole.c, whole.mu) if not x.separate and x.fixed is None]
    if len(shared) != 1:
        return None
    groups, base = fixed
    linked = LinkedGroups.of(groups, shared[0], whole.mu.prior if shared[0] == "mu" else whole.c.prior)
    if linked is None:
        return None
    place = None if near is None else float(near[problem.parameters.positions[shared[0]][0]]) * linked.unit
    found = linked.decomposition.minimise(linked.seeds, place, proven=proven, slack=slack)
    least = found.minima[0][0]
    near_best = [(value + base, linked.constants(x)) for value, x in found.minima if value <= least + NEAR]
    thetas = thetas_of(problem, [constants for _, constants in near_best])
    minima = tuple((value, theta) for (value, _), theta in zip(near_best, thetas, strict=True))
    method = "all partitions of each series at each shared value"
    gap = found.gap if math.isfinite(found.gap) else None
    return Optimum(minima[0][1], least + base, gap, minima, method, is_local=near is not None)


def fix_restitution(
    groups: Sequence[ParameterGroup], whole: ParameterGroup
) -> tuple[list[ParameterGroup], float] | None:
    """Fix e_n where the user or the normal rows alone decide it; None where other rows have a say in it.

    Parameters
    ----------
    groups : sequence of ParameterGroup
        One a series; an e_n that is fixed there stays.
    whole : ParameterGroup
        All rows, with no constant fixed in some series alone.

    Returns
    -------
    groups : list of ParameterGroup
    objective : float
        What the normal rows and the prior of e_n have at its best value.
    """
    if whole.e_n.fixed is not None:
        return list(groups), 0.0
    if not is_separable(whole) or (whole.e_n.separate and not whole.mu.separate):
        return None
    if whole.e_n.separate:
        best = [restitution_optimum(group) for group in groups]
        objective = sum(value for _, value in best)
    else:
        best = [restitution_optimum(whole)] * len(groups)
        objective = best[0][1]
    fixed = [
        without_normal_rows(group, e_n if group.e_n.fixed is None else group.e_n.fixed)
        for group, (e_n, _) in zip(groups, best, strict=True)
    ]
    return fixed, objective


@dataclass(frozen=True)
class LinkedGroups:
    """Groups with fixed e_n that share c, or mu and so kappa.

    Attributes
    ----------
    forms : tuple of LinearForm
        Each group in its unknowns c and kappa.
    decomposition : Decomposition
        Each group along the shared unknown, the first of them with its prior, over the domain of it.
    unit : float
        The shared unknown over the shared parameter: 1 + e_n where kappa stands for mu.
    """

    forms: tuple[LinearForm, ...]
    decomposition: Decomposition
    unit: float

    @classmethod
    def of(
        cls, groups: Sequence[ParameterGroup], name: str, prior: tuple[float, float] | None
    ) -> LinkedGroups | None:
        """Link groups over one parameter; None for mu of series that differ in e_n.

        Parameters
        ----------
        groups : sequence of ParameterGroup
        name : str
            Of the parameter: mu, or else the closure's own.
        prior : (float, float) or None
            Its mean and standard deviation.
        """
        over_kappa = name == "mu"
        if over_kappa and len({group.e_n.fixed for group in groups}) > 1:
            return None
        unit = 1.0 + (groups[0].e_n.fixed or 0.0) if over_kappa else 1.0
        own = "mu" if over_kappa else "c"
        groups = [  # the prior counts once
            replace(group, **{own: replace(getattr(group, own), prior=None if number else prior)})
            for number, group in enumerate(groups)
        ]
        forms = tuple(kappa_form(group) for group in groups)
        members = tuple(
            PiecewiseMember(form.problem, int(over_kappa and group.c.fixed is None))
            for form, group in zip(forms, groups, strict=True)
        )
        low, high = kappa_range(groups) if over_kappa else (groups[0].c.lower, groups[0].c.upper)
        return cls(forms, Decomposition(members, low, high), unit)

    @property
    def seeds(self) -> list[float]:
        """What each group would choose for itself, at all its local minima."""
        return [float(t[m.unknown]) for m in self.decomposition.members for _, t in m.optimum.optima]

    def constants(self, x: float) -> list[Constants]:
        """Best (e_n, c, mu) of each group at a shared value."""
        return [
            form.to_constants(member.minimiser(x))
            for form, member in zip(self.forms, self.decomposition.members, strict=True)
        ]
