"""What was asked of accuracy and time, and what came of it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Effort:
    """What a fit with --accuracy or --budget asked, picked and reached.

    Attributes
    ----------
    accuracy : float or None
        Asked: largest error of a mean, an sd or an end of an interval, in posterior standard deviations.
    budget : float or None
        Asked: seconds from the call of `fit`, reading the data included; not the start of the program, nor
        figures and files.
    method : str
        Picked: exact, mcmc or lsq.
    tolerance : float or None
        Of exact.
    steps : int or None
        Of mcmc, each ensemble's.
    reached : float or None
        exact: the largest last change of a result; mcmc: the largest standard error; None for lsq, whose
        distance from the posterior nobody knows without the posterior.
    seconds : float
        What it took, counted as the budget is.
    why : str
        Why not exact, or not as asked; empty where there is nothing to explain.
    """

    accuracy: float | None
    budget: float | None
    method: str
    tolerance: float | None
    steps: int | None
    reached: float | None
    seconds: float
    why: str = ""

    @property
    def met(self) -> bool:
        """Whether the asked accuracy was reached, as far as one was asked."""
        return self.accuracy is None or (self.reached is not None and self.reached <= self.accuracy)
