"""Errors raised on purpose, by their text as the command line has it: options are written once."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from ifrfit.errors import IfrfitError


@contextmanager
def refused(kind: type[IfrfitError], match: str = "") -> Iterator[pytest.ExceptionInfo[IfrfitError]]:
    """As `pytest.raises`, whose pattern would be held against the words of Python, where --fix is fix."""
    with pytest.raises(kind) as info:
        yield info
    text = info.value.in_shell
    assert re.search(match, text), f"{match!r} is not in {text!r}"
