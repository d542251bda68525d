"""The notebook of the docs is what a kernel makes of its cells today."""

from __future__ import annotations

import re

import nbformat
import pytest
from write_notebook import PAGE, empty, executed


def texts(notebook):
    """What each cell prints and shows as text."""
    return [
        [
            output.get("text") or output["data"].get("text/plain", "")
            for output in cell.get("outputs", ())
            if output["output_type"] != "error"
        ]
        for cell in notebook.cells
    ]


@pytest.fixture(scope="module")
def page():
    return nbformat.read(PAGE, as_version=4)


def test_its_cells_are_those_of_the_script(page):
    assert [cell.source for cell in page.cells] == [cell.source for cell in empty().cells]


def test_its_output_is_that_of_today(page):
    now = executed()
    assert not [o for cell in now.cells for o in cell.get("outputs", ()) if o["output_type"] == "error"]
    assert texts(now) == texts(page)
    pictures = [o for cell in now.cells for o in cell.get("outputs", ()) if "image/png" in o.get("data", {})]
    assert len(pictures) == 2
    tables = [
        o["data"]["text/html"]
        for c in now.cells
        for o in c.get("outputs", ())
        if "text/html" in o.get("data", {})
    ]
    assert len(tables) >= 5


def test_it_holds_nothing_of_a_machine():
    text = PAGE.read_text(encoding="utf-8")
    assert not re.search(r"/(work|home|root|tmp)/", text)
    assert len(text) < 300_000
