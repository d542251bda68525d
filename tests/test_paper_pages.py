"""docs/paper.md is the table of the code, and every misprint of docs/errata.md has the test that it names."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

from ifrfit.paper.figures import PAPER

ROOT = Path(__file__).resolve().parent.parent
ERRATA = (ROOT / "docs" / "errata.md").read_text(encoding="utf-8")
PAGE = (ROOT / "docs" / "paper.md").read_text(encoding="utf-8")


def test_the_page_is_written_from_the_table():
    assert runpy.run_path(str(ROOT / "scripts" / "write_paper.py"))["page"]() == PAGE


def test_the_page_names_every_figure_and_our_own_choices():
    for figure in PAPER:
        assert f"| [{figure.name}](../figures/{figure.stem}.svg) |" in PAGE
    models = [model for figure in PAPER for model in figure.models]
    own = [model.constants["e_t"] for model in models if "our choice" in model.label]
    assert own == [-0.99, -0.96, -0.94]
    for e_t in own:
        assert f"{e_t:.2f}" in PAGE
    for angle in ("30.20°", "2.55°", "30.96°", "19.03°", "23.45°", "26.34°", "31.76°"):
        assert f" {angle}" in PAGE


def test_every_figure_that_is_linked_is_there():
    for link in re.findall(r"\]\(\.\./([^)]+)\)", PAGE):
        assert (ROOT / link).exists(), link


def test_every_test_that_the_errata_name_exists():
    there = "".join(
        path.read_text(encoding="utf-8") for path in (ROOT / "tests" / "physics").glob("test_*.py")
    )
    named = re.findall(r"`(test_\w+)`", ERRATA)
    assert len(set(named)) >= 35
    assert [name for name in named if f"def {name}(" not in there] == []


def test_every_misprint_of_the_tables_has_a_test():
    rows = [line for line in ERRATA.splitlines() if line.startswith("| ") and not line.startswith("| where")]
    assert len(rows) == 11 + 14 + 9 + 3
    assert [row for row in rows if "`test_" not in row] == []


def test_every_test_of_a_misprint_is_named():
    text = (ROOT / "tests" / "physics" / "test_errata.py").read_text(encoding="utf-8")
    tests = re.findall(r"^def (test_\w+)\(", text, re.MULTILINE)
    plain = {"test_lateral_deviation_over_the_angle", "test_lateral_deviation_over_the_spin",
             "test_plateau_of_each_figure"}  # fmt: skip
    assert [test for test in tests if f"`{test}`" not in ERRATA and test not in plain] == []
