"""Processes that die cost no group anything but the one that kills them."""

from __future__ import annotations

import sys
from functools import partial

import pytest
from dying_workers import dying_always, dying_once, row_of

from ifrfit.data.groups import Group
from ifrfit.inference.workers.crews import crew_of
from ifrfit.inference.workers.lots import in_lots

LOT = 16  # each halving of the lot of a group that kills takes processes that start anew
GROUPS = [Group((f"{number}",), ()) for number in range(3 * LOT + 7)]
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="there is no SIGKILL")


def lost(group: Group) -> dict[str, object]:
    return {"lost": group.key}


def by_workers(work, workers):
    """The groups with their rows."""
    with crew_of(workers, None) as crew:
        return list(in_lots(iter(GROUPS), work, lost, crew, LOT))


@pytest.mark.parametrize("workers", [1, 2, 3])
def test_every_group_has_its_row(workers):
    def work(groups):
        return [row_of(group) for group in groups]

    function = work if workers == 1 else partial(dying_always, "nobody")
    found = by_workers(function, workers)
    assert sorted(group.key for group, _ in found) == sorted(group.key for group in GROUPS)
    assert all(row == {"key": group.key} for group, row in found)


def test_a_killed_worker_changes_nothing(tmp_path):
    work = partial(dying_once, tmp_path / "died", "40")
    found = by_workers(work, 2)
    assert (tmp_path / "died").exists()
    assert sorted(group.key for group, _ in found) == sorted(group.key for group in GROUPS)
    assert all(row == {"key": group.key} for group, row in found)


def test_a_group_that_kills_each_time_is_lost_alone():
    found = {group.key: row for group, row in by_workers(partial(dying_always, "40"), 2)}
    assert len(found) == len(GROUPS)
    assert found.pop(("40",)) == {"lost": ("40",)}
    assert all(row == {"key": key} for key, row in found.items())


@pytest.mark.parametrize("workers", [2, 3])
def test_a_group_that_kills_each_time_is_lost_alone_where_it_is_the_first(workers):
    """Three deaths before any answer were taken for processes that cannot start."""
    few = GROUPS[:3]
    with crew_of(workers, None) as crew:
        found = {
            group.key: row for group, row in in_lots(iter(few), partial(dying_always, "0"), lost, crew, LOT)
        }
    assert found == {("0",): {"lost": ("0",)}} | {group.key: row_of(group) for group in few[1:]}
