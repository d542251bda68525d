"""The notebook of the docs is what a kernel makes of its cells today."""

from __future__ import annotations

import re

import nbformat
import pytest
from nbclient import NotebookClient
from write_notebook import PAGE, empty, executed


def texts(notebook):
    """What each cell prints and shows as text, but for the empty ones that a bar leaves on a slow machine."""
    shown = (
        [
            output.get("text") or output["data"].get("text/plain", "")
            for output in cell.get("outputs", ())
            if output["output_type"] != "error"
        ]
        for cell in notebook.cells
    )
    return [[text for text in cell if text] for cell in shown]


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


def test_long_work_has_a_bar_that_goes_away():
    cell = nbformat.v4.new_code_cell(
        "import ifrfit\n"
        "from ifrfit.inference import notebook_progress\n"
        "notebook_progress.PATIENCE = 0.0\n"
        "ifrfit.fit('cornell-glass', method=ifrfit.Bootstrap('wild', replicates=300)).method"
    )
    notebook = nbformat.v4.new_notebook(cells=[cell], metadata=empty()["metadata"])
    client = NotebookClient(notebook, timeout=300, kernel_name="python3")
    seen = []
    process = client.process_message
    client.process_message = lambda message, *given: (seen.append(message), process(message, *given))[1]
    client.execute()
    bars = [
        message["content"]["data"]["text/html"]
        for message in seen
        if message["msg_type"] in ("display_data", "update_display_data")
    ]
    assert any(
        re.match(r'<progress value="\d+" max="300"></progress> fitting: \d+ of 300 steps', bar)
        for bar in bars
    )
    assert bars[-1] == ""
    assert notebook.cells[0].outputs[-1]["data"]["text/plain"] == "'bootstrap'"


def test_it_holds_nothing_of_a_machine():
    text = PAGE.read_text(encoding="utf-8")
    assert not re.search(r"/(work|home|root|tmp)/", text)
    assert len(text) < 300_000
