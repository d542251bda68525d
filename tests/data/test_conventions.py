"""Conventions are converted by name; what is not named stays or is refused."""

from __future__ import annotations

import shlex
import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from refusals import refused

import ifrfit.data as data
from ifrfit.data.conventions import parse_conventions, suggest
from ifrfit.errors import DataError, UsageError

LONG = "observable,gamma_deg,value,sigma\n"
REFUSED = tomllib.loads(Path(__file__).with_name("refused.toml").read_text(encoding="utf-8"))["conventions"]


@pytest.mark.parametrize(
    ("text", "convention", "gamma"),
    [
        ("alpha_deg,beta\n30,1\n", "angle=from-wall", 60),
        ("alpha_deg,beta\n30,1\n", "angle=from-normal", 30),
        ("theta [rad],beta\n0.5,1\n", "angle=from-wall", 90 - np.degrees(0.5)),
        ("alpha,theta,beta\n30,7,1\n", "angle=alpha:from-wall:deg", 60),
        ("alpha,theta,beta\n0.5,7,1\n", "angle=alpha:from-normal:rad", np.degrees(0.5)),
        ("steepness,beta\n1,1\n", "angle=steepness:tan:from-normal", 45),
        ("steepness,beta\n2,1\n", "angle=steepness:from-wall:tan", 90 - np.degrees(np.arctan(2))),
        ("My: angle,beta\n30,1\n", "angle=My: angle:from-wall:deg", 60),
        ("gamma_deg,beta\n30,1\n", "angle=from-wall", 60),
        ("tan_gamma,beta\n2,1\n", "angle=from-normal", np.degrees(np.arctan(2))),
    ],
)
def test_angle(read, text, convention, gamma):
    assert read(text, convention).table.gamma_deg[0] == pytest.approx(gamma, abs=1e-12)


@pytest.mark.parametrize(
    ("header", "gamma"),
    [
        ("incident_angle_from_normal_deg", 30),
        ("angle from the wall [deg]", 60),
        ("alpha_from_surface_deg", 60),
        ("theta from wall (deg)", 60),
    ],
)
def test_a_header_may_say_from_where(read, header, gamma):
    obs = read(f"{header},beta\n30,1\n")
    assert obs.table.gamma_deg[0] == gamma
    assert bool(obs.notes) == (gamma == 60)


def test_from_the_wall_keeps_degrees_exact_and_says_so(read):
    obs = read("alpha_deg,beta\n75.25,1\n", "angle=from-wall")
    assert obs.table.gamma_deg[0] == 14.75
    assert "x.csv: column alpha_deg was read as the angle from the wall." in obs.notes


def test_naming_the_angle_leaves_the_other_candidate_out_with_a_note(read):
    obs = read("alpha_deg,theta,beta\n30,7,1\n", "angle=alpha_deg:from-wall")
    assert any("column theta is ignored" in note for note in obs.notes)


def test_naming_the_angle_does_not_say_from_where(read):
    with refused(DataError, match="could be measured from the wall or from its normal"):
        read("alpha_deg,theta,beta\n30,7,1\n", "angle=alpha_deg")


@pytest.mark.parametrize(
    ("name", "convention", "observable", "sign"),
    [
        ("beta", "beta=contact", "beta", 1),
        ("beta", "beta=opposite-sign", "beta", -1),
        ("beta", "beta=centre", "beta_cm", 1),
        ("e_t", "e_t=centre", "beta_cm", -1),
        ("tan_psi", "psi=over-incoming", "tan_psi_after", 1),
        ("tan_psi", "psi=over-outgoing", "tan_psi_out", 1),
        ("psi_deg", "psi=over-incoming", "psi_after_deg", 1),
        ("psi_deg", "psi=over-outgoing", "psi_out_deg", 1),
    ],
)
def test_observables_in_wide_and_long_tables(read, name, convention, observable, sign):
    wide = read(f"gamma_deg,{name},sigma_{name}\n30,0.25,0.1\n", convention).table
    long = read(f"{LONG}{name},30,0.25,0.1\n", convention).table
    for table in (wide, long):
        assert (table.observable[0], table.value[0], table.sigma[0]) == (observable, sign * 0.25, 0.1)


def test_a_mapping_says_the_same(read):
    table = read("alpha_deg,beta\n30,1\n", convention={"angle": "from-wall", "beta": "opposite-sign"}).table
    assert (table.gamma_deg[0], table.value[0]) == (60, -1)


def test_columns_and_units_by_name(read):
    table = read(
        "Winkel,Stoss,u,err\n0.5,0.4,2000,0.1\n",
        "angle=Winkel:from-normal:rad",
        "column:beta=Stoss",
        "column:sigma_beta=err",
        "unit:u=mm/s",
    ).table
    assert list(table.iloc[0][["observable", "value", "speed_m_s", "sigma"]]) == ["beta", 0.4, 2.0, 0.1]
    assert table.gamma_deg[0] == pytest.approx(np.degrees(0.5))


def test_a_column_called_gamma_by_the_user_is_from_the_normal(read):
    assert read("Winkel,beta\n30,0.4\n", "column:gamma_deg=Winkel").table.gamma_deg[0] == 30


def test_the_same_quantity_in_two_conventions_is_refused(read):
    with refused(DataError, match="'e_t' and 'beta_cm' are beta_cm in two conventions"):
        read(f"{LONG}beta_cm,30,0.25,0.1\ne_t,40,0.25,0.1\n", "e_t=centre")
    with refused(DataError, match="beta_cm and e_t both give beta_cm, perhaps in two conventions"):
        read("gamma_deg,beta_cm,e_t\n30,0.1,0.1\n", "e_t=centre")


def test_a_convention_without_effect_is_noted(read):
    obs = read("gamma_deg,e_n\n30,0.9\n", "beta=opposite-sign")
    assert obs.notes == ("x.csv: convention beta=opposite-sign found nothing to apply to.",)
    obs = read("e_n\n0.9\n", "angle=from-wall")
    assert obs.notes == ("x.csv: convention angle=from-wall found nothing to apply to.",)
    obs = read("gamma_deg,beta\n30,0.4\n", "z=out-of-wall")
    assert obs.notes == ("x.csv: convention z=out-of-wall found nothing to apply to.",)


@pytest.mark.parametrize(("convention", "message"), REFUSED.items())
def test_unknown_conventions(convention, message):
    with refused(UsageError, match=message):
        parse_conventions([convention])


def test_contradicting_conventions():
    with refused(UsageError, match="beta: both 'centre' and 'contact' are given"):
        parse_conventions(["beta=centre", "beta=contact"])


def test_a_convention_about_a_column_that_is_not_there(read):
    with refused(
        UsageError, match=r"names the column 'phi', which .* does not have\. It has gamma_deg, beta\."
    ):
        read("gamma_deg,beta\n30,0.4\n", "angle=phi:from-wall")


def test_a_suggested_convention_survives_the_shell():
    option, text = shlex.split(suggest("angle=alpha [°]:from-wall"))
    assert option == "--convention"
    assert parse_conventions([text]).angle_column == "alpha [°]"
    assert suggest("angle=alpha:from-wall") == "--convention angle=alpha:from-wall"


@pytest.mark.parametrize(
    "convention",
    [
        ("ignore=Ort,Zeit [s]", "ignore=a, b"),
        ("ignore=Ort", "ignore=Zeit [s]", "ignore=a, b"),
        ("column:note=Ort", "column:comment=Zeit [s]", "column:remark=a, b"),
    ],
)
def test_columns_can_be_left_out(read, convention):
    obs = read('Ort;Zeit [s];"a, b";gamma_deg;beta\nx;1;;30;0,4\n', *convention)
    assert (obs.table.gamma_deg[0], obs.table.value[0], obs.notes) == (30, 0.4, ())


def test_columns_that_are_known_can_be_left_out_too(read):
    assert list(read("gamma_deg,beta,e_n\n30,0.4,x\n", convention={"ignore": "e_n"}).table.observable) == [
        "beta"
    ]


def test_what_is_left_out_must_be_there_and_not_be_used(read):
    with refused(UsageError, match=r"ignore=beta,Ort: there is no column 'Ort'\. The columns are gamma_deg"):
        read("gamma_deg,beta\n30,0.4\n", "ignore=beta,Ort")
    with refused(UsageError, match=r"the column 'Ort' is both named and ignored\. Keep one"):
        read("gamma_deg,beta,Ort\n30,0.4,1\n", "ignore=Ort", "column:speed_m_s=Ort")


def test_a_parquet_column_that_holds_neither_numbers_nor_text_can_be_left_out(tmp_path):
    path = tmp_path / "x.parquet"
    pd.DataFrame({"flags": [[1], [2]], "gamma_deg": [10, 20], "beta": [0.4, 0.3]}).to_parquet(path)
    assert list(data.read(path, convention=["ignore=flags"]).table.value) == [0.4, 0.3]
    with refused(DataError, match="column flags: unknown name"):
        data.read(path)
    with refused(
        DataError, match=r"neither numbers nor text\. Convert it, or leave it out: --conv.*=flags\."
    ):
        data.read(path, convention=["column:speed_m_s=flags"])


@pytest.mark.parametrize(
    ("convention", "observable", "value"),
    [
        (("column:e_t=x_centre", "e_t=centre"), "beta_cm", -0.25),
        (("column:beta=x_centre", "beta=opposite-sign"), "beta", -0.25),
        (("column:tan_psi=x_centre", "psi=over-outgoing"), "tan_psi_out", 0.25),
        (("column:psi=x_centre", "psi=over-incoming", "unit:x_centre=deg"), "psi_after_deg", 0.25),
    ],
)
def test_named_columns_and_choices_work_together(read, convention, observable, value):
    obs = read("gamma_deg,x_centre\n30,0.25\n", *convention)
    assert (obs.table.observable[0], obs.table.value[0], obs.notes) == (observable, value, ())


def test_a_named_column_leaves_its_question_open(read):
    with refused(
        DataError, match=r"column x: could be v_t'/v_t of the centre .* say --convention e_t=centre"
    ):
        read("gamma_deg,x\n30,0.25\n", "column:e_t=x")
    with refused(DataError, match="column x: could be measured from the wall or from its normal"):
        read("x,beta\n30,0.25\n", "column:alpha_deg=x")
    assert read("x,beta\n30,0.25\n", "column:alpha=x", "angle=from-wall").table.gamma_deg[0] == 60


@pytest.mark.parametrize(
    ("header", "convention", "degrees"),
    [
        ("incidence_deg", ("column:gamma=incidence_deg",), 0.5),
        ("incidence_rad", ("column:gamma=incidence_rad",), np.degrees(0.5)),
        ("incidence [rad]", ("column:gamma_deg=incidence [rad]",), np.degrees(0.5)),
        ("incidence", ("column:gamma_rad=incidence",), np.degrees(0.5)),
        ("incidence_deg", ("column:gamma=incidence_deg", "unit:incidence_deg=rad"), np.degrees(0.5)),
        ("Winkel_rad", ("angle=Winkel_rad:from-normal",), np.degrees(0.5)),
        ("Winkel (deg)", ("angle=Winkel (deg):from-normal",), 0.5),
    ],
)
def test_the_unit_of_a_named_column(read, header, convention, degrees):
    assert read(f"{header},beta\n0.5,0.4\n", *convention).table.gamma_deg[0] == pytest.approx(degrees)


def test_provenance_of_rows_that_do_not_state_theirs(read):
    text = "gamma_deg,beta,provenance\n30,0.4,\n40,0.3,simulated\n"
    obs = read(text, "provenance=measured")
    assert list(obs.table.provenance) == ["measured", "simulated"]
    assert obs.sources[0].provenance == "measured, simulated"
    assert read("gamma_deg,beta\n30,0.4\n", "provenance=digitized").provenance == ("digitised",)
    obs = read("gamma_deg,beta,provenance\n30,0.4,stand-in\n", "provenance=measured")
    assert obs.provenance == ("stand-in",), "what a file says is never overruled"
    assert obs.notes == ("x.csv: convention provenance=measured found nothing to apply to.",)


def test_a_column_of_labels_and_a_name_the_wrong_way_round_have_a_remedy():
    table = {"gamma_deg": [10.0, 20.0, 30.0, 40.0], "beta": [0.4] * 4, "material": ["a", "a", "b", "b"]}
    with refused(DataError, match=r"it is the series: --convention column:series=material"):
        data.read(table)
    both = {**table, "coating c": ["x", "x", "y", "y"]}
    with refused(DataError, match=r"material may say which rows belong together: .*column:series=material"):
        data.read(both)
    found = data.read(table, convention={"column:series": "material"}).table
    assert found["series"].tolist() == ["a", "a", "b", "b"]
    named = {"gamma_deg": [10.0, 20.0], "tangential restitution": [0.4, 0.3]}
    with refused(UsageError, match=r"name of the schema stands first.*'column:beta=tangential restitution'"):
        data.read(named, convention={"column:tangential restitution": "beta"})
    assert len(data.read(named, convention={"column:beta": "tangential restitution"}).table) == 2
