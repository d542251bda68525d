"""The fit of one group as a row of the campaign's table: whatever happens there is a row, too."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any

from ifrfit.data import Observations, combine
from ifrfit.data.common_errors import loadings_of
from ifrfit.data.conventions import Conventions
from ifrfit.data.groups import Group, GroupedFiles
from ifrfit.data.readers import NothingMeasuredError, observe
from ifrfit.errors import DataError, IfrfitError
from ifrfit.inference.estimator import Estimator
from ifrfit.inference.fit import fit
from ifrfit.inference.options import Model, Noise
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.types import Estimate
from ifrfit.physics.effects.contact import SOLID
from ifrfit.report.provenance import kinds_of, provenance_words
from ifrfit.report.sentences import headline

Row = dict[str, Any]

FAILURE, FINDINGS, LOOK, PROVENANCE = "failure", "findings", "look", "provenance"
KAPPA = "kappa"
PARTS = ("sd", "lo68", "hi68", "lo95", "hi95", "status")


@dataclass(frozen=True)
class GroupQuestion:
    """What is asked of every group.

    Attributes
    ----------
    conventions : Conventions
        Of the columns, those passed over among them that only form groups.
    model : Model
    noise : Noise
    method : Estimator
    selection : mapping
        Keywords of `ifrfit.fit` that choose rows.
    seed : int
    facts : bool
        Whether slips, effects and lack of fit are looked for.
    """

    conventions: Conventions
    model: Model
    noise: Noise
    method: Estimator
    selection: Mapping[str, Any] = field(default_factory=dict)
    seed: int = 0
    facts: bool = True

    def observations(self, group: Group, files: GroupedFiles) -> Observations:
        """The rows of a group in the common schema.

        Raises
        ------
        DataError
            As `ifrfit.data.readers.observe`, where its files could not be read whole, and where rows have
            errors in common.
        """
        if group.trouble:
            raise DataError(group.trouble)
        inertia = self.model.inertia_factor
        found: list[Observations] = []
        nothing: NothingMeasuredError | None = None
        for table in group.tables:
            try:
                own = observe(table, files.conventions_of(table), SOLID if inertia is None else inertia)
            except NothingMeasuredError as error:
                nothing = error  # as empty cells are: they take nothing from the group's other files
            else:
                found.append(own)
        if nothing is not None and not found:
            raise nothing
        whole = combine(found)
        _, _, shared = loadings_of(whole.table)
        if shared and self.noise.counts_common_errors:
            raise DataError(
                f"Rows have errors in common (column common{shared[0]} and so on), which tie groups, and "
                "a campaign takes groups as independent. Fit the file as one with --separate, or leave these "
                "errors out of account with --common-errors ignored."
            )
        return whole


def fit_group(question: GroupQuestion, files: GroupedFiles, group: Group) -> Row:
    """The constants of a group and what is found of them; the reason where there are none.

    Returns
    -------
    dict
        ``files``, ``rows`` of the files, and ``failure``; where it is empty ``n``, ``n_sliding``,
        ``n_sticking``, provenance, each constant and kappa with sd, intervals and status, the correlations of
        the free constants, chi2, dof, p_value, whether the optimum is proven, and what calls for a look.
    """
    row: Row = {"files": ", ".join(group.files), "rows": group.rows, FAILURE: ""}
    try:
        found = fit(
            question.observations(group, files),
            question.model,
            noise=question.noise,
            method=question.method,
            seed=question.seed,
            **question.selection,
        )
        return row | _findings(found, facts=question.facts)
    except IfrfitError as error:
        return row | {FAILURE: error.in_shell}
    except Exception as error:  # noqa: BLE001 - a bug in one group must not take the others with it
        said = f"internal error, {type(error).__name__}: {error}. This is a bug; fit the group by itself."
        return row | {FAILURE: said}


def _findings(found: FitResult, *, facts: bool) -> Row:
    kinds = dict.fromkeys(kind for source in found.inputs for kind in kinds_of(found, source))
    row: Row = {
        "n": found.fit.n,
        "n_sliding": found.fit.n_sliding,
        "n_sticking": found.fit.n_sticking,
        PROVENANCE: provenance_words(tuple(kinds)),
    }
    estimates = found.flat_constants()
    kappa = found.derived.get(KAPPA)
    if isinstance(kappa, Estimate):
        estimates[KAPPA] = kappa
    for name, estimate in estimates.items():
        row |= zip(estimate_columns(name), estimate_cells(estimate), strict=True)
    row |= _correlations(found)
    row |= {name: _number(getattr(found.fit, name)) for name in ("chi2", "dof", "p_value")}
    if facts:
        row["proven"] = bool(found.facts["global_optimum"].ok)
        row["converged"] = bool(found.facts["converged"].ok)
        row[FINDINGS] = ", ".join(name for name, fact in found.facts.items() if not fact.ok)
        row[LOOK] = headline(found)
    return row


def _correlations(found: FitResult) -> Row:
    """Of each two free constants."""
    names, matrix = found.correlation.names, found.correlation.matrix
    pairs = combinations(range(len(names)), 2)
    return {correlation_column(names[i], names[j]): _number(float(matrix[i, j])) for i, j in pairs}


def correlation_column(one: str, other: str) -> str:
    """What the correlation of two constants is called in the table."""
    return "correlation_" + "_".join(sorted((one, other)))


def estimate_columns(name: str) -> tuple[str, ...]:
    """What the columns of a quantity are called: value, sd, ends of the intervals and status."""
    return (name, *(f"{name}_{part}" for part in PARTS))


def estimate_cells(estimate: Estimate) -> tuple[float | str | None, ...]:
    """What the table holds there."""
    numbers = (estimate.value, estimate.stderr, *estimate.interval68, *estimate.interval95)
    return (*map(_number, numbers), estimate.status)


def columns_of(rows: Iterable[Mapping[str, Any]]) -> list[str]:
    """The columns of the table, in the order in which rows first have them."""
    kinds = dict.fromkeys(map(tuple, rows))  # thousands of rows, of very few kinds
    return list(dict.fromkeys(name for kind in kinds for name in kind))


def constants_of(rows: Iterable[Mapping[str, Any]]) -> list[str]:
    """The constants, and kappa, that any row has."""
    return [name.removesuffix("_status") for name in columns_of(rows) if name.endswith("_status")]


def _number(x: float | None) -> float | None:
    """A number of the table; infinite ends stay, what is not defined is empty."""
    return None if x is None or math.isnan(x) else float(x)
