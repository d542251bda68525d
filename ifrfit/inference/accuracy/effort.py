"""What was asked of accuracy and time, and what came of it, in words."""

from __future__ import annotations

from dataclasses import dataclass

from ifrfit.text import duration, power_of_ten


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

    @property
    def says(self) -> str:
        """Method and setting, what was reached, in which time, and what was asked."""
        taken = f"in {duration(self.seconds)}"
        why = f" ({self.why})" if self.why else ""
        asked = [power_of_ten(self.accuracy)] if self.accuracy is not None else []
        if self.budget is not None:
            asked.append(f"{'at most' if asked else 'the best in'} {duration(self.budget)}")
        if self.method == "lsq":
            found = f"least squares {taken}{why}; how far from the posterior is not known"
        else:
            found = f"{self._setting} reached {self._reached} {taken}{why}"
        return f"{found}; asked: {', '.join(asked)}"

    @property
    def missed(self) -> str:
        """That the accuracy was not reached."""
        assert self.accuracy is not None
        within = "" if self.budget is None else f" within {duration(self.budget)}"
        start = f"the asked accuracy of {power_of_ten(self.accuracy)} of an sd was not reached{within}"
        if self.method == "lsq":
            return f"{start}: least squares do not tell how far they are from the posterior"
        return f"{start}: {self._setting} came to {self._reached}"

    @property
    def _setting(self) -> str:
        if self.tolerance is not None:
            return f"exact, tolerance {power_of_ten(self.tolerance)},"
        return f"mcmc, {self.steps:,} steps,"

    @property
    def _reached(self) -> str:
        if self.reached is None:
            return "no standard error yet"
        kind = "a standard error of " if self.method == "mcmc" else ""
        return f"{kind}{power_of_ten(self.reached)} of an sd"
