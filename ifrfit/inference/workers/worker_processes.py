"""Processes of their own for long computations, which know what was plugged in here."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Collection, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from importlib import import_module
from multiprocessing import active_children, get_context, parent_process
from multiprocessing.process import BaseProcess

from ifrfit.errors import UsageError
from ifrfit.inference.model.error_law import ERROR_LAWS
from ifrfit.physics.closures import CLOSURES
from ifrfit.physics.observables import OBSERVABLES

# a problem names its closure, observables and law of errors: each process looks them up
_NEEDED = (CLOSURES, OBSERVABLES, ERROR_LAWS)
FITS = "ifrfit.inference.fit"  # what every process needs, a second of imports


@contextmanager
def worker_processes(workers: int) -> Iterator[Executor]:
    """Start processes in which everything is registered that is registered here.

    None is forked from this one, whatever the platform's default: it would inherit the threads of numerical
    libraries.

    Raises
    ------
    UsageError
        If they cannot start, or an entry that was registered here cannot be imported there.
    """
    others = active_children()
    pool = start_processes(workers)
    try:
        yield pool
    except BrokenProcessPool:
        raise could_not_start(workers) from None
    except (KeyboardInterrupt, GeneratorExit):
        end_at_once(pool, others)
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def start_processes(workers: int, module: str = FITS) -> ProcessPoolExecutor:
    """As `worker_processes`, for who looks after the death of a process himself.

    Parameters
    ----------
    workers : int
    module : str
        What each imports before there is work.
    """
    added = registered_here(f"--workers {workers}")
    if import_once(module):
        with suppress(OSError, EOFError):  # it was killed, or what it is asked through has been removed
            return _pool(workers, "forkserver", added, module)
    return _pool(workers, "spawn", added, module)


def _pool(workers: int, how: str, added: list[tuple[str, str]], module: str) -> ProcessPoolExecutor:
    others = active_children()
    pool = ProcessPoolExecutor(workers, get_context(how), initializer=_begin, initargs=(added, module))
    try:
        # a process that were first started when work comes could start while another one dies, and Python
        # 3.11's pool would print that it cannot count its processes meanwhile
        with interrupts_deferred(), suppress(BrokenProcessPool):
            for _ in range(workers):
                pool.submit(int)
    except (OSError, EOFError):
        end_at_once(pool, others)
        raise
    return pool


def import_once(module: str) -> bool:
    """Let a fresh process import a module, from which those of `start_processes` are forked.

    Returns
    -------
    bool
        False where each has to import it by itself: elsewhere than on Linux, where libraries of the system
        may not bear it, and where there is no place for its socket.
    """
    if sys.platform != "linux":
        return False
    from multiprocessing import forkserver, resource_tracker  # which are not everywhere

    get_context("forkserver").set_forkserver_preload([module])
    resource_tracker.ensure_running()  # which would let interrupts in again
    try:
        with interrupts_deferred():
            forkserver.ensure_running()
    except OSError:
        return False
    return True


@contextmanager
def interrupts_deferred() -> Iterator[None]:
    """Let an interrupt (Ctrl-C) wait until the end of this, and never reach processes that start meanwhile.

    A terminal sends it to all processes: those that compute leave it to the one that started them, which
    ends them. On Windows nothing is held.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def a_process_died(pool: Executor) -> bool:
    """Whether a process of the pool has ended, which none does by itself."""
    processes: dict[int, BaseProcess] = getattr(pool, "_processes", None) or {}
    return not all(process.is_alive() for process in list(processes.values()))


def end_at_once(pool: Executor, others: Collection[BaseProcess]) -> None:
    """End the processes that this one started, whatever they are at, but for some others."""
    for child in active_children():
        if child not in others:
            child.kill()
    # one that ended in the middle of an answer leaves the thread that reads it waiting for the rest, as long
    # as there is somebody to write it: this process holds an end of that pipe, too
    answers = getattr(getattr(pool, "_result_queue", None), "_writer", None)
    if answers is not None:
        answers.close()


def could_not_start(workers: int) -> UsageError:
    """What is said where no process lives."""
    return UsageError(
        f"--workers {workers}: the processes could not start. In a script of your own put the call "
        'under if __name__ == "__main__":, or take one worker.'
    )


def registered_here(option: str) -> list[tuple[str, str]]:
    """Module and name of what was plugged in here.

    Raises
    ------
    UsageError
        With the option that asked for other processes, where these cannot import an entry.
    """
    return [_place(registry.kind, entry, option) for registry in _NEEDED for entry in registry.added]


def _place(kind: str, entry: object, option: str) -> tuple[str, str]:
    """Module and name of an entry, or of its class where that makes the same entry without arguments."""
    owner = type(entry)
    for module_name, module in tuple(sys.modules.items()):
        # the main module of a notebook is no file, which another process could run
        if module_name != "__main__" or hasattr(module, "__file__"):
            for name, value in tuple(vars(module).items()):
                if value is entry or (value is owner and entry == _made(owner)):
                    return module_name, name
    raise UsageError(
        f"{option}: other processes cannot import the {kind} '{entry.name}', which was registered "  # type: ignore[attr-defined]
        "here. Define it at the top level of a module, or take one worker."
    )


def _made(owner: type) -> object:
    try:
        return owner()
    except TypeError:  # it takes arguments
        return None


def _begin(added: list[tuple[str, str]], module: str) -> None:
    """What a process does first."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    import_module(module)
    register(added)


def _end_with_parent() -> None:
    """End where the process that gives the work was killed: its pipes would be waited at without end."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def register(added: list[tuple[str, str]]) -> None:
    """Register what `registered_here` told of another process, unless it is known."""
    for module, name in added:
        found = getattr(import_module(module), name)
        entry = found() if isinstance(found, type) else found
        registry = next(each for each in _NEEDED if each.accepts(entry))
        if entry.name not in registry:  # the module may have registered it itself
            registry.add(entry)
