"""Groups of the plainest question, fitted together: columns of numbers, known noise, all constants free.

Their rows of the campaign's table are those of `group_fit`, to less than a thousandth of an uncertainty. A
group in which anything is out of the ordinary is left to it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from ifrfit.campaign.group_fit import (
    FAILURE,
    KAPPA,
    PROVENANCE,
    GroupQuestion,
    Row,
    correlation_column,
    estimate_columns,
    fit_group,
)
from ifrfit.campaign.many_groups.likelihoods import PlainLikelihoods
from ifrfit.campaign.many_groups.posteriors import GroupPosteriors, group_posteriors
from ifrfit.campaign.many_groups.transition_integral import alike_groups
from ifrfit.campaign.many_groups.values import Restitution, Tangential, padded
from ifrfit.data.cell_table import CellColumn, Cells
from ifrfit.data.column_layout import Layout
from ifrfit.data.column_roles import identify
from ifrfit.data.conventions import Conventions
from ifrfit.data.groups import Group, GroupedFiles
from ifrfit.data.stream.impact_stream import Batch, ImpactStream
from ifrfit.data.stream.tally import Tally
from ifrfit.data.validate import TINY_SHARE
from ifrfit.errors import DataError, IfrfitError
from ifrfit.inference.estimators import Exact
from ifrfit.inference.keywords import selection_of
from ifrfit.inference.model.parameters import Domain, ParameterSet
from ifrfit.inference.options import Model
from ifrfit.physics.closures import get_closure
from ifrfit.physics.effects.contact import SOLID
from ifrfit.physics.impulse_laws import Coefficients
from ifrfit.physics.observables import OBSERVABLES
from ifrfit.report.provenance import provenance_words

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_UNITS = ("deg", "1")  # in which a number means the same whatever stands beside it
_KEYS = ("gamma", "spin_x", "spin_y", "e_n")
_FREE = 3  # e_n, the closure constant, mu
_BY_THEMSELVES, _TOGETHER = 20, 250  # groups: some seconds, with facts
_FEW = 5  # tangential values below which nothing is ordinary


def fit_groups(question: GroupQuestion, files: GroupedFiles, groups: Sequence[Group]) -> list[Row]:
    """A row of each group, in their order: plain ones together, the others each by itself."""
    plain = plain_rows(question, files, groups)
    return [
        plain[place] if place in plain else fit_group(question, files, group)
        for place, group in enumerate(groups)
    ]


def groups_at_once(question: GroupQuestion) -> int:
    """How many groups are given to a process as one piece of work."""
    return _BY_THEMSELVES if _law(question) is None else _TOGETHER


def plain_rows(question: GroupQuestion, files: GroupedFiles, groups: Sequence[Group]) -> dict[int, Row]:
    """Rows of those groups that are plain, by their place among the groups."""
    law = _law(question)
    if law is None:
        return {}
    found: dict[int, Row] = {}
    pending = _of_one_file(groups)
    while pending:
        alike = pending.pop()
        try:
            found |= _rows(question, files, groups, alike, law)
        except IfrfitError:
            # a group that is refused says for itself what is wrong; whether it stands beside others matters
            # to none of them
            if len(alike) > 1:
                pending += [alike[: len(alike) // 2], alike[len(alike) // 2 :]]
    return found


def _law(question: GroupQuestion) -> Coefficients | None:
    """The law of the closure where the question is plain."""
    model, noise = question.model, question.noise
    closure = get_closure(model.closure)
    asked = replace(Model(model.closure), inertia_factor=model.inertia_factor)
    if (
        question.facts
        or question.method != Exact()
        or model != asked
        or not closure.bilinear
        or closure.constant is None
        or noise.policy not in (None, "known")
        or not noise.error_model.is_plain
        or noise.error_model.offset is not None
        or noise.sigma_velocity is not None
        or selection_of(question.selection).exclude
        or selection_of(question.selection).series
    ):
        return None
    law = closure.law(_inertia(model))
    return law if isinstance(law, Coefficients) and law.b1 == 0.0 and law.a1 != 0.0 else None


def _inertia(model: Model) -> float:
    return SOLID if model.inertia_factor is None else model.inertia_factor


def _of_one_file(groups: Sequence[Group]) -> list[list[int]]:
    """Places of groups that are rows of one file, file by file."""
    found: dict[tuple[str, ...], list[int]] = {}
    for place, group in enumerate(groups):
        if len(group.tables) == 1 and not group.trouble:
            table = group.tables[0]
            found.setdefault((table.file, *table.headers), []).append(place)
    return list(found.values())


def _rows(
    question: GroupQuestion,
    files: GroupedFiles,
    groups: Sequence[Group],
    alike: Sequence[int],
    law: Coefficients,
) -> dict[int, Row]:
    """Rows of those groups of one file that are resolved.

    Raises
    ------
    IfrfitError
        A cell of any group is not what it should be.
    """
    tables = [groups[place].tables[0] for place in alike]
    conventions = files.conventions_of(tables[0])
    layout = identify(_together(tables), conventions)
    model = question.model
    inertia = _inertia(model)
    stream = ImpactStream(files.files[0], (), conventions, selection_of(question.selection), inertia)
    stream = stream.choosing_by(layout)
    oblique = _oblique(layout, stream)
    if oblique is None:
        return {}
    tally = Tally(series=[""])  # groups of several series are none of these
    batch, usable = stream.impacts_of(layout, np.zeros(len(layout.cells), dtype=np.intp), tally)
    own = np.repeat(np.arange(len(alike)), [len(table) for table in tables])
    clean = np.bincount(own, ~usable, minlength=len(alike)) == 0
    domains = _domains(model, inertia)
    ends = domains["e_n"].lower, domains["e_n"].upper
    values = _Values.of(batch, own, len(alike), oblique, inertia, ends)
    every = PlainLikelihoods.of(values.tangential, values.e_n, law, tuple(domains.values()))
    certain = np.flatnonzero(clean & values.ordinary & (values.counts[:, 0] >= _FEW) & every.is_certain)
    likelihoods = every.of_groups(certain)
    left_open = likelihoods.left_open()
    found: dict[int, Row] = {}
    for some, is_open, nodes in alike_groups(likelihoods):
        few, left = likelihoods.of_groups(some), left_open.of_groups(some)
        posteriors = group_posteriors(few, left, is_open, nodes)
        places = certain[some]
        columns = _columns(tuple(domains), posteriors, values.counts[places], conventions)
        cells = zip(*columns.values(), strict=True)
        for place, is_resolved, said in zip(places.tolist(), posteriors.resolved, cells, strict=True):
            if is_resolved:
                group = groups[alike[place]]
                row: Row = {"files": ", ".join(group.files), "rows": group.rows, FAILURE: ""}
                found[alike[place]] = row | dict(zip(columns, said, strict=True))
    return found


def _domains(model: Model, inertia: float) -> dict[str, Domain]:
    """Of e_n, the closure constant, mu and kappa."""
    parameters = ParameterSet(tuple(model.parameters(inertia)), ("",))
    free = {each.name: each.domain for each in parameters}
    own = str(get_closure(model.closure).constant)
    return {"e_n": free["e_n"], own: free[own], "mu": free["mu"], KAPPA: parameters.kappas[0].domain}


def _together(tables: Sequence[Cells]) -> Cells:
    """The tables under one another."""
    columns: list[CellColumn | DataError] = []
    for parts in zip(*(table.columns for table in tables), strict=True):
        unreadable = [part for part in parts if isinstance(part, DataError)]
        if unreadable:
            columns.append(unreadable[0])
        elif isinstance(parts[0], np.ndarray):
            columns.append(np.concatenate(parts))
        else:
            columns.append([cell for part in parts for cell in part])
    lines = np.concatenate([table.lines for table in tables])
    return replace(tables[0], lines=lines, columns=columns, _points={})


def _oblique(layout: Layout, stream: ImpactStream) -> str | None:
    """The one tangential observable beside e_n, where there is nothing else and all units are plain."""
    tangential = [name for name in stream.observables if OBSERVABLES[name].linear is not None]
    if len(tangential) != 1 or set(stream.observables) != {tangential[0], "e_n"}:
        return None
    if not stream.has_sigma or stream.notes:
        return None
    known = {*_KEYS, tangential[0], "sigma:e_n", f"sigma:{tangential[0]}"}
    plain = all(
        key in known and (column.unit in _UNITS or (column.dimension == "number" and column.unit is None))
        for key, column in layout.columns.items()
    )
    return tangential[0] if plain and not layout.momentum and not layout.notes else None


@dataclass(frozen=True)
class _Values:
    """The measured values of each group, how many are tangential and how many there are, and what is odd.

    Attributes
    ----------
    tangential : Tangential
    e_n : Restitution
    counts : ndarray of int, (groups, 2)
        Of tangential values, and of all.
    ordinary : ndarray of bool, (groups,)
    """

    tangential: Tangential
    e_n: Restitution
    counts: Index
    ordinary: NDArray[np.bool_]

    @classmethod
    def of(
        cls, batch: Batch, own: Index, groups: int, name: str, inertia: float, domain: tuple[float, float]
    ) -> _Values:
        """Of the groups; `domain` of e_n."""
        linear = OBSERVABLES[name].linear
        assert linear is not None
        at, value, sigma = batch.values[name]
        incidence = batch.incidence.take(at)
        offset, slope = linear(incidence, inertia)
        odd = (incidence.slip <= 0.0) | (incidence.cosine <= 0.0) | (slope == 0.0)
        ordinary = np.bincount(own[at], odd, minlength=groups) == 0
        ordinary &= _alike(sigma, own[at], groups)
        with np.errstate(divide="ignore", invalid="ignore"):
            tau, factor = incidence.tau, (value - offset) / slope
        order = np.lexsort((tau, own[at]))
        columns = (tau, factor, (slope / sigma) ** 2.0)
        tangential = padded(own[at][order], groups, [column[order] for column in columns], (np.inf, 0.0, 0.0))
        at_e, e_n, sigma_e = batch.values["e_n"]
        ordinary &= _alike(sigma_e, own[at_e], groups)
        normal = padded(own[at_e], groups, [e_n, sigma_e**-2.0], (0.0, 0.0))
        oblique = np.bincount(own[at], minlength=groups)
        counts = np.stack((oblique, oblique + np.bincount(own[at_e], minlength=groups)), axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            measured = Restitution.of(normal[0], normal[1], domain)
        return cls(Tangential(*tangential), measured, counts, ordinary)


def _alike(sigma: Array, own: Index, groups: int) -> NDArray[np.bool_]:
    """Whether no uncertainty of a group can stand alone far below its others, as by a slip of the hand."""
    least, most = np.full(groups, np.inf), np.zeros(groups)
    np.minimum.at(least, own, sigma)
    np.maximum.at(most, own, sigma)
    return np.asarray(least >= TINY_SHARE * most)


def _columns(
    names: Sequence[str], posteriors: GroupPosteriors, counts: Index, conventions: Conventions
) -> dict[str, list[Any]]:
    """What is found of each group, column by column; counts (groups, 2) of tangential values, and of all."""
    likelihoods, (oblique, n) = posteriors.likelihoods, counts.T
    sliding = likelihoods.optima.sliding
    columns: dict[str, list[Any]] = {
        "n": n.tolist(),
        "n_sliding": sliding.tolist(),
        "n_sticking": (oblique - sliding).tolist(),
        PROVENANCE: [provenance_words((conventions.provenance,))] * n.size,
    }
    for quantity, name in enumerate(names):
        parts = zip(*posteriors.cells(quantity), strict=True)
        columns |= {column: list(part) for column, part in zip(estimate_columns(name), parts, strict=True)}
    for i, j in combinations(range(_FREE), 2):
        columns[correlation_column(names[i], names[j])] = posteriors.correlation[:, i, j].tolist()
    # where every impact sticks kappa takes no degree of freedom
    dof = n - likelihoods.curvature.is_finite[:, :_FREE].sum(axis=1)
    fit = {"chi2": likelihoods.chi2, "dof": dof.astype(float), "p_value": chdtrc(dof, likelihoods.chi2)}
    return columns | {name: of.tolist() for name, of in fit.items()}
