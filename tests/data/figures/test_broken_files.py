"""Broken and hostile files: one sentence with file and place, exit status 3, nothing written."""

from __future__ import annotations

import copy
import json
import re
import tarfile
import time
import tracemalloc
from pathlib import Path

import pytest
from command_line import in_this_process
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from project_files import (
    POINTS,
    THREE,
    as_json,
    as_tar,
    axes,
    axis_point,
    calibration,
    coordinate_system,
    curve,
    dataset,
    engauge,
    version_3,
    version_4,
)

import ifrfit
from ifrfit.data.figures import bounded_xml, digitised_figure
from ifrfit.errors import DataError

WHOLE = as_json(version_4())
XML = engauge()


def member(name="figure/x", kind=tarfile.REGTYPE, size=0, link=""):
    found = tarfile.TarInfo(name)
    found.type, found.size, found.linkname = kind, size, link
    return found


def header_alone(name, size):
    """A tar whose one header claims a size that no bytes follow."""
    return member(name, size=size).tobuf(tarfile.GNU_FORMAT) + bytes(1024)


def changed(*path, to):
    project = copy.deepcopy(version_4())
    inner = project
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = to
    return as_json(project)


def without(*path):
    project = copy.deepcopy(version_4())
    inner = project
    for key in path[:-1]:
        inner = inner[key]
    del inner[path[-1]]
    return as_json(project)


def clicked(**of_each):
    given = [
        {**each, **{key: values[i] for key, values in of_each.items()}}
        for i, each in enumerate(calibration())
    ]
    return axes(calibrationPoints=given)


def with_axes(given):
    return as_json(version_4(axes_coll=[given]))


POINT = "axesColl", 0, "calibrationPoints"
BOMB = (
    b'<!DOCTYPE lolz [<!ENTITY a "lol"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">'
    b'<!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;&b;&b;">]><Document>&c;</Document>'
)
OUTSIDE = b'<!DOCTYPE x [<!ENTITY a SYSTEM "file:///etc/passwd">]><Document>&a;</Document>'

CASES = {
    # JSON
    "cut short": (WHOLE[:300], "line 1, character"),
    "cut in a text": (WHOLE[:40], "cut short"),
    "nested too deeply": (b'{"version":' * 200_000, "is nested more deeply than any project file"),
    "lists too deep": (b'{"version":' + b"[" * 200_000, "is nested more deeply"),
    "too large": (b'{"version": "' + b"x" * (17 * 2**20) + b'"}', "17 MB of JSON are more than any project"),
    "no UTF-8": (b'{"version": "\xff\xfe\xff"}', "no JSON"),
    "not a number": (b'{"version": [4, NaN]}', "NaN is no number of JSON"),
    "endless digits": (b'{"version": [' + b"9" * 6000 + b"]}", "no JSON"),
    "no project": (b'{"axesColl": []}', "is no project of WebPlotDigitizer"),
    "a list of versions that is none": (changed("version", to="4.2"), "version: is '4.2', not a list"),
    "version of text": (changed("version", to=["4"]), "version[0]: is '4', not a number"),
    "no version": (changed("version", to=[]), "version: is none; known are 3 and 4"),
    "version 5": (changed("version", to=[5, 0]), "version: is 5.0; known are 3 and 4"),
    "version 2 in wpd": (as_json(version_3(version=(2, 6))), "wpd.version: is 2.6; known are 3 and 4"),
    "wpd of a wrong type": (b'{"wpd": 3}', "wpd: is a number, not an object"),
    "axes of a wrong type": (changed("axesColl", to={}), "axesColl: is an object, not a list"),
    "axes without a type": (without("axesColl", 0, "type"), "axesColl[0]: has no type"),
    "axes without points": (without(*POINT), "axesColl[0]: has no calibrationPoints"),
    "no axes": (as_json(version_4(axes_coll=[])), "datasetColl[0].axesName: there are no axes called 'XY'"),
    "neither axes nor points": (as_json(version_4(axes_coll=[], dataset_coll=[])), "has no axes"),
    "three points": (
        with_axes(axes(calibrationPoints=calibration()[:3])),
        "take four calibration points, here are 3",
    ),
    "a point without px": (without(*POINT, 2, "px"), "axesColl[0].calibrationPoints[2]: has no px"),
    "px of text": (changed(*POINT, 2, "px", to="ten"), "calibrationPoints[2].px: is 'ten', not a number"),
    "px of true": (
        changed(*POINT, 2, "px", to=True),
        "calibrationPoints[2].px: is true or false, not a number",
    ),
    "px beyond numbers": (
        WHOLE.replace(b'"px": 90.0', b'"px": 1e999', 1),
        "calibrationPoints[2].px: is not a finite number",
    ),
    "dx of words": (changed(*POINT, 0, "dx", to="ten"), "calibrationPoints[0].dx: 'ten' is not a number"),
    "dx empty": (changed(*POINT, 0, "dx", to=""), "calibrationPoints[0].dx: '' is not a number"),
    "dx missing": (changed(*POINT, 0, "dx", to=None), "calibrationPoints[0]: has no dx"),
    "dx beyond numbers": (
        changed(*POINT, 0, "dx", to="1e999"),
        "calibrationPoints[0].dx: is not a finite number",
    ),
    "an axis of no length": (
        with_axes(clicked(dx=("5",) * 4)),
        "the x axis: all clicks on it are said to be at 5",
    ),
    "one spot": (with_axes(clicked(px=(9,) * 4, py=(9,) * 4)), "lie on one spot or on one line"),
    "beyond numbers": (
        with_axes(clicked(px=(1e308, -1e308, 1e308, 0.0))),
        "lie on one spot or on one line",
    ),
    "one line": (with_axes(clicked(px=(1, 2, 3, 4), py=(1, 2, 3, 4))), "lie on one spot or on one line"),
    "groups of a wrong type": (changed("datasetColl", 0, "groupNames", to="Upper"), "groupNames: is 'Upper', not a list"),
    "a group of text": (
        as_json(version_4(dataset_coll=[dataset(groupNames=["P", "U"], data=[{"x": 1, "y": 2, "group": "U"}])])),
        "datasetColl[0].data[0].group: is 'U', not a number",
    ),
    "a log axis through zero": (
        with_axes({**axes(), "isLogX": True}),
        "the x axis: is logarithmic and goes from 0 to 90, through zero",
    ),
    "a flag of text": (changed("axesColl", 0, "isLogX", to="yes"), "isLogX: is 'yes', not true or false"),
    "axes twice": (as_json(version_4(axes_coll=[axes(), axes()])), "axesColl: 2 axes are called 'XY'"),
    "datasets twice": (
        as_json(version_4(dataset_coll=[dataset(), dataset()])),
        "2 datasets are called 'glass'",
    ),
    "no points": (
        as_json(version_4(dataset_coll=[dataset(points=())])),
        "there is no point on the axes 'XY'",
    ),
    "a point of text": (
        changed("datasetColl", 0, "data", 1, "x", to="1"),
        "datasetColl[0].data[1].x: is '1', not a",
    ),
    "a point without y": (without("datasetColl", 0, "data", 1, "y"), "datasetColl[0].data[1]: has no y"),
    "data of a wrong type": (
        changed("datasetColl", 0, "data", to="x"),
        "datasetColl[0].data: is 'x', not a list",
    ),
    "too many points": (
        as_json(version_4(dataset_coll=[dataset(points=POINTS * 3_334)])),
        "datasetColl[0]: holds 10,002 points, the most that are read are 10,000",
    ),
    "a point that is infinitely far": (
        as_json(
            version_4(
                axes_coll=[{**clicked(dx=("1", "9", "1", "9")), "isLogX": True}],
                dataset_coll=[dataset(points=[(1e9, 1.0)])],
            )
        ),
        "dataset 'glass': a point lies so far outside the axes",
    ),
    # tar
    "tar cut short": (as_tar(WHOLE)[:2100], "a damaged tar archive"),
    "tar of nothing": (as_tar(WHOLE, name="figure/other.json"), "has no wpd.json"),
    "tar of two": (as_tar(WHOLE, name="wpd.json", extra=(member("b/wpd.json"),)), "2 files called wpd.json"),
    "tar that leads out": (as_tar(WHOLE, extra=(member("../../x"),)), "../../x: leads out of the archive"),
    "tar from the root": (as_tar(WHOLE, extra=(member("/etc/x"),)), "leads out of the archive"),
    "tar that leads out on Windows": (as_tar(WHOLE, extra=(member("..\\..\\x"),)), "leads out of the archive"),
    "tar from a drive": (as_tar(WHOLE, extra=(member("C:\\x"),)), "leads out of the archive"),
    "tar with a link": (
        as_tar(WHOLE, extra=(member("figure/a", tarfile.SYMTYPE, link="/etc/passwd"),)),
        "figure/a: is a link or a device",
    ),
    "tar with a hard link": (
        as_tar(WHOLE, extra=(member("figure/wpd.json", tarfile.LNKTYPE, link="/etc/passwd"),)),
        "is a link or a device",
    ),
    "tar with a device": (
        as_tar(WHOLE, extra=(member("figure/a", tarfile.CHRTYPE),)),
        "is a link or a device",
    ),
    "tar of ten GB": (
        header_alone("figure/wpd.json", 10 * 2**30),
        "figure/wpd.json: is said to be 10,737,418,240 bytes long, the archive has 1,536",
    ),
    "tar of many": (
        as_tar(WHOLE, extra=tuple(member(f"figure/{i}") for i in range(1200))),
        "more than 1000 files",
    ),
    "tar of broken JSON": (as_tar(WHOLE[:99]), "figure/wpd.json, line 1, character"),
    # XML
    "XML cut short": (XML[:400], "line 1, character"),
    "XML bomb": (BOMB, "defines entities, which no project does"),
    "XML from outside": (OUTSIDE, "defines entities, which no project does"),
    "XML too deep": (b"<Document>" + b"<a>" * 100_000, "is nested more than 50 deep"),
    "XML of too much": (b"<Document>" + b"<a/>" * 50_001 + b"</Document>", "has too many elements"),
    "other XML": (b"<svg><Document/></svg>", "its root is 'svg', that of Engauge Digitizer is Document or ErrorReport"),
    "XML of a tag without an end": (b'<Document a="' + b"x" * (20 * 2**20), "line 1, character 1: no XML from here"),
    "XML in no encoding": (b'<?xml version="1.0" encoding="nonsense"?><Document/>', "no XML"),
    "binary Engauge": (b"\x00\x00\xca\xfe" + bytes(99), "before version 6, whose binary files are not read"),
    "no scales": (XML.replace(b"<Coords ", b"<Other "), "has no Coords"),
    "unknown scale": (engauge(coordinate_system(scales=("Linear", "Root"))), "ScaleYRadiusString: is 'Root'"),
    "two clicks": (engauge(coordinate_system(THREE.split("</Point>")[0] + "</Point>")), "here are 1"),
    "clicks on a line": (
        engauge(coordinate_system("".join(axis_point(i, (i, i), (i, i * i)) for i in range(3)))),
        "curve Axes: its clicks lie on one spot or on one line",
    ),
    "log through zero": (engauge(coordinate_system(scales=("Log", "Linear"))), "from 0 to 90, through zero"),
    "a click of text": (
        XML.replace(b'<PositionScreen X="', b'<PositionScreen X="a', 1),
        "PositionScreen, X: 'a1",
    ),
    "a click without a place": (
        XML.replace(b"<PositionScreen ", b"<Position ", 1),
        "PositionScreen: has no X",
    ),
    "curves twice": (engauge(coordinate_system(curves=curve() + curve())), "2 curves are called 'Curve1'"),
    # points
    "other JSON": (b'{"a": 1}', "holds no line of numbers"),
    "a page": (b"<html><p>1,2</p></html>", "holds no line of numbers"),
    "text alone": (b"gamma,beta\n", "holds no line of numbers"),
    "one column": (b"1\n2\n", "line 1: 1 column of numbers"),
    "three columns": (b"1,2,3\n4,5,6\n", "line 1: 3 columns of numbers, points are pairs"),
    "half a point": (b"1,2\n3,\n", "line 2, column 2: an empty cell is not a number"),
    "a word": (b"1,2\n3,four\n", "line 2, column 2: 'four' is not a number"),
    "an open quotation": (b'1,2\n"3,4\n', "line 2"),
    "binary": (b"\x01\x02\x03\x00" * 99, "the file is binary"),
    "a PDF": (b"%PDF-1.7 ....", "the file is a PDF"),
    "empty": (b"", "the file is empty"),
}


@pytest.mark.parametrize("name", CASES)
def test_refused_with_file_and_place_and_nothing_written(tmp_path, monkeypatch, name):
    raw, words = CASES[name]
    # a tenth: to trace the memory of as many as are read takes half a minute
    monkeypatch.setattr(digitised_figure, "MOST_POINTS", 10_000)
    monkeypatch.setattr(bounded_xml, "_MOST_ELEMENTS", 50_000)
    monkeypatch.chdir(tmp_path)
    Path("figure").write_bytes(raw)
    tracemalloc.start()
    begin = time.process_time()
    said = in_this_process("import", "figure", "--x", "gamma_deg", "--y", "beta", "--out", "data.csv")
    spent, (_, most) = time.process_time() - begin, tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert said.returncode == 3, said.stderr
    assert said.stdout == ""
    assert said.stderr.startswith("ifrfit: figure")
    assert words in said.stderr
    assert len(said.stderr) < 400
    assert len(re.findall(r"[.!?](?=\s+[A-Z]|\s*$)", said.stderr)) <= 2
    assert [each.name for each in Path().iterdir()] == ["figure"]
    assert most < 400 * 2**20
    assert spent < 8.0


@pytest.mark.parametrize(("name", "words"), [("folder", "this is a folder"), ("none", "there is no such file")])
def test_what_is_no_file_is_refused(tmp_path, monkeypatch, name, words):
    monkeypatch.chdir(tmp_path)
    Path("folder").mkdir()
    said = in_this_process("import", name, "--x", "gamma_deg", "--y", "beta", "--out", "data.csv")
    assert said.returncode == 3, said.stderr
    assert said.stderr.startswith(f"ifrfit: {name}: {words}")
    assert [each.name for each in Path().iterdir()] == ["folder"]


_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=6), inner, max_size=4),
    max_leaves=8,
)
_PLACES = st.sampled_from(
    [
        ("version",),
        ("axesColl",),
        ("datasetColl",),
        ("axesColl", 0),
        ("axesColl", 0, "type"),
        ("axesColl", 0, "isLogX"),
        POINT,
        (*POINT, 1),
        (*POINT, 1, "dx"),
        (*POINT, 1, "py"),
        ("datasetColl", 0),
        ("datasetColl", 0, "axesName"),
        ("datasetColl", 0, "data"),
        ("datasetColl", 0, "data", 0),
        ("datasetColl", 0, "data", 0, "y"),
    ]
)
QUIET = settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def read_or_refuse(path, raw):
    path.write_bytes(raw)
    said = ""
    try:
        ifrfit.read_figure(path, x="gamma_deg", y="beta")
    except (DataError, ifrfit.UsageError) as error:
        said = error.in_shell
    assert said == "" or said.startswith((str(path), "--"))


@QUIET
@example(place=("datasetColl", 0, "data", 0, "y"), value=3.6e157)  # its square is infinite
@given(place=_PLACES, value=_VALUES)
def test_any_value_anywhere_is_read_or_refused(tmp_path, place, value):
    read_or_refuse(tmp_path / "figure", json.dumps(json.loads(changed(*place, to=value))).encode())


@QUIET
@given(
    whole=st.sampled_from([WHOLE, XML, as_tar(WHOLE), as_json(version_3()), b"1,2\n3,4\n"]),
    cut=st.floats(0.0, 1.0),
    wrong=st.binary(max_size=3),
)
def test_any_damage_is_read_or_refused(tmp_path, whole, cut, wrong):
    at = int(cut * len(whole))
    read_or_refuse(tmp_path / "figure", whole[:at] + wrong + whole[at + len(wrong) :])


def test_the_control_an_undamaged_one_of_each_is_read(tmp_path):
    for raw in (WHOLE, XML, as_tar(WHOLE), as_json(version_3()), b"10,0.5\n40,0.1\n"):
        path = tmp_path / "figure"
        path.write_bytes(raw)
        assert len(ifrfit.read_figure(path, x="gamma_deg", y="beta"))
