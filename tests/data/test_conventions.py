"""Conventions are converted by name; what is not named stays or is refused."""

from __future__ import annotations

import numpy as np
import pytest

import ifrfit.data as data
from ifrfit.data.conventions import parse_conventions
from ifrfit.errors import DataError, UsageError

LONG = "observable,gamma_deg,value,sigma\n"


@pytest.fixture
def read(tmp_path):
    def read(text, *convention, **mapping):
        path = tmp_path / "x.csv"
        path.write_text(text)
        return data.read(path, convention=mapping or convention)

    return read


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
    with pytest.raises(DataError, match="could be measured from the wall or from its normal"):
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
    table = read("alpha_deg,beta\n30,1\n", angle="from-wall", beta="opposite-sign").table
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
    with pytest.raises(DataError, match="'e_t' and 'beta_cm' are beta_cm in two conventions"):
        read(f"{LONG}beta_cm,30,0.25,0.1\ne_t,40,0.25,0.1\n", "e_t=centre")
    with pytest.raises(DataError, match="beta_cm and e_t both give beta_cm, perhaps in two conventions"):
        read("gamma_deg,beta_cm,e_t\n30,0.1,0.1\n", "e_t=centre")


def test_a_convention_without_effect_is_noted(read):
    obs = read("gamma_deg,e_n\n30,0.9\n", "beta=opposite-sign")
    assert obs.notes == ("x.csv: convention beta=opposite-sign found nothing to apply to.",)
    obs = read("e_n\n0.9\n", "angle=from-wall")
    assert obs.notes == ("x.csv: convention angle=from-wall found nothing to apply to.",)


@pytest.mark.parametrize(
    ("convention", "message"),
    [
        (
            "speed=fast",
            r"--convention speed=fast: unknown name\. Known are angle=from-normal\|from-wall\|COLUMN",
        ),
        ("beta=other", r"--convention beta=other: the choices are contact, opposite-sign, centre\."),
        ("e_t=constant", r"--convention e_t=constant: the choices are centre\."),
        ("psi=both", r"the choices are over-incoming, over-outgoing\."),
        ("beta", r"--convention beta: write NAME=CHOICE\. Known are"),
        ("unit:u=furlong", r"unknown unit\. Known are deg, rad, m, mm, m/s, mm/s, rad/s, rpm, 1\."),
        ("column:betta=x", r"'betta' is no column\. Known are series, observable"),
        ("angle=from-wall:from-normal", "both 'from-normal' and 'from-wall' are given. Keep one"),
    ],
)
def test_unknown_conventions(convention, message):
    with pytest.raises(UsageError, match=message):
        parse_conventions([convention])


def test_contradicting_conventions():
    with pytest.raises(UsageError, match="beta: both 'centre' and 'contact' are given"):
        parse_conventions(["beta=centre", "beta=contact"])


def test_a_convention_about_a_column_that_is_not_there(read):
    with pytest.raises(
        UsageError, match=r"names the column 'phi', which .* does not have\. It has gamma_deg, beta\."
    ):
        read("gamma_deg,beta\n30,0.4\n", "angle=phi:from-wall")
