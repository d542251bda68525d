"""A mapping whose values are worked out when somebody first asks for one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from typing import Generic, TypeVar

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
        return self._entries[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    def __repr__(self) -> str:
        return repr(dict(self._entries))

    def __reduce__(self) -> tuple[type[dict[str, Value]], tuple[dict[str, Value]]]:
        return dict, (dict(self._entries),)
