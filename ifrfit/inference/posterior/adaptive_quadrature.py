"""The posterior of a problem by adaptive quadrature: refined until no result moves by more than a tolerance.

Eq. (7) of ``docs/theory/posterior.md`` is the error estimate that every refinement follows.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

from ifrfit.errors import UsageError
from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, least_squares
from ifrfit.inference.posterior.integral_layout import IntegralLayout, make_layout
from ifrfit.inference.posterior.joint_grid import JointDensity
from ifrfit.inference.posterior.layout_marginals import kappa_marginals, marginals_of
from ifrfit.inference.posterior.marginals import (
    Marginal,
    errors_of_quantiles,
    largest_error,
)
from ifrfit.inference.posterior.quadrature_posterior import QuadraturePosterior

TOLERANCE = 1e-4  # of a standard deviation, and of the log evidence

_ROUNDS = 30
# Sizes of grids, in values of the density
_SMALL = 200_000  # up to which a round is cheap
_LARGE = 1_500_000  # beyond which a round is expensive
_MEMORY = 12_000_000  # that would fill the memory: 0.3 to 0.6 GB; 1.3 where c does not see e_n
_PATIENCE_LARGE, _PATIENCE = 2, 8  # rounds in which the error must halve, on large grids and others
_LOOSER = 2.0  # times what was allowed, until the next grid fits into memory
_HELPFUL = 0.7  # largest share of its error that a round may leave, if the next one is to be like it
_NEGLIGIBLE = 1e-7  # share of the mass, times the tolerance, that panels of the first grid may lack
_SMALLEST_ALLOWED = 1e-15
_OF_A_LOOK = 0.15  # share of the work that the look for empty panels may take
# Change of the log evidence in that look from which on a first grid hardly ends it, and the share of the work
# that it may then take: one that takes more leaves no room for a second
_ROUGH, _OF_A_ROUGH_GRID = 0.2, 0.6
_NO_MASS = 1e-12  # of kappa at the end of its domain, beyond which e_n does not separate
_RISE = 30.0  # of minus twice the log likelihood, up to which modes must lie within that domain
_NEAR_END = 0.999  # share of kappa's domain at which its end begins


class GridTooLargeError(UsageError):
    """The grid of a posterior would be too large."""


def _too_large(size: int) -> GridTooLargeError:
    return GridTooLargeError(
        f"The exact posterior needs a grid of {size:.0e} values here, which does not fit into memory. "
        "Use --method mcmc, or fix a constant."
    )


def integrate(
    problem: Problem,
    tolerance: float = TOLERANCE,
    start: LeastSquaresFit | None = None,
    over: Callable[[], bool] | None = None,
    most_work: float = math.inf,
) -> QuadraturePosterior:
    """Integrate the posterior of a problem.

    Parameters
    ----------
    problem : Problem
    tolerance : float
        Of means, standard deviations and quantiles in posterior standard deviations, and of the log evidence.
    start : LeastSquaresFit, optional
        The certified optimum, where it is known already.
    over : callable, optional
        Asked before and after every round: whether to end with what was reached.
    most_work : float
        Values of the density, each by its cost, after which no further grid is begun.

    Returns
    -------
    QuadraturePosterior

    Raises
    ------
    DataError
        Where the noise is unknown and the data cannot tell it from the constants.
    GridTooLargeError
        Where the first grid would fill the memory, or take more work.
    UsageError
        For a domain that reaches where sticking has no meaning.
    TimeoutError
        If `over` says so before the first round.
    """
    found = _refined(problem, tolerance, start, over, most_work)
    return QuadraturePosterior(
        problem,
        float(found.density.log_z[0]),
        found.evidence_error,
        tolerance,
        tolerance,
        found.layout,
        found.density,
        found.marginals,
        tuple(found.errors),
    )


def log_evidence(
    problem: Problem,
    tolerance: float = TOLERANCE,
    start: LeastSquaresFit | None = None,
    most_work: float = math.inf,
) -> tuple[float, float]:
    """Log of the integral of the normalised likelihood times the normalised prior, and its error.

    The marginals are left out.

    Parameters
    ----------
    problem : Problem
    tolerance : float
        Of the log evidence: the last change between two rules.
    start : LeastSquaresFit, optional
        The certified optimum, where it is known already.
    most_work : float
        As `integrate`.

    Raises
    ------
    DataError, UsageError
        As `integrate`.
    """
    found = _refined(problem, tolerance, start, None, most_work, has_marginals=False)
    return float(found.density.log_z[0]), found.evidence_error


def refuse_large(problem: Problem, tolerance: float, start: LeastSquaresFit, most_work: float) -> None:
    """Lay the first grid of a posterior, to see whether there is room for it.

    Raises
    ------
    GridTooLargeError
        Where it would take more than `most_work`.
    UsageError
        As `integrate`.
    """
    layout = make_layout(problem, start, tolerance, separate_e_n=True)
    Refinement(layout, tolerance, most_work=most_work).lay_first_grid()


def _refined(
    problem: Problem,
    tolerance: float,
    start: LeastSquaresFit | None,
    over: Callable[[], bool] | None,
    most_work: float,
    *,
    has_marginals: bool = True,
) -> Refinement:
    """Refine the integral with e_n separated, eq. (8), or whole where rows or domain do not allow that."""
    start = least_squares(problem) if start is None else start
    for separate_e_n in (True, False):
        layout = make_layout(problem, start, tolerance, separate_e_n=separate_e_n)
        refinement = Refinement(layout, tolerance, over, most_work, has_marginals=has_marginals)
        modes = [start.optimum.theta, *(theta for _, theta in start.optimum.minima)]
        modes += [theta for rise, theta in start.rivals if rise <= _RISE]
        kappas = problem.parameters.kappas
        if any(refinement.leaves_out([one.value(theta) for one in kappas]) for theta in modes):
            continue
        refinement.run()
        most_work = refinement.work_left
        if not refinement.kappa_reaches_end():
            break
    return refinement


class Refinement:
    """The refinement of one integral: rounds of evaluating, estimating errors, and splitting panels.

    Parameters
    ----------
    layout : IntegralLayout
    tolerance : float
    over : callable, optional
        Whether time is up.
    most_work : float
        As `integrate`.
    has_marginals : bool
        Whether the marginals must converge beside the evidence.

    Attributes
    ----------
    density : JointDensity
        Of the last grid.
    marginals : mapping
    error : float
        Largest error of a marginal, in standard deviations.
    errors : list of float
        The same, round by round; of means and standard deviations alone where these exceed the tolerance.
    evidence_error : float
    work_left : float
        Of `most_work`.
    """

    density: JointDensity
    marginals: Mapping[str, Marginal]

    def __init__(
        self,
        layout: IntegralLayout,
        tolerance: float,
        over: Callable[[], bool] | None = None,
        most_work: float = math.inf,
        *,
        has_marginals: bool = True,
    ) -> None:
        self.layout, self.tolerance = layout, tolerance
        self.work_left = most_work
        self._integral, self._has_marginals = layout.integral, has_marginals
        self._is_over = over if over is not None else lambda: False
        self.errors: list[float] = []
        self._reaches_end: bool | None = None  # by the present grid; not known yet
        self._allowed = tolerance  # error of all panels of an axis

    def run(self) -> None:
        """Refine until all is within the tolerance, panels no longer help, or the next grid is too large.

        Raises
        ------
        GridTooLargeError
            Where the first grid would fill the memory, or take more work than there may be.
        TimeoutError
            If time is up before the first round.
        """
        self.lay_first_grid()
        for round_ in range(_ROUNDS):
            self._evaluate()
            is_last = round_ == _ROUNDS - 1 or self._is_over()
            has_marginals = self.evidence_error <= self.tolerance or is_last
            if has_marginals:
                self.marginals = self._marginals()
                if not self.errors and self.kappa_reaches_end():
                    return  # finer panels would not part e_n from it
                self._estimate_error()
                if max(self.error, self.evidence_error) <= self.tolerance:
                    return
                if is_last or self._is_stalled():
                    return
            if not self._refine():
                if not has_marginals:
                    self.marginals = self._marginals()
                    self._estimate_error()
                return

    def kappa_reaches_end(self) -> bool:
        """Whether a separated kappa has mass where the bound of mu ties it to e_n, eq. (8)."""
        if self._reaches_end is None:
            self._reaches_end = self.layout.separable and self._has_mass_at_end()
        return self._reaches_end

    def _has_mass_at_end(self) -> bool:
        kappas = self.marginals or kappa_marginals(self.layout, self.density)  # `log_evidence` asks for none
        return any(
            kappas[name].mass_above(end) > _NO_MASS
            for name, end in zip(self.layout.kappa_names, self._ends_of_kappa(), strict=True)
        )

    def leaves_out(self, kappas: Sequence[float]) -> bool:
        """Whether one of these, of a mode that is known, lies beyond the end of a separated domain.

        The density inside may have fallen to nothing before that end, about another mode.
        """
        ends = self._ends_of_kappa() if self.layout.separable else ()
        return any(kappa > end for kappa, end in zip(kappas, ends, strict=False))

    def _ends_of_kappa(self) -> list[float]:
        """Where the end of each block's separated domain of kappa begins; infinite where it is given."""
        found = []
        for block in range(len(self.layout.kappa_names)):
            domain = self._integral.series[block].mu
            shared = self._integral.number_of("mu")
            if shared is not None:
                domain = self._integral.shared[shared].parameter
            found.append(_NEAR_END * domain.upper if isinstance(domain, FreeParameter) else math.inf)
        return found

    def lay_first_grid(self) -> None:
        """Drop panels without mass, and see whether there is room for the rest.

        Raises
        ------
        GridTooLargeError, TimeoutError
            As `run`.
        """
        integral = self._integral
        with integral.low_order(integral.axes):
            has_room = integral.is_within(_MEMORY, _OF_A_LOOK * self.work_left)
        if not has_room:
            raise _too_large(self._integral.size())
        looked = self._integral.drop_empty_panels(_NEGLIGIBLE * self.tolerance)
        is_unbounded = any(series.is_unbounded for series in self._integral.series)
        if is_unbounded and self._integral.size() > _SMALL:
            self.work_left -= self._integral.refine_transitions(self.tolerance, self.work_left)
        if self._is_over():
            raise TimeoutError
        share = _OF_A_ROUGH_GRID if looked > _ROUGH else 1.0
        if not self._integral.is_within(_MEMORY, share * self.work_left):
            raise _too_large(self._integral.size())

    def _evaluate(self) -> None:
        # the grid before, on which the marginals rest, goes first: two would take twice the memory
        self.marginals = {}
        if hasattr(self, "density"):
            del self.density
        self.work_left -= self._integral.work()
        self.density, self._reaches_end = self._integral.evaluate(), None
        self.evidence_error = self.density.evidence_error()

    def _marginals(self) -> Mapping[str, Marginal]:
        return marginals_of(self.layout, self.density) if self._has_marginals else {}

    def _estimate_error(self) -> None:
        self.error = largest_error(self.marginals, self.tolerance)
        self.errors.append(self.error)

    def _is_stalled(self) -> bool:
        """Whether the error has not halved for some rounds."""
        patience = _PATIENCE_LARGE if self.density.size() > _LARGE else _PATIENCE
        return len(self.errors) > patience and self.error > 0.5 * self.errors[-1 - patience]

    def _refine(self) -> bool:
        """Split the panels that carry the error, with as little allowed as changes anything.

        Where all of them would not fit into memory, those with the largest errors; where they would take too
        much work, none, because sampling is quicker then.

        Returns
        -------
        bool
            Whether there are any, and room for them.
        """
        if len(self.errors) > 1 and self.errors[-1] > _HELPFUL * self.errors[-2]:
            self._allowed *= 0.1
        marginals = self.marginals if self.evidence_error <= self.tolerance else {}
        errors = errors_of_quantiles(marginals, self.tolerance)
        # before any panel changes: marginals are read from the density on the present ones
        kinks = [
            marginal.kinks(marginal.at_levels(self.tolerance))
            for marginal in marginals.values()
            if marginal.kinks is not None and marginal.moments(0)[1] > 0.0
        ]
        restore = self._integral.remembered()
        sources = self._integral.error_sources(self.density, errors)
        changed = self._integral.refine(sources, self._allowed)
        for axis, places in kinks:
            changed |= axis.split(places)
        while not changed and self._allowed > _SMALLEST_ALLOWED:
            self._allowed *= 0.1
            changed = self._integral.refine(sources, self._allowed)
        allowed = self._allowed
        while changed and self._integral.size() > _MEMORY:
            restore()
            allowed *= _LOOSER
            changed = self._integral.refine(sources, allowed)
        if not self._integral.is_within(_MEMORY, self.work_left):
            restore()
            return False
        return changed
