"""The script that has a shell ask for completion: printed, or read whenever the shell starts."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

# where a shell looks, and what it is told there
_STARTED_BY = {"bash": "~/.bashrc", "zsh": "~/.zshrc", "fish": "~/.config/fish/completions/ifrfit.fish"}
_LINES = {
    "bash": 'eval "$(ifrfit --show-completion bash)"',
    # what completes is not there in a zsh that nobody has set up
    "zsh": "(( $+functions[compdef] )) || { autoload -Uz compinit && compinit; }; "
    'eval "$(ifrfit --show-completion zsh)"',
    "fish": "ifrfit --show-completion fish | source",
}


def completion_options(run: Callable[..., None]) -> Callable[..., None]:
    """Decorate the group of all commands with what shows and installs the completion of a shell."""
    for name, act, says in (
        ("--show-completion", _show, "Print the completion script of a shell: bash, zsh or fish."),
        ("--install-completion", _install, "Have a shell read it when it starts."),
    ):
        run = click.option(
            name,
            is_flag=False,
            flag_value="",
            metavar="[SHELL]",
            is_eager=True,
            expose_value=False,
            callback=act,
            help=f"{says}  [default: that of $SHELL]",
        )(run)
    return run


def _shell_of(given: str) -> str:
    """The shell that is meant, or that of $SHELL."""
    shell = given or Path(os.environ.get("SHELL", "")).name
    if shell not in _STARTED_BY:
        raise click.UsageError(f"Name the shell, {', '.join(_STARTED_BY)}, not {shell or 'none'!r}.")
    return shell


def _show(ctx: click.Context, parameter: click.Parameter, given: Any) -> None:
    if given is None or ctx.resilient_parsing:
        return
    from click.shell_completion import get_completion_class

    made = get_completion_class(_shell_of(given))
    assert made is not None
    click.echo(made(ctx.command, {}, "ifrfit", "_IFRFIT_COMPLETE").source())
    ctx.exit()


def _install(ctx: click.Context, parameter: click.Parameter, given: Any) -> None:
    if given is None or ctx.resilient_parsing:
        return
    shell = _shell_of(given)
    place, line = Path(_STARTED_BY[shell]), _LINES[shell]
    try:
        place = place.expanduser()
        already = place.read_bytes().decode("utf-8", "replace") if place.exists() else ""
        if line not in already.splitlines():
            place.parent.mkdir(parents=True, exist_ok=True)
            gap = "" if already.endswith("\n") or not already else "\n"
            with place.open("a", encoding="utf-8") as file:
                file.write(f"{gap}{line}\n")
    except (OSError, RuntimeError) as error:  # the latter where there is no home
        raise click.ClickException(
            f"{place}: {getattr(error, 'strerror', error)}. Add the line yourself: {line}"
        ) from None
    click.echo(f"{place} has the line: {line}\nIt holds from the next start of {shell} on.")
    ctx.exit()
