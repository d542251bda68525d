"""docs/architecture.md names what is there: fields of types, stations of a value, files and folders."""

from __future__ import annotations

import re
import sys
from dataclasses import fields, is_dataclass
from functools import reduce
from importlib import import_module
from pathlib import Path
from types import FrameType, FunctionType

import numpy as np
import pytest
from factories import table_file

import ifrfit
from ifrfit.inference.io.write_result import to_dict

ROOT = Path(__file__).resolve().parent.parent
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
TYPES = dict(re.findall(r"^### `([\w.]+)`\n(.*?)(?=^##)", PAGE, re.MULTILINE | re.DOTALL))
STATIONS = re.findall(r"^\| \d+ \| `([\w.]+)` \|", PAGE, re.MULTILINE)
OF_THE_PAGE = 2  # stations at the end that belong to the report, not to the fit


def found_at(name: str) -> object:
    """The class or function of a dotted name."""
    parts = name.split(".")
    modules = [part for part in parts if part.islower()]
    while True:
        try:
            module = import_module(".".join(modules))
        except ModuleNotFoundError:
            modules.pop()
        else:
            return reduce(getattr, parts[len(modules) :], module)


@pytest.mark.parametrize("name", TYPES)
def test_the_types_have_these_fields(name: str) -> None:
    found = found_at(name)
    assert isinstance(found, type)
    if is_dataclass(found):
        there = [each.name for each in fields(found)]
    else:
        there = [each for each in vars(found) if not each.startswith("_")]
    assert re.findall(r"^- `(\w+)`: \S", TYPES[name], re.MULTILINE) == there


def test_the_central_types_are_all_there() -> None:
    names = {name.rpartition(".")[2] for name in TYPES}
    assert names >= {
        "Observations",
        "ParameterSet",
        "Problem",
        "LeastSquaresFit",
        "Distribution",
        "FitResult",
    }


def test_a_value_passes_every_station(tmp_path: Path) -> None:
    """A fit to a table calls each of them up to result.json; those of the page are functions."""
    assert len(STATIONS) <= 25
    gamma = np.linspace(5.0, 85.0, 14)
    beta = ifrfit.rebound(gamma, e_n=0.94, e_t=-0.8, mu=0.12, degrees=True).beta
    beta = beta + 0.03 * np.random.default_rng(1).standard_normal(gamma.size)
    path = table_file(tmp_path / "impacts.csv", {"gamma_deg": gamma, "beta": beta, "sigma_beta": 0.03})
    codes = {}
    for name in STATIONS:
        found = found_at(name)
        function = getattr(found, "__func__", getattr(found, "fget", found))
        assert isinstance(function, FunctionType), name
        codes[function.__code__] = name
    called = set()

    def record(frame: FrameType, event: str, _: object) -> None:
        if event == "call" and frame.f_code in codes:
            called.add(codes[frame.f_code])

    before = sys.getprofile()
    sys.setprofile(record)
    try:
        content = to_dict(ifrfit.fit(path, fix={"e_n": 0.94}))
    finally:
        sys.setprofile(before)
    assert content["points"]["gamma_deg"] == pytest.approx(gamma)
    assert [name for name in STATIONS if name not in called] == STATIONS[-OF_THE_PAGE:]


def test_the_files_and_folders_exist() -> None:
    named = re.findall(r"`((?:ifrfit/|tests/|datasets)[\w./]*)`", PAGE)
    assert len(named) > 30
    assert [name for name in named if not (ROOT / name).exists()] == []
    links = re.findall(r"\]\(([^)#]+)\)", PAGE)
    assert [link for link in links if not (ROOT / "docs" / link).exists()] == []
