"""Lots of items given to a crew: a process that dies costs its lot a second try, and other lots nothing."""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from typing import Generic, TypeVar

from ifrfit.inference.workers.crews import TRIES, Crew, CrewDiedError, LotDiedError

T = TypeVar("T")
R = TypeVar("R")


@dataclass
class _Lot(Generic[T]):
    items: list[T]
    deaths: int = 0


def in_lots(
    items: Iterable[T],
    work: Callable[[Sequence[T]], list[R]],
    lost: Callable[[T], R],
    crew: Crew | None,
    size: int,
) -> Iterator[tuple[T, R]]:
    """Each item with what came of it, as they become ready.

    Parameters
    ----------
    items : iterable
    work : callable
        Gives the results of some items; it goes to other processes where there are any.
    lost : callable
        Gives the result of an item with which a process died each time.
    crew : Crew or None
        None: this process itself.
    size : int
        Items of a lot.

    Raises
    ------
    UsageError
        Processes cannot start, or are lost for good.
    """
    lots = _batched(items, size)
    if crew is None:
        for lot in lots:
            yield from zip(lot.items, work(lot.items), strict=True)
        return
    retries: deque[_Lot[T]] = deque()
    running: dict[Future[list[R]], _Lot[T]] = {}
    while True:
        try:
            while _submit(crew, work, running, retries, lots):
                for future in crew.first_done(running):
                    try:
                        found = crew.result(future)
                    except LotDiedError:
                        running[future].deaths = TRIES - 1
                        yield from _after_death(running.pop(future), retries, lost)
                    else:
                        yield from zip(running.pop(future).items, found, strict=True)
            return
        except CrewDiedError:
            for lot in running.values():
                yield from _after_death(lot, retries, lost)
            running.clear()


def _after_death(lot: _Lot[T], retries: deque[_Lot[T]], lost: Callable[[T], R]) -> Iterator[tuple[T, R]]:
    """A lot whose process died is tried some times more, then item by item, then lost."""
    lot.deaths += 1
    if lot.deaths < TRIES:
        retries.append(lot)
    elif len(lot.items) > 1:
        retries.extend(_Lot([item]) for item in lot.items)
    else:
        yield lot.items[0], lost(lot.items[0])


def _batched(items: Iterable[T], size: int) -> Iterator[_Lot[T]]:
    source = iter(items)
    while part := list(itertools.islice(source, size)):
        yield _Lot(part)


def _submit(
    crew: Crew,
    work: Callable[[Sequence[T]], list[R]],
    running: dict[Future[list[R]], _Lot[T]],
    retries: deque[_Lot[T]],
    pending: Iterator[_Lot[T]],
) -> bool:
    """Keep the processes busy; False when nothing is left to wait for.

    A lot that was there when a process died runs alone: the next death tells whose it is.
    """
    while len(running) < 2 * crew.size:
        suspect = bool(retries)
        if suspect and running:
            break
        lot = retries.popleft() if suspect else next(pending, None)
        if lot is None:
            break
        try:
            running[crew.submit(work, lot.items)] = lot
        except CrewDiedError:
            (retries.appendleft if suspect else retries.append)(lot)
            raise
        if suspect:
            break
    return bool(running)


def in_order(
    items: Sequence[T], work: Callable[[Sequence[T]], list[R]], lost: Callable[[T], R], crew: Crew | None
) -> Iterator[R]:
    """What comes of each item, in the order of the items; the arguments are those of `in_lots`."""
    ready: dict[int, R] = {}
    following = 0
    numbered = in_lots(enumerate(items), partial(_unnumbered, work), partial(_lost, lost), crew, 1)
    for (number, _), found in numbered:
        ready[number] = found
        while following in ready:
            yield ready.pop(following)
            following += 1


def _unnumbered(work: Callable[[Sequence[T]], list[R]], items: Sequence[tuple[int, T]]) -> list[R]:
    return work([item for _, item in items])


def _lost(lost: Callable[[T], R], item: tuple[int, T]) -> R:
    return lost(item[1])
