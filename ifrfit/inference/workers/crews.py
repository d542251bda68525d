"""Who does long work: processes of this machine, or the workers of a Dask scheduler."""

from __future__ import annotations

import contextlib
import logging
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import partial
from multiprocessing import active_children
from multiprocessing.process import BaseProcess
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from ifrfit._version import __version__
from ifrfit.errors import UsageError
from ifrfit.inference.option_fields import check_form
from ifrfit.inference.workers.worker_processes import (
    FITS,
    a_process_died,
    could_not_start,
    end_at_once,
    import_once,
    register,
    registered_here,
    start_processes,
)

if TYPE_CHECKING:
    from distributed import Client

T = TypeVar("T")
R = TypeVar("R")

TRIES = 3
_ANSWERS_WITHIN = 15  # seconds
_WORKERS_WITHIN = 60
_WITHOUT_WORKERS = 60.0  # seconds without any, after which nobody is waited for
_LOOK_EVERY = 2.0  # seconds
_LEAST_AT_ONCE = 8  # given to a cluster, to which workers may come at any time


class CrewDiedError(Exception):
    """A process died, and took what all of its crew had in hand."""


class LotDiedError(Exception):
    """The processes that had a lot in hand died each time."""


class Crew(Protocol):
    """Processes that take work."""

    @property
    def size(self) -> int:
        """How much they can do at once."""

    def submit(self, work: Callable[[Sequence[T]], R], items: Sequence[T]) -> Future[R]:
        """Give work; CrewDiedError where nobody is there to take it."""

    def let_go(self) -> None:
        """There is no further work: processes end meanwhile, and are started anew where there is."""

    def first_done(self, given: Collection[Future[R]]) -> Collection[Future[R]]:
        """Wait until some of what was given is done.

        Raises
        ------
        UsageError
            Nobody is left who could do it.
        """

    def result(self, future: Future[R]) -> R:
        """What came of it.

        Raises
        ------
        CrewDiedError, LotDiedError
        UsageError
            The crew is lost.
        """


@dataclass
class Processes:
    """Processes of this machine; after a death all of them are started anew.

    Attributes
    ----------
    size : int
    module : str
        What each imports before there is work, beginning at once.
    """

    size: int
    module: str = FITS
    _pool: ProcessPoolExecutor | None = None
    _first: Future[int] | None = None  # does nothing, and shows that a process lives
    _has_started: bool = False
    _deaths: int = 0
    _others: Sequence[BaseProcess] = ()

    def __post_init__(self) -> None:
        if not import_once(self.module):
            self._started()

    def _started(self) -> ProcessPoolExecutor:
        if self._pool is None:
            self._others = active_children()
            self._pool = start_processes(self.size, self.module)
            with contextlib.suppress(BrokenProcessPool):
                self._first = self._pool.submit(int)
        return self._pool

    def submit(self, work: Callable[[Sequence[T]], R], items: Sequence[T]) -> Future[R]:
        """See `Crew`."""
        pool = self._started()
        try:
            return pool.submit(work, items)
        except (BrokenProcessPool, OSError, EOFError):  # the latter where it breaks while another starts
            raise self._died() from None

    def let_go(self) -> None:
        """See `Crew`."""
        if self._pool is not None:
            self._pool.shutdown(wait=False, cancel_futures=True)
            self._pool = None

    def first_done(self, given: Collection[Future[R]]) -> Collection[Future[R]]:
        """See `Crew`; a process that dies is started anew."""
        while not (done := wait(given, timeout=_LOOK_EVERY, return_when=FIRST_COMPLETED).done):
            # the thread of the pool waits for the rest of an answer of one that died within it, without end
            if self._pool is not None and a_process_died(self._pool):
                end_at_once(self._pool, self._others)
        return done

    def result(self, future: Future[R]) -> R:
        """See `Crew`."""
        try:
            return future.result()
        except BrokenProcessPool:
            raise self._died() from None

    def _died(self) -> Exception:
        # one that was started while the others were ended would be waited for without end
        if self._pool is not None:
            end_at_once(self._pool, self._others)
        self.close()
        self._deaths += 1
        first = self._first
        if first is not None and first.done() and not first.cancelled():
            self._has_started |= first.exception() is None
        if not self._has_started and self._deaths >= TRIES:
            return could_not_start(self.size)
        return CrewDiedError()

    def end_at_once(self) -> None:
        """End the processes, whatever they are at."""
        if self._pool is not None:
            end_at_once(self._pool, self._others)

    def close(self) -> None:
        """Let the processes end."""
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)
            self._pool = None


class Cluster:
    """Workers of a Dask scheduler, which gives the work of a worker that dies to another.

    Parameters
    ----------
    address : str
        As ``tcp://host:8786``.

    Raises
    ------
    UsageError
        Nobody answers, there is no worker, or a worker has another version of ifrfit.
    """

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client
        except ImportError:
            raise UsageError(
                f"--scheduler {address}: Dask is missing. pip install 'ifrfit[scale]'."
            ) from None
        self._address = address
        self._added = registered_here(f"--scheduler {address}")
        try:
            self._client: Client = Client(address, timeout=_ANSWERS_WITHIN, set_as_default=False)
        except (OSError, ValueError) as error:
            reason = str(error).splitlines()[0] if str(error) else "no answer"
            raise UsageError(
                f"--scheduler {address}: no scheduler answers there ({reason:.120}). Start one by 'dask "
                "scheduler', and give the address that it prints."
            ) from None
        # what it writes of a lost connection is said here in a sentence
        self._log = logging.getLogger("distributed.client")
        self._level = self._log.level
        self._log.setLevel(logging.CRITICAL + 1)
        try:
            self._meet()
            self._executor: Executor = self._client.get_executor(pure=False)
        except BaseException:
            self.close()
            raise

    def _meet(self) -> None:
        """Wait for a worker, and see that all have this version."""
        try:
            self._client.wait_for_workers(1, timeout=_WORKERS_WITHIN)
        except TimeoutError:
            raise UsageError(
                f"--scheduler {self._address}: it has no workers. Start some by 'dask worker "
                f"{self._address} --nthreads 1', where ifrfit is installed."
            ) from None
        try:
            versions = self._client.run(_version)
        except (ImportError, AttributeError, OSError) as error:
            raise UsageError(
                f"--scheduler {self._address}: a worker cannot import ifrfit {__version__} ({error}). "
                "Install it there."
            ) from None
        self._size: int = max(_LEAST_AT_ONCE, sum(self._client.nthreads().values()))
        other = {version for version in versions.values() if version != __version__}
        if other:
            raise UsageError(
                f"--scheduler {self._address}: a worker has ifrfit {min(other)}, this is "
                f"{__version__}. Install the same version there."
            )

    @property
    def size(self) -> int:
        """Threads of the workers that were there at first; more may have come."""
        return self._size

    def submit(self, work: Callable[[Sequence[T]], R], items: Sequence[T]) -> Future[R]:
        """See `Crew`."""
        with self._lost_is_said():
            return self._executor.submit(partial(_knowing, self._added, work), items)

    def let_go(self) -> None:
        """See `Crew`: they are somebody else's."""

    def first_done(self, given: Collection[Future[R]]) -> Collection[Future[R]]:
        """See `Crew`: a scheduler without workers waits for some without end."""
        missed: float | None = None
        while not (done := wait(given, _LOOK_EVERY, FIRST_COMPLETED).done):
            with self._lost_is_said():
                has_workers = bool(self._client.nthreads())
            now = time.monotonic()
            missed = None if has_workers else now if missed is None else missed
            if missed is not None and now - missed >= _WITHOUT_WORKERS:
                raise UsageError(
                    f"--scheduler {self._address}: for {_WITHOUT_WORKERS:g} seconds it has had no workers. "
                    "Start some, and run the same command: it goes on with what was found before, if --out "
                    "was given."
                )
        return done

    def result(self, future: Future[R]) -> R:
        """See `Crew`."""
        from distributed.scheduler import KilledWorker

        with self._lost_is_said():
            try:
                return future.result()
            except KilledWorker:
                raise LotDiedError from None

    @contextlib.contextmanager
    def _lost_is_said(self) -> Iterator[None]:
        from distributed.client import FutureCancelledError
        from distributed.comm.core import CommClosedError

        try:
            yield
        except (CancelledError, FutureCancelledError, CommClosedError, RuntimeError) as error:
            if isinstance(error, RuntimeError) and self._client.status == "running":
                raise
            raise UsageError(
                f"--scheduler {self._address}: the scheduler is gone. Start it and its workers anew, and "
                "run the same command: it goes on with what was found before, if --out was given."
            ) from None

    def close(self) -> None:
        """Leave the scheduler."""
        with contextlib.suppress(OSError, TimeoutError):
            self._client.close(timeout=5)
        self._log.setLevel(self._level)


@contextlib.contextmanager
def crew_of(workers: int, scheduler: str | None, module: str = FITS) -> Iterator[Crew | None]:
    """Those who do the work; None is this process itself.

    Parameters
    ----------
    workers : int
    scheduler : str or None
    module : str
        That processes of this machine import while this one gets ready.

    Raises
    ------
    UsageError
        For numbers that make no sense, and a scheduler beside processes.
    """
    check_form("--workers", "integer", workers)
    if scheduler is not None:
        check_form("--scheduler", "text", scheduler)
    if workers < 1:
        raise UsageError(f"--workers {workers}: it must be 1 or more.")
    if scheduler is not None and workers > 1:
        raise UsageError(f"--workers {workers} beside --scheduler {scheduler}: leave one out.")
    if scheduler is None and workers == 1:
        yield None
        return
    crew: Processes | Cluster = Processes(workers, module) if scheduler is None else Cluster(scheduler)
    try:
        yield crew
    except BaseException:  # nothing that they are at is waited for
        if isinstance(crew, Processes):
            crew.end_at_once()
        raise
    finally:
        crew.close()


def _version() -> str:
    return __version__


def _knowing(added: list[tuple[str, str]], work: Callable[[Sequence[Any]], R], items: Sequence[Any]) -> R:
    """The work, where what was registered for it is known."""
    register(added)
    return work(items)
