"""What the README shows is what the package does."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import ifrfit

README = (Path(__file__).resolve().parent.parent / "README.md").read_text(encoding="utf-8")


def test_the_fit_that_is_shown_is_the_fit_that_is_made():
    found = ifrfit.fit("kharaz-2001", prior={"e_n": (0.98, 0.01)}, gamma_min=15)
    shown = re.search(r"    closure IFR.*?(?=\n`--out`)", README, re.DOTALL)
    assert shown is not None
    lines = [line[4:].rstrip() for line in shown.group().rstrip().splitlines()]
    made = "\n".join(line.rstrip() for line in found.summary().splitlines())
    assert "\n".join(lines) in made


def test_the_library_example_runs(impacts, tmp_path, monkeypatch):
    impacts(gamma=np.linspace(5, 85, 30), noise=0.03, sigma=0.03)  # writes impacts.csv
    monkeypatch.chdir(tmp_path)
    example = re.search(r"```python\n(.*?)```", README, re.DOTALL)
    assert example is not None
    names: dict[str, object] = {}
    exec(example.group(1), names)
    assert (tmp_path / "result.json").exists()
    assert names["fit"].constants["e_t"].status in ("determined", "one_sided")


def test_every_file_that_is_linked_exists():
    root = Path(__file__).resolve().parent.parent
    links = re.findall(r"\]\(([^)#]+)\)", README)
    assert links
    for link in links:
        assert (root / link).exists(), link


@pytest.mark.parametrize(
    "name", ["rebound", "fit", "read", "load_dataset", "load_result", "lmfit_model", "simulate"]
)
def test_the_public_names_are_there(name):
    assert callable(getattr(ifrfit, name))
    assert name in dir(ifrfit)
