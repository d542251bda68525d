"""How far long work is, in a notebook; at a terminal the command line shows it."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from html import escape
from typing import Any

from ifrfit.text import progress_words

Progress = Callable[[int, int], None]

PATIENCE = 2.0  # seconds until it is shown
_EVERY = 0.25  # seconds from one look to the next


@contextmanager
def shown_in_notebook(progress: Progress | None, what: str, of: str) -> Iterator[Progress | None]:
    """Who is to be told how far work is: whoever asked, else a bar under the cell of a notebook.

    Parameters
    ----------
    progress : callable or None
        Who asked.
    what, of : str
        What is done, and what is counted.

    Yields
    ------
    callable or None
        None where nobody looks.
    """
    if progress is not None or not _in_notebook():
        yield progress
        return
    bar = _Bar(what, of)
    try:
        yield bar.update
    finally:
        bar.close()


def _in_notebook() -> bool:
    """Whether a kernel runs this; IPython is imported then."""
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    return getattr(shell, "kernel", None) is not None


class _Bar:
    """A bar that appears after some seconds, and is taken away at the end."""

    def __init__(self, what: str, of: str) -> None:
        self._what, self._of = what, of
        self._begin = self._looked = time.monotonic()
        self._first: int | None = None
        self._shown: Any = None

    def update(self, done: int, most: int) -> None:
        """Tell how far it is."""
        now = time.monotonic()
        first = self._first = done if self._first is None else self._first
        if now - self._begin < PATIENCE or (self._shown is not None and now - self._looked < _EVERY):
            return
        self._looked = now
        words = f"{self._what}: {progress_words(done, most, self._of, done - first, now - self._begin)}"
        self._draw(f'<progress value="{done}" max="{most}"></progress> {escape(words)}', words)

    def _draw(self, html: str, words: str) -> None:
        from IPython.display import display

        content = {"text/html": html, "text/plain": words}
        if self._shown is None:
            self._shown = display(content, raw=True, display_id=True)  # type: ignore[no-untyped-call]
        else:
            self._shown.update(content, raw=True)

    def close(self) -> None:
        """Take it away."""
        if self._shown is not None:
            self._draw("", "")
