from __future__ import annotations

import csv
import subprocess
import sys
from pathlib import Path

import pytest

from ifrfit.data.catalogue import dataset_names, install, printed_constants
from ifrfit.errors import UsageError
from ifrfit.report import cases, reproduce

ROOT = Path(__file__).parents[2]
HEADER = (
    "dataset,series,constant,printed,value,stderr,lo95,hi95,status,identifiable,lack_of_fit_ok,lack_of_fit_p,"
    "certified,provenance,figure,note"
)
FEW = tuple(case for case in cases.CASES if case.name in ("kharaz-2001-from-15-deg", "buck-2017"))


@pytest.fixture(autouse=True)
def nothing_installed(tmp_path_factory, monkeypatch):
    monkeypatch.setenv("IFRFIT_DATA_DIR", str(tmp_path_factory.mktemp("data")))


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """One whole run: its folder and its text."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("IFRFIT_DATA_DIR", str(tmp_path_factory.mktemp("data")))
        out = tmp_path_factory.mktemp("whole") / "deep" / "figures"
        return out, reproduce.reproduce(out)


@pytest.fixture
def few(monkeypatch):
    monkeypatch.setattr(reproduce, "CASES", FEW)


def rows_of(folder):
    with (folder / "constants.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def of(rows, figure, constant):
    (row,) = (row for row in rows if row["figure"] == figure and row["constant"] == constant)
    return row


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_every_dataset_is_fitted_and_every_case_drawn(whole):
    out, _ = whole
    figures = {f"{case.name}.{suffix}" for case in cases.CASES for suffix in ("svg", "png")}
    assert {path.name for path in out.iterdir()} == figures | {"constants.csv"}
    assert {case.dataset for case in cases.CASES} == set(dataset_names())
    assert all((out / name).stat().st_size > 5_000 for name in figures)


def test_the_table_has_its_columns_and_says_where_everything_comes_from(whole):
    out, _ = whole
    assert (out / "constants.csv").read_text("utf-8").partition("\n")[0] == HEADER
    rows = rows_of(out)
    assert len(rows) == 3 * len(cases.CASES)
    assert {row["dataset"]: row["provenance"] for row in rows} == {
        "kharaz-2001": "digitised",
        "netl-glass-acrylic": "measured",
        **dict.fromkeys(
            ("cross-2019", "buck-2017", "hashemnia-2019", "reagle-2013", "wang-2020"), "stand-in"
        ),
    }
    for row in rows:
        assert row["note"].startswith("STAND-IN") == (row["provenance"] == "stand-in")
        printed = printed_constants(row["dataset"]).get(row["series"], {}).get(row["constant"])
        assert row["printed"] == ("" if printed is None else str(printed))
        if row["status"] == "fixed":
            assert row["value"] == row["printed"]
            assert row["stderr"] == ""
        if row["status"] == "not_determined":
            assert row["value"] == ""


def test_the_series_of_cross_keep_their_own_printed_friction(whole):
    rows = rows_of(whole[0])
    printed = {
        row["series"]: row["printed"]
        for row in rows
        if row["dataset"] == "cross-2019"
        if row["constant"] == "mu"
    }
    assert printed == {"no spin": "0.12", "spin 0.225": "0.14", "spin 0.833": "0.14"}


def test_kharaz_is_contradicted_by_its_near_normal_impacts_only(whole):
    out, text = whole
    rows = rows_of(out)
    every, oblique = (of(rows, name, "mu") for name in ("kharaz-2001", "kharaz-2001-from-15-deg"))
    assert (every["lack_of_fit_ok"], oblique["lack_of_fit_ok"]) == ("false", "true")
    assert float(every["lack_of_fit_p"]) < 0.001 <= float(oblique["lack_of_fit_p"])
    # Chung & Ooi (2011) use 0.092 for this experiment
    assert float(oblique["lo95"]) < 0.092 < float(oblique["hi95"])
    assert of(rows, "kharaz-2001-from-15-deg", "e_t")["status"] == "one_sided"
    assert "verdict: the data contradict one set of constants (p = 7e-04" in text
    assert "verdict: no lack of fit" in text


def test_certificates_are_stated_where_they_exist_and_only_there(whole):
    certified = {row["figure"]: row["certified"] for row in rows_of(whole[0])}
    # of beta_tot and delta no bound is known; two optima near each other do not take a certificate away
    without = {"reagle-2013", "wang-2020"}
    assert {name for name, told in certified.items() if told == "false"} == without


def test_stand_ins_are_named_as_such_and_never_get_a_verdict(whole):
    data, _, stand_ins = whole[1].partition("STAND-INS, generated from the constants the paper prints.")
    assert data.startswith("DATA, digitised and measured\n")
    assert "verdict" in data
    assert "says nothing about the experiments" in stand_ins.replace("\n", " ")
    assert "verdict" not in stand_ins
    assert stand_ins.count("given to the fit") == 5
    assert "identifiable 95 % intervals hold the value put in" in stand_ins
    assert all(len(line) <= 100 for line in whole[1].splitlines() if not line.startswith("written: "))
    assert whole[1].endswith("\n")


def test_a_second_run_writes_the_same_bytes(few, tmp_path):
    reproduce.reproduce(tmp_path / "a")
    reproduce.reproduce(tmp_path / "b")
    assert contents(tmp_path / "a") == contents(tmp_path / "b")


def test_its_own_output_is_replaced_and_nothing_else(few, tmp_path):
    reproduce.reproduce(tmp_path)
    before = contents(tmp_path)
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "fit.svg").write_text("mine too")
    (tmp_path / "buck-2017.svg").write_text("old")
    reproduce.reproduce(tmp_path)
    assert contents(tmp_path) == before | {"notes.txt": b"mine", "fit.svg": b"mine too"}


def test_a_table_of_another_make_is_not_replaced(few, tmp_path):
    (tmp_path / "constants.csv").write_text("speed,of,light\n")
    with pytest.raises(UsageError, match=r"constants\.csv is not a table of this command\. Choose another"):
        reproduce.reproduce(tmp_path)
    assert contents(tmp_path) == {"constants.csv": b"speed,of,light\n"}


def test_a_file_in_the_place_of_the_folder_is_refused(tmp_path):
    (tmp_path / "figures").write_text("")
    with pytest.raises(UsageError, match=r"figures is a file\. Name a folder with --out\."):
        reproduce.reproduce(tmp_path / "figures")


def test_what_cannot_be_written_leaves_the_folder_as_it_was(few, tmp_path, monkeypatch):
    def full(figure, path):
        path.write_bytes(b"half")
        raise OSError(28, "No space left on device")

    (tmp_path / "notes.txt").write_text("mine")
    monkeypatch.setattr(reproduce, "save_figure", full)
    with pytest.raises(UsageError, match=r"cannot be written \(No space left on device\)\. Choose another"):
        reproduce.reproduce(tmp_path)
    assert contents(tmp_path) == {"notes.txt": b"mine"}
    with pytest.raises(UsageError, match="cannot be written"):
        reproduce.reproduce(tmp_path / "new" / "folder")
    assert not (tmp_path / "new").exists()


def test_data_of_the_users_own_are_fitted_in_the_place_of_a_stand_in(few, tmp_path):
    lines = [f"{gamma},{0.3 - 0.012 * gamma},0.05" for gamma in range(10, 85, 5)]
    (tmp_path / "mine.csv").write_text("\n".join(["gamma_deg,beta,sigma", *lines]))
    (tmp_path / "labelled.csv").write_text(
        "\n".join(["series,gamma_deg,beta,sigma", *(f"no spin,{x}" for x in lines)])
    )
    out = tmp_path / "out"
    reproduce.reproduce(out)
    install("buck-2017", tmp_path / "labelled.csv")
    text = reproduce.reproduce(out)
    assert of(rows_of(out), "buck-2017", "mu")["provenance"] == "digitised"
    assert "STAND-IN" not in text
    assert b"STAND-IN" not in (out / "buck-2017.svg").read_bytes()
    # a series that the case does not know: told, and no figure of the earlier data is left behind
    install("buck-2017", tmp_path / "mine.csv")
    text = reproduce.reproduce(out)
    assert "buck-2017: not fitted to your own data. " in text
    assert not (out / "buck-2017.svg").exists()
    assert (out / "kharaz-2001-from-15-deg.svg").exists()


def test_progress_goes_to_standard_error_and_only_on_request(few, tmp_path, capfd):
    reproduce.reproduce(tmp_path)
    assert capfd.readouterr() == ("", "")
    reproduce.reproduce(tmp_path, progress=True)
    assert capfd.readouterr().out == ""


def test_the_script_does_the_same(whole, tmp_path):
    done = subprocess.run(
        [sys.executable, ROOT / "scripts" / "reproduce_paper.py", "--out", tmp_path / "out"],
        capture_output=True,
        text=True,
        encoding="utf-8",
        check=True,
    )
    assert done.stdout.partition("\nwritten: ")[0] == whole[1].partition("\nwritten: ")[0]
    assert done.stderr == ""
    assert contents(tmp_path / "out") == contents(whole[0])


def test_the_script_refuses_in_a_sentence(tmp_path):
    (tmp_path / "file").write_text("")
    done = subprocess.run(
        [sys.executable, ROOT / "scripts" / "reproduce_paper.py", "--out", tmp_path / "file"],
        capture_output=True,
        text=True,
        encoding="utf-8",
        check=False,
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == f"{tmp_path / 'file'} is a file. Name a folder with --out.\n"
