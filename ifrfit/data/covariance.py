"""A covariance matrix of values, as independent errors and errors that rows have in common.

A symmetric, positive definite C is D + L L' with a diagonal D: with the least eigenvalue of C in all of D, or
with that of the correlation matrix times the variances, whichever leaves fewer columns of L. It is the same C
to rounding in either case; nothing is left out.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.common_errors import common_columns_in, of_value
from ifrfit.data.observations import Observations
from ifrfit.errors import UsageError

Array = NDArray[np.float64]

MOST_ROWS = 1000  # every column of L stands in the table of points
_SYMMETRIC = 1e-9  # relative difference of two elements that are to be the same
_SAME = 1e-6  # relative difference of a variance and a sigma squared that are to be the same
_DEFINITE = 1e-10  # least eigenvalue over the largest one
_NOTHING = 1e-12  # eigenvalue over the largest one that is rounding


def with_covariance(observations: Observations, covariance: Any) -> Observations:
    """Observations whose values have a covariance matrix.

    Parameters
    ----------
    observations : Observations
    covariance : array_like, (n, n)
        Of the values of `observations.table`, row by row, in their units.

    Raises
    ------
    UsageError
        For what is no covariance matrix of these values, and where the table says something else.
    """
    import pandas as pd

    table = observations.table
    matrix = _checked(covariance, len(table))
    _refuse_other_sigma(matrix, table["sigma"].to_numpy(dtype=float))
    shared = common_columns_in(table.columns)
    if shared:
        raise UsageError(
            f"covariance: the table has errors in common of its own ({shared[0]} and so on). Give the whole "
            "covariance without these columns, or leave covariance out."
        )
    variance, loadings = split(matrix)
    columns = {of_value(number): column for number, column in enumerate(loadings.T, start=1)}
    table = pd.concat([table.assign(sigma=np.sqrt(variance)), pd.DataFrame(columns, table.index)], axis=1)
    count = loadings.shape[1]
    note = (
        f"covariance of {len(table)} values: their sigma is its independent part, the rest "
        f"{count} error{'' if count == 1 else 's'} in common"
    )
    return replace(observations, table=table).with_note(note) if count else replace(observations, table=table)


def split(matrix: Array) -> tuple[Array, Array]:
    """The variances D, (n,), and loadings L, (n, r), of a covariance matrix D + L L'."""
    sd = np.sqrt(np.diag(matrix))
    parts = [_with_equal_part(matrix, np.ones(len(sd))), _with_equal_part(matrix / np.outer(sd, sd), sd)]
    return min(parts, key=lambda part: part[1].shape[1])


def _with_equal_part(matrix: Array, scale: Array) -> tuple[Array, Array]:
    """With the least eigenvalue as the independent part of every row, times the square of a scale, (n,)."""
    values, vectors = np.linalg.eigh(matrix)
    least = float(values[0])
    rest = values - least
    kept = np.flatnonzero(rest > _NOTHING * len(values) * values[-1])[::-1]
    loadings = vectors[:, kept] * np.sqrt(rest[kept]) * scale[:, None]
    # which sign an eigenvector has is arbitrary
    largest = loadings[np.abs(loadings).argmax(axis=0), np.arange(kept.size)]
    return least * scale**2, loadings * np.sign(largest)


def _checked(covariance: Any, n: int) -> Array:
    """The matrix, if it is a covariance of n values."""
    try:
        if np.iscomplexobj(covariance):  # a cast would drop what is imaginary
            raise TypeError
        matrix = np.asarray(covariance, dtype=float)
    except (TypeError, ValueError):
        raise UsageError("covariance: is no matrix of numbers. Give an array, n by n.") from None
    if matrix.shape != (n, n):
        shape = " by ".join(map(str, matrix.shape)) or "a single number"
        remedy = "Give n by n, in the order of ifrfit.read(data).table."
        if matrix.ndim == 1 and matrix.size == n:
            remedy = "Independent errors are a column sigma of the table."
        raise UsageError(f"covariance: is {shape}, and the table has n = {n} values. {remedy}")
    if n > MOST_ROWS:
        raise UsageError(
            f"covariance: of {n} values, and at most {MOST_ROWS} are taken. Give what they have in common as "
            "columns common1, common2, ... of the table, and the rest as sigma."
        )
    if not np.isfinite(matrix).all():
        i, j = np.argwhere(~np.isfinite(matrix))[0]
        raise UsageError(f"covariance: element ({i}, {j}) is {matrix[i, j]}. Give a finite number.")
    if not (np.diag(matrix) > 0.0).all():
        i = int(np.argmin(np.diag(matrix)))
        raise UsageError(f"covariance: the variance of row {i} is {matrix[i, i]:g}. Give a positive one.")
    sd = np.sqrt(np.diag(matrix))
    correlation = matrix / np.outer(sd, sd)
    differs = np.abs(correlation - correlation.T)
    if differs.max() > _SYMMETRIC:
        i, j = np.unravel_index(int(differs.argmax()), differs.shape)
        raise UsageError(
            f"covariance: is not symmetric, ({i}, {j}) is {matrix[i, j]:g}, ({j}, {i}) is {matrix[j, i]:g}. "
            "Give C, not a factor of it."
        )
    values = np.linalg.eigvalsh(0.5 * (correlation + correlation.T))
    if values[0] < _DEFINITE * values[-1]:
        raise UsageError(
            f"covariance: is not positive definite (least eigenvalue of its correlations {values[0]:.2g}). "
            "Add the variance of what each value errs by alone to the diagonal."
        )
    return np.asarray(0.5 * (matrix + matrix.T))


def _refuse_other_sigma(matrix: Array, sigma: Array) -> None:
    """Refuse a table whose sigma says something else than the diagonal."""
    given = np.isfinite(sigma)
    if not given.any():
        return
    diagonal = np.diag(matrix)
    if (np.abs(diagonal[given] / sigma[given] ** 2 - 1.0) <= _SAME).all():
        return
    i = int(np.flatnonzero(given)[np.argmax(np.abs(np.log(diagonal[given] / sigma[given] ** 2)))])
    if (np.abs(diagonal[given] / sigma[given] - 1.0) <= _SAME).all():
        raise UsageError(
            f"covariance: its diagonal is the column sigma, not its square (row {i}: {diagonal[i]:g}). "
            "Did you mean sigma**2 on its diagonal?"
        )
    raise UsageError(
        f"covariance: the variance of row {i} is {diagonal[i]:g}, and the table states sigma = {sigma[i]:g}. "
        "Leave the column out, or give sigma**2 on the diagonal."
    )
