"""Every error that ifrfit raises on purpose, with the exit status the command line gives it."""

from __future__ import annotations

from ifrfit.option_words import in_python


class IfrfitError(Exception):
    """Base of all errors raised on purpose. The text is one or two sentences: where, what, what to do.

    As text it names options as Python does, in `in_shell` as the command line.

    Examples
    --------
    >>> import ifrfit
    >>> try:
    ...     ifrfit.fit("no-such.csv")
    ... except ifrfit.IfrfitError as error:
    ...     print(str(error)[:59])
    no-such.csv: there is neither a file nor a dataset of that
    """

    exit_status = 1

    def __str__(self) -> str:
        return in_python(self.in_shell)

    @property
    def in_shell(self) -> str:
        """The text with options as the command line has them: ``--fix e_n=0.9``."""
        return str(self.args[0]) if self.args else ""


class UsageError(IfrfitError, ValueError):
    """The call itself is wrong: an unknown name, a value outside its domain, options that contradict.

    Examples
    --------
    >>> import ifrfit
    >>> try:
    ...     ifrfit.fit("cornell-glass", fix={"en": 0.97})
    ... except ifrfit.UsageError as error:
    ...     print(error)
    fix={"en": ...}: closure IFR has no such constant. It has e_n, e_t, mu. Did you mean e_n?
    """

    exit_status = 2


class UnknownNameError(UsageError, KeyError):
    """A name that a mapping or a distribution does not have; its text says which there are.

    Examples
    --------
    >>> import ifrfit
    >>> try:
    ...     ifrfit.fit("cornell-glass").distribution.mean("kapa")
    ... except ifrfit.UsageError as error:
    ...     print(str(error)[:44], "...", str(error)[-23:])
    There is no quantity 'kapa'. There are e_n, ... Did you mean kappa?
    """


class DataError(IfrfitError, ValueError):
    """The data are refused. The text names the file, the line and the column where there is one.

    Examples
    --------
    >>> import ifrfit
    >>> try:
    ...     ifrfit.read({"gamma_deg": [10, 40], "beta": [0.4, "high"]})
    ... except ifrfit.DataError as error:
    ...     print(str(error)[:66])
    table, row 1 (counted from 0), column beta: 'high' is not a number
    """

    exit_status = 3
