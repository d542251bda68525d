"""The templates are read as they say."""

from __future__ import annotations

import re

import pytest

from ifrfit.data import read, template_text
from ifrfit.errors import DataError


@pytest.mark.parametrize("raw", [False, True])
def test_examples_cannot_be_fitted_by_mistake(tmp_path, raw):
    path = tmp_path / "t.csv"
    path.write_text(template_text(raw))
    with pytest.raises(DataError, match="there is a header, but no row under it"):
        read(path)


@pytest.mark.parametrize("raw", [False, True])
def test_examples_read_once_their_sign_is_removed(tmp_path, raw):
    path = tmp_path / "t.csv"
    path.write_text(re.sub(r"^#(?=\d)", "", template_text(raw), flags=re.MULTILINE))
    obs = read(path)
    if raw:
        assert list(obs.table.observable) == ["v_x", "v_n", "spin_y_after"] * 2
        assert "miss" not in obs.notes[0]
        assert float(obs.notes[0].split("closes to ")[1].split(" %")[0]) < 0.1
    else:
        assert list(obs.table.observable) == ["beta", "e_n", "beta", "e_n", "beta"]
        assert list(obs.table.value) == [0.42, 0.94, 0.18, 0.93, -0.51]


@pytest.mark.parametrize("raw", [False, True])
def test_survives_a_spreadsheet(tmp_path, raw):
    """Semicolons, decimal commas and a BOM, as a spreadsheet with a comma locale saves it."""
    path, again = tmp_path / "t.csv", tmp_path / "u.csv"
    text = re.sub(r"^#(?=\d)", "", template_text(raw), flags=re.MULTILINE)
    path.write_text(text)
    lines = [x if x.startswith("#") else x.replace(",", ";").replace(".", ",") for x in text.splitlines()]
    again.write_bytes("\r\n".join(lines).encode("utf-8-sig"))
    assert list(read(again).table.value) == list(read(path).table.value)


def test_lines_fit_a_terminal():
    assert all(len(line) <= 115 for raw in (False, True) for line in template_text(raw).splitlines())
