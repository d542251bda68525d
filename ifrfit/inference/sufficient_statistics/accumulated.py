"""One pass over a stream of impacts: their sums, and what else of their values a fit needs to know."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.observations import Source
from ifrfit.data.stream import Batch, ImpactStream
from ifrfit.inference.model.noise import resolution
from ifrfit.inference.sufficient_statistics.moments import Moments, N, bin_of, middles
from ifrfit.physics.observables import OBSERVABLES
from ifrfit.text import joined

Array = NDArray[np.float64]
Index = NDArray[np.intp]

BINS = 2048  # intervals of tau, unless there are very many rows


@dataclass
class GroupNotes:
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
    groups: list[GroupNotes] = field(default_factory=list)

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
        self.groups += [GroupNotes() for _ in range(groups - len(self.groups))]

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


def source_of(of: Accumulated) -> Source:
    """Where the impacts come from, with how many were left out and why."""
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
