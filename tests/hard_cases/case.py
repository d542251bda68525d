"""What a hard case is: what is fed, what must come out, and how to run and check it."""

from __future__ import annotations

import contextlib
import re
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

FILE = "impacts.csv"
OUT = "results"
METHODS = ("lsq", "profile", "exact", "mcmc")
GROUPS = (
    "rebound",
    "scenes",
    "data refused",
    "identifiability",
    "strangers",
    "slips",
    "ordinary",
    "numerics",
)


@dataclass(frozen=True)
class HardCase:
    """One row of the table of hard cases.

    Attributes
    ----------
    name : str
        Unique, a few words.
    group : str
        One of `GROUPS`.
    what : str
        One sentence: what is fed.
    answer : str
        One sentence: what must come out.
    run : callable
        From an empty folder, and the method where the case has any, to the outcome.
    check : callable
        Asserts about the outcome.
    methods : tuple of str
        The methods that must all give this answer; empty where nothing is fitted.
    slow : tuple of str
        Those of them that are tried with ``-m long`` only.
    """

    name: str
    group: str
    what: str
    answer: str
    run: Callable[..., Any]
    check: Callable[[Any], None]
    methods: tuple[str, ...] = ()
    slow: tuple[str, ...] = ("mcmc",)


def by_turns(cases: Sequence[HardCase]) -> tuple[HardCase, ...]:
    """Of cases with two methods one by the first and the next by the second; the other way is slow."""
    return tuple(
        replace(case, slow=(case.methods[i % 2],)) if len(case.methods) == 2 else case
        for i, case in enumerate(cases)
    )


@dataclass(frozen=True)
class Told:
    """What a command did.

    Attributes
    ----------
    status : int
    out, err : str
    left : tuple of str
        What lies in the folder afterwards, less what was put there.
    """

    status: int
    out: str
    err: str
    left: tuple[str, ...]


def command(folder: Path, arguments: Sequence[str]) -> Told:
    """Run the command line in a folder, in this process."""
    from command_line import in_this_process

    before = set(folder.iterdir())
    with contextlib.chdir(folder):
        result = in_this_process(*arguments)
    left = tuple(sorted(p.name for p in set(folder.iterdir()) - before))
    return Told(result.returncode, result.stdout, result.stderr, left)


def fits(outcome: Any) -> Iterator[Any]:
    """Every fit in what a case comes to, beside its brute-force optimum where there is one."""
    if isinstance(outcome, tuple | list):
        for part in outcome:
            yield from fits(part)
    elif not isinstance(outcome, Told):
        yield outcome


def put(folder: Path, content: str | bytes, name: str = FILE) -> Path:
    """Write a data file into the folder."""
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def in_a_process(folder: Path) -> Told:
    """Run the program itself on an empty file, as a shell does."""
    put(folder, "")
    words = [sys.executable, "-W", "error::RuntimeWarning", "-m", "ifrfit", "fit", FILE, "--out", OUT]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    left = tuple(p.name for p in folder.iterdir() if p.name != FILE)
    return Told(done.returncode, done.stdout, done.stderr, left)


def refused(*words: str) -> Callable[[Told], None]:
    """Exit status 3, one or two sentences with these words, no traceback, nothing written."""

    def check(told: Told) -> None:
        assert told.status == 3, told
        for word in words:
            assert word in told.err, (word, told.err)
        assert "Traceback" not in told.err
        assert told.err.startswith(f"ifrfit: {FILE}")
        assert told.err.count("\n") == 1
        assert len(told.err) < 500
        assert 1 <= len(re.findall(r"[.!?](?=\s+[A-Z'-]|\s*$)", told.err)) <= 2, told.err
        assert told.out == ""
        assert told.left == ()

    return check
