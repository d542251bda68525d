"""What all tests share: impacts made by the package's own physics, as files."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest
from factories import impacts_file
from hypothesis import settings

# at home every run looks at new examples; in CI a change is judged by the same ones each time
settings.register_profile("home", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "home")

Impacts = Callable[..., Path]


@pytest.hookimpl(tryfirst=True)  # before xdist reads the groups
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Give the tests that share a fixture to one worker, so that it is made once (--dist loadgroup).

    A fixture of a module keeps the tests of that file together, one of a session those of its folder.
    """
    for item in items:
        shared = [found[-1] for found in item._fixtureinfo.name2fixturedefs.values()]  # type: ignore[attr-defined]
        places = {fixture.scope: fixture.baseid for fixture in shared if fixture.baseid}
        group = places.get("session", places.get("module"))
        if group:
            item.add_marker(pytest.mark.xdist_group(group))


@pytest.fixture
def impacts(tmp_path: Path) -> Impacts:
    """Write impacts to a file: keyword arguments as `impacts_text`, or several dictionaries of them."""

    def write(*several: dict[str, object], name: str = "impacts.csv", **one: object) -> Path:
        return impacts_file(tmp_path / name, *(several or (one,)))

    return write
