"""Processes of their own: start-up, imports, version, pipes, and the whole of reproduce."""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
from pathlib import Path

import pytest
from factories import rest_long

from ifrfit import __version__

# prints, as the last line of standard error, which of the modules were imported
_WATCH = """
import json, sys
from ifrfit.cli.main import app
try:
    app(sys.argv[2:], prog_name="ifrfit")
finally:
    print(json.dumps([m for m in json.loads(sys.argv[1]) if m in sys.modules]), file=sys.stderr)
"""


def imported(python, modules, *arguments):
    found = python("-c", _WATCH, json.dumps(modules), *arguments)
    assert found.returncode == 0
    return json.loads(found.stderr.splitlines()[-1])


def test_version(python):
    found = python("-m", "ifrfit", "--version")
    assert (found.returncode, found.stdout, found.stderr) == (0, f"ifrfit {__version__}\n", "")


# pages that the kernel makes for 300 times ten arrays of 0.24 MB
_PAGES = """
import resource, sys
import numpy as np
from ifrfit.cli.main import keep_freed_memory
if sys.argv[1] == "keep":
    keep_freed_memory()
for _ in range(300):
    [np.ones(30_000) for _ in range(10)]
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="a setting of glibc")
def test_arrays_share_their_pages(python):
    without, kept = (int(python("-c", _PAGES, word).stdout) for word in ("no", "keep"))
    assert kept < 0.5 * without


@pytest.mark.parametrize("arguments", [("--help",), ("--version",), ("fit", "--help"), ("template",)])
def test_help_costs_no_heavy_import(python, arguments):
    heavy = ["numpy", "scipy", "pandas", "matplotlib", "lmfit", "pyarrow"]
    allowed = ["numpy", "pandas"] if arguments == ("template",) else []
    assert [m for m in imported(python, heavy, *arguments) if m not in allowed] == []


def test_listing_the_commands_looks_no_option_up(python):
    assert imported(python, ["ifrfit.inference.estimators", "ifrfit.inference.options"], "--help") == []


def test_json_costs_no_import_that_it_does_not_need(python):
    # pandas itself imports pyarrow where it is installed, but not its reader of Parquet
    spared = ["matplotlib", "lmfit", "scipy.stats", "scipy.optimize", "scipy.interpolate", "pyarrow.parquet"]
    spared += ["rich.console"]
    arguments = ("fit", "kharaz-2001", "--prior", "e_n=0.98,0.01", "--json")
    assert imported(python, [*spared, "numpy"], *arguments) == ["numpy"]


@pytest.mark.parametrize(
    "arguments",
    rest_long(
        [
            ("fit", "x.csv"),
            ("datasets", "show", "kharaz-2001"),
            ("fit", "x.csv", "--json"),
            ("template",),
        ],
        2,
    ),
)
def test_a_terminal_that_knows_ascii_only_is_served(python, arguments):
    Path("x.csv").write_text("γ [°],β,σ_β\n10,0.4,0.1\n30,0.3,0.1\n60,-0.5,0.1\n", encoding="utf-8")
    found = python("-m", "ifrfit", *arguments, PYTHONIOENCODING="ascii:strict")
    assert (found.returncode, found.stderr) == (0, "")


@pytest.mark.parametrize("arguments", rest_long([("--out", "results"), ("--json",)]))
def test_no_warning_reaches_the_user_whatever_the_file_is_called(python, arguments):
    # elsewhere than on Linux file names are text
    name = os.fsdecode(b"Messung_\xfc.csv") if sys.platform == "linux" else "Messung_ü.csv"
    Path(name).write_text("gamma_deg,beta,sigma\n10,0.4,0.1\n30,0.3,0.1\n60,-0.5,0.1\n", encoding="utf-8")
    found = python("-W", "error", "-m", "ifrfit", "fit", name, *arguments)
    assert (found.returncode, found.stderr) == (0, "")


def test_a_closed_pipe_is_no_error():
    with subprocess.Popen(
        [sys.executable, "-m", "ifrfit", "fit", "kharaz-2001", "--json"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        process.stdout.close()
        said = process.stderr.read()
    assert "Traceback" not in said
    assert "internal error" not in said
    assert "Exception ignored" not in said


FULL = Path("/dev/full")


@pytest.mark.skipif(not FULL.exists(), reason="there is no /dev/full")
@pytest.mark.parametrize("arguments", [("--help",), ("fit", "kharaz-2001")])
def test_a_full_disk_behind_standard_output_is_said(arguments):
    with FULL.open("w") as full:
        command = [sys.executable, "-m", "ifrfit", *arguments]
        found = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert (found.returncode, found.stderr) == (1, "ifrfit: standard output: No space left on device.\n")


@pytest.mark.skipif(not FULL.exists(), reason="there is no /dev/full")
@pytest.mark.parametrize("arguments", [("--help",), ("conventions",)])
def test_where_a_bug_is_looked_for_it_is_shown(arguments):
    with FULL.open("w") as full:
        command = [sys.executable, "-m", "ifrfit", *arguments]
        own = os.environ | {"IFRFIT_DEBUG": "1"}
        found = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False, env=own)
    assert "Traceback" in found.stderr


@pytest.mark.skipif(os.name != "posix", reason="a shell that closes it")
def test_a_standard_output_that_is_closed_is_no_error():
    command = ["sh", "-c", '"$0" -m ifrfit fit kharaz-2001 >&-', sys.executable]
    found = subprocess.run(command, stderr=subprocess.PIPE, text=True, check=False)
    assert (found.returncode, found.stderr) == (0, "")


def test_reproduce_writes_figures_and_prints_the_table(cli):
    found = cli("reproduce", "--out", "figures", "--figure", "3", "--figure", "A2.1b")
    assert (found.returncode, found.stderr) == (0, "")
    assert "cross-2019-no-spin" in found.stdout
    assert "stand-in" in found.stdout.lower()
    made = {path.name for path in Path("figures").iterdir()}
    assert made == {f"{stem}.{suffix}" for stem in ("fig3", "figA2.1b") for suffix in ("svg", "png", "csv")}
    assert [path.name for path in Path().iterdir()] == ["figures"]
