"""Least squares: certified optimum, the noise where it is estimated, and weights that follow from the fit.

Errors that are not normal, and errors of angles, are met by iteratively reweighted least squares (IRLS).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from ifrfit.errors import DataError
from ifrfit.inference.diagnostics.thresholds import AT_REST, NOISE_GAP
from ifrfit.inference.model.common_errors import CommonErrorFit, whitening
from ifrfit.inference.model.common_likelihood import CommonLikelihood
from ifrfit.inference.model.error_model import ITERATED, PLAIN, ErrorModel
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.row_likelihood import RowLaw, at_theta, slopes
from ifrfit.inference.model.rows import Index
from ifrfit.inference.optimize.aitken import end_of_steps
from ifrfit.inference.optimize.angle_offset import (
    AngleOffset,
    offset_at,
    offset_minima,
    prior_sd_of,
    slope_by_offset,
)
from ifrfit.inference.optimize.common_error_search import with_common_errors
from ifrfit.inference.optimize.laplace import GaussianApproximation, gaussian_approximation
from ifrfit.inference.optimize.noise_identifiability import needs_sigma, refuse_exact_group
from ifrfit.inference.optimize.noise_modes import NoiseModes, likely_sigma, noise_modes, phi
from ifrfit.inference.optimize.optimum import Array, Optimum
from ifrfit.inference.optimize.piecewise import NEAR
from ifrfit.inference.optimize.solve import solve
from ifrfit.inference.optimize.tied_search import searched_sigma

_ITERATIONS = 100
_CONVERGED = 1e-10
_REFITTED = 1e-6  # of a noise of which a test or a start is made
_SEARCHES = 3  # over an angle offset
NO_DIGITS = 1e15  # chi2 in which a difference of 1 is lost in rounding
_REWEIGHTINGS = 60
_PATIENCE = 8  # of them, for a smaller change
_WEIGHTS_CONVERGED = 1e-8
_SAME_MODE = 1.0  # rise of -2 log likelihood that the degrees of freedom of the noises may cause
_SMALLEST_FACTOR = 1e-6  # on sigma: a smaller one says that the misfit is nothing but rounding

_NOTHING = 1e-9  # of the information: a share of it that no number of degrees of freedom changes


@dataclass(frozen=True)
class LeastSquaresFit:
    """An optimum with the noise that goes with it.

    Attributes
    ----------
    optimum : Optimum
    sigma : ndarray
        Standard uncertainty of each row that the intervals rest on.
    noise : mapping
        "series/observable" to its sigma (the root mean square where rows differ).
    noise_dof : float
        Degrees of freedom behind the noise where it is estimated; infinite where all sigma is known.
    change : float
        Last relative change of the noise; 0 where it is known.
    gaussian : GaussianApproximation
    rivals : tuple of (float, ndarray)
        Other modes over constants and noises: how far minus twice their log likelihood lies above that of the
        best, and theta.
    angle_offset : AngleOffset or None
        Offset of the set angles at which all of this holds, where one is fitted; `gaussian` has its
        uncertainty integrated out.
    common : CommonErrorFit or None
        Errors that rows have in common, at which all of this holds, where there are any; `gaussian` has
        theirs integrated out.
    """

    optimum: Optimum
    sigma: Array
    noise: Mapping[str, float]
    noise_dof: float
    change: float
    gaussian: GaussianApproximation
    rivals: tuple[tuple[float, Array], ...] = ()
    angle_offset: AngleOffset | None = None
    common: CommonErrorFit | None = None

    @property
    def common_loadings(self) -> Array | None:
        """By how much each value is off, (n, r), for one standard error of what rows have in common."""
        if self.common is not None:
            return self.common.loadings
        return None if self.angle_offset is None else self.angle_offset.common[:, None]

    @property
    def converged(self) -> bool:
        """Whether the iteration over the noise has come to rest."""
        return self.change <= AT_REST


def least_squares(problem: Problem, start: Array | None = None, *, proven: bool = True) -> LeastSquaresFit:
    """Fit by least squares under the problem's noise policy.

    known: sigma is taken at its word. scaled: sigma times one common factor, from the misfit.
    unknown: the noise of each group from the misfit. mixed: so where no sigma is given. The modes of the
    likelihood are those of `noise_modes`; about the best of them constants and noises are iterated, with the
    degrees of freedom that each noise keeps. With heavy tails or errors of angles the weights are iterated as
    well, see `_iteratively_reweighted`.

    Parameters
    ----------
    problem : Problem
    start : ndarray, optional
        theta of a neighbouring problem: where only a search can find the optimum, it begins there alone.
    proven : bool
        Whether a proof over unknown noises is needed where it is dear, see `noise_modes`.

    Raises
    ------
    DataError
        If the noise is to come from the misfit and a group could be fitted exactly, or given sigma are so
        small that chi2 has no digits.
    """
    found = _least_squares(problem, start, proven=proven)
    if problem.noise.is_known:
        _refuse_lost_digits(found.optimum.objective)
    return found


def _least_squares(problem: Problem, start: Array | None, *, proven: bool) -> LeastSquaresFit:
    if problem.common is not None:
        return with_common_errors(problem, _at_common, start, proven=proven)
    if problem.parameters.is_tied and not problem.noise.is_known:
        return _with_plain_errors(problem, start, searched_sigma(problem))
    if not problem.error_model.is_plain:
        return _iteratively_reweighted(problem)
    if problem.error_model.offset is not None:
        return _with_angle_offset(problem, start)
    return _with_plain_errors(problem, start, proven=proven)


def _refuse_lost_digits(objective: float) -> None:
    """Refuse a chi2 so large that a difference of 1 is lost in rounding."""
    if objective > NO_DIGITS:
        raise DataError(
            f"chi2 of the best fit is {objective:.0e}: sigma is so small that no digits are left to tell one "
            "constant from another. Correct sigma, or take --noise scaled, which keeps its proportions alone."
        )


def at_fitted_offset(problem: Problem, found: LeastSquaresFit) -> Problem:
    """The problem at the offset of the set angles, and at the errors that rows have in common, of a fit."""
    if found.common is not None:
        return problem.at_common(found.common.value)
    return problem if found.angle_offset is None else problem.at_offset(found.angle_offset.value)


def _at_common(
    problem: Problem,
    value: Array,
    start: Array | None = None,
    sigma: Array | None = None,
    *,
    proven: bool = True,
) -> LeastSquaresFit:
    """The fit at given common errors, their scatter integrated out of the Gaussian.

    With sigma given, (n,), unknown noises are those of the mode that it is of.
    """
    there = problem.at_common(value)
    likelihood = CommonLikelihood(problem, value)

    def loadings(theta: Array) -> Array:
        return np.asarray(likelihood.loadings(theta[None])[0])

    if problem.error_model.is_plain:
        known = None if problem.noise.is_known else sigma
        found = _with_plain_errors(there, start, known, common=loadings, proven=proven)
    else:
        found = _iteratively_reweighted(there, common=loadings)
    return replace(found, common=CommonErrorFit(value, loadings(found.optimum.theta)))


def _with_angle_offset(problem: Problem, start: Array | None = None) -> LeastSquaresFit:
    """Fit under an unknown offset of the set angles: the fit at the best offset, and what that adds to it.

    The search follows the modes of the fit without an offset; it is repeated with those that the fit at the
    best one finds beside them. Other local minima over the offset count as other minima of the constants.
    """
    assert problem.offset is not None
    prior_sd = prior_sd_of(problem)
    first = _with_plain_errors(problem.at_offset(min(0.0, problem.offset.upper)), start)
    modes = [first.optimum.theta, *(theta for _, theta in first.rivals)]

    def by_offset(there: Problem) -> Callable[[Array], Array]:
        return lambda theta: (prior_sd * slope_by_offset(there, theta))[:, None]

    for _ in range(_SEARCHES):
        minima = offset_minima(problem, modes)
        at_best = problem.at_offset(minima[0][1])
        near = None if problem.closure.bilinear else modes[0]
        found = _with_plain_errors(at_best, near, common=by_offset(at_best))
        if problem.noise.is_known:
            break
        expected = minima[0][0] - (minima[0][1] / prior_sd) ** 2
        if phi(at_best, found.optimum.theta) >= expected - NOISE_GAP:
            break
        modes.append(found.optimum.theta)
    offset = offset_at(at_best, found.sigma, found.optimum.theta, minima, prior_sd)
    prior = offset.pull**2
    others = [(value + prior, theta) for value, theta in found.optimum.minima]
    for rise, degrees in offset.minima:
        if rise <= NEAR:
            theta = solve(problem.at_offset(degrees), found.sigma, start).theta
            others.append((found.optimum.objective + prior + rise, theta))
    optimum = replace(
        found.optimum,
        objective=found.optimum.objective + prior,
        minima=tuple(sorted(others, key=lambda pair: pair[0])),
        method=f"{found.optimum.method}, at the best angle offset",
    )
    return replace(found, optimum=optimum, angle_offset=offset)


def refit(problem: Problem, sigma: Array, start: Array | None = None) -> LeastSquaresFit:
    """Fit a problem that differs little from one whose fit is known, without a proof over unknown noises.

    The noises come to rest to a millionth.

    Parameters
    ----------
    problem : Problem
    sigma : ndarray, (n,)
        Standard uncertainty of its rows in the known fit: the mode of the noises that is followed.
    start : ndarray, optional
        As for `least_squares`.

    Raises
    ------
    DataError
        As `least_squares`.
    """
    if not problem.error_model.is_plain:
        return _iteratively_reweighted(problem)
    return _with_plain_errors(problem, start, sigma)


def followed(problem: Problem, known: LeastSquaresFit) -> LeastSquaresFit:
    """Fit a problem that differs little from one whose fit is known, with the rival modes of that one.

    Rivals are moved to the domain of this problem where they lie outside.
    Nothing is proven over unknown noises, but where an offset of the angles is fitted.

    Parameters
    ----------
    problem : Problem
    known : LeastSquaresFit
        Of the other problem, with the sigma of the rows of this one.

    Raises
    ------
    DataError
        As `least_squares`.
    """
    if problem.offset is not None:
        return least_squares(problem)
    free, ends = problem.parameters.free, problem.parameters.bounds()
    rivals = tuple((rise, np.where(free, np.clip(theta, *ends), theta)) for rise, theta in known.rivals)
    return replace(refit(problem, known.sigma, known.optimum.theta), rivals=rivals)


def _with_plain_errors(
    problem: Problem,
    start: Array | None = None,
    known_sigma: Array | None = None,
    *,
    common: Callable[[Array], Array] | None = None,
    proven: bool = True,
) -> LeastSquaresFit:
    """Fit under normal errors of the values alone; see `least_squares` and `refit`.

    The Gaussian has what rows have in common integrated out: `common` gives the loadings at theta, (n, r).
    """

    def expanded(sigma: Array, theta: Array) -> GaussianApproximation:
        loadings = None if common is None else common(theta)
        return gaussian_approximation(problem, sigma, theta, common=loadings)

    if problem.noise.is_known:
        optimum = solve(problem, problem.noise.sigma, start, proven=known_sigma is None)
        gaussian = expanded(problem.noise.sigma, optimum.theta)
        return LeastSquaresFit(
            optimum, problem.noise.sigma, group_sigma(problem, problem.noise.sigma), math.inf, 0.0, gaussian
        )
    groups = problem.noise_groups()
    for name, rows in groups.items():
        refuse_exact_group(problem, name, rows)
    base = problem.noise.base
    modes = None if known_sigma is not None else noise_modes(problem, start, proven=proven)
    first = np.asarray(known_sigma) if modes is None else likely_sigma(problem, modes.best.theta)
    factor = first / base
    change, settled = math.inf, _CONVERGED if known_sigma is None else _REFITTED
    before: Array | None = None
    # a search that found the optimum once follows it while the noise settles
    near = modes.best.theta if start is None and modes is not None else start
    for number in range(_ITERATIONS):
        if number == 0 and modes is not None and not modes.follows_squares:
            optimum = modes.best.optimum  # of these very weights
        else:
            optimum = solve(problem, base * factor, near, proven=False)
        gaussian = expanded(base * factor, optimum.theta)
        new = _factors(problem, optimum.theta, base, groups, gaussian)
        step = np.log(new / factor)
        change = float(np.abs(np.expm1(step)).max(initial=0.0))
        if change <= settled:
            break
        factor = new
        near = optimum.theta
        ahead = None if before is None else end_of_steps(before, step)
        if ahead is not None:
            factor = factor * np.exp(ahead)
        before = step if ahead is None else None
    sigma = base * factor
    is_provisional = optimum.is_local and modes is not None
    if is_provisional and modes is not None:
        # one factor on all sigma moves nothing: what is proven is so at any, and need not be proven again
        proven_before = modes.follows_squares and modes.gap is not None
        optimum = solve(problem, sigma, start, slack=math.inf if proven_before else 0.0)
        if proven_before:
            optimum = _with_scaled_proof(optimum, modes.best.optimum, float(factor[0]) ** -2)
    if is_provisional or change > settled:
        gaussian = expanded(sigma, optimum.theta)
    count = problem.noise.count
    dof = sum(count(rows) - float(gaussian.leverage[rows].sum()) for rows in groups.values())
    rivals: tuple[tuple[float, Array], ...] = ()
    if modes is None:
        optimum = replace(optimum, gap=None)
    elif not modes.follows_squares:
        optimum = _with_modes(optimum, modes, phi(problem, optimum.theta) - modes.best.value)
        rivals = modes.rivals
    return LeastSquaresFit(optimum, sigma, group_sigma(problem, sigma), dof, change, gaussian, rivals)


def _with_scaled_proof(optimum: Optimum, proven: Optimum, ratio: float) -> Optimum:
    """The optimum with the better of its own proof and of one whose objective is `ratio` times smaller."""
    if optimum.gap is None or proven.gap is None:
        return optimum
    bound = ratio * (proven.objective - proven.gap)
    return replace(optimum, gap=min(optimum.gap, max(0.0, optimum.objective - bound)))


def _with_modes(optimum: Optimum, modes: NoiseModes, moved: float) -> Optimum:
    """The optimum at the noise of the best mode, with the proof and the rivals of the modes themselves.

    The degrees of freedom of the noises have `moved` it off the mode, up in Phi: a little, or the proof is of
    another place.
    """
    rivals = tuple((optimum.objective + rise, theta) for rise, theta in modes.rivals if rise <= NEAR)
    return replace(
        optimum,
        gap=modes.gap if modes.gap is None or moved <= _SAME_MODE else modes.gap + moved,
        minima=((optimum.objective, optimum.theta), *rivals),
        method=optimum.method if modes.gap is None else f"{optimum.method}, noise included",
        tolerance=NOISE_GAP,
    )


def _iteratively_reweighted(
    problem: Problem, common: Callable[[Array], Array] | None = None
) -> LeastSquaresFit:
    """Fit with weights that follow from the fit.

    The weight of a row by the law of errors, `ErrorLaw.weight`, makes the fixed point the maximum of the
    likelihood (Lange, Little & Taylor 1989). Errors of angle and spin add to sigma through the slope at the
    fit (effective variance); where the true angles are integrated out this is no more than the place to begin
    from. Each single fit is certified; that the weights lead to the best of several fixed points is not.

    Returns
    -------
    LeastSquaresFit
        With `sigma` as weighted, and the Gaussian approximation widened to the information of that law.
    """
    plain = replace(problem, error_model=PLAIN)
    base, factor = problem.noise.sigma, 1.0
    if problem.noise.is_scaled:
        factor = float(np.median(_with_plain_errors(plain).sigma / base))
    law, nu = problem.error_model.law, problem.error_model.dof
    sigma, change = base * factor, math.inf
    before: Array | None = None
    optimum = solve(plain, sigma)
    least, waited = math.inf, 0
    for _ in range(_REWEIGHTINGS):
        theta = optimum.theta
        wide = _effective_sigma(problem, theta, factor)
        z = problem.residual(theta) / wide
        weight = law.weight(z, nu)
        if problem.noise.is_scaled:
            leverage = gaussian_approximation(plain, sigma, theta).leverage
            dof = max(z.size - float(leverage.sum()), 0.5)
            factor = max(factor * math.sqrt(float(weight @ (z * z)) / dof), _SMALLEST_FACTOR)
            wide = _effective_sigma(problem, theta, factor)
        new = wide / np.sqrt(weight)
        step = np.log(new / sigma)
        change = float(np.abs(np.expm1(step)).max())
        ahead = None if before is None else end_of_steps(before, step)
        before = step if ahead is None else None
        sigma = new if ahead is None or change <= _WEIGHTS_CONVERGED else new * np.exp(ahead)
        optimum = solve(plain, sigma)
        least, waited = (change, 0) if change < least else (least, waited + 1)
        if change <= _WEIGHTS_CONVERGED or waited == _PATIENCE:  # a row at a kink weighs now more, now less
            break
    wider = 1.0 / math.sqrt(law.information(nu))
    loadings = None if common is None else common(optimum.theta)
    gaussian = gaussian_approximation(plain, sigma * wider, optimum.theta, common=loadings)
    dof = math.inf
    if problem.noise.is_scaled:
        dof = max(sigma.size - float(gaussian.leverage.sum()), 0.5)
    optimum = replace(optimum, gap=None, method=f"{optimum.method}, {ITERATED}")
    return LeastSquaresFit(optimum, sigma, group_sigma(problem, base * factor), dof, change, gaussian)


def _effective_sigma(problem: Problem, theta: Array, factor: float = 1.0) -> Array:
    """Error of each row with those of its angle and spin added through the slope at theta, (n,)."""
    sigma = problem.noise.sigma * factor
    if problem.error_model.angles == "none":
        return np.asarray(sigma)
    square = sigma**2
    laws = replace(problem, error_model=ErrorModel(angles="effective", gamma=problem.error_model.gamma))
    for number, _ in enumerate(problem.series):
        rows = np.flatnonzero(problem.rows.series == number)
        law = RowLaw.of(laws, rows)
        for sd, slope in slopes(law, at_theta(problem, theta[None], series=number)):
            square[rows[law.order]] += (slope[0, 0, :, 0] * sd) ** 2
    return np.asarray(np.sqrt(square))


def _factors(
    problem: Problem, theta: Array, base: Array, groups: Mapping[str, Index], gaussian: GaussianApproximation
) -> Array:
    """Noise factor of each row: misfit of its group over the degrees of freedom that the group keeps."""
    residual = problem.residual(theta) / base
    factor = np.ones(base.size)
    for name, rows in groups.items():
        square = float(residual[rows] @ residual[rows])
        count = problem.noise.count(rows)
        dof = count - float(gaussian.leverage[rows].sum())
        # a misfit of nothing but rounding says nothing of the noise
        if dof < 0.5 or square <= problem.rounding_variance(rows) * count:
            raise DataError(needs_sigma(problem, name, rows))
        factor[rows] = math.sqrt(square / dof)
    return factor


def group_sigma(problem: Problem, sigma: Array) -> dict[str, float]:
    """Root mean square of sigma in each "series/observable", of one measurement."""
    return {name: problem.noise.per_measurement(sigma, rows) for name, rows in problem.groups().items()}


def fitted_constants(problem: Problem, fit: LeastSquaresFit) -> float:
    """How many constants the rows pay for: the trace of the matrix that takes values to their fit.

    Errors that rows have in common are none of them: they have a law.
    """
    if fit.common is None:
        return float(fit.gaussian.leverage.sum())
    local, seen = fit.gaussian, fit.gaussian.seen
    by_phi = problem.jacobian(fit.optimum.theta) @ local.to_theta / fit.sigma[:, None]
    unit, size = whitening(fit.common.loadings, fit.sigma)
    by_phi -= (unit * (1.0 - 1.0 / np.sqrt(1.0 + size**2))) @ (unit.T @ by_phi)
    return float(((by_phi @ local.vectors[:, seen] / local.singular[seen]) ** 2).sum())


def group_dof(problem: Problem, fit: LeastSquaresFit) -> Array:
    """Degrees of freedom that each unknown noise keeps: its rows less their leverage, (groups,)."""
    leverage = fit.gaussian.leverage
    return np.array(
        [
            max(problem.noise.count(rows) - float(leverage[rows].sum()), 0.5)
            for rows in problem.noise_groups().values()
        ]
    )


def satterthwaite(shares: Array, dof: Array) -> float:
    """Degrees of freedom of a sum of estimated variances; infinite where none of it is estimated.

    Parameters
    ----------
    shares : ndarray, (groups,)
        Of the sum, each with an unknown noise; what is missing to 1 is known.
    dof : ndarray, (groups,)

    References
    ----------
    Satterthwaite (1946), Biometrics Bull. 2, 110.
    """
    spread = float((shares**2 / dof).sum())
    return 1.0 / spread if spread > _NOTHING else math.inf


def dof_of_functional(problem: Problem, fit: LeastSquaresFit, functional: Array) -> float:
    """Degrees of freedom behind the sd of functional @ phi.

    After Satterthwaite: each unknown noise counts by its share of the information.
    """
    if math.isinf(fit.noise_dof):
        return math.inf
    shares = information_shares(problem, fit, functional)
    return fit.noise_dof if shares is None else satterthwaite(shares, group_dof(problem, fit))


def information_shares(problem: Problem, fit: LeastSquaresFit, functional: Array) -> Array | None:
    """Share of each unknown noise's rows in the information on functional @ phi; None if it is not seen."""
    local = fit.gaussian
    inverse = np.where(local.seen, 1.0 / np.where(local.seen, local.singular, 1.0) ** 2, 0.0)
    direction = local.vectors @ (inverse * (functional @ local.vectors))
    total = float(functional @ direction)
    if not (total > 0.0 and math.isfinite(local.variance(functional, 1.0))):
        return None
    moved = problem.jacobian(fit.optimum.theta) @ (local.to_theta @ direction) / fit.sigma
    loadings = fit.common_loadings
    if loadings is not None:  # an error that all rows share is known, by its prior
        unit, size = whitening(loadings, fit.sigma)
        moved -= unit @ (size**2 / (1.0 + size**2) * (unit.T @ moved))
    groups = problem.noise_groups().values()
    return np.array([float(moved[rows] @ moved[rows]) for rows in groups]) / total
