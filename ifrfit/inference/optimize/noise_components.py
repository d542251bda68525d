"""Unknown noises that share no constant: parts of a problem whose likelihood is the product of theirs.

What measures e_n and nothing else, and the rows of series that share nothing, are components of their own.
Each is a piecewise problem, but for e_n with one noise: there the minimum is a mean.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.branch_and_bound import minimise
from ifrfit.inference.optimize.concentrated_likelihood import ConcentratedLikelihood, Minimum
from ifrfit.inference.optimize.linear_families import LinearForm, linear_form
from ifrfit.inference.optimize.parameter_group import (
    Array,
    ParameterGroup,
    is_separable,
    restitution_optimum,
    without_normal_rows,
)
from ifrfit.inference.optimize.solve import independent_groups, whole_group

Index = NDArray[np.intp]


@dataclass(frozen=True)
class NoiseComponent:
    """Rows in one linear form, and the noises that are theirs alone.

    Attributes
    ----------
    form : LinearForm
        Of rows in units of their base.
    groups : ndarray of int
        The problem's groups of noise.
    of_row : ndarray of int
        Place in `groups` of each of its rows; -1 where sigma is known.
    sizes, scatter : ndarray
        Rows of each group, and the variance of their values.
    least : float
        S_g/n_g below which there is nothing but rounding.
    """

    form: LinearForm
    groups: Index
    of_row: Index
    sizes: Array
    scatter: Array
    least: float

    @property
    def is_monotone(self) -> bool:
        """Whether its likelihood falls with its sum of squares: no noise, or one for all and no priors."""
        of_all = bool((self.form.always >= 0).all() and (self.of_row >= 0).all())
        return self.groups.size == 0 or (self.groups.size == 1 and of_all)

    def solve(self, gap: float) -> tuple[list[Minimum], float]:
        """Its minima of Phi, best first, and a lower bound, within `gap` of the best if that can be."""
        if self.is_monotone:
            return self._least_squares()
        # what is negative is a prior, of no row
        always = np.where(self.form.always >= 0, self.of_row[np.maximum(self.form.always, 0)], -1)
        likelihood = ConcentratedLikelihood.of(
            self.form.problem,
            self.of_row[self.form.switching],
            always,
            self.sizes,
            self.least,
            self.scatter,
        )
        return likelihood.prove(likelihood.minima(), gap)

    def _least_squares(self) -> tuple[list[Minimum], float]:
        found = minimise(self.form.problem)
        if not self.groups.size:
            return [Minimum(found.chi2, np.empty(0))], found.chi2 - found.gap
        n = float(self.sizes[0])
        best, low = (max(x / n, self.least) for x in (found.chi2, found.chi2 - found.gap))
        return [Minimum(n * float(np.log(best)), np.array([best]))], n * float(np.log(low))


@dataclass(frozen=True)
class SolvedComponent:
    """A component whose minima and bound are known."""

    groups: Index
    minima: list[Minimum]
    bound: float
    is_monotone: bool = True

    def solve(self, gap: float) -> tuple[list[Minimum], float]:
        """What is known."""
        return self.minima, self.bound


Component = NoiseComponent | SolvedComponent


@dataclass(frozen=True)
class SplitProblem:
    """What measures e_n alone, and the rest with e_n fixed: it knows kappa only."""

    restitution: list[Component]
    rest: Problem


def without_restitution(problem: Problem) -> SplitProblem | None:
    """Split off the rows that measure e_n alone, where series share some constants; None where it is tied.

    Parameters
    ----------
    problem : Problem
    """
    whole = whole_group(problem, problem.noise.base)
    normal = problem.rows.of_kind("normal")
    rest = np.flatnonzero(~normal)
    if (
        not (problem.noise.has_unknown and problem.closure.bilinear and normal.any() and rest.size)
        or whole.e_n.fixed is not None
        or problem.rows.has_kind("curved")
        or not is_separable(whole)
        or (whole.e_n.separate and not whole.mu.separate)
        or np.unique(problem.rows.series[rest]).size < len(problem.series)
    ):
        return None
    at = np.flatnonzero(normal)
    places = [at]
    if whole.e_n.separate:
        places = [at[problem.rows.series[at] == i] for i in range(len(problem.series))]
    components = _components(problem, [_restitution(whole, own) for own in places if own.size])
    if components is None:
        return None
    e_n = replace(problem.parameters["e_n"], fixed=whole.e_n.lower, prior=None)
    return SplitProblem(components, problem.with_rows(rest).with_parameters([e_n]))


def noise_components(problem: Problem) -> list[Component] | None:
    """Split a problem with unknown noises; None where it is not made of piecewise problems.

    Parameters
    ----------
    problem : Problem
    """
    parts = _parts(problem)
    return None if parts is None else _components(problem, parts)


def _components(problem: Problem, parts: Sequence[tuple[ParameterGroup, Index]]) -> list[Component] | None:
    """The parts in linear form, or solved; None where one has no such form, or two share a noise."""
    names = list(problem.noise_groups().values())
    label = problem.noise_numbers
    scaled = problem.rows.value / problem.noise.base
    least = least_variance(problem)
    made: list[Component] = []
    for part, at in parts:
        groups = np.unique(label[at])
        if (
            groups.size == 1
            and groups[0] >= 0
            and part.e_n.prior is None
            and part.rows.of_kind("normal").all()
        ):
            made.append(_mean_of(part, groups, least))
            continue
        form = linear_form(part)
        if form is None:
            return None
        groups = groups[groups >= 0]
        of_row = np.where(label[at] >= 0, np.searchsorted(groups, label[at]), -1)
        sizes = np.array([float(names[g].size) for g in groups])
        scatter = np.array([max(float(np.var(scaled[names[g]])), 1e-12) for g in groups])
        made.append(NoiseComponent(form, groups, of_row, sizes, scatter, least))
    every = np.concatenate([each.groups for each in made])
    return made if np.unique(every).size == every.size else None


def least_variance(problem: Problem) -> float:
    """S_g/n_g, of any group of a problem with unknown noises, below which there is nothing but rounding."""
    return max(problem.rounding_variance(rows) for rows in problem.noise_groups().values())


def _mean_of(part: ParameterGroup, groups: Index, least: float) -> SolvedComponent:
    """Rows of one noise that measure e_n alone: the weighted mean is their only minimum."""
    n = float(len(part.rows))
    variance = max(restitution_optimum(part)[1] / n, least)
    value = n * math.log(variance)
    return SolvedComponent(groups, [Minimum(value, np.array([variance]))], value)


def _parts(problem: Problem) -> list[tuple[ParameterGroup, Index]] | None:
    """Rows that share constants, each with their places; None where series share only some of them."""
    if not problem.closure.bilinear and problem.has_oblique:
        return None
    groups = independent_groups(problem, problem.noise.base)
    if groups is None:
        return None
    by_scale = problem.noise.is_scaled  # one factor for all rows: nothing can be split
    return groups if by_scale else [part for group, at in groups for part in _split(group, at)]


def _split(group: ParameterGroup, at: Index) -> Sequence[tuple[ParameterGroup, Index]]:
    """What measures e_n alone, and the rest, where they share no constant."""
    normal = group.rows.of_kind("normal")
    oblique = bool(group.rows.is_oblique.any())
    if group.e_n.fixed is not None or (oblique and not is_separable(group)):
        return [(group, at)]
    alone, own = _restitution(group, np.flatnonzero(normal))
    return [(alone, at[own]), (without_normal_rows(group, 0.0), at[~normal])]


def _restitution(group: ParameterGroup, own: Index) -> tuple[ParameterGroup, Index]:
    """The rows that measure e_n alone."""
    alone = replace(
        group,
        rows=group.rows.take(own),
        sigma=group.sigma[own],
        c=replace(group.c, fixed=group.c.lower, prior=None),
        mu=replace(group.mu, fixed=group.mu.lower, prior=None),
    )
    return alone, own
