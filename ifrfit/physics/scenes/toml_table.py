"""A table of a scene file and its numbers; every message names the file, the key and what to do."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from ifrfit.errors import DataError
from ifrfit.physics.angles import Array
from ifrfit.physics.units import names, to_si

Kind = Literal["value", "grid", "normal", "uniform", "lognormal"]
RANDOM: tuple[Kind, ...] = ("normal", "uniform", "lognormal")
_FORMS = "a number, a list of numbers, { from, to, count }, { mean, sd }, { low, high } or { median, gsd }"
_MOST = 100_000
_LARGEST = 1e300
_WIDEST = 10.0  # sd over the possible range: beyond it nearly every draw would be thrown away


@dataclass(frozen=True)
class Quantity:
    """One number of a scene, in SI units (angles in degrees).

    Attributes
    ----------
    kind : str
    numbers : tuple of float
        value: itself; grid: its values; normal: mean, sd; uniform: low, high; lognormal: median, geometric
        standard deviation.
    low, high : float
        What is possible: distributions are cut there.
    """

    kind: Kind
    numbers: tuple[float, ...]
    low: float
    high: float

    @classmethod
    def of(cls, value: float) -> Quantity:
        """One value without bounds."""
        return cls("value", (value,), -np.inf, np.inf)

    @property
    def random(self) -> bool:
        """Whether it is drawn."""
        return self.kind in RANDOM

    @property
    def grid(self) -> Array:
        """The values of a grid; one value for everything else (nan where it is drawn)."""
        if self.random:
            return np.array([np.nan])
        return np.array(self.numbers)

    def draw(self, n: int, rng: np.random.Generator) -> Array:
        """Independent draws of a distribution, cut at its bounds by drawing again.

        Parameters
        ----------
        n : int
        rng : numpy.random.Generator

        Returns
        -------
        ndarray, shape (n,)
        """
        found = self._uncut(n, rng)
        while True:
            outside = np.flatnonzero((found < self.low) | (found > self.high))
            if not outside.size:
                return found
            found[outside] = self._uncut(outside.size, rng)

    def _uncut(self, n: int, rng: np.random.Generator) -> Array:
        first, second = self.numbers
        if self.kind == "uniform":
            return rng.uniform(first, second, n)
        if self.kind == "lognormal":
            return np.asarray(first * second ** rng.standard_normal(n))
        return rng.normal(first, second, n)


class Table:
    """One table of the file and the keys of it that were asked for."""

    def __init__(self, content: Mapping[str, Any], path: str, file: str) -> None:
        self.content = content
        self.path = path
        self.file = file
        self._known: set[str] = set()

    def at(self, key: str) -> str:
        """File and full name of a key."""
        return f"{self.file}: {self.path}.{key}" if self.path else f"{self.file}: {key}"

    def has(self, base: str, dimension: str = "number") -> bool:
        """Whether the number is there, in any of its units."""
        return any(name in self.content for name in names(base, dimension))

    def table(self, key: str) -> Table:
        """A table in this one; empty if it is not there."""
        self._known.add(key)
        inner = self.content.get(key, {})
        if not isinstance(inner, dict):
            raise DataError(f"{self.at(key)} must be a table: write [{key}] above its numbers.")
        return Table(inner, f"{self.path}.{key}" if self.path else key, self.file)

    def raw(self, key: str) -> Any:
        """Whatever is there; None if nothing is."""
        self._known.add(key)
        return self.content.get(key)

    def text(self, key: str, default: str = "") -> str:
        """A piece of text."""
        value = self.raw(key)
        if value is None:
            return default
        if not isinstance(value, str) or not value.strip():
            raise DataError(f'{self.at(key)} must be text, as {key} = "...".')
        return value

    def texts(self, key: str) -> tuple[str, ...] | None:
        """A list of text; None if it is not there."""
        value = self.raw(key)
        if value is None:
            return None
        if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
            raise DataError(f'{self.at(key)} must be a list of names, as {key} = ["...", "..."].')
        return tuple(value)

    def number(
        self, base: str, dimension: str = "number", *, low: float = -math.inf, high: float = math.inf
    ) -> float | None:
        """One number in SI units; None if it is not there."""
        quantity = self.quantity(base, dimension, low=low, high=high)
        if quantity is None:
            return None
        if quantity.kind != "value":
            raise DataError(f"{self.at(self._name(base, dimension) or base)} must be one number.")
        return quantity.numbers[0]

    def quantity(
        self, base: str, dimension: str = "number", *, low: float = -math.inf, high: float = math.inf
    ) -> Quantity | None:
        """A number, grid or distribution in SI units; None if it is not there.

        Parameters
        ----------
        base : str
            Name without unit.
        dimension : str
            Of `ifrfit.physics.units.UNITS`.
        low, high : float
            What is possible, in SI units; included.
        """
        name = self._name(base, dimension)
        if name is None:
            return None
        value = self.content[name]
        kind, numbers = self._form(name, value)
        converted = [to_si(number, name, base, dimension) for number in numbers]
        if kind == "lognormal":
            converted[1] = numbers[1]  # a ratio
        return self._within(name, Quantity(kind, tuple(converted), low, high), numbers)  # type: ignore[arg-type]

    def done(self) -> None:
        """Refuse keys that nobody asked for."""
        for key in self.content:
            if key not in self._known:
                raise DataError(f"{self.at(key)} is not known{_hint(key, self._known)}.")

    def _name(self, base: str, dimension: str) -> str | None:
        possible = names(base, dimension)
        self._known.update(possible)
        there = [name for name in possible if name in self.content]
        if len(there) > 1:
            raise DataError(f"{self.at(there[0])} and {there[1]} give the same twice. Remove one.")
        if not there and base in self.content:
            raise DataError(f"{self.at(base)} has no unit. Call it {', '.join(possible)}.")
        return there[0] if there else None

    def _form(self, name: str, value: Any) -> tuple[str, tuple[float, ...]]:
        if isinstance(value, list):
            if not value:
                raise DataError(f"{self.at(name)} is an empty list. Give {_FORMS}.")
            return "grid", tuple(self._float(name, item) for item in value)
        if not isinstance(value, dict):
            return "value", (self._float(name, value),)
        forms = {
            ("from", "to", "count"): "grid",
            ("mean", "sd"): "normal",
            ("low", "high"): "uniform",
            ("median", "gsd"): "lognormal",
        }
        for keys, kind in forms.items():
            if set(value) == set(keys):
                numbers = tuple(self._float(name, value[key]) for key in keys)
                return kind, self._range(name, numbers) if kind == "grid" else numbers
        raise DataError(f"{self.at(name)} is none of the forms known. Give {_FORMS}.")

    def _range(self, name: str, numbers: tuple[float, ...]) -> tuple[float, ...]:
        first, last, count = numbers
        if count != int(count) or not 2 <= count <= _MOST or not first < last:
            raise DataError(
                f"{self.at(name)}: a range runs upwards in a whole count of 2 or more, as "
                "{ from = 5, to = 85, count = 17 }."
            )
        steps = int(count) - 1
        return (*(first + (last - first) * i / steps for i in range(steps)), last)

    def _float(self, name: str, value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise DataError(f"{self.at(name)}: {value!r} is not a number. Give {_FORMS}.")
        if abs(value) > _LARGEST:  # also integers that no float can hold, and infinity
            raise DataError(f"{self.at(name)}: {str(value)[:20]} is too large. Give {_FORMS}.")
        if math.isnan(value):
            raise DataError(f"{self.at(name)}: nan is not a number. Give {_FORMS}.")
        return float(value)

    def _within(self, name: str, quantity: Quantity, given: tuple[float, ...]) -> Quantity:
        first, *rest = quantity.numbers
        low, high = quantity.low, quantity.high
        if quantity.kind == "normal" and not rest[0] > 0.0:
            raise DataError(f"{self.at(name)}: sd = {given[1]:g} must be positive.")
        if quantity.kind == "normal" and rest[0] > _WIDEST * (high - low):
            raise DataError(
                f"{self.at(name)}: sd = {given[1]:g} is far wider than what is possible{_span(low, high)}. "
                "Give { low, high } instead."
            )
        if quantity.kind == "lognormal" and not (first > 0.0 and 1.0 < rest[0] <= 100.0):
            raise DataError(f"{self.at(name)}: median must be positive and gsd between 1 and 100.")
        if quantity.kind == "uniform" and not first < rest[0]:
            raise DataError(f"{self.at(name)}: low = {given[0]:g} must lie below high = {given[1]:g}.")
        checked = quantity.numbers if quantity.kind not in ("normal", "lognormal") else (first,)
        for value, written in zip(checked, given, strict=False):
            if not low <= value <= high:
                raise DataError(f"{self.at(name)}: {written:g} is impossible{_span(low, high)}. Correct it.")
        return quantity


def _span(low: float, high: float) -> str:
    if math.isinf(low) and math.isinf(high):
        return ""
    if math.isinf(high):
        return f" (at least {low:g} in SI units)"
    return f" ({low:g} to {high:g} in SI units)"


def _hint(key: str, known: Iterable[str]) -> str:
    near = difflib.get_close_matches(key, sorted(known), n=1)
    return f"; the closest is {near[0]}" if near else f". Known are {', '.join(sorted(known))}"
