"""Which points of a figure are ringed: the rows that the fit calls outliers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.result.fit_result import FitResult

if TYPE_CHECKING:
    import pandas as pd


def is_outlier(result: FitResult, rows: pd.DataFrame) -> NDArray[np.bool_]:
    """Tell for each of some points whether it is an outlier, shape (n,).

    The rows that the fit names; they need not be the ones with the largest residuals, for an outlier drags
    the curve away from its neighbours. By the residuals where the fit does not judge them.
    """
    fact = result.facts.get("outliers")
    if fact is not None and "limit" in fact.figures:
        named = {str(name) for name in fact.figures.get("rows") or ()}
        places = rows[["source", "row", "observable"]].itertuples(index=False)
        return np.array([f"{p.source} line {p.row} ({p.observable})" in named for p in places], dtype=bool)
    return np.asarray(np.abs(rows["standardised"].to_numpy(dtype=float)) > outlier_limit(result))


def outlier_limit(result: FitResult) -> float:
    """Largest standardised residual that chance allows in any of the points: Bonferroni at 1 %."""
    from scipy.special import ndtri

    return float(-ndtri(0.005 / max(len(result.points), 1)))
