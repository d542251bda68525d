"""Progress: at a terminal only, and never on standard output."""

from __future__ import annotations

import contextlib
import os
import re
import subprocess
import sys
import time

import pytest

from ifrfit.cli.output import working
from ifrfit.text import progress_words


def test_nobody_is_told_where_nobody_looks(capsys: pytest.CaptureFixture[str]) -> None:
    with working(quiet=False) as progress:
        assert progress is None
    assert capsys.readouterr() == ("", "")


def test_a_terminal_shows_how_far_how_fast_and_how_long(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "80")
    with working(quiet=True) as progress:
        assert progress is None
    with working(quiet=False, after=0.0) as progress:
        assert progress is not None
        time.sleep(0.5)  # until what draws it is there
        progress(100, 10_000)
        time.sleep(0.1)
        progress(200, 10_000)
    out, err = capsys.readouterr()
    assert out == ""
    assert "200 of 10,000 steps" in err
    assert re.search(r"\d+ a second, \d+ s left", err)


def test_short_work_shows_nothing_and_imports_nothing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    with working(quiet=False) as progress:
        assert progress is not None
        progress(1, 2)
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("done", "most", "seconds", "words"),
    [
        (0, 10, 5.0, "0 of 10 steps"),
        (200, 10_000, 5.0, "200 of 10,000 steps, 40 a second, 4 min left"),
        (5, 10, 5.0, "5 of 10 steps, 1 a second, 5 s left"),
        (1, 10_000, 10.0, "1 of 10,000 steps, 0.1 a second, 28 h left"),
        (10, 10, 5.0, "10 of 10 steps, 2 a second"),
    ],
)
def test_words_of_progress(done: int, most: int, seconds: float, words: str) -> None:
    assert progress_words(done, most, "steps", done, seconds) == words


def test_what_was_there_before_is_no_rate() -> None:
    assert progress_words(900, 1000, "steps", 100, 10.0) == "900 of 1,000 steps, 10 a second, 10 s left"


# the command line, shown at once
_AT_ONCE = """
import sys
import ifrfit.cli.output as output
from ifrfit.cli.main import main
output.working.__wrapped__.__kwdefaults__["after"] = 0.0
sys.argv[0] = "ifrfit"
main()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="terminals of POSIX")
@pytest.mark.parametrize("at_terminal", [True, False])
def test_a_real_terminal_sees_progress_and_a_pipe_none(at_terminal: bool) -> None:
    """80 columns, and standard output elsewhere: it has the result alone."""
    import pty

    ours, theirs = pty.openpty() if at_terminal else os.pipe()
    asked = ["fit", "cross-2019", "--fix", "e_n=0.94", "--method", "mcmc", "--max-steps", "60"]
    with subprocess.Popen(
        [sys.executable, "-c", _AT_ONCE, *asked],
        stdout=subprocess.PIPE,
        stderr=theirs,
        env={**os.environ, "TERM": "xterm", "COLUMNS": "80", "NO_COLOR": "1"},
    ) as process:
        os.close(theirs)
        seen = b""
        with contextlib.suppress(OSError):  # how Linux tells the end of a terminal
            while part := os.read(ours, 4096):
                seen += part
        out = process.stdout.read().decode() if process.stdout else ""
        assert process.wait() == 0
    os.close(ours)
    assert "closure IFR" in out
    assert "\x1b" not in out
    if at_terminal:
        assert b"of 60 steps" in seen
        assert re.search(rb"a second", seen)
        # NO_COLOR: the cursor moves, and nothing has a colour
        assert not re.search(rb"\x1b\[[0-9;]*3[0-7]m", seen)
    else:
        assert seen == b""
