"""Ctrl-C on a process of its own: what was found is kept and said, and nothing is left running."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="process groups and signals of POSIX")

# the command line, which tells a file when work is under way
_TOLD = """
import contextlib, pathlib, signal, sys
import ifrfit.cli.{module} as module
from ifrfit.cli.main import main

@contextlib.contextmanager
def working(*_args, **_options):
    told = []
    def progress(done, most):
        told.append(done)
        if len(told) == {after}:
            pathlib.Path("under-way").touch()
    yield progress

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in the background
    module.working = working
    sys.argv[0] = "ifrfit"
    main()
"""
_PATIENCE = 120.0  # seconds until a busy machine must have come so far


def interrupt(
    *arguments: str, module: str = "fit", after: int = 1, number: signal.Signals = signal.SIGINT
) -> tuple[subprocess.CompletedProcess, float]:
    """Run a command, press Ctrl-C once it is under way; what came of it, and seconds until it had ended.

    Any other signal goes to the command alone, as that of a batch system may.
    """
    script = Path("told.py")
    script.write_text(_TOLD.format(module=module, after=after), encoding="utf-8")
    sign = Path("under-way")
    sign.unlink(missing_ok=True)
    with subprocess.Popen(
        [sys.executable, str(script), *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        try:
            end = time.monotonic() + _PATIENCE
            while not sign.exists() and process.poll() is None and time.monotonic() < end:
                time.sleep(0.02)
            assert sign.exists(), process.communicate()[1]
            # a terminal sends it to all of them
            (os.killpg if number == signal.SIGINT else os.kill)(process.pid, number)
            begin = time.monotonic()
            out, err = process.communicate(timeout=_PATIENCE)
            elapsed = time.monotonic() - begin
        finally:
            alive = left_over(process.pid)
            if alive:
                os.killpg(process.pid, signal.SIGKILL)
    assert not alive, "processes are left"
    return subprocess.CompletedProcess(arguments, process.returncode, out, err), elapsed


def left_over(group: int) -> bool:
    """Whether a process of a group lives on; a helper of Python's own needs a moment to see the end."""
    for _ in range(100):
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return False
        time.sleep(0.05)
    return True


FIT = ("fit", "cross-2019", "--fix", "e_n=0.94")
# measured, with other work on both cores: 0.1 to 0.25 s, and 2.5 s where a comparison draws what it has
SOON = 5.0


@pytest.mark.usefixtures("small_page")
@pytest.mark.parametrize("workers", ["1", "2"])
def test_chains_are_kept_and_the_same_command_goes_on(cli, workers: str) -> None:
    asked = (*FIT, "--method", "mcmc", "--max-steps", "120", "--workers", workers, "--out", "results")
    found, elapsed = interrupt(*asked)
    assert (found.returncode, found.stdout) == (130, "")
    assert found.stderr.startswith("ifrfit: interrupted. ")
    assert "steps of the chains are kept in" in found.stderr
    assert "the same command goes on with them" in found.stderr
    assert found.stderr.count("\n") == 1
    assert elapsed < SOON
    assert not Path("results").exists()
    with np.load("results.unfinished/chains.npz", allow_pickle=False) as file:
        steps = file["at"].shape[1]
        first = file["at"]
    assert 0 < steps < 120

    if workers == "1":
        assert cli(*asked, "--quiet").returncode == 0
        assert not Path("results.unfinished").exists()
        with np.load("results/chains.npz", allow_pickle=False) as file:
            assert file["at"].shape[1] == 120
            np.testing.assert_array_equal(file["at"][:, :steps], first)


def test_a_batch_system_ends_a_campaign_that_goes_on_later(cli) -> None:
    """As SLURM does when the time is over: SIGTERM, and some seconds later SIGKILL."""
    rng = np.random.default_rng(1)
    lines = [
        f"r{group},{gamma:.3f},{0.3 + noise[0]:.4f},{0.9 + noise[1]:.4f}"
        for group in range(300)
        for gamma, *noise in np.column_stack((rng.uniform(10.0, 80.0, 8), rng.normal(0.0, 0.02, (8, 2))))
    ]
    Path("all.csv").write_text("run,gamma_deg,beta,e_n\n" + "\n".join(lines), encoding="utf-8")
    asked = ("campaign", "all.csv", "--by", "run", "--method", "lsq", "--no-facts", "--out", "results")
    found, elapsed = interrupt(*asked, module="campaign", after=2, number=signal.SIGTERM)
    assert (found.returncode, found.stdout) == (143, "")
    assert found.stderr == "ifrfit: interrupted. What was found is kept: --resume goes on.\n"
    assert elapsed < SOON
    assert Path("results.unfinished.jsonl").exists()
    assert cli(*asked, "--resume", "--quiet").returncode == 0


def test_without_a_folder_chains_are_kept_here(cli) -> None:
    asked = (*FIT, "--method", "mcmc", "--max-steps", "90")
    found, _ = interrupt(*asked)
    assert found.returncode == 130
    (kept,) = Path().glob("ifrfit-*.unfinished")
    assert str(kept) in found.stderr


@pytest.mark.usefixtures("small_page")
def test_chains_of_another_question_are_not_gone_on_with(cli) -> None:
    asked = (*FIT, "--method", "mcmc", "--max-steps", "90", "--out", "results")
    interrupt(*asked)
    assert cli(*asked, "--seed", "1", "--quiet").returncode == 0
    assert cli(*asked[:-2], "--seed", "1", "--out", "anew", "--quiet").returncode == 0
    one, other = (json.loads(Path(x, "result.json").read_text())["constants"] for x in ("results", "anew"))
    assert one == other


BOOTSTRAP = ("--method", "bootstrap", "--replicates", "100000", "--out", "results")


@pytest.mark.usefixtures("small_page")
def test_replicates_are_kept(cli) -> None:
    found, elapsed = interrupt(*FIT, *BOOTSTRAP, after=2)
    assert (found.returncode, found.stdout) == (130, "")
    assert "replicates are kept in" in found.stderr
    assert elapsed < SOON
    with np.load("results.unfinished/replicates.npz", allow_pickle=False) as file:
        kept = len(file["reason"])
    assert kept > 1000
    assert cli(*FIT, *BOOTSTRAP[:3], "1000", "--out", "results", "--quiet").returncode == 0
    assert not Path("results.unfinished").exists()
    assert cli(*FIT, *BOOTSTRAP[:3], "1000", "--out", "anew", "--quiet").returncode == 0
    one, other = (json.loads(Path(x, "result.json").read_text())["constants"] for x in ("results", "anew"))
    for name in ("e_t", "mu"):
        assert one[name]["value"] == pytest.approx(other[name]["value"], rel=1e-9)


def test_a_comparison_keeps_what_is_compared() -> None:
    found, elapsed = interrupt(
        "compare", "cross-2019", "--fix", "e_n=0.94", "--out", "compared", module="compare", after=2
    )
    assert found.returncode == 130
    assert elapsed < 2.0 * SOON
    assert "not fitted" in found.stderr
    assert "nothing cross-validated" in found.stderr
    assert "VERDICT" in found.stdout
    kept = json.loads(Path("compared/compare.json").read_text())
    assert any("Interrupted: " in note for note in kept["notes"])


def test_an_interrupt_before_anything_is_found_says_so() -> None:
    found, _ = interrupt("compare", "cross-2019", "--fix", "e_n=0.94", module="compare", after=1)
    assert (found.returncode, found.stdout, found.stderr) == (130, "", "ifrfit: interrupted.\n")


def test_reports_that_were_drawn_are_written_with_an_index_of_them(cli) -> None:
    content = cli(*FIT, "--method", "lsq", "--json").stdout
    for name in ("a", "b", "c"):
        Path(f"{name}.json").write_text(content, encoding="utf-8")
    found, _ = interrupt("report", "a.json", "b.json", "c.json", "--out", "pages", module="report", after=1)
    assert (found.returncode, found.stdout) == (130, "")
    assert found.stderr == "ifrfit: interrupted. 1 of 3 reports are in pages.\n"
    assert {path.name for path in Path("pages").iterdir()} == {"index.html", "a.html"}
    assert "b.html" not in Path("pages/index.html").read_text(encoding="utf-8")
