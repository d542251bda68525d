"""Frozen dataclasses as plain values for JSON, and back by their type hints.

An object of the file has a key for each field of the dataclass, in the order of the fields. Metadata of a
field change this:

- ``key``: name in the file, where it is not that of the field;
- ``optional``: left out where the value is None, empty, or its default;
- ``internal``: never written, and read as its default.

nan and infinity, which JSON does not know, are written as null. A type hint ``Annotated[..., Null(...)]``
says what null stands for in it, so that it can be read back.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence, Sized
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass
from functools import cache
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, NoReturn, Union, get_args, get_origin, get_type_hints

import numpy as np

from ifrfit.errors import DataError

REMEDY = "Fit the data again to get a whole file."
OPTIONAL = {"optional": True}
INTERNAL = {"internal": True}


@dataclass(frozen=True)
class Null:
    """Mark of numbers that a file may hold as null.

    Attributes
    ----------
    values : tuple of float
        What null stands for in each of two numbers, or one value for all.
    """

    values: tuple[float, ...]


@dataclass(frozen=True)
class Shape:
    """Mark of an array: along each of its axes it has an entry for each item of another field.

    Attributes
    ----------
    axes : tuple of str
        Keys of these fields beside the array.
    """

    axes: tuple[str, ...]


@dataclass
class Nulls:
    """What had to be written as null.

    Attributes
    ----------
    open_ends : bool
        Whether there were infinite numbers where infinity means that there is no bound.
    values : list of str
        All others: the key of each, and what it was.
    """

    open_ends: bool = False
    values: list[str] = field(default_factory=list)

    def number(self, value: float, path: str, bound: bool) -> float | None:
        """A finite number, or None, of which a note is kept."""
        if math.isfinite(value):
            return value
        if bound:
            self.open_ends = True
        else:
            self.values.append(f"{path} ({'not a number' if math.isnan(value) else 'infinite'})")
        return None


@cache
def layout(kind: type) -> tuple[tuple[Field[Any], str, Any], ...]:
    """Fields of a dataclass that stand in a file, each with its key and its type hint."""
    hints = get_type_hints(kind, include_extras=True)
    return tuple(
        (each, each.metadata.get("key", each.name), hints[each.name])
        for each in fields(kind)
        if "internal" not in each.metadata
    )


def to_plain(value: Any, nulls: Nulls | None = None, path: str = "", *, bound: bool = False) -> Any:
    """A value as JSON knows it.

    Parameters
    ----------
    value
        Dataclass, mapping, sequence, set (sorted), array or scalar, nested as they come; anything else as
        its text.
    nulls : Nulls, optional
        Takes note of the numbers that are written as null.
    path : str
        Key of the value in the file, for these notes.
    bound : bool
        Whether numbers are bounds: floats, infinite where there is no bound.

    Returns
    -------
    str, int, float, bool, None, list or dict
    """
    nulls = Nulls() if nulls is None else nulls
    if isinstance(value, float) or (bound and type(value) is int):  # nearly all there is: asked first
        return nulls.number(float(value), path, bound)
    if value is None or isinstance(value, (str, int)):
        return value
    if is_dataclass(value) and not isinstance(value, type):
        content = {}
        for each, key, hint in layout(type(value)):
            item = getattr(value, each.name)
            empty = item is None or (isinstance(item, Sized) and len(item) == 0)
            if "optional" not in each.metadata or not (empty or item == each.default):
                content[key] = to_plain(item, nulls, _joined(path, key), bound=_is_bound(hint))
        return content
    if isinstance(value, Mapping):
        return {
            str(key): to_plain(item, nulls, _joined(path, key), bound=bound) for key, item in value.items()
        }
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, (list, tuple, set, frozenset)):
        items = sorted(value, key=str) if isinstance(value, (set, frozenset)) else value
        return [to_plain(item, nulls, f"{path}[{i}]", bound=bound) for i, item in enumerate(items)]
    if isinstance(value, np.generic):
        return to_plain(value.item(), nulls, path, bound=bound)
    return str(value)


def _joined(path: str, key: object) -> str:
    return f"{path}.{key}" if path else str(key)


@cache
def _is_bound(hint: Any) -> bool:
    """Whether null in it stands for infinity."""
    if isinstance(hint, Null):
        return any(map(math.isinf, hint.values))
    return any(map(_is_bound, get_args(hint)))


class Node:
    """A value of a JSON file that knows its key, so that whatever is wrong can be named."""

    def __init__(self, value: Any, path: str, file: str) -> None:
        self.value = value
        self.path = path
        self.file = file

    def __getitem__(self, key: str) -> Node:
        self.check(dict)
        path = _joined(self.path, key)
        if key not in self.value:
            raise DataError(f"{self.file}: the key '{path}' is missing. {REMEDY}")
        return Node(self.value[key], path, self.file)

    def check(self, kind: type, what: str = "") -> None:
        """Refuse a value of another kind."""
        fits = isinstance(self.value, (int, float) if kind is float else kind)
        if not fits or (kind in (int, float) and isinstance(self.value, bool)):
            self.fail(_WORDS[kind], what)

    def fail(self, expected: str, what: str = "") -> NoReturn:
        """Refuse the value and say what it must be."""
        what = what or f"the key '{self.path}'"
        raise DataError(f"{self.file}: {what} must be {expected}. {REMEDY}")

    def scalar(self, kind: type) -> Any:
        """A value of this kind: str, bool or int."""
        self.check(kind)
        return self.value

    def number(self, null: float | None = None) -> float:
        """A number; `null` is what null stands for, where it may be."""
        if self.value is None and null is not None:
            return null
        self.check(float)
        try:
            return float(self.value)
        except OverflowError:  # a whole number of more digits than a float can hold
            self.fail("a number below 1e308")

    def each(self, read: Callable[[Node], Any]) -> list[Any]:
        """Read every item of a list."""
        self.check(list)
        return [read(Node(item, f"{self.path}[{i}]", self.file)) for i, item in enumerate(self.value)]

    def array(self, shape: tuple[int, ...], null: float = math.nan) -> Any:
        """A read-only array of this shape; `null` is what null stands for."""
        last = len(shape) == 1
        items = self.each(lambda item: item.number(null) if last else item.array(shape[1:], null))
        if len(items) != shape[0]:
            self.fail(f"a list of {shape[0]} {'numbers' if last else 'lists'}")
        numbers = np.array(items, dtype=float).reshape(shape)
        numbers.flags.writeable = False
        return numbers


_WORDS: dict[type, str] = {
    dict: "an object",
    list: "a list",
    str: "text",
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    NoneType: "null",
}
_LISTS = (tuple, Sequence)


def from_plain(hint: Any, node: Node, beside: Node | None = None) -> Any:
    """Read a value by its type hint.

    Parameters
    ----------
    hint
        Dataclass, mapping of str, tuple or sequence, Literal, union, str, bool, int, float, None or Any;
        ``Annotated`` with `Null` or `Shape`.
    node : Node
    beside : Node, optional
        The object that `node` stands in, for a `Shape`.

    Returns
    -------
    Any
        A value of that type.

    Raises
    ------
    DataError
        If something is missing or of the wrong kind; the file and the key are named.
    """
    kind, args = get_origin(hint), get_args(hint)
    if hint in (Any, object):
        return node.value
    if kind is Annotated:
        return _numbers(args[0], args[1:], node, beside)
    if kind is Literal:
        return node.value if node.value in args else node.fail(f"one of {', '.join(args)}")
    if kind in (Union, UnionType):
        return from_plain(_member(args, node), node)
    if kind is Mapping:
        node.check(dict)
        return {key: from_plain(args[1], node[key]) for key in node.value}
    if kind in _LISTS:
        return tuple(node.each(lambda item: from_plain(args[0], item)))
    if is_dataclass(hint):
        owner: Any = hint
        return owner(**from_fields(owner, node))
    return node.number() if hint is float else node.scalar(hint)


def from_fields(kind: Any, node: Node) -> dict[str, Any]:
    """The fields of a dataclass that stand in an object, by name; see `from_plain`."""
    node.check(dict)
    values = {}
    for each, key, hint in layout(kind):
        required = each.default is MISSING and each.default_factory is MISSING
        if required or key in node.value:
            values[each.name] = from_plain(hint, node[key], node)
    return values


def _numbers(kind: Any, marks: tuple[Null | Shape, ...], node: Node, beside: Node | None) -> Any:
    """A number, two numbers or an array, any of which may be null."""
    values = next((mark.values for mark in marks if isinstance(mark, Null)), (math.nan,))
    shape = next((mark.axes for mark in marks if isinstance(mark, Shape)), None)
    if shape is not None and beside is not None:
        return node.array(tuple(len(beside[axis].value) for axis in shape), values[0])
    if kind is float:
        return node.number(values[0])
    node.check(list)
    if len(node.value) != 2:
        node.fail("a list of two numbers or null")
    null = iter(values)
    return tuple(node.each(lambda end: end.number(next(null))))


def _member(kinds: tuple[Any, ...], node: Node) -> Any:
    """Which type of a union a value has; of two kinds of objects, that of objects alone is a mapping."""
    value = node.value
    if value is None and NoneType in kinds:
        return NoneType
    lists = [kind for kind in kinds if get_origin(kind) in _LISTS]
    if isinstance(value, list) and lists:
        return lists[0]
    others = [kind for kind in kinds if kind is not NoneType and kind not in lists] or lists
    if len(others) == 1:
        return others[0]
    node.check(dict)
    is_mapping = all(isinstance(item, (dict, list, NoneType)) for item in value.values())
    return next(kind for kind in others if (get_origin(kind) is Mapping) == is_mapping)
