"""Ctrl-C, and the signal by which a batch system ends a job: work stops alike, and what was found is kept."""

from __future__ import annotations

import signal
from types import FrameType

_received: list[int] = []


def heed_termination() -> None:
    """Let SIGTERM interrupt what goes on as Ctrl-C does, unless the process was told to ignore it."""
    if signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
        signal.signal(signal.SIGTERM, _interrupt)


def _interrupt(number: int, frame: FrameType | None) -> None:
    _received.append(number)
    raise KeyboardInterrupt


def status_of_interrupt() -> int:
    """Exit status of a command that was interrupted: 128 and the number of the signal, as shells have it."""
    return 128 + (_received[-1] if _received else signal.SIGINT)
