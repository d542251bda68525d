"""Raw velocities: the observables equal those of an impulse written down here, in every frame and unit."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from refusals import refused

import ifrfit.data as data
from ifrfit.errors import DataError

RADIUS = 0.005


def impact(u, omega, k, e_n, inertia, into=1):
    """Velocity and right-handed spin after: impulse -k U_t along the wall; z into it, or out of it (-1)."""
    u, omega = np.asarray(u, dtype=float), np.asarray(omega, dtype=float)
    arm = np.array([0, 0, into * RADIUS])
    contact = u + np.cross(omega, arm)
    p = np.array([-k * contact[0], -k * contact[1], -(1 + e_n) * u[2]])
    return u + p, omega + np.cross(arm, p) / (inertia * RADIUS**2)


def turn(v, phi):
    c, s = np.cos(phi), np.sin(phi)
    return np.array([c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]])


def table_of(path, impacts, **options):
    """Write impacts (u, omega, v, Omega) with all components, and read them."""
    names = [f"u_{a}_m_s" for a in "xyz"] + [f"omega_{a}_rad_s" for a in "xyz"]
    names += [f"v_{a}_m_s" for a in "xyz"] + [f"omega_{a}_after_rad_s" for a in "xyz"] + ["radius_m"]
    rows = [",".join(repr(float(x)) for x in np.concatenate([*i, [RADIUS]])) for i in impacts]
    path.write_text("\n".join([",".join(names), *rows]) + "\n")
    return data.read(path, **options)


def values(obs):
    return dict(zip(obs.table.observable, obs.table.value, strict=True))


def ordinary(low, high):
    """Floats without what is refused: denormals that no instrument gives, and codes written in nines."""
    return st.floats(low, high).filter(lambda x: x == 0 or (abs(x) > 1e-10 and set(f"{x:g}") - set("-9.")))


# -99 alone in its column is refused as a code for "not measured"
SPINS = ordinary(-800, 800).filter(lambda x: f"{x:g}".strip("-9.") != "")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=60)
@given(
    u_x=st.floats(0.01, 5),
    u_z=st.floats(0.1, 5),
    spins=st.tuples(SPINS, SPINS, SPINS),
    k=ordinary(0, 0.5),
    e_n=st.floats(0, 1),
    phi=ordinary(-3.1, 3.1),
)
def test_observables_equal_the_impulse_in_any_frame(tmp_path, u_x, u_z, spins, k, e_n, phi):
    u, omega = np.array([u_x, 0, u_z]), np.array(spins)
    v, after = impact(u, omega, k, e_n, 0.4)
    speed = np.hypot(u_x, u_z)
    obs = table_of(tmp_path / "raw.csv", [[turn(x, phi) for x in (u, omega, v, after)]])
    expected = {
        "v_x": v[0] / speed,
        "v_y": v[1] / speed,
        "v_n": -v[2] / speed,
        "spin_y_after": RADIUS * after[1] / speed,
        "spin_x_after": -RADIUS * after[0] / speed,
    }
    assert values(obs) == pytest.approx(expected, abs=1e-9, rel=1e-9)
    row = obs.table.iloc[0]
    assert row.gamma_deg == pytest.approx(np.degrees(np.arctan2(u_x, u_z)), abs=1e-9)
    assert row.speed_m_s == pytest.approx(speed)
    assert (row.spin_x, row.spin_y) == pytest.approx(
        (-RADIUS * omega[0] / speed, RADIUS * omega[1] / speed), abs=1e-9, rel=1e-9
    )
    assert set(obs.table.impact_id) == {"line 2"}


def test_only_what_was_measured_comes_out(read):
    planar = read("u_x_m_s,u_z_m_s,v_x_m_s,v_z_m_s\n3,4,2,-3.5\n1,1,,-0.9\n")
    assert list(planar.table.observable) == ["v_x", "v_n", "v_n"]
    assert list(planar.table.value)[:2] == pytest.approx([0.4, 0.7])
    assert dict(planar.sources[0].rows_skipped) == {"not measured": 1}


def test_units_and_spellings(read):
    a = read("u_x_m_s,u_z_m_s,omega_y_rad_s,v_x_m_s,omega_y_after_rad_s,radius_m\n3,4,10,2,-200,0.005\n")
    rpm = 30 / np.pi
    b = read(
        "u_x [mm/s];u_z [mm/s];ω_y [rpm];v_x [mm/s];Ω_y [rpm];diameter_mm\n"
        f"3000;4000;{10 * rpm!r};2000;{-200 * rpm!r};10\n"
    )
    c = read(
        "speed_m_s,gamma_rad,Omega_y_rad_s,omega_y_rad_s,v_x_m_s,radius_mm\n5,"
        f"{np.arctan2(3, 4)},-200,10,2,5\n"
    )
    assert values(a) == pytest.approx({"v_x": 0.4, "spin_y_after": -0.2})
    for other in (b, c):
        assert values(other) == pytest.approx(values(a))
        assert other.table.spin_y[0] == pytest.approx(0.01)
        assert other.table.gamma_deg[0] == pytest.approx(a.table.gamma_deg[0])


def test_motion_against_x_is_turned_round(read):
    there = read("u_x_m_s,u_z_m_s,omega_y_rad_s,v_x_m_s,omega_y_after_rad_s,radius_m\n3,4,10,2,-200,0.005\n")
    back = read("u_x_m_s,u_z_m_s,omega_y_rad_s,v_x_m_s,omega_y_after_rad_s,radius_m\n-3,4,-10,-2,200,0.005\n")
    assert values(back) == values(there)
    assert back.table.spin_y[0] == there.table.spin_y[0]


def test_uncertainties_are_propagated(read):
    """Against 200,000 random draws around the same impact."""
    rng = np.random.default_rng(5)
    n = 200_000
    sd = {
        "u_x": 0.02,
        "u_y": 0.03,
        "u_z": 0.01,
        "v_x": 0.04,
        "v_y": 0.05,
        "omega_y": 2.0,
        "omega_y_after": 3.0,
    }
    mean = {
        "u_x": 3.0,
        "u_y": 1.0,
        "u_z": 4.0,
        "v_x": 2.0,
        "v_y": 0.5,
        "omega_y": 50.0,
        "omega_y_after": -200.0,
    }
    unit = {name: "rad_s" if name.startswith("omega") else "m_s" for name in mean}
    head = [f"{x}_{unit[x]}" for x in mean] + [f"sigma_{x}_{unit[x]}" for x in mean]
    extra = ["omega_x_rad_s", "omega_x_after_rad_s", "sigma_omega_x_rad_s", "sigma_omega_x_after_rad_s"]
    head += [*extra, "radius_m", "v_z_m_s"]
    cells = [*mean.values(), *sd.values(), 0, 100, 2.0, 3.0, RADIUS, -3]
    table = read(",".join(head) + "\n" + ",".join(map(str, cells)) + "\n").table.set_index("observable")
    d = {name: mean[name] + sd[name] * rng.standard_normal(n) for name in mean}
    ox, oxa = 2.0 * rng.standard_normal(n), 100 + 3.0 * rng.standard_normal(n)
    ut = np.hypot(d["u_x"], d["u_y"])
    c, s, u = d["u_x"] / ut, d["u_y"] / ut, np.hypot(ut, d["u_z"])
    draws = {
        "v_x": (c * d["v_x"] + s * d["v_y"]) / u,
        "v_y": (c * d["v_y"] - s * d["v_x"]) / u,
        "spin_y_after": RADIUS * (c * d["omega_y_after"] - s * oxa) / u,
    }
    for name, draw in draws.items():
        assert table.value[name] == pytest.approx(draw.mean(), abs=4 * draw.std() / np.sqrt(n) + 1e-4)
        # the components of u share their errors with the turn: 10 % is what leaving that out costs here
        assert table.sigma[name] == pytest.approx(draw.std(), rel=0.1)
    spin = RADIUS * (c * d["omega_y"] - s * ox) / u
    assert table.sigma_spin_y["v_x"] == pytest.approx(spin.std(), rel=0.1)
    gamma = np.degrees(np.arctan2(ut, d["u_z"]))
    assert table.sigma_gamma_deg["v_x"] == pytest.approx(gamma.std(), rel=0.02)
    assert np.isnan(table.sigma["v_n"])


def impacts(inertia, count=12, noise=0.0, rng=None):
    result = []
    for gamma in np.radians(np.linspace(10, 80, count)):
        u = 3 * np.array([np.sin(gamma), 0, np.cos(gamma)])
        v, after = impact(u, [0, 0, 0], 0.2, 0.9, inertia)
        shake = noise * rng.standard_normal(3) if rng is not None else 0.0
        result.append([u, np.zeros(3), v + shake, after])
    return result


def test_angular_momentum_of_a_solid_ball_closes(tmp_path):
    obs = table_of(tmp_path / "x.csv", impacts(0.4))
    (check,) = obs.momentum
    assert check.ok
    assert (check.n, check.n_violating, check.suggested) == (12, 0, None)
    assert (check.limit, check.inertia_factor, check.source) == (0.05, 0.4, "x.csv")
    assert check.rms < 1e-12
    assert check.says.startswith("x.csv: angular momentum about the contact closes to ")
    assert check.says.endswith("(rms over 12 impacts, inertia factor 0.4).")
    assert obs.notes == (), "what the check says is not said twice"


def test_angular_momentum_of_a_hollow_ball_closes_only_with_its_own_inertia(tmp_path):
    (wrong,) = table_of(tmp_path / "x.csv", impacts(2 / 3)).momentum
    assert not wrong.ok
    assert (wrong.n, wrong.n_violating) == (12, 12)
    assert wrong.suggested == pytest.approx(2 / 3)
    assert wrong.says.startswith(
        "x.csv: the velocities contradict the inertia factor 0.4; try --inertia-factor 0.667 (thin hollow "
        "ball; the velocities ask for 0.667), or check size and signs. With 0.4, angular momentum about the "
        "contact only closes to "
    )
    assert wrong.says.endswith("12 of 12 miss by more than 5 % (lines 2, 3, 4, ...).")
    (right,) = table_of(tmp_path / "x.csv", impacts(2 / 3), inertia_factor=2 / 3).momentum
    assert right.ok
    assert right.rms < 1e-12


@pytest.mark.parametrize("noise", [0.1, 0.15])
def test_errors_of_the_velocities_are_no_other_inertia(tmp_path, noise):
    """3 and 5 % of the speed: they miss by more than the limit, but by nothing that all impacts have."""
    for seed in range(12):
        rows = impacts(0.4, count=24, noise=noise, rng=np.random.default_rng(seed))
        (check,) = table_of(tmp_path / "x.csv", rows).momentum
        assert check.ok
        (wrong,) = table_of(tmp_path / "w.csv", rows, inertia_factor=2 / 3).momentum
        assert not wrong.ok
    assert check.rms > check.limit
    assert check.says.endswith("as far as errors of that size tell.")


def test_a_body_of_its_own_gets_its_own_factor(tmp_path):
    (check,) = table_of(tmp_path / "x.csv", impacts(0.55)).momentum
    assert "try --inertia-factor 0.55, or check size and signs." in check.says


def test_one_bad_impact_is_named(tmp_path):
    rows = impacts(0.4)
    rows[5][2] = rows[5][2] + np.array([0.25, 0, 0])
    (check,) = table_of(tmp_path / "x.csv", rows).momentum
    assert check.ok
    assert check.n_violating == 1
    assert "; 1 of 12 miss by more than 5 % (line 7)." in check.says
    assert "--inertia-factor" not in check.says


@pytest.mark.parametrize("spoil", ["sign", "noise"])
def test_no_inertia_factor_is_suggested_where_none_explains_the_miss(tmp_path, spoil):
    rng = np.random.default_rng(1)
    rows = impacts(0.4, noise=0.5 if spoil == "noise" else 0.0, rng=rng)
    for row in rows:
        row[3] = -row[3] if spoil == "sign" else row[3]
    (check,) = table_of(tmp_path / "x.csv", rows).momentum
    assert not check.ok
    assert check.suggested is None
    assert check.says.endswith(
        "Check the signs of the spins, the size, and the inertia factor 0.4 (--inertia-factor)."
    )


def test_the_check_goes_with_its_source(tmp_path):
    (tmp_path / "b").mkdir()
    a = table_of(tmp_path / "x.csv", impacts(0.4))
    b = table_of(tmp_path / "b" / "x.csv", impacts(2 / 3))
    both = data.combine([a, b])
    assert [(c.source, c.ok) for c in both.momentum] == [("x.csv", True), ("x.csv (2)", False)]
    assert both.momentum[1].says.startswith("x.csv (2): ")
    some = data.select(both, data.Selection(observable=("v_n",)))
    assert some.momentum == both.momentum
    assert "x.csv (2): the velocities contradict" in both._repr_html_()


def test_no_check_without_spin_after(read):
    assert read("u_x_m_s,u_z_m_s,v_x_m_s,v_z_m_s\n3,4,2,-3.5\n").momentum == ()
    assert read("gamma_deg,beta\n30,0.1\n").momentum == ()


def test_spin_before_not_given_is_said(read):
    obs = read("u_x_m_s,u_z_m_s,v_x_m_s,omega_y_after_rad_s,radius_m\n3,4,2,-200,0.005\n")
    assert "x.csv: no spin before the impact is given; it was taken as 0." in obs.notes


COLUMNS = (
    "column:u_x=vx_in",
    "column:u_z=vz_in [m/s]",
    "column:v_x=vx_out",
    "column:v_z_m_s=vz_out",
    "column:omega_y_after=wy_rad_s",
    "unit:vx_in=m/s",
    "unit:vx_out=m/s",
)


def test_raw_velocities_under_any_name(read):
    obs = read("vx_in,vz_in [m/s],vx_out,vz_out,wy_rad_s,radius_mm\n3,4,2,-3,-200,5\n", *COLUMNS)
    assert values(obs) == pytest.approx({"v_x": 0.4, "v_n": 0.6, "spin_y_after": -0.2})


def test_uncertainties_of_raw_velocities_under_any_name(read):
    text = (
        "vx_in,vz_in [m/s],vx_out,vz_out,wy_rad_s,radius_mm,a,b,c [mm/s],d\n3,4,2,-3,-200,5,0.1,0.2,300,7\n"
    )
    names = (
        "column:sigma_u_x=a",
        "column:sigma_v_x=b",
        "column:sigma_v_z=c [mm/s]",
        "column:sigma_omega_y_after=d",
    )
    plain = read(
        "u_x_m_s,u_z_m_s,v_x_m_s,v_z_m_s,omega_y_after_rad_s,radius_mm,sigma_u_x_m_s,sigma_v_x,sigma_v_z_m_s,"
        "sigma_omega_y_after_rad_s\n3,4,2,-3,-200,5,0.1,0.2,0.3,7\n"
    )
    got = read(text, *COLUMNS, *names)
    assert plain.table.sigma.notna().all()
    assert list(got.table.sigma) == pytest.approx(list(plain.table.sigma))
    assert got.table.sigma_gamma_deg[0] == pytest.approx(plain.table.sigma_gamma_deg[0])
    assert got.table.sigma_gamma_deg[0] > 0
    assert got.called("sigma_gamma_deg") == "the uncertainty of the angle (from a)"


def test_uncertainties_go_by_the_names_of_the_file(read):
    obs = read(
        "u_x_m_s,u_z_m_s,v_x_m_s,omega_y [rpm],radius_mm,sigma_u_x_m_s,sigma_u_z_m_s,sigma_omega_y [rpm],"
        "sigma_radius_mm\n3,4,2,1,5,0.1,0.1,0.1,0.01\n"
    )
    assert (
        obs.called("sigma_gamma_deg") == "the uncertainty of the angle (from sigma_u_x_m_s and sigma_u_z_m_s)"
    )
    assert (
        obs.called("sigma_spin_y")
        == "the uncertainty of the spin (from sigma_omega_y [rpm] and sigma_radius_mm)"
    )
    assert any(
        "the uncertainty of the size (sigma_radius_mm) is common to all impacts" in n for n in obs.notes
    )
    long = read("observable,gamma_deg,value,sigma_gamma [deg]\nbeta,10,0.4,1\n")
    assert data.combine([long, obs]).called("sigma_gamma_deg") == (
        "the uncertainty of the angle (from sigma_gamma [deg], sigma_u_x_m_s and sigma_u_z_m_s)"
    )
    kept = data.select(obs, data.Selection(observable=("v_x",)))
    assert kept.called("sigma_gamma_deg") == obs.called("sigma_gamma_deg")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=40)
@given(
    u=st.tuples(st.floats(0.1, 5), ordinary(-5, 5), st.floats(-5, -0.1)),
    spins=st.tuples(SPINS, SPINS, SPINS),
    k=st.floats(0.05, 0.4),
)
def test_z_out_of_the_wall(tmp_path, u, spins, k):
    u, omega = np.array(u), np.array(spins)
    v, after = impact(u, omega, k, 0.8, 0.4, into=-1)
    along = np.array([u[0], u[1], 0]) / np.hypot(u[0], u[1])
    # the spin that moves the contact along the way it comes, by the definition U = u + omega x (-R z)
    speed, back = np.linalg.norm(u), np.cross([0, 0, -1.0], along)
    contact = np.hypot(*(u + np.cross(omega, [0, 0, -RADIUS]))[:2])
    assume(contact > 0.01 * speed)
    obs = table_of(tmp_path / "raw.csv", [[u, omega, v, after]], convention=["z=out-of-wall"])
    got = values(obs)
    assert got["v_n"] == pytest.approx(0.8 * -u[2] / speed)
    assert got["v_x"] == pytest.approx(v @ along / speed, abs=1e-9)
    assert got["spin_y_after"] == pytest.approx(RADIUS * (after @ back) / speed, abs=1e-9)
    assert obs.table.spin_y[0] == pytest.approx(RADIUS * (omega @ back) / speed, abs=1e-9)
    (check,) = obs.momentum
    assert check.rms < 1e-9
    # the same impact, turned half round about x by hand, says the same
    half = np.array([1.0, -1.0, -1.0])
    turned = table_of(tmp_path / "turned.csv", [[half * x for x in (u, omega, v, after)]])
    assert values(turned) == got
    # a wrong sense of the spins does not close
    mirrored = table_of(tmp_path / "m.csv", [[u, omega, v, -after]], convention=["z=out-of-wall"])
    assert mirrored.momentum[0].rms > check.rms


def test_z_out_of_the_wall_is_said_and_checked(read):
    text = "u_x_m_s,u_z_m_s,v_x_m_s,v_z_m_s\n3,-4,2,{}\n"
    obs = read(text.format("3"), "z=out-of-wall")
    assert obs.notes == (
        "x.csv: z was read as pointing out of the wall; velocities and spins along y and z changed sign.",
    )
    assert read("u_x_m_s,u_z_m_s,v_x_m_s\n3,4,2\n", "z=into-wall").notes == ()
    with refused(DataError, match=r"column v_z_m_s: -3, but z points out of the wall by --convention z=out"):
        read(text.format("-3"), "z=out-of-wall")
    with refused(
        DataError, match=r"u_z_m_s: -4, but z points into .* or say --convention z=out-of-wall if z"
    ):
        read(text.format("3"))


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_spins_of_another_radius_are_named_beside_the_inertia_factor(tmp_path, factor):
    (check,) = table_of(tmp_path / "x.csv", impacts(0.4 * factor)).momentum
    assert f"spins {factor:g} times as large close as well (radius for diameter" in check.says
