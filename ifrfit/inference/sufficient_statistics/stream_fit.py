"""The fit of impacts that are not held in memory: sums by intervals of tau, and the rows these do not decide.

A pass over the files gives the sums (`moments`). They tell which intervals the transition may lie in:
elsewhere it costs more than the best fit by so much that neither the optimum nor any mass of the posterior is
there (`transition_bounds`). A second pass fetches the impacts of these intervals; all others are condensed
(`condensed_rows`). The problem of both is one like any other, with the same certificate and posterior.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.special import chdtrc, fdtrc

from ifrfit.data.observations import Observations, Source, make_table
from ifrfit.data.readers import observe
from ifrfit.data.selection import select
from ifrfit.data.stream import Batch, ImpactStream
from ifrfit.errors import DataError, UsageError
from ifrfit.inference.diagnostics.optimum_facts import at_bound, global_optimum, identifiable
from ifrfit.inference.diagnostics.thresholds import FACTS, REFUTED
from ifrfit.inference.estimators import Estimator
from ifrfit.inference.model.noise import NoiseModel, Policy, resolution
from ifrfit.inference.model.parameters import Parameter, ParameterSet
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Rows
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, least_squares
from ifrfit.inference.result.build import build_result
from ifrfit.inference.result.deferred import Deferred
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.types import Fact, FitStatistics
from ifrfit.inference.sufficient_statistics.condensed_rows import condensed_rows
from ifrfit.inference.sufficient_statistics.moments import Moments, N, bin_of, middles
from ifrfit.inference.sufficient_statistics.transition_bounds import least_direct, least_misfit
from ifrfit.physics.closure import Closure
from ifrfit.physics.compiling import available
from ifrfit.physics.observables import OBSERVABLES
from ifrfit.text import joined

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Progress = Callable[[int, int], None]
SampleFit = Callable[[Observations], FitResult]

BINS = 2048  # intervals of tau, or four times as many for each of these numbers of rows that there are
_MANY = (30_000_000, 300_000_000)
FAR = 80.0  # of minus twice the log likelihood above the best: less mass than exp(-40) lies there
_MOST_ROWS = 2_000_000  # that are fetched
_PASSES = 4
_METHODS = ("exact", "lsq")
_MEAN, _SCATTER = "mean of an interval", "scatter within intervals"  # what condensed rows are
# facts that the whole answers; the others are looked for in a sample
_OF_ALL = ("converged", "global_optimum", "identifiable", "at_bound", "sharing", "predictive")


@dataclass
class _Group:
    """What a pass found of one series and observable beside the sums."""

    smallest_sigma: float = math.inf
    largest_sigma: float = 0.0
    largest_value: float = 0.0
    square_sigma: float = 0.0
    log_sigma: float = 0.0
    last_decimal: float = 1.0
    least_gamma: float = 90.0
    largest_gamma: float = 0.0


@dataclass
class Accumulated:
    """Sums of all impacts of a stream.

    Attributes
    ----------
    stream : ImpactStream
    weighted : bool
        Whether sigma gives the weights.
    bins : int
        Intervals of tau.
    moments : Moments
        Groups are series times observables.
    """

    stream: ImpactStream
    weighted: bool
    bins: int = BINS
    moments: Moments | None = None
    groups: list[_Group] = field(default_factory=list)

    def add(self, batch: Batch) -> None:
        """Add the impacts of a batch."""
        names = self.stream.observables
        self._make_room(len(self.stream.series) * len(names))
        assert self.moments is not None
        for number, name in enumerate(names):
            at, value, sigma = batch.values[name]
            if not at.size:
                continue
            group = batch.series[at] * len(names) + number
            place, w, s, r, x = _row_sums(batch, name, at, value, sigma, self)
            self.moments.add(group, place, w, s, r, x)
            for own in np.unique(group).tolist():
                here = group == own
                self._note(own, value[here], sigma[here], batch.gamma_deg[at][here])

    def _make_room(self, groups: int) -> None:
        fresh = Moments.nothing(groups, self.bins)
        if self.moments is not None:
            if self.moments.high.shape[0] == groups:
                return
            fresh.high[: self.moments.high.shape[0]] = self.moments.high
            fresh.low[: self.moments.low.shape[0]] = self.moments.low
        self.moments = fresh
        self.groups += [_Group() for _ in range(groups - len(self.groups))]

    def _note(self, own: int, value: Array, sigma: Array, gamma: Array) -> None:
        known = self.groups[own]
        known.least_gamma = min(known.least_gamma, float(gamma.min()))
        known.largest_gamma = max(known.largest_gamma, float(gamma.max()))
        known.largest_value = max(known.largest_value, float(np.abs(value).max()))
        if known.last_decimal > 1e-6:
            known.last_decimal = min(known.last_decimal, resolution(value))
        if self.weighted:
            known.smallest_sigma = min(known.smallest_sigma, float(sigma.min()))
            known.largest_sigma = max(known.largest_sigma, float(sigma.max()))
            known.square_sigma += float(sigma @ sigma)
            known.log_sigma += float(np.log(sigma).sum())

    @property
    def sums(self) -> Array:
        """(groups, bins, 7)."""
        assert self.moments is not None
        return self.moments.high

    def observable_of(self, group: int) -> str:
        """Observable of a group."""
        return self.stream.observables[group % len(self.stream.observables)]

    def series_of(self, group: int) -> int:
        """Series of a group."""
        return group // len(self.stream.observables)


def _row_sums(
    batch: Batch, name: str, at: Index, value: Array, sigma: Array, of: Accumulated
) -> tuple[Index, Array, Array, Array, Array]:
    """Interval, weight, slope, value less offset and 1/tau of some rows."""
    incidence = batch.incidence.take(at)
    w = sigma**-2.0 if of.weighted else np.ones(at.size)
    observable = OBSERVABLES[name]
    if observable.linear is None:
        slope = np.ones(at.size) if observable.by_e_n is None else observable.by_e_n(incidence)
        return np.zeros(at.size, dtype=np.intp), w, np.asarray(slope), value, np.zeros(at.size)
    offset, slope = observable.linear(incidence, of.stream.inertia_factor)
    slip = np.hypot(incidence.slip_x, incidence.slip_y)
    with np.errstate(divide="ignore"):
        x = np.where(slip > 0.0, incidence.cosine / slip, 0.0)
    slope = np.where(slip > 0.0, slope, 0.0)
    place = bin_of(slip, incidence.cosine, of.bins)
    x = np.where(slip > 0.0, x - middles(of.bins)[place], 0.0)
    return place, w, slope, value - offset, x


def fit_stream(
    stream: ImpactStream,
    closure: Closure,
    parameters: Sequence[Parameter],
    policy: str | None,
    estimator: Estimator,
    fit_sample: SampleFit,
    *,
    separate_noise: bool,
    assumed: tuple[str, ...],
    seed: int = 0,
    command: str = "",
    progress: Progress | None = None,
) -> FitResult:
    """Recover one set of constants from impacts that are not held in memory.

    Parameters
    ----------
    stream : ImpactStream
    closure : Closure
        A bilinear one.
    parameters : sequence of Parameter
    policy : {"known", "unknown"} or None
        None: known where every observable has a column of uncertainties.
    estimator : Estimator
        exact or lsq.
    fit_sample : callable
        Fits a sample that is held in memory, for the facts that look at single rows.
    separate_noise : bool
    assumed : tuple of str
    seed, command, progress
        As `ifrfit.fit`.

    Raises
    ------
    UsageError
        For what needs the rows one by one.
    DataError
        As the stream; and where the data leave open where the transition lies, so that too many impacts would
        have to be held.
    """
    _refuse(closure, policy, estimator)
    rows = stream.expected_rows()
    of = Accumulated(stream, weighted=False, bins=BINS * 4 ** sum(rows >= many for many in _MANY))
    for number, batch in enumerate(stream.batches(progress, sampled=True)):
        if number == 0:
            of.weighted = stream.has_sigma if policy is None else policy == "known"
            if of.weighted and not stream.has_sigma:
                raise DataError(
                    f"{stream.path}: --noise known needs a column of uncertainties for each observable."
                )
        of.add(batch)
    if not of.groups or not of.sums[:, :, N].any():
        reasons = "; ".join(f"{count} {reason}" for reason, count in stream.skipped.items() if count)
        raise DataError(f"{stream.path}: no row can be used ({reasons}). Fill in what was measured.")
    if not stream.has_spin and any(OBSERVABLES[name].linear is not None for name in stream.observables):
        assumed = (*assumed, "no spin before impact")
    noise: Policy = "known" if of.weighted else "unknown"
    question = _Question(of, closure, tuple(parameters), noise, separate_noise)
    problem, optimum, fetched = question.solve(progress)
    estimation = estimator.run(problem, optimum, seed=seed, progress=None)
    result = build_result(
        problem, optimum, estimation, seed=seed, command=command, assumed=assumed, brief=True
    )
    sample = _sample(stream, fit_sample)
    kinds = problem.observations.table["impact_id"].to_numpy(dtype=object)
    source = _source(of)
    proven = question.gap(problem, optimum, fetched)
    optimum = replace(optimum, optimum=replace(optimum.optimum, gap=proven))
    correction = _likelihood_correction(problem, optimum, of)
    evidence = result.fit.log_evidence
    if isinstance(sample, DataError):
        said = f"no fact on single rows was looked for, because a sample of them is refused: {sample}"
    else:
        said = (
            f"facts on single rows were looked for in a sample of {len(sample.points):,} values of "
            f"{source.rows_used:,}; the result keeps no rows, so that there is neither figure nor report"
        )
    return replace(
        result,
        inputs=(source,),
        fit=replace(
            _statistics(problem, optimum, result, of, correction),
            log_evidence=None if evidence is None else evidence + correction.of_evidence,
        ),
        facts=Deferred(lambda: _facts(problem, optimum, result, sample, kinds)),
        warnings=(*result.warnings, *_warnings(stream, source), said),
        points=result.points.iloc[:0],
        problem=None,
        least_squares=None,
    )


def _refuse(closure: Closure, policy: str | None, estimator: Estimator) -> None:
    if not available():
        raise UsageError("Data that are not held in memory need numba: pip install 'ifrfit[scale]'.")
    if not closure.bilinear:
        raise UsageError(
            f"--closure {closure.name}: its law is not linear on either side of a transition, so that it "
            "needs the rows one by one. Take a part of the data in one file."
        )
    if policy not in (None, "known", "unknown"):
        raise UsageError(f"--noise {policy}: data that are not held in memory take known or unknown.")
    if estimator.name not in _METHODS:
        raise UsageError(
            f"--method {estimator.name}: data that are not held in memory take {' or '.join(_METHODS)}."
        )


@dataclass(frozen=True)
class _Question:
    """What is asked of the sums."""

    of: Accumulated
    closure: Closure
    parameters: tuple[Parameter, ...]
    noise: Policy
    separate_noise: bool

    def solve(self, progress: Progress | None) -> tuple[Problem, LeastSquaresFit, NDArray[np.bool_]]:
        """The problem with the impacts that it needs one by one, its optimum, and their intervals."""
        fetched = np.zeros((len(self.of.stream.series), self.of.bins), dtype=bool)
        rows: list[pd.DataFrame] = []
        for _ in range(_PASSES):
            problem = self.problem(rows, fetched)
            optimum = least_squares(problem)
            needed = self.bounds(problem) < self.value(problem, optimum) + FAR
            if not (needed & ~fetched).any():
                return problem, optimum, fetched
            # neighbours, too: the next optimum lies a little beside this one
            fetched |= needed | np.roll(needed, 1, axis=1) | np.roll(needed, -1, axis=1)
            self._refuse_many(fetched)
            rows = self._fetch(fetched, progress)
        raise DataError(
            f"{self.of.stream.path}: where the transition lies did not settle. Fit a part of the data "
            "in memory."
        )

    def _refuse_many(self, fetched: NDArray[np.bool_]) -> None:
        n = sum(
            float(self.of.sums[group, fetched[self.of.series_of(group)], N].sum())
            for group in self._oblique()
        )
        if n > _MOST_ROWS:
            raise DataError(
                f"{self.of.stream.path}: the data leave open where sliding ends, so that {n:,.0f} values "
                f"would have to be held at once ({_MOST_ROWS:,} at most). Fit a part of them, or say more by "
                "--fix, --prior or --bounds."
            )

    def _oblique(self) -> list[int]:
        return [
            group
            for group in range(len(self.of.groups))
            if OBSERVABLES[self.of.observable_of(group)].linear is not None
        ]

    def _fetch(self, fetched: NDArray[np.bool_], progress: Progress | None) -> list[pd.DataFrame]:
        """The impacts of some intervals, in the common schema."""
        found = []
        stream = self.of.stream
        for batch in stream.batches(progress):
            i = batch.incidence
            with np.errstate(invalid="ignore"):
                place = bin_of(np.hypot(i.slip_x, i.slip_y), i.cosine, self.of.bins)
            inside = fetched[batch.series, place]
            for name in stream.observables:
                if OBSERVABLES[name].linear is None:
                    continue
                at, value, sigma = batch.values[name]
                here = inside[at]
                if here.any():
                    own = at[here]
                    columns = {
                        "series": np.array(stream.series, dtype=object)[batch.series[own]],
                        "observable": np.full(own.size, name, dtype=object),
                        "gamma_deg": batch.gamma_deg[own],
                        "spin_x": i.spin_x[own],
                        "spin_y": i.spin_y[own],
                        "value": value[here],
                        "sigma": sigma[here] if self.of.weighted else np.full(own.size, np.nan),
                    }
                    found.append(make_table(columns))
        return found

    def problem(self, rows: Sequence[pd.DataFrame], fetched: NDArray[np.bool_]) -> Problem:
        """The condensed rows of all other intervals, and the impacts of these."""
        of, stream = self.of, self.of.stream
        tables, counts = list(rows), [np.ones(len(t)) for t in rows]
        scale = [self._scale_of(table) for table in rows]
        for group, known in enumerate(of.groups):
            name, series = of.observable_of(group), of.series_of(group)
            sums = of.sums[group].copy()
            if OBSERVABLES[name].linear is not None:
                sums[fetched[series]] = 0.0
            span = (known.least_gamma, known.largest_gamma)
            made = condensed_rows(sums, name, stream.inertia_factor, span)
            if not made.value.size:
                continue
            columns = {
                "series": np.full(made.value.size, stream.series[series], dtype=object),
                "observable": np.full(made.value.size, name, dtype=object),
                "gamma_deg": made.gamma_deg,
                "value": made.value,
                "sigma": made.sigma if of.weighted else np.full(made.value.size, np.nan),
                "impact_id": np.where(made.is_scatter, _SCATTER, _MEAN).astype(object),
            }
            tables.append(make_table(columns))
            scale.append(made.sigma / self._typical(group))
            counts.append(made.count)
        table = pd.concat(tables, ignore_index=True)
        table["source"] = stream.path.name
        table["provenance"] = next(iter(stream.provenances), "")
        arrays, names = Rows.of(table.assign(impact_id=""))
        noise = NoiseModel(
            self.noise,
            table["sigma"].to_numpy(dtype=float),
            separate=self.separate_noise,
            scale=np.concatenate(scale),
            counts=np.concatenate(counts),
        )
        inertia = stream.inertia_factor
        parameters = ParameterSet(self.parameters, names)
        made_of = Problem(
            arrays, self.closure, inertia, parameters, noise, Observations(table, (_source(of),))
        )
        return made_of.with_noise(noise.with_bounds(self._noise_bounds(made_of)))

    def _typical(self, group: int) -> float:
        """Root mean square of the sigma of a group; 1 where it is unknown."""
        of = self.of
        return (
            math.sqrt(of.groups[group].square_sigma / float(of.sums[group, :, N].sum()))
            if of.weighted
            else 1.0
        )

    def _scale_of(self, table: pd.DataFrame) -> Array:
        """Sigma of fetched rows over the typical one of their groups."""
        stream = self.of.stream
        if not self.of.weighted:
            return np.ones(len(table))
        series = np.array([stream.series.index(name) for name in table["series"]])
        number = np.array([stream.observables.index(name) for name in table["observable"]])
        typical = np.array([self._typical(group) for group in range(len(self.of.groups))])
        sigma = table["sigma"].to_numpy(dtype=float)
        return np.asarray(sigma / typical[series * len(stream.observables) + number])

    def _noise_bounds(self, problem: Problem) -> Mapping[str, tuple[float, float]]:
        """As `NoiseModel.bounds`, from all values."""
        found = {}
        for name in problem.noise_groups():
            parts = name.rpartition("/")
            groups = [
                known
                for group, known in enumerate(self.of.groups)
                if self.of.observable_of(group) == parts[2]
                and (not parts[0] or self.of.stream.series[self.of.series_of(group)] == parts[0])
            ]
            low = min(known.last_decimal for known in groups) / math.sqrt(12.0)
            found[name] = (low, max(1.0, *(known.largest_value for known in groups)))
        return found

    def bounds(self, problem: Problem) -> Array:
        """Least value with the transition of a series in each interval, (series, bins), see `value`."""
        of = self.of
        own = problem.parameters[self.closure.constant] if self.closure.constant else None
        domain = (0.0, 0.0) if own is None else own.ends
        law = self.closure.law(problem.inertia_factor)
        series, observables = len(of.stream.series), of.stream.observables
        least = np.zeros((series, len(observables), of.bins))
        for group in range(len(of.groups)):
            number = group % len(observables)
            if OBSERVABLES[observables[number]].linear is None:
                least[of.series_of(group), number] = least_direct(of.sums[group])
            else:
                least[of.series_of(group), number] = least_misfit(of.sums[group], law, domain)  # type: ignore[arg-type]
        together = not any(p.separate for p in self.parameters)
        found = np.empty((series, of.bins))
        for number in range(series):
            # a series whose constants are its own has its transition where it likes
            others = (
                least if together else np.broadcast_to(least.min(axis=2, keepdims=True), least.shape).copy()
            )
            others[number] = least[number]
            found[number] = self._combined(others)
        return found

    def _combined(self, least: Array) -> Array:
        """The misfit of all groups, (bins,), from that of each, (series, observables, bins)."""
        if self.noise == "known":
            return np.asarray(least.sum(axis=(0, 1)))
        counts = self.of.sums[:, :, N].sum(axis=1).reshape(least.shape[:2])
        if self.separate_noise:
            parts = [
                (least[i, k], counts[i, k]) for i in range(least.shape[0]) for k in range(least.shape[1])
            ]
        else:
            parts = list(zip(least.sum(axis=0), counts.sum(axis=0), strict=True))
        return np.asarray(sum(n * np.log(np.maximum(q, 1e-300) / n) for q, n in parts if n > 0.0))

    def value(self, problem: Problem, optimum: LeastSquaresFit) -> float:
        """chi2 of the optimum; under unknown noises the sum of n log(S/n)."""
        residual = problem.residual(optimum.optimum.theta) / problem.noise.base
        prior = problem.parameters.prior_residuals(optimum.optimum.theta)
        total = float(prior @ prior)
        if self.noise == "known":
            return total + float(residual @ residual)
        for rows in problem.noise_groups().values():
            count = problem.noise.count(rows)
            total += count * math.log(float(residual[rows] @ residual[rows]) / count)
        return total

    def gap(self, problem: Problem, optimum: LeastSquaresFit, fetched: NDArray[np.bool_]) -> float | None:
        """The gap of the optimum, once no transition elsewhere can do better."""
        beyond = self.bounds(problem)[~fetched]
        if beyond.size and float(beyond.min()) < self.value(problem, optimum):
            return None
        return optimum.optimum.gap


@dataclass(frozen=True)
class _Correction:
    """What is added to the log likelihood and to the log evidence of condensed rows to be those of all."""

    of_likelihood: float
    of_evidence: float


def _likelihood_correction(problem: Problem, optimum: LeastSquaresFit, of: Accumulated) -> _Correction:
    """Condensed rows have other norms than the measurements they stand for; their squares are the same."""
    half_log_2pi = 0.5 * math.log(2.0 * math.pi)
    noise = problem.noise
    n = noise.count(np.arange(len(problem.rows)))
    ours = float(np.log(noise.base).sum())
    if noise.is_known:
        theirs = sum(known.log_sigma for known in of.groups)
        both = ours - theirs - (n - len(problem.rows)) * half_log_2pi
        return _Correction(both, both)
    likelihood = float(np.log(noise.base).sum()) - (n - len(problem.rows)) * half_log_2pi
    for rows in problem.noise_groups().values():
        square = float(((problem.residual(optimum.optimum.theta) / noise.base)[rows] ** 2).sum())
        log_noise = 0.5 * math.log(square / noise.count(rows))
        likelihood -= (noise.count(rows) - rows.size) * log_noise
    return _Correction(likelihood, ours)


def _statistics(
    problem: Problem, optimum: LeastSquaresFit, result: FitResult, of: Accumulated, correction: _Correction
) -> FitStatistics:
    """The statistics of all measurements."""
    counts = problem.noise.counts
    assert counts is not None
    theta = optimum.optimum.theta
    n = round(float(counts.sum()))
    dof = n - round(float(optimum.gaussian.leverage.sum()))
    _, sticks = problem.impulse(*problem.per_row(theta))
    oblique = problem.rows.is_oblique
    log_l = result.fit.log_likelihood + correction.of_likelihood
    k = optimum.gaussian.rank + len(problem.noise_groups())
    chi2 = result.fit.chi2
    known = problem.noise.is_known
    residual = problem.residual(theta) / (problem.noise.scale if problem.noise.scale is not None else 1.0)
    return replace(
        result.fit,
        n=n,
        n_sticking=round(float(counts[oblique & sticks].sum())),
        n_sliding=round(float(counts[oblique & ~sticks].sum())),
        dof=dof,
        reduced_chi2=chi2 / dof if known else None,
        p_value=float(chdtrc(dof, chi2)) if known else None,
        rmse=float(np.sqrt((residual**2).sum() / n)),
        log_likelihood=log_l,
        aic=2.0 * k - 2.0 * log_l,
        bic=k * math.log(n) - 2.0 * log_l,
    )


def _source(of: Accumulated) -> Source:
    stream = of.stream
    used = round(float(of.sums[:, :, N].sum()))
    skipped = {reason: count for reason, count in stream.skipped.items() if count}
    ranges = list(stream.selection.ranges)
    return Source(
        name=stream.path.name or str(stream.path),
        sha256="",
        rows=used + sum(skipped.values()),
        rows_used=used,
        rows_skipped=skipped,
        provenance=", ".join(name for name in stream.provenances if name),
        selection=f"{joined(ranges)} range" if ranges else "",
    )


def _sample(stream: ImpactStream, fit_sample: SampleFit) -> FitResult | DataError:
    """The fit of the sample, or why there is none."""
    conventions = stream.conventions
    wanted = replace(stream.selection, observable=tuple(stream.observables))
    try:
        return fit_sample(select(observe(stream.sampled(), conventions, stream.inertia_factor), wanted))
    except DataError as error:
        return error


def _lack_of_fit(problem: Problem, optimum: LeastSquaresFit, kinds: NDArray[np.object_]) -> Fact:
    """Whether the means of narrow intervals of tau follow the closure, by what values scatter about them.

    An F test, of all impacts but those about the transition, of which none is a mean.
    """
    counts = problem.noise.counts
    assert counts is not None
    z = problem.residual(optimum.optimum.theta) / optimum.sigma
    is_tangential = problem.rows.of_kind("tangential")
    means, pairs = (kinds == _MEAN) & is_tangential, (kinds == _SCATTER) & is_tangential
    # a pair stands about its mean: what it has in common is that of the mean, its difference is scatter
    places = np.flatnonzero(pairs).reshape(-1, 2)
    common, apart = z[places].sum(axis=1) / math.sqrt(2.0), np.diff(z[places], axis=1)[:, 0] / math.sqrt(2.0)
    between = float(z[means] @ z[means]) + float(common @ common)
    within = float(apart @ apart)
    dof = float(means.sum()) + common.size - optimum.gaussian.rank
    rest = float(counts[means | pairs].sum()) - means.sum() - common.size
    if dof < 1.0 or rest < 1.0 or within <= 0.0:
        says = "too few impacts away from the transition to look for lack of fit"
        return Fact(True, says, {"tested": False}, FACTS["lack_of_fit"])
    p = float(fdtrc(dof, rest, (between / dof) / (within / rest)))
    departure = math.sqrt(max(between / (within / rest) - dof, 0.0) / float(counts[means | pairs].sum()))
    figures = {"p_value": p, "dof": dof, "departure_over_noise": departure}
    if p < REFUTED:
        says = (
            f"the closure does not describe these data (p = {p:.2g}, means of narrow intervals of tau): they "
            f"depart from it by {departure:.2g} times the noise of one value. ifrfit compare on a part of "
            "the data shows which closure does"
        )
        return Fact(False, says, figures, FACTS["lack_of_fit"])
    return Fact(
        True, f"no lack of fit (p = {p:.2g}, means of narrow intervals of tau)", figures, FACTS["lack_of_fit"]
    )


def _facts(
    problem: Problem,
    optimum: LeastSquaresFit,
    result: FitResult,
    sample: FitResult | DataError,
    kinds: NDArray[np.object_],
) -> dict[str, Fact]:
    """Of the optimum those of all impacts, the others those of the sample."""
    own = {name: fact for name, fact in result.facts.items() if name in _OF_ALL and name != "predictive"}
    own["global_optimum"] = global_optimum(optimum, bilinear=True)
    own["at_bound"] = at_bound(result.constants)
    own["identifiable"] = identifiable(
        problem, optimum, result.constants, result.fit.n_sticking, result.fit.n_sliding
    )
    own["lack_of_fit"] = _lack_of_fit(problem, optimum, kinds)
    if isinstance(sample, DataError):
        return own
    looked = {
        name: replace(fact, says=f"in a sample of {len(sample.points):,} values: {fact.says}")
        for name, fact in sample.facts.items()
        if name not in own
    }
    return {
        **{k: f for k, f in looked.items() if not f.ok},
        **own,
        **{k: f for k, f in looked.items() if f.ok},
    }


def _warnings(stream: ImpactStream, source: Source) -> list[str]:
    """What was left out, with the first places."""
    said = list(stream.notes)
    for reason, places in stream.places.items():
        count = source.rows_skipped.get(reason, 0)
        first = " (the first of them)" if count > len(places) else ""
        said.append(f"{count:,} value{'s' if count > 1 else ''} left out, {reason}: {joined(places)}{first}")
    return said
