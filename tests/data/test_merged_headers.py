"""Headers of two rows: titles over several columns, and names below them."""

from __future__ import annotations

import pytest
from refusals import refused
from sheet_files import ods, xlsx

from ifrfit.errors import DataError

TITLES = ["", "before", "", "", "after", "", ""]
NAMES = ["shot", "v [m/s]", "angle_deg", "spin_rpm", "v [m/s]", "angle_deg", "spin_rpm"]
ROWS = [[1, 5, 37, 0, 4, 25, 900], [2, 6, 20, 300, 5, 12, 800]]
SAID = ("column:impact_id=shot", "angle=from-normal", "spin=topspin", "column:radius_m=radius")
ONE_ROW = "impact_id,v_in_m_s,angle_in_deg,spin_in_rpm,v_out_m_s,angle_out_deg,spin_out_rpm,radius_m\n"


def text(rows, delimiter=","):
    return "".join(delimiter.join(map(str, row)) + "\n" for row in rows)


@pytest.fixture
def expected(read):
    whole = ONE_ROW + text([[*row, 0.02] for row in ROWS])
    return read(whole, "angle=from-normal", "spin=topspin").table.drop(columns=["row", "source"])


def same(found, expected):
    assert found.table.drop(columns=["row", "source"]).equals(expected)


def sheet(titles=TITLES, names=NAMES, size="radius_m"):
    return [[*titles, ""], [*names, size], *([*row, 0.02] for row in ROWS)]


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
def test_titles_over_names_in_text(read, expected, delimiter):
    found = read(text(sheet(), delimiter), *SAID[:3])
    same(found, expected)
    assert list(found.table.row)[:1] == [3]


@pytest.mark.parametrize("write", [xlsx, ods])
def test_titles_over_names_in_sheets(read, expected, write):
    same(read(write({"a": sheet()}), *SAID[:3]), expected)
    above = [["Tennis, June"], [""], *sheet()]
    same(read(write({"a": above}), *SAID[:3]), expected)


def test_a_row_of_units_below_both(read, expected):
    names = [name.partition(" ")[0].replace("_deg", "").replace("_rpm", "") for name in NAMES]
    rows = sheet(names=names, size="radius")
    units = ["", "m/s", "°", "rpm", "m/s", "°", "rpm", "m"]
    same(read(text([*rows[:2], units, *rows[2:]]), *SAID[:3]), expected)


def test_units_in_the_titles(read, expected):
    rows = [
        ["impact_id", "speed [m/s]", "", "angle (deg)", "", "spin [rpm]", "", "radius_m"],
        ["", "before", "after", "before", "after", "before", "after", ""],
        *([*(row[i] for i in (0, 1, 4, 2, 5, 3, 6)), 0.02] for row in ROWS),
    ]
    same(read(text(rows), *SAID[1:3]), expected)
    same(read(xlsx({"a": rows}, merged=["A1:A2", "B1:C1", "D1:E1", "F1:G1", "H1:H2"]), *SAID[1:3]), expected)


@pytest.mark.parametrize(
    "titles",
    ["u [m/s],,v [m/s],", "velocity before [m/s],,velocity after [m/s],", "v before (m/s),,v after (m/s),"],
)
def test_components_below_a_velocity(read, titles):
    found = read(f"{titles}\nx,z,x,z\n3,4,2,-3\n")
    values = dict(zip(found.table.observable, found.table.value, strict=True))
    assert values == pytest.approx({"v_x": 0.4, "v_n": 0.6})
    assert found.table.speed_m_s[0] == 5.0


def test_value_and_sigma_below_an_observable(read):
    found = read(
        "gamma_deg,beta,,e_n,\n,value,sigma,value,sigma\n10,0.4,0.02,0.9,0.01\n40,0.1,0.03,0.91,0.02\n"
    )
    table = found.table.set_index(["observable", "gamma_deg"])
    expected = {
        ("beta", 10): (0.4, 0.02),
        ("beta", 40): (0.1, 0.03),
        ("e_n", 10): (0.9, 0.01),
        ("e_n", 40): (0.91, 0.02),
    }
    assert {key: (row.value, row.sigma) for key, row in table.iterrows()} == expected
    with refused(DataError, "looks like an uncertainty: one standard uncertainty is a column sigma_beta"):
        read("gamma_deg,beta,\n,value,error\n10,0.4,0.02\n")


def test_where_a_merged_title_ends_is_what_the_sheet_says(read):
    rows = [
        ["before", "", "after", "", "", ""],
        ["v_x_m_s", "v_z_m_s", "v_x_m_s", "v_z_m_s", "omega_y_rad_s", "radius_m"],
        [3, 4, 2, -3, 50, 0.02],
    ]
    says = "line 1: 'after' may end before the column 'omega_y_rad_s' or hold for it, too, which makes"
    for table in (text(rows), ods({"a": rows}), xlsx({"a": rows})):
        with refused(DataError, says):
            read(table)
    before = read(xlsx({"a": rows}, merged=["A1:B1", "C1:D1"])).table
    assert set(before.spin_y) == {0.2}
    assert "spin_y_after" not in set(before.observable)
    after = read(xlsx({"a": rows}, merged=["A1:B1", "C1:E1"])).table
    assert set(after.spin_y) == {0.0}
    assert after.value[after.observable == "spin_y_after"].tolist() == [0.2]


def test_a_title_that_means_nothing_is_none(read):
    found = read("Glass on glass,,June\ngamma_deg,beta,sigma_beta\n10,0.4,0.1\n")
    assert list(found.table.value) == [0.4]
    with refused(DataError, "columns 1 and 3 are both called 'gamma_deg'"):
        read("glass,,steel,\ngamma_deg,beta,gamma_deg,beta\n10,0.4,10,0.5\n")
