"""The workers of a Dask scheduler do what one process does, and a death there changes nothing."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest
from dying_workers import dying_always, dying_once, row_of
from refusals import refused
from streams import folder_of, impacts

import ifrfit
from ifrfit.campaign.run import run_campaign
from ifrfit.data.groups import Group
from ifrfit.data.stream import portions
from ifrfit.errors import UsageError
from ifrfit.inference.estimators import Bootstrap, LeastSquares
from ifrfit.inference.workers import crews
from ifrfit.inference.workers.crews import crew_of
from ifrfit.inference.workers.lots import in_lots

distributed = pytest.importorskip("distributed")
pytest.importorskip("numba")
pytestmark = [
    pytest.mark.skipif(sys.platform == "win32", reason="there is no SIGKILL"),
    pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning"),
]
GROUPS = [Group((f"{number}",), ()) for number in range(40)]
HERE = Path(__file__).parents[2]  # where the workers find the work of the tests


def record_of(fit):
    """All that a result file says, but for the time."""
    return {key: value for key, value in fit.to_dict().items() if key not in ("created", "command")}


@pytest.fixture(scope="module")
def local():
    """Address of a cluster of two processes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(HERE))
        with distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0", silence_logs=50
        ) as cluster:
            yield cluster.scheduler_address


@pytest.fixture
def small_portions(monkeypatch):
    """So small that a folder of some thousand rows has many."""
    monkeypatch.setattr(portions, "FIRST_ROWS", 600)
    monkeypatch.setattr(portions, "ROWS", 600)


def lost(group):
    return {"lost": group.key}


def rows_by(address, work):
    with crew_of(1, address) as crew:
        return {group.key: row for group, row in in_lots(iter(GROUPS), work, lost, crew, 10)}


def test_a_fit_is_the_same_to_the_last_bit(tmp_path, local, small_portions):
    folder = folder_of(tmp_path / "all", impacts(3000, series=2), 3, "parquet")
    alone = ifrfit.fit(folder, method="lsq")
    assert record_of(ifrfit.fit(folder, method=LeastSquares(scheduler=local))) == record_of(alone)


def test_a_bootstrap_is_the_same_to_the_last_bit(tmp_path, local, small_portions):
    folder = folder_of(tmp_path / "all", impacts(5000), 3, "parquet")
    alone, there = (
        ifrfit.fit(folder, method=Bootstrap(replicates=100, scheduler=address)) for address in (None, local)
    )
    assert record_of(there) == record_of(alone)


def test_a_campaign_is_the_same(tmp_path, local):
    table = impacts(240).assign(run=[f"{number // 60}" for number in range(240)])
    folder = folder_of(tmp_path / "all", table, 2)
    rows = []
    for name, scheduler in (("here", None), ("there", local)):
        with crew_of(1, scheduler) as crew:
            found, _ = run_campaign(
                [folder], ["run"], tmp_path / name, lambda done: [], crew=crew, facts=False
            )
        rows.append((found.keys, found.rows))
    assert len(rows[0][0]) == 4
    assert repr(rows[1]) == repr(rows[0])


def test_a_worker_that_dies_changes_nothing(tmp_path, local):
    rows = rows_by(local, partial(dying_once, tmp_path / "died", "17"))
    assert (tmp_path / "died").exists()
    assert rows == {group.key: row_of(group) for group in GROUPS}


def test_what_kills_each_worker_is_lost_alone(local):
    rows = rows_by(local, partial(dying_always, "17"))
    assert rows.pop(("17",)) == {"lost": ("17",)}
    assert rows == {group.key: row_of(group) for group in GROUPS if group.key != ("17",)}


def test_other_versions_are_refused(local, monkeypatch):
    monkeypatch.setattr(crews, "__version__", "99.0")
    with refused(UsageError, match=r"a worker has ifrfit .*, this is 99\.0"), crew_of(1, local):
        pass


def test_nobody_answers(monkeypatch):
    monkeypatch.setattr(crews, "_ANSWERS_WITHIN", 0.3)
    with refused(UsageError, match="no scheduler answers there"), crew_of(1, "tcp://127.0.0.1:9"):
        pass
    with refused(UsageError, match="no scheduler answers there"), crew_of(1, "nonsense"):
        pass


@contextlib.contextmanager
def started(*command):
    """A process of Dask's command line."""
    process = subprocess.Popen(
        [sys.executable, "-m", "dask", *command],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env=os.environ | {"PYTHONPATH": str(HERE)},
        start_new_session=True,
    )
    try:
        yield process
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


@pytest.fixture
def port():
    """One that is free."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


def test_scheduler_and_workers_of_the_command_line(tmp_path, port, small_portions, monkeypatch):
    monkeypatch.setattr(crews, "_WORKERS_WITHIN", 0.5)
    folder = folder_of(tmp_path / "all", impacts(9000), 3, "parquet")
    alone, out = record_of(ifrfit.fit(folder, method="lsq")), tmp_path / "out"
    address = f"tcp://127.0.0.1:{port}"
    method = LeastSquares(scheduler=address, resume=out)
    quick = ("--nthreads", "1", "--no-nanny", "--no-dashboard")
    with started("scheduler", "--port", f"{port}", "--dashboard-address", "127.0.0.1:0") as scheduler:
        with refused(UsageError, match="it has no workers"):
            ifrfit.fit(folder, method=method)
        monkeypatch.setattr(crews, "_WORKERS_WITHIN", 60)
        with started("worker", address, *quick) as one, started("worker", address, *quick):
            killed = []

            def killing(of):
                def progress(done, most):
                    if not killed and done > 1500:
                        killed.append(of)
                        os.killpg(of.pid, signal.SIGKILL)

                return progress

            assert record_of(ifrfit.fit(folder, method=method, progress=killing(one))) == alone
            assert killed.pop() is one
            with refused(UsageError, match="the scheduler is gone"):
                ifrfit.fit(folder, method=method, progress=killing(scheduler))
    assert list((tmp_path / "out.unfinished").iterdir())
    assert record_of(ifrfit.fit(folder, method=LeastSquares(resume=out))) == alone
    assert not (tmp_path / "out.unfinished").exists()


def test_a_scheduler_that_has_lost_its_workers_is_not_waited_for_without_end(
    tmp_path, port, small_portions, monkeypatch
):
    monkeypatch.setattr(crews, "_WITHOUT_WORKERS", 1.0)
    monkeypatch.setattr(crews, "_LOOK_EVERY", 0.2)
    folder = folder_of(tmp_path / "all", impacts(9000), 3, "parquet")
    address, out = f"tcp://127.0.0.1:{port}", tmp_path / "out"
    quick = ("--nthreads", "1", "--no-nanny", "--no-dashboard")
    with (
        started("scheduler", "--port", f"{port}", "--dashboard-address", "127.0.0.1:0"),
        started("worker", address, *quick) as worker,
    ):

        def killing(done, most):
            if done > 1500:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(worker.pid, signal.SIGKILL)

        method = LeastSquares(scheduler=address, resume=out)
        with pytest.raises(UsageError, match="it has had no workers"):
            ifrfit.fit(folder, method=method, progress=killing)
    alone = record_of(ifrfit.fit(folder, method="lsq"))
    assert record_of(ifrfit.fit(folder, method=LeastSquares(resume=out))) == alone
