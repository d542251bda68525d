"""A profile followed over its whole domain: where it is low, where it bends, where it closes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
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
_DOUBLED = 10  # steps, each twice the last, that are looked at together where the domain has no end
_SPLIT = 8  # intervals of a window that are split together
_ROOT_STEPS = 60


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
COARSE = Resolution(0, 1e-7, between=False)  # for what the Gaussian approximation leaves open


class ProfileCurve:
    """Evaluations of a profile between two ends, each kept.

    Parameters
    ----------
    function : callable
        Places to rises, (n,) to (n,); several cost little more than one, so they are looked at together.
    lower, upper : float
        Domain; the upper end may be infinite.
    far : float, optional
        Place from which on the profile is level, where the domain has no end.
    resolution : Resolution
        How closely it is looked at.
    unconverged : sequence of float
        Places at which the function ran out of rounds; it notes them as it goes.
    """

    def __init__(
        self,
        function: Callable[[Array], Array],
        lower: float,
        upper: float,
        far: float | None = None,
        resolution: Resolution = FINE,
        unconverged: Sequence[float] = (),
    ) -> None:
        self._function = function
        self._pieces: dict[float, tuple[Interval, ...]] = {}
        self._resolution = resolution
        self.lower, self.upper = lower, upper
        self._far = far
        self._last = upper
        self._known: dict[float, float] = {}
        self._base = 0.0
        self._endless = False
        self._unconverged = unconverged

    def __call__(self, x: float) -> float:
        """Rise at a place."""
        self._look([x])
        return self._known[x] - self._base

    def _look(self, places: Iterable[float]) -> None:
        """Look at several places together."""
        new = sorted({x for x in places if x not in self._known})
        if new:
            self._known.update(zip(new, self._function(np.array(new)).tolist(), strict=True))

    @property
    def n_evaluations(self) -> int:
        """Places looked at so far."""
        return len(self._known)

    @property
    def stopped(self) -> str:
        """What a budget cut short, in words; nothing if all came to its end."""
        if self._endless:
            return f"it does not close up to {self._last:.0e}"
        if self._unconverged:
            open_ones = f"{len(self._unconverged)} of its {self.n_evaluations} places"
            return f"the search has not settled at {open_ones}"
        return ""

    def best_place(self, value: float) -> float:
        """Place of the optimum: the given one, unless the profile has met a better one.

        A search may have stopped at an optimum that is not the best; from then
        on rises are counted from the best.
        """
        best = min(self._known, key=lambda place: (self._known[place], place))
        if self._known[best] >= self._known.get(value, 0.0) - _BETTER:
            self._base = self._known.get(value, 0.0)
            return value
        from scipy.optimize import minimize_scalar  # 0.2 s, and hardly any profile meets a better optimum

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
        if math.isinf(self.upper) and self._far is not None:
            self._last = max(self._far, 1.05 * inside[-1])
        self._look(self._places_of(inside, step))
        if math.isinf(self._last):
            self._last = self._doubled_end(inside[-1], step, limit)
        self(self.lower), self(self._last)
        for x in inside if self._resolution.between else inside[:1]:
            self._outward(x, -step, limit)
        for x in inside if self._resolution.between else inside[-1:]:
            self._outward(x, step, limit)
        self._look(np.linspace(self.lower, self._last, self._resolution.scan + 2)[1:-1].tolist())

    def _places_of(self, inside: Sequence[float], step: float) -> list[float]:
        """Places that an exploration is likely to look at."""
        steps = [x + sign * i * step for x in inside for sign in (-1.0, 1.0) for i in _STEPS]
        if math.isinf(self._last):
            steps += [inside[-1] + (2.0**i - 1.0) * step for i in range(_DOUBLED)]
            over_all = [self.lower]
        else:
            over_all = np.linspace(self.lower, self._last, self._resolution.scan + 2).tolist()
        return [*inside, *over_all, *(x for x in steps if self.lower < x < self._last)]

    def _doubled_end(self, start: float, step: float, limit: float) -> float:
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

    def cross(self, limits: Iterable[float]) -> None:
        """Find the pieces below several limits together."""
        brackets = {limit: self._brackets(limit) for limit in limits}
        every = [(*pair, limit) for limit, found in brackets.items() for pair in found if pair[0] != pair[1]]
        ends = dict(zip(every, self._crossings(every), strict=True))
        for limit, found in brackets.items():
            each = [ends.get((*pair, limit), pair[0]) for pair in found]
            self._pieces[limit] = tuple(zip(each[::2], each[1::2], strict=True))

    def pieces(self, limit: float) -> tuple[Interval, ...]:
        """Intervals in which the profile stays below the limit, ascending."""
        if limit not in self._pieces:
            self.cross([limit])
        return self._pieces[limit]

    def _brackets(self, limit: float) -> list[tuple[float, float]]:
        """A place inside and one outside at each end of each piece below the limit; the same at a bound."""
        x, rise = self.curve()
        inside = rise <= limit
        edges = np.flatnonzero(np.diff(np.concatenate(([False], inside, [False])).astype(int)))
        found = []
        for first, after in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
            found.append((self.lower,) * 2 if first == 0 else (float(x[first]), float(x[first - 1])))
            found.append((self.upper,) * 2 if after == x.size else (float(x[after - 1]), float(x[after])))
        return found

    def _crossings(self, brackets: Sequence[tuple[float, float, float]]) -> list[float]:
        """Where the rise is the limit, between a place inside and one outside, for several of them.

        The method of Chandrupatla (1997), Adv. Eng. Softw. 28, 145, on all brackets together.
        """
        if not brackets:
            return []
        inside, outside, limits = np.array(brackets).T
        root = np.sqrt(limits)

        def over(x: Array) -> Array:
            self._look(x.tolist())
            return np.asarray(np.sqrt(np.maximum([self(place) for place in x.tolist()], 0.0)) - root)

        tolerance = 0.5 * (self._resolution.crossing * np.abs(outside - inside) + 1e-15)
        x1, x2, f1, f2 = inside, outside, over(inside), over(outside)
        best = np.where(np.abs(f1) < np.abs(f2), x1, x2)
        with np.errstate(all="ignore"):
            share = np.nan_to_num(f1 / (f1 - f2), nan=0.5)
            for _ in range(_ROOT_STEPS):
                least = tolerance / np.abs(x2 - x1)
                active = (least < 0.5) & (np.minimum(np.abs(f1), np.abs(f2)) > 0.0)
                if not active.any():
                    break
                x = np.where(active, x1 + np.clip(share, least, 1.0 - least) * (x2 - x1), x1)
                f = over(x)
                same = np.sign(f) == np.sign(f1)
                x3, f3 = np.where(same, x1, x2), np.where(same, f1, f2)
                x2, f2 = np.where(same, x2, x1), np.where(same, f2, f1)
                x1, f1 = x, f
                best = np.where(active, np.where(np.abs(f1) < np.abs(f2), x1, x2), best)
                xi, phi = (x1 - x2) / (x3 - x2), (f1 - f2) / (f3 - f2)
                share = f1 / (f2 - f1) * f3 / (f2 - f3)
                share += (x3 - x1) / (x2 - x1) * f1 / (f3 - f1) * f2 / (f3 - f2)
                smooth = (phi * phi < xi) & ((1.0 - phi) ** 2 < 1.0 - xi)
                share = np.where(smooth & np.isfinite(share), share, 0.5)
        return [float(x) for x in best]

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
            worst = np.argsort(-score, kind="stable")[:_SPLIT]
            self._look((0.5 * (x[worst] + x[worst + 1])[score[worst] > 0.0]).tolist())


def _bends(x: Array, rise: Array) -> Array:
    """How far each interval may lie from its chord: its width times the change of slope at its ends."""
    width = np.diff(x)
    change = np.abs(np.diff(np.diff(rise) / width))
    padded = np.concatenate(([0.0], change, [0.0]))
    return np.asarray(width * np.maximum(padded[:-1], padded[1:]))
