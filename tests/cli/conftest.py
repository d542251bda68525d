"""The command line, run in this process or in one of its own, far from the user's folders."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from command_line import Outcome, in_this_process


@pytest.fixture(autouse=True)
def apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Work in an empty folder, with 80 columns and without the user's own datasets."""
    work = tmp_path / "work"
    work.mkdir()
    monkeypatch.chdir(work)
    monkeypatch.setenv("IFRFIT_DATA_DIR", str(tmp_path / "own"))
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.delenv("IFRFIT_DEBUG", raising=False)


@pytest.fixture
def cli() -> Callable[..., Outcome]:
    """Run a command in this process."""
    return in_this_process


@pytest.fixture
def python() -> Callable[..., Outcome]:
    """Run an interpreter of its own."""

    def run(*arguments: object, **environment: str) -> Outcome:
        return subprocess.run(
            [sys.executable, *map(str, arguments)],
            capture_output=True,
            text=True,
            encoding="utf-8",
            check=False,
            env={**os.environ, "PYTHONIOENCODING": "utf-8", **environment},
        )

    return run
