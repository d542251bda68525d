"""What shells are offered: options, datasets, tables, choices; typer's scripts for bash, zsh and fish."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from ifrfit.data.catalogue import dataset_names
from ifrfit.inference.bootstrap.schemes import SCHEMES
from ifrfit.inference.estimators import ESTIMATORS
from ifrfit.inference.options import POLICIES
from ifrfit.physics import CLOSURES


@pytest.fixture
def offered(python):
    """Words that bash is offered for the last word of a line."""

    def complete(line: str) -> list[str]:
        found = python(
            "-c",
            "from ifrfit.cli.main import app; app(prog_name='ifrfit')",
            _IFRFIT_COMPLETE="complete_bash",
            COMP_WORDS=line,
            COMP_CWORD=str(len(line.split(" ")) - 1),
        )
        assert (found.returncode, found.stderr) == (0, "")
        return found.stdout.split()

    return complete


def test_words_are_those_of_the_registries(offered) -> None:
    assert offered("ifrfit fit x --closure ") == list(CLOSURES)
    assert offered("ifrfit fit x --noise ") == list(POLICIES)
    assert offered("ifrfit fit x --method ") == list(ESTIMATORS)
    assert offered("ifrfit fit x --resample ") == list(SCHEMES)
    assert offered("ifrfit fit x --noise s") == ["scaled"]


def test_options_commands_and_constants(offered) -> None:
    assert offered("ifrfit fit --gamma") == ["--gamma-min", "--gamma-max"]
    assert offered("ifrfit conv") == ["conventions"]
    assert "mu=" in offered("ifrfit fit x --fix ")
    assert "e_t,mu" in offered("ifrfit fit x --separate e_t,")
    assert offered("ifrfit fit x --convention beta=") == [
        "beta=contact",
        "beta=opposite-sign",
        "beta=centre",
    ]


def test_data_are_datasets_and_tables(offered) -> None:
    Path("run").mkdir()
    for name in ("a.csv", "b.tex", "run/c.parquet"):
        Path(name).touch()
    assert offered("ifrfit fit ") == [*dataset_names(), "a.csv"]
    assert offered("ifrfit fit run/") == ["run/c.parquet"]
    assert offered("ifrfit fit nowhere/x") == []  # the shell offers what it knows
    assert offered("ifrfit datasets show k") == ["kharaz-2001"]


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_each_shell_has_a_script(python, shell: str) -> None:
    found = python(
        "-c",
        "from ifrfit.cli.main import app; app(prog_name='ifrfit')",
        *("--show-completion", shell),
        _TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION="1",
    )
    assert found.returncode == 0
    assert f"_IFRFIT_COMPLETE=complete_{shell}" in found.stdout


@pytest.mark.parametrize(
    ("shell", "form"), [("zsh", '"--noise":"What sigma means'), ("fish", "--noise\tWhat sigma means")]
)
def test_zsh_and_fish_are_told_what_an_option_is(python, shell: str, form: str) -> None:
    found = python(
        "-c",
        "from ifrfit.cli.main import app; app(prog_name='ifrfit')",
        _IFRFIT_COMPLETE=f"complete_{shell}",
        _TYPER_COMPLETE_ARGS="ifrfit fit --noi",
        _TYPER_COMPLETE_FISH_ACTION="get-args",
    )
    assert (found.returncode, found.stderr) == (0, "")
    assert form in found.stdout


@pytest.mark.skipif(shutil.which("bash") is None, reason="bash is not here")
def test_a_real_bash_completes() -> None:
    program = Path(sys.executable).with_name("ifrfit")
    if not program.exists():
        pytest.skip("the command is not installed beside the interpreter")
    script = f"""
        PATH={program.parent}:$PATH
        eval "$(_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION=1 ifrfit --show-completion bash)"
        COMP_WORDS=(ifrfit fit --clos) COMP_CWORD=2
        _ifrfit_completion ifrfit
        echo "${{COMPREPLY[@]}}"
    """
    found = subprocess.run(["bash", "--norc", "-c", script], capture_output=True, text=True, check=False)
    assert found.stdout == "--closure\n"
