"""Who reads the rows, in what parts, and how often it was interrupted: none of it changes a bit."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from refusals import refused
from streams import folder_of, impacts

import ifrfit
from ifrfit.data.stream import portions
from ifrfit.errors import DataError, UsageError
from ifrfit.inference.estimators import Bootstrap, Exact, LeastSquares
from ifrfit.inference.sufficient_statistics import passes, transition_window, unfinished_pass
from ifrfit.inference.workers import crews

pytest.importorskip("numba")
NAMES = ("e_n", "e_t", "mu")


@pytest.fixture(autouse=True)
def small_portions(monkeypatch):
    """So small that a folder of some thousand rows has many."""
    monkeypatch.setattr(portions, "FIRST_ROWS", 600)
    monkeypatch.setattr(portions, "ROWS", 600)
    monkeypatch.setattr(passes, "FIRST_ROWS", 600)


def record_of(fit):
    """All that a result file says, but for the time."""
    return {key: value for key, value in fit.to_dict().items() if key not in ("created", "command")}


def test_portions_hold_every_row_once(tmp_path):
    table = impacts(5000)
    files = sorted(folder_of(tmp_path / "all", table, 3, "parquet").iterdir())
    found = portions.portions_of(files)
    assert len(found) > 5
    for number, path in enumerate(files):
        pieces = [piece for portion in found for piece in portion if piece.number == number]
        assert all(piece.path == path for piece in pieces)
        firsts = np.cumsum([0, *(piece.rows for piece in pieces)])
        assert [piece.first for piece in pieces] == firsts[:-1].tolist()
        assert [group for piece in pieces for group in piece.row_groups] == list(range(3))
    assert sum(piece.rows for portion in found for piece in portion) == 5000


@pytest.mark.parametrize(("series", "workers"), [(1, 7), (3, 2), pytest.param(1, 2, marks=pytest.mark.long)])
def test_workers_change_no_bit(tmp_path, series, workers):
    folder = folder_of(tmp_path / "all", impacts(4000, series=series), 3, "parquet")
    alone = record_of(ifrfit.fit(folder, method="exact"))
    assert record_of(ifrfit.fit(folder, method=Exact(workers=workers))) == alone


def test_parts_change_no_bit_of_the_constants(tmp_path):
    table = impacts(5000)
    found = []
    for parts in (1, 2, 7):
        folder = folder_of(tmp_path / f"{parts}", table, parts, "parquet")
        found.append(ifrfit.fit(folder, method="lsq", noise="known"))
    for fit in found[1:]:
        for name in NAMES:
            assert fit.constants[name].value == found[0].constants[name].value
            assert fit.constants[name].stderr == found[0].constants[name].stderr
        assert fit.fit.chi2 == found[0].fit.chi2
        assert fit.fit.log_likelihood == found[0].fit.log_likelihood


def test_a_window_told_too_early_costs_a_pass_and_no_digit(tmp_path, monkeypatch):
    folder = folder_of(tmp_path / "all", impacts(4000), 3, "parquet")
    alone = record_of(ifrfit.fit(folder, method="lsq"))
    fetched = []
    fetch = passes.Reader.fetch

    def counted(*given):
        fetched.append(1)
        return fetch(*given)

    def nowhere(question):
        return np.zeros(question.of.intervals.count, dtype=bool)

    monkeypatch.setattr(passes.Reader, "fetch", counted)
    assert record_of(ifrfit.fit(folder, method="lsq")) == alone
    assert not fetched
    monkeypatch.setattr(transition_window.Question, "expected_window", nowhere)
    assert record_of(ifrfit.fit(folder, method="lsq")) == alone
    assert fetched


def test_a_long_first_portion_is_looked_into_first(tmp_path, monkeypatch):
    folder = folder_of(tmp_path / "all", impacts(4000), 3, "parquet")
    alone = record_of(ifrfit.fit(folder, method="lsq"))
    monkeypatch.setattr(passes, "_MOST_KEPT", 10)
    assert record_of(ifrfit.fit(folder, method="lsq")) == alone


def interrupting(after):
    """Progress that is interrupted when so many rows are read."""

    def progress(done, most):
        if done >= after:
            raise KeyboardInterrupt

    return progress


def test_an_interrupted_fit_goes_on(tmp_path, monkeypatch):
    folder = folder_of(tmp_path / "all", impacts(5000, series=2), 3, "parquet")
    alone = record_of(ifrfit.fit(folder, method="exact"))
    out = tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        ifrfit.fit(folder, method=Exact(resume=out), progress=interrupting(3000))
    kept = list((tmp_path / "out.unfinished").iterdir())
    assert len(kept) >= 3
    read = []
    monkeypatch.setattr(
        passes,
        "_sums",
        lambda nothing, tell, wanted, _=passes._sums: read.extend(wanted) or _(nothing, tell, wanted),
    )
    assert record_of(ifrfit.fit(folder, method=Exact(resume=out))) == alone
    assert len(read) == len(portions.portions_of(sorted(folder.iterdir()))) - len(kept)
    assert not (tmp_path / "out.unfinished").exists()


_QUESTIONS = """
import sys
from pathlib import Path
import numpy as np
from ifrfit.data.conventions import Conventions
from ifrfit.data.selection import Selection
from ifrfit.data.stream.impact_stream import ImpactStream
from ifrfit.inference.sufficient_statistics.accumulated import BINS, Accumulated
from ifrfit.inference.sufficient_statistics.tau_intervals import Intervals
from ifrfit.inference.sufficient_statistics.unfinished_pass import UnfinishedPass
stream = ImpactStream.of(Path(sys.argv[1]), Conventions(), Selection(), 0.4)
nothing = Accumulated.nothing(stream, True, Intervals(BINS), np.zeros(BINS, dtype=bool))
print(UnfinishedPass(Path("x")).of(nothing).question)
"""


def test_another_process_goes_on_with_what_was_kept(tmp_path):
    """Python orders sets of strings anew in each process, and the parts are named after the question."""
    table = impacts(50, columns=("beta_cm", "beta", "v_n", "e_n")).assign(spin_x=np.nan, spin_y=np.nan)
    folder = folder_of(tmp_path / "all", table, 2, "parquet")
    questions = {
        subprocess.run(
            [sys.executable, "-c", _QUESTIONS, str(folder)],
            env={**os.environ, "PYTHONHASHSEED": seed},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed in ("1", "2", "3")
    }
    assert len(questions) == 1
    assert questions != {""}


def test_what_was_kept_of_other_files_or_questions_is_not_used(tmp_path):
    folder = folder_of(tmp_path / "all", impacts(5000), 3, "parquet")
    out = tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        ifrfit.fit(folder, method=LeastSquares(resume=out), progress=interrupting(3000))
    assert record_of(ifrfit.fit(folder, method=LeastSquares(resume=out), gamma_max=60.0)) == record_of(
        ifrfit.fit(folder, method="lsq", gamma_max=60.0)
    )
    with pytest.raises(KeyboardInterrupt):
        ifrfit.fit(folder, method=LeastSquares(resume=out), progress=interrupting(3000))
    impacts(1700, seed=8).to_parquet(folder / "1.parquet", row_group_size=500)
    assert record_of(ifrfit.fit(folder, method=LeastSquares(resume=out))) == record_of(
        ifrfit.fit(folder, method="lsq")
    )


def test_a_damaged_part_and_a_full_disk_are_told(tmp_path, monkeypatch):
    folder = folder_of(tmp_path / "all", impacts(5000), 3, "parquet")
    out = tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        ifrfit.fit(folder, method=LeastSquares(resume=out), progress=interrupting(3000))
    part = min((tmp_path / "out.unfinished").iterdir())
    whole = part.read_bytes()
    part.write_bytes(whole[:100])
    with refused(UsageError, match=r"part-.*damaged\. Remove it"):
        ifrfit.fit(folder, method=LeastSquares(resume=out))
    part.unlink()

    def full(*given, **named):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(unfinished_pass.np, "savez", full)
    with refused(UsageError, match="No space left on device"):
        ifrfit.fit(folder, method=LeastSquares(resume=out))
    assert not list((tmp_path / "out.unfinished").glob("*.new"))


def test_what_is_kept_needs_a_folder(tmp_path):
    folder = folder_of(tmp_path / "all", impacts(5000), 3, "parquet")
    (tmp_path / "out.unfinished").write_text("mine", encoding="utf-8")
    with refused(UsageError, match="cannot be written"):
        ifrfit.fit(folder, method=LeastSquares(resume=tmp_path / "out"))
    assert (tmp_path / "out.unfinished").read_text(encoding="utf-8") == "mine"


def test_a_file_that_changes_while_it_is_read(tmp_path):
    folder = folder_of(tmp_path / "all", impacts(5000), 3, "parquet")

    def progress(done, most):
        os.utime(folder / "2.parquet", (1, 1))

    with refused(DataError, match=r"2\.parquet: it changed while it was read"):
        ifrfit.fit(folder, method="lsq", progress=progress)


def test_only_some_series(tmp_path):
    table = impacts(4000, series=3)
    folder = folder_of(tmp_path / "all", table, 3, "parquet")
    own = folder_of(tmp_path / "own", table[table["series"] != "s1"], 3, "parquet")
    some, alone = (
        ifrfit.fit(folder, method="lsq", series=("s0", "s2")),
        ifrfit.fit(own, method="lsq"),
    )
    assert some.fit.n == alone.fit.n
    for name in NAMES:
        assert some.constants[name].value == pytest.approx(alone.constants[name].value, rel=1e-12)
    assert dict(some.inputs[0].rows_skipped)["outside the series"] > 1000


def test_what_is_asked_of_data_in_memory(tmp_path):
    impacts(300).to_csv(tmp_path / "few.csv", index=False)
    for given, option in (
        ({"workers": 2}, "--workers"),
        ({"scheduler": "tcp://x:1"}, "--scheduler"),
        ({"resume": "x"}, "--resume"),
    ):
        with refused(UsageError, match=f"{option}: these data are held in memory"):
            ifrfit.fit(tmp_path / "few.csv", method=Exact(**given))
        with refused(UsageError, match="where --method profile is one short computation"):
            ifrfit.fit(tmp_path / "few.csv", method=ifrfit.Profile(**given))
    with refused(UsageError, match="held in memory, where --method bootstrap takes --workers"):
        ifrfit.fit(tmp_path / "few.csv", method=Bootstrap(scheduler="tcp://x:1"))
    with refused(UsageError, match="leave one out"), crews.crew_of(2, "tcp://x:1"):
        pass


@pytest.mark.skipif(sys.platform == "win32", reason="there is no SIGKILL")
def test_a_worker_that_is_killed_changes_no_bit(tmp_path, monkeypatch):
    folder = folder_of(tmp_path / "all", impacts(5000), 3, "parquet")
    alone = record_of(ifrfit.fit(folder, method="lsq"))
    killed = []
    start = crews.start_processes

    def started(*of):
        pool = start(*of)
        if not killed:

            def submit(*given, _=pool.submit):
                future = _(*given)
                time.sleep(0.01)
                if not killed and given[0] is not int:  # which is no work
                    killed.append(next(iter(pool._processes)))
                    os.kill(killed[0], signal.SIGKILL)
                return future

            pool.submit = submit
        return pool

    monkeypatch.setattr(crews, "start_processes", started)
    assert record_of(ifrfit.fit(folder, method=LeastSquares(workers=2))) == alone
    assert killed


def test_the_same_command_twice_at_once(tmp_path, monkeypatch):
    """Parts that the other one keeps meanwhile are not taken for those that are made here."""
    folder, out = folder_of(tmp_path / "all", impacts(5000), 3, "parquet"), tmp_path / "out"
    alone = record_of(ifrfit.fit(folder, method="lsq"))
    keep = unfinished_pass.KeptParts.keep

    def keeping(kept, portion, part):
        keep(kept, portion, part)
        for other in portions.portions_of(sorted(folder.iterdir()))[::2]:  # as the other one would
            if not kept.has(other):
                (own,) = passes._sums(kept.nothing, None, [other])
                keep(kept, other, own)

    monkeypatch.setattr(unfinished_pass.KeptParts, "keep", keeping)
    assert record_of(ifrfit.fit(folder, method=LeastSquares(resume=out))) == alone


def test_a_large_file_that_must_be_held(tmp_path, monkeypatch):
    from command_line import in_this_process

    from ifrfit.data.stream import files

    monkeypatch.setattr(files, "LARGE_BYTES", 1000)
    impacts(300).to_csv(tmp_path / "a.csv", index=False, sep=";")
    command = ("fit", tmp_path / "a.csv", "--method", "lsq", "--quiet")
    assert in_this_process(*command, "--out", tmp_path / "out").returncode == 0
    assert "held in memory" in in_this_process(*command, "--workers", 2).stderr
