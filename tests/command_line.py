"""The command line, run in this process."""

from __future__ import annotations

import subprocess

from click.testing import CliRunner

from ifrfit.cli.main import app

Outcome = subprocess.CompletedProcess[str]


def in_this_process(*arguments: object) -> Outcome:
    """Run a command; what it raises beside an exit is raised."""
    words = [str(argument) for argument in arguments]
    result = CliRunner().invoke(app, words, prog_name="ifrfit")
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return Outcome(words, result.exit_code, result.stdout, result.stderr)
