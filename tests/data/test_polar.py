"""Speeds, angles and spins before and after: the same impacts as components of velocity, in every unit."""

from __future__ import annotations

import numpy as np
import pytest
from refusals import refused

import ifrfit.data as data
from ifrfit.data.column_names import role_of
from ifrfit.data.conventions import parse_conventions
from ifrfit.data.stream.files import NotStreamableError
from ifrfit.data.stream.impact_stream import ImpactStream
from ifrfit.errors import DataError, UsageError

SPEED, GAMMA, AFTER, DELTA = 5.0, 37.0, 4.0, -12.0  # m/s and degrees from the normal
TOPSPIN, TOPSPIN_AFTER, RADIUS = 30.0, 210.0, 0.02  # rad/s, m


def values(found):
    return dict(zip(found.table.observable, found.table.value, strict=True))


def expected():
    """Velocities over u and R omega/u in the paper's signs, where back-spin is positive."""
    delta = np.radians(DELTA)
    return {
        "v_x": AFTER * np.sin(delta) / SPEED,
        "v_n": AFTER * np.cos(delta) / SPEED,
        "spin_y_after": -RADIUS * TOPSPIN_AFTER / SPEED,
    }


@pytest.mark.parametrize(
    ("header", "role"),
    [
        ("v_in [m/s]", ("common", "speed", "m/s")),
        ("speed_before_mph", ("common", "speed", "mph")),
        ("incoming velocity (km/h)", ("common", "speed", "km/h")),
        ("v_out_cm_s", ("raw", "speed_after", "cm/s")),
        ("rebound_speed_m_s", ("raw", "speed_after", "m/s")),
        ("angle_in_deg", ("angle", "angle", "deg")),
        ("theta_in_from_normal_deg", ("angle", "gamma", "deg")),
        ("rebound angle [rad]", ("raw", "angle_after", "rad")),
        ("angle_out_from_surface_deg", ("raw", "angle_after_from_wall", "deg")),
        ("spin_in_rpm", ("raw", "spin", "rpm")),
        ("spin after (rps)", ("raw", "spin_after", "rps")),
        ("vx_in_m_s", ("raw", "u_x", "m/s")),
        ("vn_before_m_s", ("raw", "u_n", "m/s")),
        ("vt_after_m_s", ("raw", "v_x", "m/s")),
        ("sigma_v_out_m_s", ("sigma_raw", "speed_after", "m/s")),
        ("sigma_angle_in_deg", ("common", "sigma_gamma", "deg")),
        ("sigma_angle_out_deg", ("sigma_raw", "angle_after", "deg")),
        ("sigma_speed_m_s", ("sigma_raw", "speed", "m/s")),
        ("spin_y_after", ("observable", "spin_y_after", None)),  # a name of its own stays what it is
        ("delta_out", ("unknown", "delta_out", None)),
    ],
)
def test_names_say_before_and_after(header, role):
    found = role_of(header)
    assert (found.kind, found.name, found.unit) == role


UNITS = [
    ("m_s", 1.0, "deg", 1.0, "rad_s", 1.0),
    ("km_h", 3.6, "rad", np.pi / 180.0, "rpm", 30.0 / np.pi),
    ("mph", 3600.0 / 1609.344, "deg", 1.0, "rps", 0.5 / np.pi),
    ("cm_s", 100.0, "deg", 1.0, "rpm", 30.0 / np.pi),
]


@pytest.mark.parametrize(("speed", "by_speed", "angle", "by_angle", "rate", "by_rate"), UNITS)
def test_polar_columns_are_the_same_impact(read, speed, by_speed, angle, by_angle, rate, by_rate):
    header = f"v_in_{speed},angle_in_{angle},spin_in_{rate},"
    header += f"v_out_{speed},angle_out_{angle},spin_out_{rate},radius_cm"
    row = (SPEED * by_speed, GAMMA * by_angle, TOPSPIN * by_rate)
    row += (AFTER * by_speed, DELTA * by_angle, TOPSPIN_AFTER * by_rate, 100.0 * RADIUS)
    text = f"{header}\n{','.join(map(repr, map(float, row)))}\n"
    found = read(text, "angle=from-normal", "spin=topspin")
    assert values(found) == pytest.approx(expected(), rel=1e-12)
    assert found.table.gamma_deg[0] == pytest.approx(GAMMA, rel=1e-13)
    assert found.table.spin_y[0] == pytest.approx(-RADIUS * TOPSPIN / SPEED)
    assert found.table.speed_m_s[0] == pytest.approx(SPEED)


def test_from_the_wall_and_backspin(read):
    text = "v_in_m_s,angle_in_deg,spin_in_rad_s,v_out_m_s,angle_out_deg,spin_out_rad_s,radius_m\n"
    text += f"{SPEED},{90 - GAMMA},{-TOPSPIN},{AFTER},{90 - DELTA},{-TOPSPIN_AFTER},{RADIUS}\n"
    assert values(read(text, "angle=from-wall", "spin=backspin")) == pytest.approx(expected())
    named = text.replace("angle_in_deg", "gamma_deg").replace("angle_out_deg", "angle_out_from_wall_deg")
    named = named.replace(f",{90 - GAMMA},", f",{GAMMA},", 1)
    assert values(read(named, "spin=backspin")) == pytest.approx(expected())


def test_along_the_wall_and_its_normal(read):
    """Names of the kind of two published tables, which are magnitudes along the wall and its normal."""
    found = read(
        "diameter_m,vn_before_m_s,vt_before_m_s,vn_after_m_s,vt_after_m_s,omega_after_rad_s\n"
        "0.1,5.366,3.65,2.57,2.898,48.4\n",
        "spin=topspin",
    )
    u = np.hypot(5.366, 3.65)
    assert values(found) == pytest.approx(
        {"v_x": 2.898 / u, "v_n": 2.57 / u, "spin_y_after": -0.05 * 48.4 / u}
    )
    assert found.table.gamma_deg[0] == pytest.approx(np.degrees(np.arctan2(3.65, 5.366)))


def test_errors_are_propagated(read):
    """Against 400,000 draws of the impact: a standard deviation is known to 0.11 %, the bound is 0.6 %."""
    rng = np.random.default_rng(3)
    sd = {"v_in": 0.04, "angle_in": 0.3, "v_out": 0.05, "angle_out": 0.6, "spin_out": 4.0}
    mean = {"v_in": SPEED, "angle_in": GAMMA, "v_out": AFTER, "angle_out": 25.0, "spin_out": TOPSPIN_AFTER}
    unit = {"v": "m_s", "angle": "deg", "spin": "rad_s"}
    header = [f"{name}_{unit[name.partition('_')[0]]}" for name in mean]
    header += [f"sigma_{name}" for name in header] + ["radius_m"]
    row = [*mean.values(), *sd.values(), RADIUS]
    found = read(f"{','.join(header)}\n{','.join(map(str, row))}\n", "angle=from-normal", "spin=topspin")
    d = {name: mean[name] + sd[name] * rng.standard_normal(400_000) for name in mean}
    out = np.radians(d["angle_out"])
    drawn = {
        "v_x": d["v_out"] * np.sin(out) / d["v_in"],
        "v_n": d["v_out"] * np.cos(out) / d["v_in"],
        "spin_y_after": -RADIUS * d["spin_out"] / d["v_in"],
    }
    for name, sigma in zip(found.table.observable, found.table.sigma, strict=True):
        assert sigma == pytest.approx(drawn[name].std(), rel=6e-3)
    assert found.table.sigma_gamma_deg[0] == pytest.approx(0.3)
    assert any("their errors correlated" in note for note in found.notes)
    some = read("v_in_m_s,gamma_deg,v_out_m_s,angle_out_from_normal_deg\n5,37,4,25\n")
    assert some.table.sigma.isna().all()
    assert not any("correlated" in note for note in some.notes)


def test_the_uncertainty_takes_the_unit_of_its_value(read):
    found = read(
        "v_in,gamma_deg,v_out,rebound_angle,sigma_v_in,sigma_v_out,sigma_rebound_angle\n5,37,4,25,0.1,0.2,0.6\n",
        "unit:v_in=m/s", "unit:v_out=m/s", "unit:rebound_angle=deg", "angle=from-normal",
    )  # fmt: skip
    assert found.table.sigma[0] == pytest.approx(
        np.hypot(np.hypot(np.sin(np.radians(25)) * 0.2, np.cos(np.radians(25)) * 4 * np.radians(0.6)),
                 4 * np.sin(np.radians(25)) / 5 * 0.1) / 5
    )  # fmt: skip


@pytest.mark.parametrize(
    ("text", "convention", "says"),
    [
        ("v_in_m_s,gamma_deg,v_out_m_s\n5,37,4\n", (), "column v_out_m_s: has no angle after"),
        (
            "v_in_m_s,gamma_deg,angle_out_from_normal_deg\n5,37,4\n",
            (),
            "column angle_out_from_normal_deg: has no speed",
        ),
        (
            "v_in_m_s,gamma_deg,v_out_m_s,angle_out_deg\n5,37,4,9\n",
            (),
            "column angle_out_deg: could be measured from",
        ),
        (
            "v_in_m_s,gamma_deg,v_out_m_s,angle_out_from_wall_deg,v_z_m_s\n5,37,4,9,-3\n",
            (),
            "velocity after is given twice, by v_out_m_s and by v_z_m_s",
        ),
        (
            "v_in_m_s,gamma_deg,v_out_m_s,angle_out_from_normal_deg\n5,37,4,95\n",
            (),
            "line 2, column angle_out_from_normal_deg: 95 degrees, but a ball that leaves has -90 to 90 "
            "degrees",
        ),
        (
            "v_in_m_s,gamma_deg,v_out_m_s,angle_out_from_wall_deg\n5,37,-4,95\n",
            (),
            "line 2, column v_out_m_s: -4, but a speed is positive",
        ),
        (
            "v_in_m_s,gamma_deg,spin_out_rpm,radius_m\n5,37,4,1\n",
            (),
            "column spin_out_rpm: is positive for topspin",
        ),
        (
            "u_x_m_s,u_n_m_s,u_z_m_s,v_n_m_s\n1,1,1,1\n",
            (),
            "the normal velocity before is given twice, as u_z and u_n",
        ),
        ("u_x_m_s,u_n_m_s,v_n_m_s\n1,-1,1\n", (), "line 2, column u_n_m_s: -1, but u_n is the magnitude"),
        (
            "u_x_m_s,u_z_m_s,spin_out_rpm,radius_m\n-1,1,4,1\n",
            ("spin=topspin",),
            "column u_x_m_s: -1, but topspin and backspin are about the way the ball goes",
        ),
        (
            "u_x_m_s,u_y_m_s,u_z_m_s,spin_out_rpm,radius_m\n1,1,1,4,1\n",
            ("spin=topspin",),
            "column u_y_m_s: with a motion across x a spin without an axis is no component",
        ),
        (
            "gamma_deg,beta,sigma_speed_m_s\n10,0.4,0.1\n",
            (),
            "column sigma_speed_m_s: the uncertainty of a speed",
        ),
    ],
)
def test_what_is_open_or_impossible_is_refused(read, text, convention, says):
    with refused(DataError, says):
        read(text, *convention)


# R. Cross, Am. J. Phys. 70 (2002) 482, Tables I and II: a tennis ball without spin, angles from the surface
TENNIS = """v_in_m_s,angle_in_deg,v_out_m_s,angle_out_deg,spin_out_rad_s,radius_m
3.72,20,3.09,19.2,34.9,0.033
3.80,45,2.53,50.4,58.2,0.033
3.53,20,2.24,27.2,78.5,0.033
3.70,45,2.66,51.3,49.9,0.033
3.35,20,2.13,23.4,76.7,0.033
3.60,45,2.66,49.3,50.6,0.033
"""
PRINTED = {  # vx2 in m/s, vx2/vx1, e_y
    "vx2": [2.92, 1.61, 1.99, 1.66, 1.96, 1.74],
    "ratio": [0.84, 0.60, 0.60, 0.63, 0.62, 0.68],
    "e_y": [0.80, 0.73, 0.84, 0.79, 0.74, 0.79],
}


def test_a_printed_table_of_tennis_balls(read):
    """The table's own columns of components come out, within the rounding of what is printed."""
    found = read(TENNIS, "sports")
    table = found.table.pivot(index="impact_id", columns="observable", values="value")
    table = table.loc[[f"line {i}" for i in range(2, 8)]]
    speed = np.array([3.72, 3.80, 3.53, 3.70, 3.35, 3.60])
    gamma = np.radians(90.0 - np.array([20, 45] * 3))
    np.testing.assert_allclose(
        found.table.groupby("impact_id").gamma_deg.first()[table.index], np.degrees(gamma)
    )
    v_x, v_n = speed * table["v_x"], speed * table["v_n"]
    # v2 to 0.005 m/s and its angle to 0.05 degrees, then vx2 to 0.005 m/s itself
    np.testing.assert_allclose(v_x, PRINTED["vx2"], rtol=0, atol=0.005 + 0.005 + 3.1 * np.radians(0.05))
    # of the ratios further 0.005 m/s and, where it falls steeply, half of the degree that is printed
    np.testing.assert_allclose(v_x / (speed * np.sin(gamma)), PRINTED["ratio"], rtol=0, atol=0.02)
    np.testing.assert_allclose(v_n / (speed * np.cos(gamma)), PRINTED["e_y"], rtol=0, atol=0.03)
    assert (table["spin_y_after"] < 0).all()  # topspin
    written_out = read(TENNIS, "angle=from-wall", "spin=topspin")
    assert found.table.equals(written_out.table)
    numbered = TENNIS.replace("v_in_m_s,angle_in_deg", "v1 [m/s],theta1_from_surface_deg")
    numbered = numbered.replace(
        "v_out_m_s,angle_out_deg,spin_out_rad_s", "v2 [m/s],theta_2 (deg),omega2_rad_s"
    )
    assert read(numbered, "sports").table.equals(found.table)
    with refused(DataError, "columns have unknown names, v1 .m/s., "):  # 1 and 2 may number anything
        read(numbered, "angle=from-wall", "spin=topspin")
    assert any("spins were read as positive for topspin" in note for note in found.notes)


def test_the_shorthand_takes_no_choice_and_contradicts_nothing(read, tmp_path):
    with refused(UsageError, "--convention sports=tennis: takes no choice. Write --convention sports."):
        read(TENNIS, "sports=tennis")
    with refused(UsageError, "--convention angle: both 'from-wall' and 'from-normal' are given"):
        read(TENNIS, "sports", "angle=from-normal")
    with refused(UsageError, "--convention spin=sidespin: the choices are topspin, backspin"):
        read(TENNIS, "spin=sidespin")
    unused = data.read({"gamma_deg": [10.0], "beta": [0.4]}, convention="spin=topspin")
    assert any("convention spin=topspin found nothing to apply to" in note for note in unused.notes)


def test_a_stream_passes_nothing_over(tmp_path):
    path = tmp_path / "x.csv"
    path.write_text("gamma_deg,beta,sigma_beta,speed_m_s,sigma_speed_m_s\n" + "10,0.4,0.1,2,0.1\n" * 9)
    with refused(NotStreamableError, "sigma_speed_m_s needs the reader that holds the table in memory"):
        ImpactStream.of(path, parse_conventions(()), data.Selection(), 0.4)
