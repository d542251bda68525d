from __future__ import annotations

import csv
import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

TEXT = ("regime", "tag", "note")


@pytest.fixture(scope="session")
def oracle() -> ModuleType:
    """The independent impulse balance of oracle.py."""
    spec = importlib.util.spec_from_file_location("impact_oracle", Path(__file__).with_name("oracle.py"))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def impacts() -> dict[str, NDArray[Any]]:
    """Columns of tests/reference/impacts.csv; numbers as float, the rest as text."""
    path = Path(__file__).parents[1] / "reference" / "impacts.csv"
    with path.open(encoding="utf-8", newline="") as handle:
        rows = list(csv.DictReader(handle))
    return {
        name: np.array([row[name] for row in rows], dtype=object if name in TEXT else float)
        for name in rows[0]
    }
