"""Figures written as bytes and read."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import ifrfit


@pytest.fixture
def figure(tmp_path: Path) -> Callable[..., ifrfit.Observations]:
    """Observations of a file of these bytes."""

    def read(raw: bytes, name: str = "figure2", **given: Any) -> ifrfit.Observations:
        path = tmp_path / name
        path.write_bytes(raw)
        return ifrfit.read_figure(path, **{"x": "gamma_deg", "y": "beta"} | given)

    return read
