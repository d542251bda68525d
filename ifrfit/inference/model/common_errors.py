"""Errors that several rows have in common: what one standard error of each does to values and angles."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ifrfit.data.common_errors import loadings_of
from ifrfit.errors import UsageError
from ifrfit.inference.model.rows import Array, Index

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class CommonErrors:
    """What one standard error does to each row, for each of r independent errors that rows have in common.

    Attributes
    ----------
    value : ndarray, (n, r)
        In the unit of the value.
    gamma_deg : ndarray, (n, r)
        Degrees of the angle of incidence.
    numbers : tuple of int
        Of their columns.
    """

    value: Array
    gamma_deg: Array
    numbers: tuple[int, ...]

    @classmethod
    def of(cls, table: pd.DataFrame) -> CommonErrors | None:
        """Those of a table in the common schema; None where it has none."""
        value, gamma_deg, numbers = loadings_of(table)
        return cls(value, gamma_deg, numbers) if numbers else None

    def __len__(self) -> int:
        return int(self.value.shape[1])

    @property
    def turns_angles(self) -> bool:
        """Whether an angle of incidence is moved at all."""
        return bool(self.gamma_deg.any())

    def take(self, rows: Index) -> CommonErrors:
        """The same errors for some rows; one that moves none of them stays, and says nothing."""
        return replace(self, value=self.value[rows], gamma_deg=self.gamma_deg[rows])


@dataclass(frozen=True)
class CommonErrorFit:
    """Common errors at the optimum of least squares.

    Attributes
    ----------
    value : ndarray, (r,)
        In their standard deviations.
    loadings : ndarray, (n, r)
        B: by how much each measured value is off for one standard error, at the fitted constants.
    """

    value: Array
    loadings: Array

    @property
    def square(self) -> float:
        """Their sum of squares: what they add to chi2."""
        return float(self.value @ self.value)


def whitening(loadings: Array, sigma: Array) -> tuple[Array, Array]:
    """Directions P, (n, r), and sizes s, (r,), of loadings over sigma.

    The covariance of rows over their sigma is 1 + P s^2 P', its inverse root 1 - P (1 - 1/sqrt(1 + s^2)) P'.
    """
    if loadings.shape[1] == 0:
        return loadings, np.empty(0)
    left, size, _ = np.linalg.svd(loadings / sigma[:, None], full_matrices=False)
    return left, size


def refuse(what: str) -> UsageError:
    """The error where something knows independent rows only."""
    return UsageError(
        f"{what} knows independent errors only, and these rows have errors in common (columns common1 and so "
        "on): leave them out of account with --common-errors ignored."
    )
