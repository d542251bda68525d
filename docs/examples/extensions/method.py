"""A method with an option: the optimum that every fit starts from, as the answer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

from ifrfit.inference.option_fields import Options, option

if TYPE_CHECKING:
    from ifrfit.inference.model.problem import Problem
    from ifrfit.inference.optimize.least_squares import LeastSquaresFit
    from ifrfit.inference.result.estimation import Estimation


@dataclass(frozen=True, repr=False)
class Mode(Options):
    """The optimum as it is."""

    name: ClassVar[str] = "mode"
    title: ClassVar[str] = "posterior mode"
    label: ClassVar[str] = "mode"
    summary: ClassVar[str] = "the optimum alone"
    patience: int = option(3, "mode: how long it waits.", form="integer", metavar="N")

    def refuses(self, problem: Problem) -> str:
        """Why not: errors of angles, or heavy tails."""
        return "" if problem.error_model.is_plain else "mode: plain errors only."

    def run(
        self,
        problem: Problem,
        optimum: LeastSquaresFit,
        *,
        seed: int = 0,
        progress: Callable[[int, int], None] | None = None,
        started: float | None = None,
    ) -> Estimation:
        """Take the optimum."""
        from ifrfit.inference.estimations import least_squares_estimation

        found = least_squares_estimation(optimum)
        return replace(found, method=self.name, warnings=(f"It waited {self.patience}.",))
