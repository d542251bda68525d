"""What each importer reads of the files of its program: values by hand, whatever stale ones are kept."""

from __future__ import annotations

import numpy as np
import pytest
from project_files import (
    CLICKS,
    POINTS,
    VALUES,
    as_json,
    as_tar,
    axes,
    axis_point,
    calibration,
    coordinate_system,
    curve,
    dataset,
    engauge,
    engauge_whole,
    pixel,
    version_3,
    version_4,
)
from refusals import refused

import ifrfit
from ifrfit.data.figures.importers import FIGURE_IMPORTERS
from ifrfit.errors import DataError, UsageError
from ifrfit.registry import registered

# a click of one pixel, by hand: 90 degrees on 600 pixels, 2 on 400
SIGMA_GAMMA, SIGMA = 90.0 / 600.0, 2.0 / 400.0

FILES = {
    "version 3": as_json(version_3()),
    "version 4": as_json(version_4()),
    "version 4.0": as_json(version_4(version=(4, 0))),
    "tar": as_tar(as_json(version_4())),
    "tar of version 3": as_tar(as_json(version_3())),
    "engauge": engauge(),
    "engauge with all settings": engauge_whole(),
    "engauge error report": engauge(root="ErrorReport"),
}


def values(found):
    return found.table[["gamma_deg", "value"]].to_numpy()


@pytest.mark.parametrize("kind", FILES)
def test_values_are_made_anew_from_pixels(figure, kind):
    found = figure(FILES[kind])
    np.testing.assert_allclose(values(found), VALUES, rtol=1e-12)
    np.testing.assert_allclose(found.table["sigma_gamma_deg"], SIGMA_GAMMA, rtol=1e-12)
    np.testing.assert_allclose(found.table["sigma"], SIGMA, rtol=1e-12)
    assert set(found.table["provenance"]) == {"digitised"}
    assert list(found.table["row"]) == [1, 2, 3]
    assert set(found.table["observable"]) == {"beta"}


def test_clicks_scale_the_errors(figure):
    found = figure(FILES["version 4"], pixels=0.5)
    np.testing.assert_allclose(found.table["sigma"], SIGMA / 2.0, rtol=1e-12)
    assert any("a click of 0.5 pixels" in note for note in found.notes)


def test_the_error_that_all_share_is_told(figure):
    """By hand, for clicks that keep to their axes: without rotation the weights of both clicks of an axis."""
    found = figure(as_json(version_4(axes_coll=[axes(noRotation=True)])))
    (note,) = [each for each in found.notes if "share the error of its calibration" in each]
    # the reading nearest to an end is known worst: 10 of 90 degrees, and -0.7 of -1 to 1
    at_most = np.hypot(8.0, 1.0) / 9.0 * SIGMA_GAMMA, np.hypot(0.85, 0.15) * SIGMA
    assert f"at most {at_most[0]:.2g} in gamma_deg and {at_most[1]:.2g} in beta" in note


def test_logarithmic_axes(figure):
    clicks = [{**each, "dx": dx} for each, dx in zip(calibration(), ("1e-1", "1e1", "1", "1"), strict=True)]
    project = version_4(axes_coll=[axes(isLogX=True, calibrationPoints=clicks)])
    found = figure(as_json(project), x="tan_gamma")
    tangents = 10.0 ** (-1.0 + 2.0 * VALUES[:, 0] / 90.0)
    np.testing.assert_allclose(found.table["gamma_deg"], np.degrees(np.arctan(tangents)), rtol=1e-12)
    by_hand = np.degrees(tangents * np.log(10.0) * 2.0 / 600.0 / (1.0 + tangents**2))
    np.testing.assert_allclose(found.table["sigma_gamma_deg"], by_hand, rtol=1e-12)


def test_without_rotation(figure):
    tilted = calibration(clicks=((100.0, 500.0), (700.0, 520.0), (90.0, 480.0), (90.0, 80.0)))
    straight = figure(as_json(version_4(axes_coll=[axes(calibrationPoints=tilted, noRotation=True)])))
    np.testing.assert_allclose(values(straight), VALUES, rtol=1e-12)
    turned = figure(as_json(version_4(axes_coll=[axes(calibrationPoints=tilted)])))
    assert np.abs(values(turned) - VALUES).max() > 0.01


def test_units_and_conventions_are_those_of_tables(figure):
    clicks = calibration(texts=(("90", "-1"), ("0", "-1"), ("0", "-1"), ("0", "1")))
    project = as_json(version_4(axes_coll=[axes(calibrationPoints=clicks)]))
    found = figure(project, x="alpha_deg", convention="angle=from-wall")
    np.testing.assert_allclose(values(found), VALUES, atol=1e-12)
    radians = figure(as_json(version_4(dataset_coll=[dataset(points=(pixel(1.0, 0.1),))])), x="gamma [rad]")
    np.testing.assert_allclose(radians.table["gamma_deg"], np.degrees(1.0))
    np.testing.assert_allclose(radians.table["sigma_gamma_deg"], np.degrees(SIGMA_GAMMA))
    named = figure(FILES["version 4"], y="Umkehr", convention=["column:beta=Umkehr"])
    np.testing.assert_allclose(named.table["sigma"], SIGMA, rtol=1e-12)
    hundred = calibration(texts=(("0", "-1"), ("90", "-1"), ("0", "-100"), ("0", "100")))
    percent = figure(as_json(version_4(axes_coll=[axes(calibrationPoints=hundred)])), y="beta [%]")
    np.testing.assert_allclose(percent.table["value"], VALUES[:, 1])
    np.testing.assert_allclose(percent.table["sigma"], SIGMA)


def test_several_datasets_are_series(figure):
    sets = [dataset(), dataset("steel", points=POINTS[:2]), dataset("empty", points=())]
    project = as_json(version_4(dataset_coll=sets))
    assert figure(project).table["series"].value_counts().to_dict() == {"glass": 3, "steel": 2}
    assert set(figure(project, dataset="steel").table["series"]) == {"steel"}
    named = figure(project, dataset=["steel", "glass"], series=["a", "b"])
    assert named.table["series"].value_counts().to_dict() == {"a": 2, "b": 3}
    assert set(figure(project, series="all").table["series"]) == {"all"}
    for given, said in (
        ({"dataset": "brass"}, "--dataset 'brass': .* has the datasets 'glass', 'steel', 'empty'"),
        ({"dataset": ["glass", "glass"]}, "--dataset 'glass' is given several times"),
        ({"series": ["a", "b", "c"]}, "--series: 3 names for 2 datasets"),
        ({"dataset": "empty"}, "there is no point"),
    ):
        with refused(ifrfit.IfrfitError, said):
            figure(project, **given)


def test_several_axes(figure):
    other = axes(
        "right", calibrationPoints=calibration(texts=(("0", "0"), ("90", "0"), ("0", "0"), ("0", "2")))
    )
    bars = {"name": "bars", "type": "BarAxes", "isLog": False, "calibrationPoints": calibration()[:2]}
    sets = [
        dataset(),
        dataset("steel", "right"),
        dataset("counts", "bars", data=[{"x": 1, "y": 2, "value": [3]}]),
    ]
    project = as_json(version_4(axes_coll=[bars, axes(), other], dataset_coll=sets))
    with refused(UsageError, "--axes: .* points on the axes 'XY', 'right'. Say which, as --axes XY"):
        figure(project)
    np.testing.assert_allclose(values(figure(project, dataset="glass")), VALUES, rtol=1e-12)
    np.testing.assert_allclose(values(figure(project, axes="right"))[:, 1], VALUES[:, 1] + 1.0, rtol=1e-12)
    with refused(UsageError, "--dataset 'glass': .* on the axes 'right'"):
        figure(project, axes="right", dataset="glass")
    with refused(UsageError, "--axes 'left': .* has the axes 'bars', 'XY', 'right'"):
        figure(project, axes="left")
    with refused(DataError, r"axesColl\[0\], axes 'bars': the axes are bars"):
        figure(project, axes="bars")
    # what is not asked for may be what it likes
    only = as_json(version_4(axes_coll=[bars, axes()], dataset_coll=[sets[0], sets[2]]))
    np.testing.assert_allclose(values(figure(only)), VALUES, rtol=1e-12)


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("PolarAxes", "polar"),
        ("TernaryAxes", "ternary"),
        ("MapAxes", "those of a map"),
        ("ImageAxes", "pixels"),
    ],
)
def test_other_axes_are_refused_by_name(figure, kind, words):
    with refused(DataError, f"the axes are {words}.*Calibrate the figure as XY axes"):
        figure(as_json(version_4(axes_coll=[axes(kind=kind)])))
    with refused(DataError, f"wpd.axesType: the axes are {words}"):
        figure(as_json(version_3(kind=kind)))


@pytest.mark.parametrize("text", ["2020/01/11", "10:25", "2020-09", "2020-09-01"])
def test_dates_are_refused_by_name(figure, text):
    clicks = [{**each, "dx": text} for each in calibration()]
    with refused(DataError, rf"axesColl\[0\].calibrationPoints\[0\].dx: '{text}' is a date or a time"):
        figure(as_json(version_4(axes_coll=[axes(calibrationPoints=clicks)])))


def test_groups_of_bars_are_left_out_with_a_sentence(figure):
    grouped = dataset(groupNames=["Primary", "Upper", "Lower"])
    for number, point in enumerate(grouped["data"]):
        point.update(tuple=0, group=number)
    found = figure(as_json(version_4(dataset_coll=[grouped])))
    np.testing.assert_allclose(values(found), VALUES[:1], rtol=1e-12)
    assert any(
        "2 points of the groups Upper, Lower of dataset 'glass' were left out" in n for n in found.notes
    )


def test_an_angle_just_outside_is_put_at_the_end(figure):
    points = (pixel(-0.3, 0.5), pixel(40.0, 0.5))
    found = figure(as_json(version_4(dataset_coll=[dataset(points=points)])), y="delta_deg")
    assert list(found.table["gamma_deg"]) == pytest.approx([0.0, 40.0])
    assert any(
        "1 angle lay outside 0 to 90 degrees by less than 4 standard errors" in note for note in found.notes
    )
    with refused(DataError, "point 1, column gamma_deg: the incidence angle comes to -3 degrees"):
        figure(as_json(version_4(dataset_coll=[dataset(points=(pixel(-3.0, 0.5),))])))


def test_engauge_with_logarithms_and_clicks_on_each_axis(figure):
    clicks = "".join(
        axis_point(i, at, graph, str(i < 2))
        for i, (at, graph) in enumerate(zip(CLICKS, ((0, 7), (90, 7), (7, 0.1), (7, 10)), strict=True))
    )
    found = figure(engauge(coordinate_system(clicks, scales=("Linear", "Log"))), y="e_n")
    np.testing.assert_allclose(found.table["value"], 10.0 ** VALUES[:, 1], rtol=1e-12)
    np.testing.assert_allclose(found.table["gamma_deg"], VALUES[:, 0], rtol=1e-12)


def test_engauge_with_several_curves_and_systems(figure):
    curves = curve("glass") + curve("steel", POINTS[:1])
    found = figure(engauge(coordinate_system(curves=curves)))
    assert found.table["series"].value_counts().to_dict() == {"glass": 3, "steel": 1}
    both = engauge(coordinate_system(curves=curves), coordinate_system())
    assert set(figure(both, axes="2").table["series"]) == {"2/Curve1"}
    with refused(DataError, "the axes are 'Polar'"):
        figure(engauge(coordinate_system(kind="Polar")))
    with refused(DataError, "UnitsXString: 'Date/Time'"):
        figure(engauge(coordinate_system(units="Date/Time")))


def test_binary_engauge_is_refused_by_name(figure):
    with refused(DataError, "is of Engauge Digitizer before version 6, whose binary files are not read"):
        figure(b"\x00\x00\xca\xfe" + bytes(100))


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("10,0.5\n40,0.1\n70,-0.7\n", {"figure2": 3}),
        ("x,y\n10,0.5\n40,0.1\n70,-0.7\n", {"figure2": 3}),
        ("10;0,5\n40;0,1\n70;-0,7\n", {"figure2": 3}),
        ("x\ty\n10\t0.5\n40\t0.1\n70\t-0.7\n", {"figure2": 3}),
        ("glass,,steel,\nX,Y,X,Y\n10,0.5,10,0.5\n40,0.1,,\n70,-0.7,,\n", {"glass": 3, "steel": 1}),
        ("10, 0.5, 10, 0.5\n40, 0.1\n70, -0.7\n", {"series 1": 3, "series 2": 1}),
    ],
)
def test_points_as_text(figure, text, names):
    found = figure(text.encode())
    assert found.table["series"].value_counts().to_dict() == names
    first = found.table[found.table["series"] == next(iter(names))]
    np.testing.assert_allclose(first[["gamma_deg", "value"]], VALUES, rtol=1e-12)
    assert found.table["sigma"].isna().all()
    assert any("the errors of reading are not known" in note for note in found.notes)
    with refused(UsageError, "--pixels: .* holds values without the pixels"):
        figure(text.encode(), pixels=1)


def test_axes_must_be_an_angle_and_an_observable(figure):
    raw = FILES["version 4"]
    with refused(UsageError, "--x beta: is no incidence angle. Say which .* as --x gamma_deg"):
        figure(raw, x="beta")
    with refused(UsageError, "--y gamma_deg: is no observable"):
        figure(raw, y="gamma_deg")
    with refused(UsageError, "--x: a figure is read once it is said what both its axes are"):
        figure(raw, x="")
    for pixels in (0.0, -1.0, float("nan"), "a"):
        with refused(UsageError, "--pixels .*must be a positive number"):
            figure(raw, pixels=pixels)
    with refused(DataError, "could be measured from the wall or from its normal"):
        figure(raw, x="alpha_deg")
    with refused(UsageError, "x=... Keep one|--x and --y, too"):
        figure(raw, convention=["x=gamma_deg", "y=beta"])


def test_errors_speak_python(figure):
    with pytest.raises(UsageError, match=r'x="beta": is no incidence angle.*as x="gamma_deg"'):
        figure(FILES["version 4"], x="beta")


def test_a_project_is_read_wherever_a_table_is(tmp_path):
    path = tmp_path / "figure.json"
    path.write_bytes(FILES["version 4"])
    said = ["x=gamma_deg", "y=beta", "pixels=2"]
    np.testing.assert_allclose(values(ifrfit.read(path, convention=said)), VALUES, rtol=1e-12)
    with refused(DataError, "figure.json: is a project of WebPlotDigitizer. Say what its axes are"):
        ifrfit.read(path)
    for about_a_file in ("x=gamma_deg", "sheet=1"):
        with refused(UsageError, "is about a file, and a table was given"):
            ifrfit.read({"gamma_deg": [10], "beta": [0.4]}, convention=about_a_file)
    fit = ifrfit.fit(path, convention=said, fix={"e_n": 0.9}, method="lsq", noise="scaled")
    assert any("share the error of its calibration" in each for each in fit.warnings)


def test_an_importer_is_an_entry_of_the_registry(figure):
    class Clicks:
        name = "clicks"
        title = "Clicks"
        has_pixels = True

        def recognises(self, head):
            return head.startswith(b"CLICKS")

        def read(self, raw, file):
            return FIGURE_IMPORTERS["engauge"].read(raw.removeprefix(b"CLICKS"), file)

    with registered(Clicks()):
        np.testing.assert_allclose(values(figure(b"CLICKS" + engauge())), VALUES, rtol=1e-12)
    with refused(DataError):
        figure(b"CLICKS" + engauge())
