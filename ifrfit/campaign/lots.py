"""Lots of groups given to processes: one that dies costs its lot a second try, and other lots nothing."""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass

from ifrfit.campaign.group_fit import Row
from ifrfit.data.groups import Group
from ifrfit.inference.worker_processes import worker_processes

Work = Callable[[Sequence[Group]], list[Row]]

LOT = 25  # groups
TRIES = 3
DIED = f"the process that fitted it died {TRIES} times, as for want of memory. Fit the group by itself."


@dataclass
class _Lot:
    groups: list[Group]
    deaths: int = 0


def in_lots(
    groups: Iterable[Group], work: Work, lost: Callable[[Group], Row], workers: int
) -> Iterator[tuple[Group, Row]]:
    """Each group with its row, as they become ready.

    Parameters
    ----------
    groups : iterable of Group
    work : callable
        Gives the rows of some groups; it goes to other processes where there are several.
    lost : callable
        Gives the row of a group with which a process died each time.
    workers : int
        Processes; one is this process itself.

    Raises
    ------
    UsageError
        Processes cannot start.
    """
    lots = _batched(groups)
    if workers == 1:
        for lot in lots:
            yield from zip(lot.groups, work(lot.groups), strict=True)
        return
    retries: deque[_Lot] = deque()
    has_worked, breaks = False, 0
    while True:
        with worker_processes(workers) as pool:
            running: dict[Future[list[Row]], _Lot] = {}
            try:
                while _submit(pool, work, running, retries, lots, 2 * workers):
                    for future in wait(running, return_when=FIRST_COMPLETED).done:
                        rows = future.result()
                        has_worked = True
                        yield from zip(running.pop(future).groups, rows, strict=True)
                return
            except BrokenProcessPool:
                breaks += 1
                if not has_worked and breaks >= TRIES:
                    raise
        for lot in running.values():
            lot.deaths += 1
            if lot.deaths < TRIES:
                retries.append(lot)
            elif len(lot.groups) > 1:
                retries.extend(_Lot([group]) for group in lot.groups)
            else:
                yield lot.groups[0], lost(lot.groups[0])


def _batched(groups: Iterable[Group]) -> Iterator[_Lot]:
    source = iter(groups)
    while part := list(itertools.islice(source, LOT)):
        yield _Lot(part)


def _submit(
    pool: Executor,
    work: Work,
    running: dict[Future[list[Row]], _Lot],
    retries: deque[_Lot],
    pending: Iterator[_Lot],
    most: int,
) -> bool:
    """Keep the processes busy; False when nothing is left to wait for.

    A lot that was there when a process died runs alone: the next death tells whose it is.
    """
    while len(running) < most:
        suspect = bool(retries)
        if suspect and running:
            break
        lot = retries.popleft() if suspect else next(pending, None)
        if lot is None:
            break
        try:
            running[pool.submit(work, lot.groups)] = lot
        except BrokenProcessPool:
            (retries.appendleft if suspect else retries.append)(lot)
            raise
        if suspect:
            break
    return bool(running)
