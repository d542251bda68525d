"""A slip of the hand that was tried on a table, and when its evidence suffices to name it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ifrfit.inference.diagnostics.thresholds import DECISIVE, REFUTED

LARGEST = 4.5  # prior standard deviations of a size


@dataclass(frozen=True)
class Slip:
    """A slip that was tried.

    Attributes
    ----------
    name : str
    drop : float
        Fall of -2 log likelihood without it, constants at their best.
    p : float
        Of a slip with a size the p value, corrected for their number; else the likelihood ratio that is left
        without the row that speaks most for it.
    size, sd : float
        Of a slip with a size; 0 else.
    usual : float
        Prior standard deviation of the size.
    likely : tuple of float
        Sizes that the prior is centred at.
    observable : str
        Whose values it is in; empty where it is in none.
    series : str
        The one series it is in; empty where it is in all.
    rows : tuple of int
        Single rows that it is in.
    is_least : bool
        Whether the size ended on the limit of what is searched.
    constant : str
        That changes in the course of the table; empty for another slip.
    middle : float
        Its mean.
    e_n : float
        Of the first series, with a slip that was fitted; nan else.
    """

    name: str
    drop: float
    p: float
    size: float = 0.0
    sd: float = 0.0
    usual: float = math.inf
    likely: tuple[float, ...] = (0.0,)
    observable: str = ""
    series: str = ""
    rows: tuple[int, ...] = ()
    is_least: bool = False
    constant: str = ""
    middle: float = 0.0
    e_n: float = math.nan

    @property
    def rank(self) -> float:
        """Fall of -2 log likelihood less what the prior of the size takes: by it causes compare."""
        return self.drop - self.unlikely**2 / (self.usual**2 + self.sd**2)

    @property
    def log_bayes_factor(self) -> float:
        """Of the law with a size of this prior over the law without, by Laplace's approximation."""
        return 0.5 * self.rank + math.log(self.sd / math.hypot(self.usual, self.sd))

    @property
    def unlikely(self) -> float:
        """Distance of the size from the nearest likely one."""
        return min(abs(self.size - each) for each in self.likely)


def is_decisive(slip: Slip) -> bool:
    """Whether the evidence suffices to name a slip, and its size is one that a slip has."""
    if slip.unlikely > LARGEST * math.hypot(slip.usual, slip.sd):
        return False
    # impacts would cross the wall or its normal, or the law is missed by so much that no angle mends it
    if slip.name == "angle-offset" and slip.is_least:
        return False
    return slip.p < (REFUTED if slip.sd or slip.rows else math.exp(-0.5 * DECISIVE))
