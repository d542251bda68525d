"""What all tests share: impacts made by the package's own physics, as files."""

from __future__ import annotations

import gc
import os
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest
from browser_here import PROMISED, lacking
from factories import impacts_file, small_report
from hypothesis import settings

# at home every run looks at new examples; in CI a change is judged by the same ones each time
settings.register_profile("home", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "home")

Impacts = Callable[..., Path]


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Deselect the tests that open a page in a browser where there is none."""
    if lacking() and not PROMISED:
        left_out = [item for item in items if "browser" in getattr(item, "fixturenames", ())]
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if item not in left_out]


def pytest_collection_finish() -> None:
    """Spare the collector what stays to the end: modules, and a few thousand tests."""
    gc.collect()
    gc.freeze()


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say so at the end."""
    if lacking() and not PROMISED:
        terminalreporter.write_line(f"Pages were opened in no browser: {lacking()}.", yellow=True)


@pytest.fixture
def brief_costs(monkeypatch: pytest.MonkeyPatch) -> None:
    """``--quick`` costs by one short run of each method, law and precision, where errors do not matter."""
    from ifrfit.cost import physics_costs
    from ifrfit.cost.inference_costs import Extent

    brief = Extent(tolerances=(1e-1, 1e-3), replicates=(100,), steps=(50,), seeds=1, repeats=1, longest=0.7)
    monkeypatch.setattr("ifrfit.cost.measure.QUICK", brief)
    monkeypatch.setattr(physics_costs, "QUICK", physics_costs.Extent((50, 200), (10,), 1000, 1, 0.0))
    monkeypatch.setattr("ifrfit.cost.arithmetic_costs.QUICK_IMPACTS", 10)


@pytest.fixture
def blank_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Files of figures with nothing in them, where only their names matter; the figures are made."""
    monkeypatch.setattr("ifrfit.report.style.save_figure", lambda _, path: path.write_bytes(b"blank"))


@pytest.fixture
def small_page(monkeypatch: pytest.MonkeyPatch, blank_pictures: None) -> None:
    """Reports of one paragraph and nothing appraised, where only the files of a result matter."""
    from ifrfit.inference.appraisal import Appraisal

    nothing = Appraisal(pd.DataFrame(), {})
    monkeypatch.setattr("ifrfit.inference.appraise.appraise", lambda _: nothing)
    monkeypatch.setattr("ifrfit.report.page.writing.assemble", lambda *_: small_report())


@pytest.fixture
def impacts(tmp_path: Path) -> Impacts:
    """Write impacts to a file: keyword arguments as `impacts_text`, or several dictionaries of them."""

    def write(*several: dict[str, object], name: str = "impacts.csv", **one: object) -> Path:
        return impacts_file(tmp_path / name, *(several or (one,)))

    return write
