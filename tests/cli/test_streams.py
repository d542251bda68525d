"""A fit of files that are not held in memory, stopped by Ctrl-C and gone on with."""

from __future__ import annotations

import contextlib
import subprocess
import sys

import pytest
from command_line import in_this_process
from streams import folder_of, impacts

from ifrfit.cli import fit as fit_command
from ifrfit.data.stream import portions
from ifrfit.inference.sufficient_statistics import passes

pytest.importorskip("numba")


def test_ctrl_c_keeps_what_was_read(tmp_path, monkeypatch):
    monkeypatch.setattr(portions, "FIRST_ROWS", 600)
    monkeypatch.setattr(portions, "ROWS", 600)
    folder, out = folder_of(tmp_path / "all", impacts(4000), 3, "parquet"), tmp_path / "out"
    read, sums = [], passes._sums

    def interrupted(nothing, tell, parts):
        read.extend(parts)
        if len(read) == stop:
            raise KeyboardInterrupt
        return sums(nothing, tell, parts)

    monkeypatch.setattr(passes, "_sums", interrupted)
    command = ("fit", folder, "--out", out, "--method", "lsq", "--quiet")
    stop = 1
    early = in_this_process(*command)
    assert (early.returncode, early.stderr) == (130, "ifrfit: interrupted.\n")
    read.clear()
    stop = 4
    late = in_this_process(*command)
    assert late.returncode == 130
    assert late.stderr == "ifrfit: interrupted. What was read is kept: the same command goes on.\n"
    assert not out.exists()
    read.clear()
    stop = -1
    assert in_this_process(*command).returncode == 0
    assert {path.name for path in out.iterdir()} == {"result.json", "fit.svg", "fit.png", "report.html"}
    assert len(read) == len(portions.portions_of(sorted(folder.iterdir()))) - 2
    assert not (tmp_path / "out.unfinished").exists()


def test_resume_names_the_folder_of_the_results(tmp_path):
    folder, out = folder_of(tmp_path / "all", impacts(2000), 3, "parquet"), tmp_path / "out"
    for _ in range(2):  # it replaces what is there
        assert in_this_process("fit", folder, "--resume", out, "--quiet").returncode == 0
    assert (out / "result.json").exists()


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (("compare", "--closure", "ifr", "--closure", "maw"), "needs the rows one by one"),
        (("cost",), "Give one of its files here"),
        (
            ("fit", "--intervals"),
            "--intervals: data that are not held in memory are put to one method at a time",
        ),
    ],
)
def test_what_asks_for_all_rows_is_refused_before_any_is_read(tmp_path, monkeypatch, command, said):
    folder = folder_of(tmp_path / "all", impacts(300), 2, "parquet")
    monkeypatch.setattr(passes, "_sums", None)
    refused = in_this_process(command[0], folder, *command[1:])
    assert refused.returncode != 0
    assert said in refused.stderr


def test_rows_are_told_as_they_are_read_and_pipes_hear_nothing(tmp_path, monkeypatch):
    folder = folder_of(tmp_path / "all", impacts(4000), 3, "parquet")
    told, counted = [], []

    @contextlib.contextmanager
    def working(quiet, what="fitting", of="steps", **given):
        counted.append(of)
        yield lambda done, most: told.append((done, most))

    monkeypatch.setattr(fit_command, "working", working)
    assert in_this_process("fit", folder, "--method", "lsq").returncode == 0
    assert counted == ["rows"]
    assert told[-1] == (4000, 4000)
    command = (sys.executable, "-m", "ifrfit", "fit", str(folder), "--method", "lsq")
    assert subprocess.run(command, capture_output=True, check=True, timeout=120).stderr == b""
