"""Tables written as text and read."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import ifrfit.data as data
from ifrfit.data import Observations


@pytest.fixture
def read(tmp_path: Path) -> Callable[..., Observations]:
    """Observations of a text or of bytes, as a file of this name; options as of `ifrfit.read`."""

    def read(text: str | bytes, *convention: str, name: str = "x.csv", **options: Any) -> Observations:
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return data.read(path, **{"convention": convention} | options)

    return read
