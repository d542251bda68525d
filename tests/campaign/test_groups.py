"""Rows of many files as groups."""

from __future__ import annotations

import datetime

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from refusals import refused

from ifrfit.data.conventions import parse_conventions
from ifrfit.data.groups import Group, GroupedFiles, RefusedFile
from ifrfit.data.table_folders import table_files
from ifrfit.errors import DataError, UsageError

PLAIN = parse_conventions(())


def grouped(paths, *by):
    return GroupedFiles(tuple(table_files(paths)), by, PLAIN, tuple(paths))


def write(path, *lines, header="wall,gamma_deg,beta"):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join([header, *lines]) + "\n", encoding="utf-8")
    return path


def test_a_group_waits_for_all_its_files(tmp_path):
    write(tmp_path / "a.csv", "steel,10,0.1", "glass,20,0.2", "steel,30,0.3")
    write(tmp_path / "b.csv", "steel,40,0.4", "wood,50,0.5")
    found = list(grouped([tmp_path], "wall").groups())
    assert [group.key for group in found] == [("glass",), ("steel",), ("wood",)]
    steel = found[1]
    assert steel.files == ("a.csv", "b.csv")
    assert [table.lines.tolist() for table in steel.tables] == [[2, 4], [2]]
    assert [table.texts(2) for table in steel.tables] == [["0.1", "0.3"], ["0.4"]]
    assert steel.rows == 3


def test_columns_may_be_folders_and_the_file(tmp_path):
    for wall in ("steel", "glass"):
        for name in ("1", "2"):
            write(tmp_path / f"wall={wall}" / f"{name}.csv", "10,0.1", header="gamma_deg,beta")
    keys = [group.key for group in grouped([tmp_path], "wall", "file").groups()]
    assert keys == [("glass", "1"), ("glass", "2"), ("steel", "1"), ("steel", "2")]


def test_files_that_differ_by_their_suffix_alone_are_groups_of_their_own(tmp_path):
    write(tmp_path / "a.csv", "10,0.1", header="gamma_deg,beta")
    pd.DataFrame({"gamma_deg": [20.0], "beta": [0.2]}).to_parquet(tmp_path / "a.parquet")
    found = {group.key: group.rows for group in grouped([tmp_path], "file").groups()}
    assert found == {("a.csv",): 1, ("a.parquet",): 1}


def test_files_of_one_name_in_two_folders_are_groups_of_their_own(tmp_path):
    for place, name in enumerate(("mon/run01", "mon/run02", "tue/run01", "wed/run03")):
        write(tmp_path / f"{name}.csv", f"{10 + place},0.1", header="gamma_deg,beta")
    found = [group.key for group in grouped([tmp_path], "file").groups()]
    assert found == [("mon/run01",), ("mon/run02",), ("tue/run01",), ("wed/run03",)]
    two = grouped([tmp_path / "mon", tmp_path / "tue"], "file")
    assert [group.key[0] for group in two.groups()] == [
        (tmp_path / name).as_posix() for name in ("mon/run01.csv", "mon/run02.csv", "tue/run01.csv")
    ]
    alone = grouped([tmp_path / "mon", tmp_path / "wed"], "file")
    assert [group.key for group in alone.groups()] == [("run01",), ("run02",), ("run03",)]


def test_a_column_called_file_takes_no_group_from_another_file(tmp_path):
    """The second group of the key took the place of the first one, without a word."""
    for place, name in enumerate("abc"):
        write(tmp_path / f"{name}.csv", f"{'xxy'[place]},{10 + place},0.1", header="file,gamma_deg,beta")
    found = list(grouped([tmp_path], "file").groups())
    assert [each.key for each in found if isinstance(each, Group)] == [("x",), ("y",)]
    (refusal,) = (each for each in found if isinstance(each, RefusedFile))
    assert refusal.name == "b.csv"
    assert "its column file names a group of an earlier file, x" in refusal.reason


@pytest.mark.parametrize(
    ("kind", "values"),
    [("date32", [datetime.date(2024, 1, 2), datetime.date(2024, 1, 3)]), ("bool", [True, False])],
)
def test_kinds_that_are_no_keys_are_told_with_what_helps(tmp_path, kind, values):
    table = pa.table({"day": values, "gamma_deg": [10.0, 20.0], "beta": [0.1, 0.2]})
    pq.write_table(table, tmp_path / "a.parquet")
    (found,) = grouped([tmp_path], "day").groups()
    assert f"column day: holds {kind}" in found.reason
    assert "Write it as text, or leave day out of --by." in found.reason


def test_blanks_around_are_no_part_of_a_key(tmp_path):
    write(tmp_path / "a.csv", "s,10,0.1", '"s ",20,0.1', '" s",30,0.1', "S,40,0.1", '"s s",50,0.1')
    assert [(each.key, each.rows) for each in grouped([tmp_path], "wall").groups()] == [
        (("s",), 3), (("S",), 1), (("s s",), 1),
    ]  # fmt: skip


@pytest.mark.parametrize("by", ["file", "wall"])
def test_the_same_rows_in_two_formats_are_counted_once(tmp_path, by):
    write(tmp_path / "a.csv", "steel,10,0.1", "steel,20,0.2")
    table = pd.DataFrame({"wall": "steel", "gamma_deg": [10.0, 20.0], "beta": [0.1, 0.2]})
    table.to_parquet(tmp_path / "a.parquet")
    refusal, group = sorted(grouped([tmp_path], by).groups(), key=lambda each: isinstance(each, Group))
    assert "a.parquet: has the rows of a.csv, which would be counted twice" in refusal.reason
    assert group.rows == 2


def test_numbers_beyond_those_of_floats_are_no_keys(tmp_path):
    table = pd.DataFrame({"run": [2**53, 2**53 + 1], "gamma_deg": [10.0, 20.0], "beta": [0.1, 0.2]})
    table.to_parquet(tmp_path / "a.parquet")
    (found,) = grouped([tmp_path / "a.parquet"], "run").groups()
    assert isinstance(found, RefusedFile)
    assert "column run: holds whole numbers beyond 2^53" in found.reason


def test_parquet_numbers_are_keys_as_text(tmp_path):
    table = pd.DataFrame({"run": [1, 1, 2], "gamma_deg": [10.0, 20.0, 30.0], "beta": [0.1, 0.2, 0.3]})
    table.to_parquet(tmp_path / "a.parquet")
    found = list(grouped([tmp_path / "a.parquet"], "run").groups())
    assert [group.key for group in found] == [("1",), ("2",)]
    np.testing.assert_array_equal(found[0].tables[0].numbers(1), [10.0, 20.0])


def test_a_number_without_end_is_a_key(tmp_path):
    path = tmp_path / "a.parquet"
    pd.DataFrame({"run": [1.0, np.inf, 1.5, np.inf], "beta": 0.1}).to_parquet(path, index=False)
    assert [group.key for group in grouped([path], "run").groups()] == [("1",), ("inf",), ("1.5",)]


def test_a_file_that_cannot_be_read_takes_nothing_from_the_others(tmp_path):
    write(tmp_path / "a.csv", "steel,10,0.1")
    (tmp_path / "b.parquet").write_bytes(b"PAR1 and no more")
    write(tmp_path / "c.csv", "10,0.1", header="gamma_deg,beta")
    found = list(grouped([tmp_path], "wall").groups())
    refused = [each for each in found if isinstance(each, RefusedFile)]
    assert [each.name for each in refused] == ["b.parquet", "c.csv"]
    assert "no such column" in refused[1].reason
    assert [each.key for each in found if isinstance(each, Group)] == [("steel",)]


def test_a_file_that_changes_while_it_is_read_is_told(tmp_path, monkeypatch):
    write(tmp_path / "a.csv", "steel,10,0.1")
    changing = write(tmp_path / "b.csv", "steel,20,0.2", "wood,30,0.3")
    groups = grouped([tmp_path], "wall")
    reads = GroupedFiles._read

    def after_a_change(self, *state):
        write(changing, "steel,21,0.2", "wood,30,0.3")
        return reads(self, *state)

    monkeypatch.setattr(GroupedFiles, "_read", after_a_change)
    found = {group.key: group.trouble for group in groups.groups()}
    assert all("changed while it was read" in found[key,] for key in ("steel", "wood"))


def test_a_file_that_goes_while_it_is_read_is_told(tmp_path, monkeypatch):
    write(tmp_path / "a.csv", "steel,10,0.1")
    going = write(tmp_path / "b.csv", "steel,20,0.2", "wood,30,0.3")
    groups = grouped([tmp_path], "wall")
    reads = GroupedFiles._read

    def without_it(self, *state):
        going.unlink()
        return reads(self, *state)

    monkeypatch.setattr(GroupedFiles, "_read", without_it)
    found = {each.key: each.trouble for each in groups.groups() if isinstance(each, Group)}
    assert set(found) == {("steel",), ("wood",)}
    assert all("changed while it was read" in trouble for trouble in found.values())


def test_the_digest_follows_what_is_read(tmp_path):
    path = write(tmp_path / "a.csv", "steel,10,0.1", "glass,20,0.2")
    before = {group.key: group.digest for group in grouped([path], "wall").groups()}
    write(path, "steel,10,0.1", "glass,20,0.3")
    after = {group.key: group.digest for group in grouped([path], "wall").groups()}
    assert before["steel",] == after["steel",]
    assert before["glass",] != after["glass",]


@pytest.mark.parametrize("by", [(), ("wall", "wall")])
def test_columns_are_named_once(tmp_path, by):
    with refused(UsageError, match="--by"):
        grouped([write(tmp_path / "a.csv", "steel,10,0.1")], *by)


def test_a_column_that_no_file_has(tmp_path):
    path = write(tmp_path / "a.csv", "steel,10,0.1")
    with refused(UsageError, match=r"--by wal: .* wall, gamma_deg and beta"):
        list(grouped([path], "wal").groups())


def test_nothing_to_read(tmp_path):
    with refused(DataError, match="no CSV"):
        table_files([tmp_path])
    with refused(DataError, match="no such file"):
        table_files([tmp_path / "a.csv"])


@pytest.mark.parametrize("by", [("material",), ("file",), ("file", "material")])
def test_a_copy_of_a_file_under_another_name_is_told_and_not_counted(tmp_path, by):
    """Its rows went into the groups of the first one, or made groups of their own, twice as many."""
    text = "material,gamma_deg,beta\n" + "".join(f"{m},{20 + i},0.5\n" for m in "ab" for i in range(3))
    for name, content in (("a", text), ("b", text), ("c", text.replace("0.5", "0.4")), ("d", text)):
        (tmp_path / f"{name}.csv").write_text(content, encoding="utf-8")
    files = grouped([tmp_path], *by)
    found = list(files.groups())
    refused = [each for each in found if isinstance(each, RefusedFile)]
    groups = [each for each in found if isinstance(each, Group)]
    assert [each.name for each in refused] == ["b.csv", "d.csv"]
    assert all("a.csv, and would be counted twice. Remove one of them." in each.reason for each in refused)
    assert sum(group.rows for group in groups) == 12
    assert not any(group.trouble for group in groups)


def test_the_rows_of_a_file_in_another_format_trouble_no_group(tmp_path):
    table = pd.DataFrame({"material": list("aabb"), "gamma_deg": [10.0, 20, 30, 40], "beta": 0.5})
    table.to_csv(tmp_path / "a.csv", index=False)
    table.to_parquet(tmp_path / "a.parquet")
    files = grouped([tmp_path], "material")
    groups = [each for each in files.groups() if isinstance(each, Group)]
    assert [group.rows for group in groups] == [2, 2]
    assert not any(group.trouble for group in groups)
