from __future__ import annotations

import json
import os
from pathlib import Path

import pandas as pd
import pytest
from refusals import refused

from ifrfit.errors import UsageError
from ifrfit.inference.appraisal import Appraisal
from ifrfit.report import folder, write_folder

pytestmark = pytest.mark.usefixtures("small_page")  # what the page says is tested with the page
APPRAISAL = Appraisal(pd.DataFrame(), {}, without_profiles="They take long.")
NAMES = ["result.json", "fit.svg", "fit.png", "report.html"]


def names(place: Path) -> set[str]:
    return {entry.name for entry in place.iterdir()}


def test_a_new_folder_and_nothing_beside_it(made, tmp_path):
    out = tmp_path / "results" / "impacts"
    assert write_folder(made.fine(), APPRAISAL, out, force=False) == NAMES
    assert names(out) == set(NAMES)
    assert names(out.parent) == {"impacts"}
    assert json.loads((out / "result.json").read_text(encoding="utf-8"))["closure"] == "ifr"


def test_an_earlier_result_is_refused_and_kept(made, tmp_path):
    out = tmp_path / "a"
    write_folder(made.fine(), None, out, force=False)
    before = (out / "result.json").read_bytes()
    with refused(UsageError) as caught:
        write_folder(made.stand_in(), APPRAISAL, out, force=False)
    assert caught.value.in_shell == f"{out} holds an earlier result; add --force to replace it."
    assert (out / "result.json").read_bytes() == before
    assert names(out) == {"result.json"}


def test_force_replaces_everything_the_earlier_result_left(made, tmp_path):
    out = tmp_path / "a"
    write_folder(made.fine(), APPRAISAL, out, force=False)
    (out / "report.html").write_text("of the earlier result")
    write_folder(made.stand_in(), None, out, force=True)
    assert names(out) == {"result.json"}
    assert names(tmp_path) == {"a"}
    assert '"cross-2019"' in (out / "result.json").read_text(encoding="utf-8")


@pytest.mark.parametrize("force", [False, True])
def test_files_of_others_stay(made, tmp_path, force):
    out = tmp_path / "a"
    out.mkdir()
    (out / "notes.txt").write_text("mine")
    (out / "raw").mkdir()
    if force:
        (out / "result.json").write_text('{"schema": "ifrfit/result/1"}')
        (out / "report.html").write_text("of the earlier result")
    write_folder(made.fine(), APPRAISAL, out, force=force)
    assert names(out) == {*NAMES, "notes.txt", "raw"}
    assert (out / "notes.txt").read_text() == "mine"
    assert names(tmp_path) == {"a"}


@pytest.mark.parametrize("force", [False, True])
@pytest.mark.parametrize("name", ["fit.png", "result.json", "chains.npz"])
def test_a_file_of_others_is_not_overwritten_however_it_is_forced(made, tmp_path, name, force):
    out = tmp_path / "a"
    out.mkdir()
    (out / name).write_text("mine")
    with refused(UsageError, match=rf"holds a file {name} that is not of ifrfit: it is not replaced, nor"):
        write_folder(made.fine(), APPRAISAL, out, force=force)
    assert (out / name).read_text() == "mine"
    assert names(out) == {name}


def test_a_folder_in_the_place_of_a_file_stays_with_what_is_in_it(made, tmp_path):
    out = tmp_path / "a"
    write_folder(made.fine(), None, out, force=False)
    (out / "fit.svg").mkdir()
    (out / "fit.svg" / "mine.txt").write_text("mine")
    with refused(UsageError, match=r"holds a file fit\.svg that is not of ifrfit"):
        write_folder(made.fine(), APPRAISAL, out, force=True)
    assert (out / "fit.svg" / "mine.txt").read_text() == "mine"


def test_links_in_a_circle_are_refused_in_a_sentence(made, tmp_path):
    (tmp_path / "a").symlink_to("b")
    (tmp_path / "b").symlink_to("a")
    with refused(UsageError, match="Choose another folder with --out"):
        write_folder(made.fine(), None, tmp_path / "a", force=True)


def test_what_a_link_in_the_folder_points_to_stays(made, tmp_path):
    out = tmp_path / "a"
    write_folder(made.fine(), None, out, force=False)
    (tmp_path / "mine.png").write_text("mine")
    (out / "fit.png").symlink_to(tmp_path / "mine.png")
    write_folder(made.fine(), APPRAISAL, out, force=True)
    assert (tmp_path / "mine.png").read_text() == "mine"
    assert not (out / "fit.png").is_symlink()


def test_the_folder_one_stands_in_is_filled(made, tmp_path, monkeypatch):
    out = tmp_path / "a"
    out.mkdir()
    monkeypatch.chdir(out)
    write_folder(made.fine(), None, Path(), force=False)
    assert Path("result.json").exists()
    write_folder(made.fine(), APPRAISAL, Path(), force=True)
    assert names(Path()) == set(NAMES)


def test_a_link_stays_a_link(made, tmp_path):
    (tmp_path / "real").mkdir()
    link = tmp_path / "link"
    link.symlink_to("real")
    write_folder(made.fine(), None, link, force=False)
    write_folder(made.fine(), None, link, force=True)
    assert link.is_symlink()
    assert names(tmp_path / "real") == {"result.json"}


def test_nothing_appears_when_drawing_fails(made, tmp_path, monkeypatch):
    def fail(*_: object) -> None:
        raise RuntimeError("no ink")

    monkeypatch.setattr(folder, "save_svg_and_png", fail)
    with pytest.raises(RuntimeError, match="no ink"):
        write_folder(made.fine(), APPRAISAL, tmp_path / "deep" / "a", force=False)
    assert names(tmp_path) == set()


def test_the_earlier_result_survives_a_failed_replacement(made, tmp_path, monkeypatch):
    out = tmp_path / "a"
    write_folder(made.fine(), None, out, force=False)
    rename = Path.rename

    def fail(self: Path, target: Path) -> Path:
        if self.suffix == ".new":
            raise OSError(28, os.strerror(28))
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", fail)
    with refused(UsageError) as caught:
        write_folder(made.stand_in(), None, out, force=True)
    assert caught.value.in_shell == (
        f"{out}: cannot be written (No space left on device). Choose another folder with --out."
    )
    assert names(tmp_path) == {"a"}
    assert '"impacts.csv"' in (out / "result.json").read_text(encoding="utf-8")


def test_a_file_in_the_way(made, tmp_path):
    (tmp_path / "a").write_text("")
    with refused(UsageError) as caught:
        write_folder(made.fine(), APPRAISAL, tmp_path / "a", force=True)
    assert caught.value.in_shell == f"{tmp_path / 'a'} is a file. Name a folder with --out."
    with refused(UsageError, match=r"cannot be written \(.+\)\. Choose another folder with --out\."):
        write_folder(made.fine(), APPRAISAL, tmp_path / "a" / "b", force=True)
