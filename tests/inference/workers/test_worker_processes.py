"""Worker processes know what was registered in the process that started them, or it says that they cannot."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from extensions.closure import GRIP
from extensions.error_law import Logistic
from extensions.observable import SPIN_GAINED
from factories import impacts_file
from refusals import refused

import ifrfit
from ifrfit import MCMC, Bootstrap, UsageError
from ifrfit.inference.model.error_law import ERROR_LAWS
from ifrfit.inference.workers.crews import CrewDiedError, Processes
from ifrfit.inference.workers.worker_processes import end_at_once, start_processes, worker_processes
from ifrfit.physics.closures import CLOSURES
from ifrfit.physics.observables import OBSERVABLES
from ifrfit.registry import registered


@pytest.fixture
def default_start() -> Iterator[None]:
    """Whatever a test makes the default, how processes start is afterwards as it was before."""
    before = multiprocessing.get_start_method()
    yield
    multiprocessing.set_start_method(before, force=True)


def _known() -> tuple[str, ...]:
    return (*CLOSURES, *OBSERVABLES, *ERROR_LAWS)


def test_what_is_registered_here_is_registered_there() -> None:
    with registered(GRIP, SPIN_GAINED, Logistic()), worker_processes(1) as pool:
        assert "logistic" in pool.submit(_known).result()
        assert pool.submit(_known).result() == _known()


# of fork, spawn and forkserver, whichever a platform has, one as the default
@pytest.mark.long
@pytest.mark.parametrize(("name", "place"), [("bootstrap", 0), ("mcmc", -1)])
def test_draws_by_registered_entries_do_not_depend_on_the_workers(
    tmp_path: Path, default_start: None, name: str, place: int
) -> None:
    multiprocessing.set_start_method(multiprocessing.get_all_start_methods()[place], force=True)
    made = {"gamma": np.linspace(5.0, 85.0, 6), "e_n": 0.9, "mu": 0.12, "closure": "grip", "c": 0.7}
    made |= {"observables": ("beta", "spin_gained"), "noise": 0.01, "sigma": 0.01}
    with registered(GRIP, SPIN_GAINED, Logistic()):
        path = impacts_file(tmp_path / "impacts.csv", made, {**made, "series": "second", "seed": 1})
        noise = ifrfit.Noise("known", tails="gaussian" if name == "bootstrap" else "logistic")
        model = ifrfit.Model("grip", fix={"e_n": 0.9}, separate="mu")
        method = Bootstrap(replicates=100) if name == "bootstrap" else MCMC(max_steps=20)
        one, two = (
            ifrfit.fit(path, model, noise=noise, method=replace(method, workers=workers))
            for workers in (1, 2)
        )
    np.testing.assert_array_equal(one.state.sample, two.state.sample)


@dataclass(frozen=True)
class Named(Logistic):
    """A law that cannot be made without arguments."""

    name: str = "named"
    scale: float | None = None

    def __post_init__(self) -> None:
        if self.scale is None:
            raise TypeError


@pytest.mark.parametrize(
    ("entry", "kind"), [(replace(GRIP, name="local"), "closure"), (Named(scale=2.0), "law of errors")]
)
def test_an_entry_that_other_processes_cannot_import_is_refused(entry: object, kind: str) -> None:
    says = f"--workers 2: other processes cannot import the {kind} '.*', which was registered here. Define it"
    with registered(entry), refused(UsageError, match=says), worker_processes(2):
        pass


def long_answer() -> bytes:
    """So many bytes that the process is at its answer for a while."""
    return b"0" * 200_000_000


def is_reading(pool: ProcessPoolExecutor) -> bool:
    """Whether an answer is on its way: the thread of the pool is within the reading of it."""
    reader = pool._executor_manager_thread
    frame = sys._current_frames().get(reader.ident or 0) if reader is not None else None
    return frame is not None and frame.f_code.co_name == "_recv"


def test_processes_that_are_ended_while_they_answer_hold_up_nobody() -> None:
    before = multiprocessing.active_children()
    pool = start_processes(2)
    answer = pool.submit(long_answer)
    while not (is_reading(pool) or answer.done()):
        time.sleep(1e-3)
    assert not answer.done()
    end_at_once(pool, before)
    ended = threading.Thread(target=pool.shutdown, kwargs={"cancel_futures": True}, daemon=True)
    ended.start()
    ended.join(20.0)
    assert not ended.is_alive()


def long_answers(items: Sequence[int]) -> list[bytes]:
    return [long_answer() for _ in items]


@pytest.mark.skipif(sys.platform == "win32", reason="there is no SIGKILL")
def test_a_process_that_is_killed_while_it_answers_is_noticed() -> None:
    """The thread of the pool waited for the rest of the answer without end, and the campaign with it."""
    crew = Processes(1)
    answer = crew.submit(long_answers, [1])
    pool = crew._pool
    assert pool is not None
    while not (is_reading(pool) or answer.done()):
        time.sleep(1e-3)
    assert not answer.done()
    for process in pool._processes.values():
        process.kill()
    waiting = threading.Thread(target=crew.first_done, args=([answer],), daemon=True)
    waiting.start()
    waiting.join(20.0)
    if waiting.is_alive():
        crew.end_at_once()
        pytest.fail("nothing was noticed")
    with pytest.raises(CrewDiedError):
        crew.result(answer)


def test_what_processes_need_is_imported_before_there_is_work() -> None:
    crew = Processes(1, "ifrfit.cost.physics_costs")
    try:
        # on Linux by one process for all, which those with work are children of
        assert (crew._pool is None) == (sys.platform == "linux")
        assert crew.result(crew.submit(modules, ["ifrfit.cost.physics_costs"])) == [True]
        assert (crew.result(crew.submit(parents, [0])) == [os.getpid()]) == (sys.platform != "linux")
    finally:
        crew.close()


@pytest.mark.parametrize("gone", [False, True])
def test_a_temporary_folder_in_which_no_socket_can_be(tmp_path: Path, gone: bool) -> None:
    """It was an internal error: the path of a socket has some hundred letters at most."""
    folder = tmp_path / ("short" if gone else "x" * 120)
    folder.mkdir()
    script = f"""
from pathlib import Path
from ifrfit.inference.workers.crews import Processes
crew = Processes(1, "ifrfit.errors")
if {gone}:
    for socket in Path({str(folder)!r}).glob("*/listener-*"):
        socket.unlink()
print(crew.result(crew.submit(len, "abc")))
crew.close()
"""
    env = os.environ | {"TMPDIR": str(folder)}
    found = subprocess.run(
        [sys.executable, "-c", script], env=env, capture_output=True, text=True, timeout=60
    )
    assert (found.returncode, found.stdout, found.stderr) == (0, "3\n", "")


def test_an_interrupt_while_they_import_is_left_to_who_started_them(tmp_path: Path) -> None:
    """Python's tracker of resources lets interrupts in again where it starts."""
    script = """
import os, signal, time
from ifrfit.inference.workers.crews import Processes
signal.signal(signal.SIGINT, lambda *_: None)
crew = Processes(1, "slow")
time.sleep(0.5)
os.killpg(0, signal.SIGINT)  # as a terminal does: to all of them
print(crew.result(crew.submit(len, "abc")))
crew.close()
"""
    assert beside_a_slow_module(tmp_path, script) == (0, "3\n", "")


def beside_a_slow_module(folder: Path, script: str) -> tuple[int, str, str]:
    """Status, output and errors of a script that can import `slow`, in a session of its own."""
    (folder / "slow.py").write_text("import time\ntime.sleep(1.0)\n")
    found = subprocess.run(
        [sys.executable, "-c", script],
        env=os.environ | {"PYTHONPATH": f"{folder}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"},
        capture_output=True,
        text=True,
        timeout=60,
        start_new_session=True,
    )
    return found.returncode, found.stdout, found.stderr


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere no process imports for others")
def test_a_server_of_processes_that_is_killed_at_once(tmp_path: Path) -> None:
    """It was an internal error where it died between the question for a process and its answer."""
    script = """
import os, signal, threading
from multiprocessing import forkserver
from ifrfit.inference.workers.crews import Processes
crew = Processes(1, "slow")
pid = forkserver._forkserver._forkserver_pid
threading.Timer(0.3, os.kill, (pid, signal.SIGKILL)).start()
print(crew.result(crew.submit(len, "abc")))
crew.close()
"""
    assert beside_a_slow_module(tmp_path, script) == (0, "3\n", "")


def test_work_that_comes_when_processes_were_let_go_starts_others() -> None:
    crew = Processes(1)
    try:
        before = crew.result(crew.submit(numbers_of, [0]))
        crew.let_go()
        assert crew._pool is None
        assert crew.result(crew.submit(numbers_of, [0])) != before
    finally:
        crew.close()


_GIVES_WORK = """
import os, signal, sys
from ifrfit.inference.workers.crews import Processes
sys.path.insert(0, {folder!r})
from test_worker_processes import numbers_of
if __name__ == "__main__":
    crew = Processes(2)
    print(*crew.result(crew.submit(numbers_of, [0])), flush=True)
    os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="there is no SIGKILL")
def test_processes_end_with_the_one_that_gives_them_work(tmp_path: Path) -> None:
    """They waited for work without end, and who reads their output for them."""
    script = tmp_path / "work.py"
    script.write_text(_GIVES_WORK.format(folder=str(Path(__file__).parent)), encoding="utf-8")
    path = os.pathsep.join([*sys.path, os.environ.get("PYTHONPATH", "")])
    found = subprocess.run(
        [sys.executable, str(script)],
        capture_output=True,
        text=True,
        timeout=60,
        env=os.environ | {"PYTHONPATH": path},
        check=False,
    )  # which ends when nobody holds the output any longer
    assert found.returncode == -signal.SIGKILL
    assert int(found.stdout) > 0


def modules(names: Sequence[str]) -> list[bool]:
    return [name in sys.modules for name in names]


def parents(items: Sequence[int]) -> list[int]:
    return [os.getppid() for _ in items]


def numbers_of(items: Sequence[int]) -> list[int]:
    return [os.getpid() for _ in items]
