"""Values of a JSON file that know their key, so that whatever is wrong can be named."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NoReturn

import numpy as np

from ifrfit.errors import DataError

REMEDY = "Fit the data again to get a whole file."
_WORDS: dict[type, str] = {
    dict: "an object",
    list: "a list",
    str: "text",
    bool: "true or false",
    int: "a whole number",
    float: "a number",
}


class Node:
    """A value in the file that knows its key."""

    def __init__(self, value: Any, path: str, file: str) -> None:
        self.value = value
        self.path = path
        self.file = file

    def __getitem__(self, key: str) -> Node:
        self.check(dict)
        path = f"{self.path}.{key}" if self.path else key
        if key not in self.value:
            raise DataError(f"{self.file}: the key '{path}' is missing. {REMEDY}")
        return Node(self.value[key], path, self.file)

    def __contains__(self, key: str) -> bool:
        """Whether an object has this key."""
        self.check(dict)
        return key in self.value

    def check(self, kind: type, what: str = "") -> None:
        """Refuse a value of another kind."""
        number = kind in (int, float)
        fits = isinstance(self.value, (int, float) if kind is float else kind)
        if not fits or (number and isinstance(self.value, bool)):
            self.fail(_WORDS[kind], what)

    def fail(self, expected: str, what: str = "") -> NoReturn:
        """Refuse the value and say what it must be."""
        what = what or f"the key '{self.path}'"
        raise DataError(f"{self.file}: {what} must be {expected}. {REMEDY}")

    def text(self) -> str:
        """A text."""
        self.check(str)
        return str(self.value)

    def whole(self) -> int:
        """A whole number."""
        self.check(int)
        return int(self.value)

    def number(self, null: float | None = None) -> float:
        """A number; `null` is what null stands for, where it may be."""
        if self.value is None and null is not None:
            return null
        self.check(float)
        try:
            return float(self.value)
        except OverflowError:  # a whole number of more digits than a float can hold
            self.fail("a number below 1e308")

    def maybe(self) -> float | None:
        """A number or null."""
        return None if self.value is None else self.number()

    def each(self, read: Callable[[Node], Any]) -> list[Any]:
        """Read every item of a list."""
        self.check(list)
        return [read(Node(item, f"{self.path}[{i}]", self.file)) for i, item in enumerate(self.value)]

    def mapped(self, read: Callable[[Node], Any]) -> dict[str, Any]:
        """Read every value of an object."""
        self.check(dict)
        return {key: read(self[key]) for key in self.value}

    def array(self, length: int, null: float = math.nan) -> Any:
        """A read-only vector of `length` numbers; `null` is what null stands for."""
        numbers = np.array(self.each(lambda node: node.number(null)), dtype=float)
        if len(numbers) != length:
            self.fail(f"a list of {length} numbers")
        numbers.flags.writeable = False
        return numbers

    def finite(self) -> Any:
        """A vector of any length, all of it finite numbers."""
        self.check(list)
        if not set(map(type, self.value)) <= {int, float}:
            self.each(lambda node: node.number())
        try:
            numbers = np.array(self.value, dtype=float)
        except OverflowError:
            numbers = np.full(1, math.inf)
        if not np.isfinite(numbers).all():
            self.fail("a list of finite numbers")
        return numbers

    def square(self, length: int) -> Any:
        """A read-only matrix, `length` rows of as many numbers."""
        rows = self.each(lambda node: node.array(length))
        if len(rows) != length:
            self.fail(f"a list of {length} lists")
        matrix = np.array(rows, dtype=float).reshape(length, length)
        matrix.flags.writeable = False
        return matrix
