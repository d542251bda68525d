from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from factories import exchanged

SCENE = """\
[sphere]
diameter_mm = 5
material = "soda-lime-glass"

[wall]
material = "soda-lime-glass"

[impact]
gamma_deg = [10, 30, 50]
speed_m_s = 2

[constants]
e_n = 0.95
e_t = -0.95
mu = 0.1
"""


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., Path]:
    """Write a scene: the plain one with lines exchanged, or a text of its own."""

    def save(*exchanges: tuple[str, str], text: str = SCENE, name: str = "scene.toml") -> Path:
        path = tmp_path / name
        path.write_text(exchanged(text, *exchanges), encoding="utf-8")
        return path

    return save
