"""The machine that times are measured on: enough to judge them, nothing that tells whose it is."""

from __future__ import annotations

import os
import platform
from dataclasses import dataclass


@dataclass(frozen=True)
class Machine:
    """What times depend on.

    Attributes
    ----------
    cores : int
    architecture, system : str
        As x86_64, Linux.
    """

    cores: int
    architecture: str
    system: str

    @classmethod
    def this(cls) -> Machine:
        """The one that this runs on."""
        return cls(os.cpu_count() or 1, platform.machine(), platform.system())

    @property
    def words(self) -> str:
        """In a few words."""
        return f"{self.cores} core{'s' if self.cores > 1 else ''} ({self.architecture}, {self.system})"
