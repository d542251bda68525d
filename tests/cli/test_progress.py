"""Progress: at a terminal only, and never on standard output."""

from __future__ import annotations

import sys

import pytest

from ifrfit.cli.output import working


def test_nobody_is_told_where_nobody_looks(capsys: pytest.CaptureFixture[str]) -> None:
    with working(quiet=False) as progress:
        assert progress is None
    assert capsys.readouterr() == ("", "")


def test_a_terminal_shows_steps_and_budget(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    with working(quiet=True) as progress:
        assert progress is None
    with working(quiet=False) as progress:
        assert progress is not None
        progress(200, 10_000)
    out, err = capsys.readouterr()
    assert out == ""
    assert "200 steps, 10,000 at most" in err
