"""Every error that ifrfit raises on purpose, with the exit status the command line gives it."""

from __future__ import annotations


class IfrfitError(Exception):
    """Base of all errors raised on purpose. The text is one or two sentences: where, what, what to do."""

    exit_status = 1


class UsageError(IfrfitError, ValueError):
    """The call itself is wrong: an unknown name, a value outside its domain, options that contradict."""

    exit_status = 2


class DataError(IfrfitError, ValueError):
    """The data are refused. The text names the file, the line and the column where there is one."""

    exit_status = 3
