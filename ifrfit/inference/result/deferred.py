"""Values that are worked out when somebody first asks for them: entries of a mapping, fields of a result."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields
from functools import cached_property
from typing import Any, Generic, TypeVar

from ifrfit.errors import UnknownNameError
from ifrfit.text import joined, meant

Value = TypeVar("Value")


class Deferred(Mapping[str, Value], Generic[Value]):
    """Facts of a fit: half of its time, and a loop over a thousand fits reads none of them.

    All entries are computed together, once, at the first access of any kind: the keys depend on the data.
    Copies for other processes carry the entries, not the way to them.

    Parameters
    ----------
    compute : callable
        Gives the entries.
    """

    def __init__(self, compute: Callable[[], Mapping[str, Value]]) -> None:
        self._compute = compute

    @cached_property
    def _entries(self) -> Mapping[str, Value]:
        return self._compute()

    def __getitem__(self, key: str) -> Value:
        if key not in self._entries:
            names = list(self._entries)
            raise UnknownNameError(f"There is no '{key}'. There are {joined(names)}.{meant(str(key), names)}")
        return self._entries[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    def __repr__(self) -> str:
        return repr(dict(self._entries))

    def __reduce__(self) -> tuple[Callable[[dict[str, Value]], Deferred[Value]], tuple[dict[str, Value]]]:
        return known, (dict(self._entries),)


def known(entries: Mapping[str, Value]) -> Deferred[Value]:
    """Entries that are known already, and that say of another key which there are."""
    return Deferred(lambda: entries)


class Postponed(Generic[Value]):
    """One value, computed once, when it is first asked for.

    Copies for other processes carry the value, not the way to it.

    Parameters
    ----------
    compute : callable
        Gives the value, the same whenever it is called.
    """

    def __init__(self, compute: Callable[[], Value]) -> None:
        self._compute = compute

    @cached_property
    def value(self) -> Value:
        """The value."""
        return self._compute()

    def __reduce__(self) -> tuple[Callable[[Value], Value], tuple[Value]]:
        return _itself, (self.value,)


def _itself(value: Value) -> Value:
    return value


class PostponedField:
    """Data descriptor of a field that may be given as `Postponed`: who reads it gets the value.

    Parameters
    ----------
    name : str
        Of the field.
    """

    def __init__(self, name: str) -> None:
        self._name = name

    def __get__(self, instance: Any, owner: type | None = None) -> Any:
        if instance is None:
            return self
        own = instance.__dict__[self._name]
        return own.value if isinstance(own, Postponed) else own

    def __set__(self, instance: Any, value: Any) -> None:
        instance.__dict__[self._name] = value


def replaced(of: Value, **changes: Any) -> Value:
    """As `dataclasses.replace`, without asking for what is postponed."""
    kept = {each.name: of.__dict__[each.name] for each in fields(of) if each.init}  # type: ignore[arg-type]
    return type(of)(**kept | changes)
