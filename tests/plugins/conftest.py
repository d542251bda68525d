from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from command_line import in_this_process

sys.path.insert(0, str(Path(__file__).parent))

from extensions.closure import GRIP
from extensions.effect import Brake
from extensions.error_law import Logistic
from extensions.exporter import ARCADE
from extensions.format import FORMAT
from extensions.method import Mode
from extensions.observable import SPIN_GAINED
from extensions.section import SECTION
from toys import BEND, HALF_DROP, LOCK, TILT

from ifrfit.registry import registered


@pytest.fixture(scope="module")  # not for the session: tests elsewhere register the same examples
def toys() -> Iterator[None]:
    """Everything that is made up, registered for as long as these tests run."""
    with registered(
        GRIP, BEND, LOCK, SPIN_GAINED, TILT, HALF_DROP, Brake(), Logistic(), Mode(), SECTION, FORMAT, ARCADE
    ):
        yield


@pytest.fixture(scope="session")
def cli() -> Callable[..., str]:
    """A command in this process that must succeed; its output."""

    def run(*arguments: object) -> str:
        found = in_this_process(*arguments)
        assert found.returncode == 0, found.stderr
        return found.stdout

    return run
