"""The problem of all impacts: condensed rows, and the impacts of the intervals a transition may lie in."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ifrfit.data.observations import Observations, make_table
from ifrfit.errors import DataError
from ifrfit.inference.model.noise import NoiseModel, Policy
from ifrfit.inference.model.parameters import Parameter, ParameterSet
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Rows
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, least_squares
from ifrfit.inference.sufficient_statistics.accumulated import Accumulated, source_of
from ifrfit.inference.sufficient_statistics.condensed_rows import condensed_rows
from ifrfit.inference.sufficient_statistics.moments import N, bin_of
from ifrfit.inference.sufficient_statistics.transition_bounds import least_direct, least_misfit
from ifrfit.physics.closure import Closure
from ifrfit.physics.observables import OBSERVABLES

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Progress = Callable[[int, int], None]

FAR = 80.0  # of minus twice the log likelihood above the best: less mass than exp(-40) lies there
_MOST_ROWS = 2_000_000  # that are fetched
_PASSES = 4
MEAN, SCATTER = "mean of an interval", "scatter within intervals"  # what condensed rows are


@dataclass(frozen=True)
class Question:
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
                "impact_id": np.where(made.is_scatter, SCATTER, MEAN).astype(object),
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
            arrays, self.closure, inertia, parameters, noise, Observations(table, (source_of(of),))
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
