"""What shells are offered: options, datasets, tables, choices; and where its script goes."""

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
    """Words that bash is offered for the last word of a line; files stand for those it knows itself."""

    def complete(line: str) -> list[str]:
        found = python(
            "-c",
            "from ifrfit.cli.main import app; app(prog_name='ifrfit')",
            _IFRFIT_COMPLETE="bash_complete",
            COMP_WORDS=line,
            COMP_CWORD=str(len(line.split(" ")) - 1),
        )
        assert (found.returncode, found.stderr) == (0, "")
        return [word.removeprefix("plain,") for word in found.stdout.split()]

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
    assert offered("ifrfit fit nowhere/x") == ["file,nowhere/x"]
    assert offered("ifrfit datasets show k") == ["kharaz-2001"]


SHELLS = ("bash", "zsh", "fish")


@pytest.mark.parametrize("shell", SHELLS)
def test_each_shell_has_a_script(cli, monkeypatch, shell: str) -> None:
    named = cli("--show-completion", shell)
    assert named.returncode == 0
    assert f"_IFRFIT_COMPLETE={shell}_complete" in named.stdout
    monkeypatch.setenv("SHELL", f"/usr/bin/{shell}")
    assert cli("--show-completion").stdout == named.stdout


@pytest.mark.parametrize("shell", SHELLS)
def test_a_line_is_added_once_to_what_a_shell_reads_and_nothing_is_lost(
    cli, monkeypatch, tmp_path, shell: str
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    if shell == "bash":
        (tmp_path / ".bashrc").write_text("alias l=ls")  # with no end of line
    said = cli("--install-completion", shell).stdout
    place = Path(said.split(" has the line")[0])
    assert place.is_relative_to(tmp_path)
    written = place.read_text()
    assert cli("--install-completion", shell).returncode == 0
    assert place.read_text() == written
    lines = written.splitlines()
    assert lines[:-1] == (["alias l=ls"] if shell == "bash" else [])
    assert f"ifrfit --show-completion {shell}" in lines[-1]


def test_a_place_that_cannot_be_written_is_named_with_the_line_to_add(cli, monkeypatch, tmp_path) -> None:
    (tmp_path / ".bashrc").mkdir()
    monkeypatch.setenv("HOME", str(tmp_path))
    found = cli("--install-completion", "bash")
    assert found.returncode == 1
    assert "Add the line yourself: eval" in found.stderr


@pytest.mark.parametrize(("given", "used"), [(("csh",), "/bin/bash"), ((), "/bin/csh"), ((), "")])
def test_another_shell_is_refused_with_those_there_are(cli, monkeypatch, given, used: str) -> None:
    monkeypatch.setenv("SHELL", used)
    found = cli("--show-completion", *given)
    assert found.returncode == 2
    assert "Name the shell, bash, zsh, fish, not" in found.stderr


def test_zsh_is_told_what_an_option_is(python) -> None:
    found = python(
        "-c",
        "from ifrfit.cli.main import app; app(prog_name='ifrfit')",
        _IFRFIT_COMPLETE="zsh_complete",
        COMP_WORDS="ifrfit fit --noi",
        COMP_CWORD="2",
    )
    assert (found.returncode, found.stderr) == (0, "")
    assert "--noise\nWhat sigma means" in found.stdout


@pytest.mark.skipif(shutil.which("bash") is None, reason="bash is not here")
def test_a_real_bash_completes() -> None:
    program = Path(sys.executable).with_name("ifrfit")
    if not program.exists():
        pytest.skip("the command is not installed beside the interpreter")
    script = f"""
        PATH={program.parent}:$PATH
        eval "$(ifrfit --show-completion bash)"
        COMP_WORDS=(ifrfit fit --clos) COMP_CWORD=2
        _ifrfit_completion ifrfit
        echo "${{COMPREPLY[@]}}"
    """
    found = subprocess.run(["bash", "--norc", "-c", script], capture_output=True, text=True, check=False)
    assert found.stdout == "--closure\n"
