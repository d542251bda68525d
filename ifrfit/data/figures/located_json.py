"""Values of a JSON text that know where in the file they stand, so that each refusal can say it."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeVar

from ifrfit.data.cell_table import show
from ifrfit.errors import DataError

LARGEST_JSON = 16 * 2**20  # bytes; project files with thousands of points take a tenth of one MB
T = TypeVar("T")
_REMEDY = "Save the project anew."
_KINDS = {dict: "an object", list: "a list", str: "text", bool: "true or false", type(None): "null"}


@dataclass(frozen=True)
class Located:
    """A value and its place.

    Attributes
    ----------
    value : object
        As `json` reads it.
    file : str
    place : str
        As ``axesColl[0].calibrationPoints``; empty for the whole.
    """

    value: object
    file: str
    place: str = ""

    @property
    def at(self) -> str:
        """File and place, for a message."""
        return f"{self.file}, {self.place}" if self.place else self.file

    def has(self, key: str) -> bool:
        """Whether an object has something under a key."""
        return isinstance(self.value, dict) and self.value.get(key) is not None

    def __getitem__(self, key: str) -> Located:
        """What an object has under a key."""
        found = self._expected(dict)
        place = f"{self.place}.{key}" if self.place else key
        if found.get(key) is None:
            raise DataError(f"{self.at}: has no {key}. {_REMEDY}")
        return Located(found[key], self.file, place)

    def items(self) -> Iterator[Located]:
        """The entries of a list."""
        for number, each in enumerate(self._expected(list)):
            yield Located(each, self.file, f"{self.place}[{number}]")

    def text(self) -> str:
        """A text, without control characters."""
        found = str(self._expected(str))
        return "".join(letter if letter.isprintable() else " " for letter in found).strip()

    def flag(self) -> bool:
        """True or false."""
        return bool(self._expected(bool))

    def number(self) -> float:
        """A finite number.

        Raises
        ------
        DataError
            For anything else.
        """
        if isinstance(self.value, bool) or not isinstance(self.value, int | float):
            raise DataError(f"{self.at}: is {self._shown()}, not a number. {_REMEDY}")
        try:
            found = float(self.value)
        except OverflowError:
            found = math.inf
        if not math.isfinite(found):
            raise DataError(f"{self.at}: is not a finite number. {_REMEDY}")
        return found

    def _expected(self, kind: type[T]) -> T:
        if not isinstance(self.value, kind):
            raise DataError(f"{self.at}: is {self._shown()}, not {_KINDS[kind]}. {_REMEDY}")
        return self.value

    def _shown(self) -> str:
        if isinstance(self.value, str):
            return show(self.value)
        return _KINDS.get(type(self.value), "a number")


def read_json(raw: bytes, file: str) -> Located:
    """The whole of a JSON text.

    Raises
    ------
    DataError
        It is too large, nested too deeply, or no JSON; the text says the line.
    """
    if len(raw) > LARGEST_JSON:
        raise DataError(
            f"{file}: {len(raw) / 2**20:.0f} MB of JSON are more than any project of points takes, the most "
            f"is {LARGEST_JSON // 2**20} MB. Export the points as CSV."
        )
    try:
        return Located(json.loads(raw.decode("utf-8-sig"), parse_constant=_refuse_constant), file)
    except json.JSONDecodeError as error:
        raise DataError(
            f"{file}, line {error.lineno}, character {error.colno}: no JSON from here on, or cut short. "
            f"{_REMEDY}"
        ) from None
    except RecursionError:
        raise DataError(f"{file}: is nested more deeply than any project file. {_REMEDY}") from None
    except ValueError as error:  # no UTF-8, NaN, or a whole number of thousands of digits
        raise DataError(f"{file}: no JSON ({str(error)[:80]}). {_REMEDY}") from None


def _refuse_constant(name: str) -> None:
    raise ValueError(f"{name} is no number of JSON")
