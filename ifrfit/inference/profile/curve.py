"""A profile followed over its whole domain: where it is low, where it bends, where it closes."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ifrfit.inference.optimize.optimum import Array

Interval = tuple[float, float]

_STEPS = (1.0, 2.0, 3.0, 4.0, 6.0)  # sd, on both sides of each optimum; then doubled
_DOUBLINGS = 60
_FEWEST, _POINTS, _MOST = 25, 60, 100  # of places: on a flat profile, on any other, altogether
_STRAIGHT = 1e-3  # bend below which a straight line shows the profile as well
_BETTER = 1e-6  # fall below the fit's optimum that is not rounding
_NARROW = 1e-4  # of the window, below which no interval is split


@dataclass(frozen=True)
class Resolution:
    """How closely a profile is looked at.

    Attributes
    ----------
    scan : int
        Places spread over the whole domain, for valleys that no optimum announced.
    crossing : float
        Share of a bracket to which the end of an interval is known.
    between : bool
        Whether the curve is followed between optima, too, where only its shape shows.
    """

    scan: int
    crossing: float
    between: bool


FINE = Resolution(16, 1e-8, between=True)
COARSE = Resolution(0, 1e-4, between=False)  # for what the Gaussian approximation leaves open


class ProfileCurve:
    """Evaluations of a profile between two ends, each kept.

    Parameters
    ----------
    function : callable
        Place to rise.
    lower, upper : float
        Domain; the upper end may be infinite.
    far : float, optional
        Place from which on the profile is level, where the domain has no end.
    resolution : Resolution
        How closely it is looked at.

    Attributes
    ----------
    unconverged : list of float
        Places at which the function ran out of rounds, for it to note.
    """

    def __init__(
        self,
        function: Callable[[float], float],
        lower: float,
        upper: float,
        far: float | None = None,
        resolution: Resolution = FINE,
    ) -> None:
        self._function = function
        self._resolution = resolution
        self.lower, self.upper = lower, upper
        self._far = far
        self._last = upper
        self._known: dict[float, float] = {}
        self._base = 0.0
        self._endless = False
        self.unconverged: list[float] = []

    def __call__(self, x: float) -> float:
        """Rise at a place."""
        if x not in self._known:
            self._known[x] = self._function(x)
        return self._known[x] - self._base

    @property
    def n_evaluations(self) -> int:
        """Places looked at so far."""
        return len(self._known)

    @property
    def stopped(self) -> str:
        """What a budget cut short, in words; nothing if all came to its end."""
        if self._endless:
            return f"it does not close up to {self._last:.0e}"
        if self.unconverged:
            return f"the noise has not settled at {len(self.unconverged)} of its {self.n_evaluations} places"
        return ""

    def best_place(self, value: float) -> float:
        """Place of the optimum: the given one, unless the profile has met a better one.

        A search, or several noises in turn, may have stopped at an optimum that is not the best; from then
        on rises are counted from the best.
        """
        from scipy.optimize import minimize_scalar

        best = min(self._known, key=lambda place: (self._known[place], place))
        if self._known[best] >= self._known.get(value, 0.0) - _BETTER:
            self._base = self._known.get(value, 0.0)
            return value
        x, _ = self.curve()
        i = int(np.searchsorted(x, best))
        ends = float(x[max(i - 1, 0)]), float(x[min(i + 1, x.size - 1)])
        minimize_scalar(self, bounds=ends, method="bounded", options={"maxiter": 20})
        best = min(self._known, key=lambda place: (self._known[place], place))
        self._base = self._known[best]
        return best

    def explore(self, optima: Sequence[float], step: float, limit: float) -> None:
        """Go out from each optimum until the profile has risen over the limit, then scan the domain."""
        inside = sorted({min(max(x, self.lower), self.upper) for x in optima if math.isfinite(x)})
        for x in inside:
            self(x)
        self._last = self.upper if math.isfinite(self.upper) else self._finite_end(inside[-1], step, limit)
        self(self.lower), self(self._last)
        for x in inside if self._resolution.between else inside[:1]:
            self._outward(x, -step, limit)
        for x in inside if self._resolution.between else inside[-1:]:
            self._outward(x, step, limit)
        for x in np.linspace(self.lower, self._last, self._resolution.scan + 2)[1:-1].tolist():
            self(x)

    def _finite_end(self, start: float, step: float, limit: float) -> float:
        if self._far is not None:
            return max(self._far, 1.05 * start)
        for _ in range(_DOUBLINGS):
            start, step = start + step, 2.0 * step
            if self(start) > limit:
                return start
        self._endless = True
        return start

    def _outward(self, x: float, step: float, limit: float) -> None:
        for i in range(_DOUBLINGS):
            reach = _STEPS[i] if i < len(_STEPS) else _STEPS[-1] * 2.0 ** (i + 1 - len(_STEPS))
            place = x + reach * step
            if not self.lower < place < self._last or self(place) > limit:
                return

    def pieces(self, limit: float) -> tuple[Interval, ...]:
        """Intervals in which the profile stays below the limit, ascending."""
        x, rise = self.curve()
        inside = rise <= limit
        edges = np.flatnonzero(np.diff(np.concatenate(([False], inside, [False])).astype(int)))
        found = []
        for first, after in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
            low = self.lower if first == 0 else self._crossing(float(x[first]), float(x[first - 1]), limit)
            high = (
                self.upper if after == x.size else self._crossing(float(x[after - 1]), float(x[after]), limit)
            )
            found.append((low, high))
        return tuple(found)

    def _crossing(self, inside: float, outside: float, limit: float) -> float:
        """Where the rise is the limit; its root is nearly straight, which needs few steps."""
        from scipy.optimize import brentq

        root = math.sqrt(limit)

        def over(x: float) -> float:
            return math.sqrt(max(self(x), 0.0)) - root

        if over(inside) == 0.0:
            return inside
        fine = self._resolution.crossing
        return float(brentq(over, inside, outside, xtol=fine * abs(outside - inside) + 1e-15, rtol=1e-13))

    def curve(self) -> tuple[Array, Array]:
        """Places looked at, ascending, and the rises there."""
        x = np.array(sorted(self._known))
        return x, np.maximum([self._known[place] - self._base for place in x.tolist()], 0.0)

    def window(self, limit: float, *, fill: bool = True) -> tuple[Array, Array]:
        """The profile over the region below the limit, with places added where it bends most."""
        x, rise = self.curve()
        low, high = float(x[rise <= limit].min()), float(x[rise <= limit].max())
        if fill:
            pieces = self.pieces(limit)
            low = max(min(a for a, _ in pieces), self.lower)
            high = min(max(b for _, b in pieces), self._last)
        while True:
            x, rise = self.curve()
            shown = (x >= low) & (x <= high)
            x, rise = x[shown], rise[shown]
            if not fill or x.size >= _POINTS or self.n_evaluations >= _MOST or x.size < 2:
                return x, rise
            width = np.diff(x)
            score = np.where(width > _NARROW * (high - low), _bends(x, rise), 0.0)
            if x.size >= _FEWEST and score.max() < _STRAIGHT:
                return x, rise
            # a little for width alone, so that no stretch stays empty
            score = score + limit / _FEWEST * (width / (high - low)) * (width > _NARROW * (high - low))
            if score.max() == 0.0:
                return x, rise
            i = int(score.argmax())
            self(float(0.5 * (x[i] + x[i + 1])))


def _bends(x: Array, rise: Array) -> Array:
    """How far each interval may lie from its chord: its width times the change of slope at its ends."""
    width = np.diff(x)
    change = np.abs(np.diff(np.diff(rise) / width))
    padded = np.concatenate(([0.0], change, [0.0]))
    return np.asarray(width * np.maximum(padded[:-1], padded[1:]))
