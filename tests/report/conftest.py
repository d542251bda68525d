from __future__ import annotations

from types import ModuleType

import built_results
import pytest


@pytest.fixture
def made() -> ModuleType:
    """The results built by hand in built_results.py."""
    return built_results
