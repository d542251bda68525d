"""Work on groups that takes its process with it: as a process that the system kills."""

from __future__ import annotations

import os
import signal
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ifrfit.data.groups import Group


def row_of(group: Group) -> dict[str, Any]:
    """A row without a fit."""
    return {"key": group.key}


def dying_once(flag: Path, victim: str, groups: Sequence[Group]) -> list[dict[str, Any]]:
    """Rows of groups; the first process that meets the victim dies."""
    for group in groups:
        if group.key[0] == victim and not flag.exists():
            flag.touch()
            os.kill(os.getpid(), signal.SIGKILL)
    return [row_of(group) for group in groups]


def dying_always(victim: str, groups: Sequence[Group]) -> list[dict[str, Any]]:
    """Rows of groups; every process that meets the victim dies."""
    if any(group.key[0] == victim for group in groups):
        os.kill(os.getpid(), signal.SIGKILL)
    return [row_of(group) for group in groups]
