"""What docs/how-to/digitise.md shows is what happens."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import numpy as np
from command_line import in_this_process
from project_files import as_json, dataset, pixel, version_4

import ifrfit

PAGE = (Path(__file__).parents[3] / "docs" / "how-to" / "digitise.md").read_text(encoding="utf-8")


def test_its_commands_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("IFRFIT_DATA_DIR", str(tmp_path / "own"))
    gamma = np.linspace(5.0, 85.0, 25)
    beta = ifrfit.rebound(gamma, e_n=0.9, e_t=-0.8, mu=0.15, degrees=True).beta
    points = [pixel(*each) for each in zip(gamma, beta, strict=True)]
    Path("figure.json").write_bytes(as_json(version_4(dataset_coll=[dataset(points=points)])))
    lines = re.findall(r"^    (ifrfit .*)$", PAGE, re.MULTILINE)
    lines += re.findall(r"['`](ifrfit (?:fit|check) figure\.json [^'`]*)['`]", PAGE)
    assert len(lines) == 6
    for line in lines:
        if line != "ifrfit reproduce":  # draws for minutes; tests/paper has it
            said = in_this_process(*shlex.split(line)[1:])
            assert said.returncode == 0, (line, said.stderr)
