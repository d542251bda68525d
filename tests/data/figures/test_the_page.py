"""What docs/how-to/digitise.md shows is what happens."""

from __future__ import annotations

import json
import re
import shlex
import shutil
from pathlib import Path

import draw_digitise
import numpy as np
from command_line import in_this_process

HOW_TO = Path(__file__).parents[3] / "docs" / "how-to"
PAGE = (HOW_TO / "digitise.md").read_text(encoding="utf-8")


def test_its_commands_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("IFRFIT_DATA_DIR", str(tmp_path / "own"))
    shutil.copy(HOW_TO / "digitise" / "figure.json", "figure.json")
    lines = re.findall(r"^    (ifrfit .*)$", PAGE, re.MULTILINE)
    lines += re.findall(r"['`](ifrfit (?:fit|check) figure\.json [^'`]*)['`]", PAGE)
    assert len(lines) == 6
    for line in lines:
        if line != "ifrfit reproduce":  # draws for minutes; tests/paper has it
            said = in_this_process(*shlex.split(line)[1:])
            assert said.returncode == 0, (line, said.stderr)
    drawn = [path.suffix for path in Path("paper").iterdir()]
    assert {".png", ".html"} <= set(drawn)


def test_the_constants_are_those_that_it_says():
    found = draw_digitise.fitted(HOW_TO / "digitise")
    said = re.search(r"e_t = (\S+) and mu = (\S+), and", PAGE)
    assert said is not None
    for name, text in zip(("e_t", "mu"), said.groups(), strict=True):
        value, _, digits = text.rstrip(")").partition("(")
        places = len(value.partition(".")[2])
        constant = found.constants[name]
        assert value == f"{constant.value:.{places}f}"
        assert int(digits) == round(constant.stderr * 10**places)
        assert abs(constant.value - draw_digitise.CONSTANTS[name]) < 3.0 * constant.stderr


def test_its_pictures_are_those_of_the_script(tmp_path):
    """Marks lie where they are in the picture: text of another size moves them by less than a pixel or two."""
    draw_digitise.main(tmp_path)
    there = HOW_TO / "digitise"
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(path.name for path in there.iterdir())
    made, kept = (
        json.loads((folder / "figure.json").read_text(encoding="utf-8"))["datasetColl"][0]["data"]
        for folder in (tmp_path, there)
    )
    places = [np.array([[point["x"], point["y"]] for point in data]) for data in (made, kept)]
    np.testing.assert_allclose(*places, rtol=0, atol=3.0)
    for picture in re.findall(r"!\[[^\]]+\]\((digitise/[a-z]+\.png)\)", PAGE):
        assert (HOW_TO / picture).read_bytes().startswith(b"\x89PNG")
    assert all(path.stat().st_size < 60_000 for path in there.iterdir())
