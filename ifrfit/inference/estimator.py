"""What a method of estimation must offer, and the bases of the package's own.

A method is a frozen dataclass whose fields are its options. This module imports nothing heavy: what a method
computes stands in modules of its own, which `run` imports.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, ClassVar, Protocol, TypedDict, runtime_checkable

from ifrfit.inference.option_fields import Options

if TYPE_CHECKING:
    from ifrfit.inference.model.problem import Problem
    from ifrfit.inference.optimize.least_squares import LeastSquaresFit
    from ifrfit.inference.result.estimation import Estimation

Progress = Callable[[int, int], None]


@runtime_checkable
class Estimator(Protocol):
    """A method of estimation: a frozen dataclass whose fields are its options, see `option_fields.option`.

    Attributes
    ----------
    name : str
        On the command line and in result files.
    title : str
        In reports: "Markov chain Monte Carlo".
    label : str
        In tables: "MCMC".
    summary : str
        In the help text: "Markov chains".
    """

    @property
    def name(self) -> str:
        """Name on the command line and in result files."""

    @property
    def title(self) -> str:
        """Name in reports."""

    @property
    def label(self) -> str:
        """Short name in tables."""

    @property
    def summary(self) -> str:
        """A few words for the help text."""

    def refuses(self, problem: Problem) -> str:
        """Why the method cannot do a problem, with the remedy; empty where it can."""

    def run(
        self,
        problem: Problem,
        optimum: LeastSquaresFit,
        *,
        seed: int = 0,
        progress: Progress | None = None,
        started: float | None = None,
    ) -> Estimation:
        """Estimate the parameters.

        Parameters
        ----------
        problem : Problem
        optimum : LeastSquaresFit
            Of the problem, certified: where every method starts.
        seed : int
            Of all random numbers.
        progress : callable, optional
            Called with the steps done, and the most that there may be.
        started : float, optional
            Seconds that the clock of `ifrfit.inference.accuracy.request` showed when the user asked; by
            default it is asked now.

        Raises
        ------
        UsageError, DataError
            If the problem is not one for the method after all.
        """


class RunKeywords(TypedDict, total=False):
    """Keywords of `Estimator.run`."""

    seed: int
    progress: Progress | None
    started: float | None


class Method(Options):
    """Base of the package's own methods: does every problem, as long as it does not say otherwise.

    An offset of the set angles is fitted by a method that says so, see `method_limits.refuses_offset`; priors
    of every law are known to one that says so, see `method_limits.refuses_prior`; so are ties between
    constants, and errors that rows have in common.
    """

    fits_angle_offset: ClassVar[bool] = False
    takes_common_errors: ClassVar[bool] = False
    takes_every_prior: ClassVar[bool] = False
    takes_ties: ClassVar[bool] = False

    def refuses(self, problem: Problem) -> str:
        """Why the method cannot do a problem; empty where it can."""
        return ""


class PlainErrors(Method):
    """Base of methods that know independent Gaussian errors of the values only."""

    name: ClassVar[str]

    def refuses(self, problem: Problem) -> str:
        """Why not: errors of angles, or heavy tails."""
        if problem.error_model.is_plain:
            return ""
        return (
            f"--method {self.name} knows independent Gaussian errors of the values only: use --method exact "
            f"or mcmc with {problem.error_model.option}."
        )
