"""The templates are read as they say."""

from __future__ import annotations

import csv
import io
import re

import pytest
from click.testing import CliRunner

from ifrfit.cli.main import app
from ifrfit.data import read, template_text
from ifrfit.data.column_names import COMMON, RAW
from ifrfit.inference.fit import fit
from ifrfit.physics import OBSERVABLES

BOTH = pytest.mark.parametrize("raw", [False, True], ids=["derived", "raw"])
TRUTH = {"e_n": 0.94, "e_t": -0.98, "mu": 0.12}


def with_examples(raw: bool) -> str:
    return re.sub(r"^#(?=\d)", "", template_text(raw), flags=re.MULTILINE)


@BOTH
def test_an_untouched_template_is_refused_with_what_to_do(tmp_path, monkeypatch, raw):
    monkeypatch.chdir(tmp_path)
    printed = CliRunner().invoke(app, ["template", *(["--raw"] if raw else [])])
    assert printed.stdout == template_text(raw)
    (tmp_path / "my.csv").write_text(printed.stdout)
    done = CliRunner().invoke(app, ["fit", "my.csv"])
    assert done.exit_code == 3
    assert done.stdout == ""
    assert "my.csv: there is a header, but no row under it." in done.stderr
    assert "Add one impact a line." in done.stderr


@BOTH
def test_examples_read_once_their_sign_is_removed(tmp_path, raw):
    path = tmp_path / "t.csv"
    path.write_text(with_examples(raw))
    obs = read(path)
    assert obs.provenance == ("simulated",), "example rows never pass as measured"
    if raw:
        assert list(obs.table.observable) == ["v_x", "v_n", "spin_y_after"] * 8
        assert obs.momentum[0].rms < 0.03
    else:
        both, only_beta = ["beta", "e_n"], ["beta"]
        assert list(obs.table.observable) == both * 2 + only_beta + both * 4 + only_beta
        assert list(obs.table.value[:5]) == [0.45, 0.92, 0.40, 0.95, 0.37]


@BOTH
def test_examples_give_the_constants_they_were_made_with(tmp_path, raw):
    path = tmp_path / "t.csv"
    path.write_text(with_examples(raw))
    result = fit(read(path))
    assert result.facts["lack_of_fit"].ok
    for name, true in TRUTH.items():
        found = result.constants[name]
        assert found.status in ("determined", "one_sided")
        # three standard deviations: the noise of the examples is fixed
        assert abs(found.value - true) < 3.0 * found.stderr


@BOTH
@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
def test_survives_being_taken_apart_into_cells_and_saved(tmp_path, raw, delimiter):
    path, again = tmp_path / "t.csv", tmp_path / "u.csv"
    path.write_text(with_examples(raw))
    cells = list(csv.reader(io.StringIO(with_examples(raw))))
    width = max(map(len, cells))
    with again.open("w", newline="") as file:
        csv.writer(file, delimiter=delimiter).writerows([*c, *[""] * (width - len(c))] for c in cells)
    table = read(again).table
    assert list(table.value) == list(read(path).table.value)
    assert set(table.provenance) == {"simulated"}


@BOTH
def test_it_is_well_laid_out(raw):
    lines = template_text(raw).splitlines()
    assert all(len(line) <= 88 for line in lines)
    assert not any('"' in line or line != line.rstrip() for line in lines)
    rules = [line for line in lines if line.startswith("#") and not line[1:2].isdigit()]
    for line in rules:
        assert line == "#" or line.startswith("# "), "rules are told from commented-out rows"
        # runs of spaces only at the start and between a column and what it means
        assert len(re.findall(r"\S {2,}(?=\S)", line[2:])) <= 1, line


@BOTH
def test_every_column_that_it_names_is_known_and_explained(raw):
    lines = template_text(raw).splitlines()
    header = next(line for line in lines if not line.startswith("#")).split(",")
    rules = "\n".join(line for line in lines if line.startswith("# "))
    for column in header:
        assert re.search(rf"\b{column}\b", rules), column
    named = re.findall(r"^#   (\w+)(?:, (\w+))*  ", rules, flags=re.MULTILINE)
    known = {*COMMON, *OBSERVABLES, *RAW}
    for name in {name for pair in named for name in pair if len(name) > 1}:
        plain = re.sub(r"^sigma_", "", name)
        assert plain in known or re.sub(r"_(deg|m_s|rad_s|mm)$", "", plain) in known, name
