"""Collisions of two equal spheres are read as impacts on a wall: pairs simulated here as two bodies."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from refusals import refused

import ifrfit
from ifrfit.data.catalogue import load_dataset
from ifrfit.errors import UsageError

PAIR = "pair=equal-spheres"
RADIUS, INERTIA = 0.002, 0.4
CORNELL = Path(__file__).with_name("cornell_relative_velocities.csv")
WORKSHEET = ("column:u_z=gn_before_m_s", "column:u_x=gt_before_m_s", "column:v_n=gn_after_m_s",
             "column:v_x=gt_centre_after_m_s", "ignore=worksheet_row")  # fmt: skip


def collide(velocities, spins, *, e_n, mu, e_t=None, beta0=None, second=1.0):
    """Velocities and spins of two spheres of mass 1 after they touch; z runs from the first to the second.

    One impulse P acts on the first sphere at +R z and -P on the second at -R z, whose radius is `second`
    times that of the first. Friction of closure IFR stops at the impulse whose turning of both spheres alone
    would end the slip; that of FR where the slip is reversed by beta0.
    """
    (c1, c2), (w1, w2) = velocities, spins
    z = np.array([0.0, 0.0, 1.0])
    arm1, arm2 = RADIUS * z, -second * RADIUS * z
    slip = (c1 + np.cross(w1, arm1)) - (c2 + np.cross(w2, arm2))
    tangential = slip - slip @ z * z
    by_motion, by_turning = 2.0, 2.0 / INERTIA
    normal = (1.0 + e_n) * slip @ z / by_motion
    size = np.linalg.norm(tangential)
    way = tangential / size if size > 0.0 else tangential
    if beta0 is not None:
        along = min((1.0 + beta0) * size / (by_motion + by_turning), mu * normal)
    else:
        along = (1.0 + e_t) * size / (by_motion + by_turning) + min(size / by_turning, mu * normal)
    impulse = -along * way - normal * z
    turn1 = np.cross(arm1, impulse) / (INERTIA * arm1 @ arm1)
    turn2 = np.cross(arm2, -impulse) / (INERTIA * arm2 @ arm2)
    return (c1 + impulse, c2 - impulse), (w1 + turn1, w2 + turn2)


def relative(velocities, spins):
    """Of the first centre to the second, and the sum of the spins."""
    return np.concatenate([velocities[0] - velocities[1], spins[0] + spins[1]])


def text_of(impacts):
    """A table of relative motion before and after."""
    names = [f"{what}_{axis}" for what in ("u", "omega") for axis in "xyz"]
    header = [f"{name}_{'m_s' if name[0] == 'u' else 'rad_s'}" for name in names]
    header += [f"v_{axis}_m_s" for axis in "xyz"] + [f"omega_{axis}_after_rad_s" for axis in "xyz"]
    rows = [",".join(repr(float(x)) for x in np.concatenate(impact)) + f",{RADIUS}" for impact in impacts]
    return "\n".join([",".join([*header, "radius_m"]), *rows]) + "\n"


def experiment(*, seed=1, count=40, **constants):
    """Collisions at all angles, with both spheres moving and spinning before."""
    rng = np.random.default_rng(seed)
    impacts = []
    for gamma in np.radians(np.linspace(4.0, 80.0, count)):
        mean, spins = rng.normal(0.0, 2.0, 3), rng.normal(0.0, 150.0, (2, 3))
        half = 0.6 * np.array([np.sin(gamma), 0.0, np.cos(gamma)])
        before = (mean + half, mean - half), tuple(spins)
        impacts.append((relative(*before), relative(*collide(*before, **constants))))
    return impacts


CONSTANTS = [
    ("ifr", {"e_n": 0.9, "e_t": -0.93, "mu": 0.13}),
    ("fr", {"e_n": 0.7, "beta0": 0.35, "mu": 0.2}),
]
VECTORS = st.tuples(*[st.floats(-3.0, 3.0).filter(lambda x: abs(x) > 1e-6)] * 3)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=40)
@given(
    closure=st.sampled_from(CONSTANTS),
    u=st.tuples(st.floats(0.05, 3.0), st.floats(0.05, 3.0)),
    mean=VECTORS,
    spins=st.tuples(VECTORS, VECTORS),
)
def test_a_pair_is_a_sphere_on_a_wall_in_the_relative_frame(read, closure, u, mean, spins):
    name, constants = closure
    half = 0.5 * np.array([u[0], 0.0, u[1]])
    before = (np.add(mean, half), np.subtract(mean, half)), tuple(300.0 * np.array(w) for w in spins)
    after = collide(*before, **constants)
    table = read(text_of([(relative(*before), relative(*after))]), PAIR).table
    row, got = table.iloc[0], dict(zip(table["observable"], table["value"], strict=True))
    wall = ifrfit.rebound(
        row["gamma_deg"], row["spin_x"], row["spin_y"], closure=name, degrees=True, **constants
    )
    expected = {"v_x": wall.v_x, "v_y": wall.v_y, "v_n": wall.v_n, "spin_x_after": wall.spin_x,
                "spin_y_after": wall.spin_y}  # fmt: skip
    assert got == pytest.approx({key: float(value) for key, value in expected.items()}, abs=1e-9)


@pytest.mark.parametrize(("closure", "constants"), CONSTANTS)
def test_the_constants_of_simulated_pairs_come_back(read, closure, constants):
    rng = np.random.default_rng(5)
    impacts = experiment(**constants)
    for _, after in impacts:
        after[:3] += 0.01 * rng.standard_normal(3)
        after[3:] += 0.01 / RADIUS * rng.standard_normal(3)
    data = read(text_of(impacts), PAIR)
    fit = ifrfit.fit(data, closure=closure, method="lsq", observable=["v_x", "v_n", "spin_y_after"])
    for name, value in constants.items():
        found = fit.constants[name]
        assert found.value == pytest.approx(value, abs=4.0 * found.stderr)
        assert found.stderr < 0.03
    assert all(check.ok for check in data.momentum)
    assert any("wall in the relative frame" in note for note in data.notes)


def test_spheres_of_unequal_size_are_found_where_spins_are_known(read):
    """Control: the spins of unequal spheres count by their radii, and their plain sum closes nothing."""
    (equal,) = read(text_of(experiment(**CONSTANTS[0][1])), PAIR).momentum
    assert equal.rms < 1e-12
    (check,) = read(text_of(experiment(second=2.0, **CONSTANTS[0][1])), PAIR).momentum
    assert not check.ok


def test_the_spin_of_one_sphere_alone_is_found(read):
    impacts = experiment(**CONSTANTS[0][1])
    for before, after in impacts:
        before[3:] /= 2.0
        after[3:] /= 2.0
    (check,) = read(text_of(impacts), PAIR).momentum
    assert check.suggested == pytest.approx(2.0 * INERTIA)
    assert "and that spins are the sum of both spheres' (one of them asks for 2 J)" in check.says


@pytest.mark.parametrize("choice", ["unequal-spheres", "sphere-wall", "discs", "equal"])
def test_other_pairs_are_refused_with_the_reason(read, choice):
    with refused(UsageError) as said:
        read(text_of(experiment(count=3, **CONSTANTS[0][1])), f"pair={choice}")
    assert said.value.in_shell == (
        f"--convention pair={choice}: the choices are equal-spheres. Two equal spheres are a wall in the "
        "relative frame; of other pairs radii, masses and inertia factors of both bodies enter, and ifrfit "
        "does not read them. For impacts on a wall leave the convention away."
    )


@pytest.mark.parametrize("text", ["gamma_deg,beta\n30,0.1\n", "observable,gamma_deg,value\nbeta,30,0.1\n"])
def test_observables_of_pairs_are_taken_as_they_are(read, text):
    pair, wall = read(text, PAIR), read(text)
    assert pair.table.equals(wall.table)
    assert pair.notes == (
        "x.csv: read as collisions of two equal spheres, which are a wall in the relative frame: velocities "
        "are of one centre relative to the other, spins the sum of both spheres'.",
    )


def test_relative_velocities_of_glass_spheres_give_the_bundled_observables():
    """The Cornell group's worksheet, as columns of a stranger's own naming."""
    table = ifrfit.read(CORNELL, convention=[PAIR, *WORKSHEET]).table
    known = load_dataset("cornell-glass").table
    angle = np.radians(table["gamma_deg"].to_numpy())
    for observable, own, share in (("v_n", "e_n", np.cos(angle)), ("v_x", "beta_cm", -np.sin(angle))):
        rows = (table["observable"] == observable).to_numpy()
        assert rows.sum() == 24
        expected = known[known["observable"] == own]
        assert table["value"].to_numpy()[rows] / share[rows] == pytest.approx(
            expected["value"].to_numpy(), abs=2e-6
        )
        assert table["gamma_deg"].to_numpy()[rows] == pytest.approx(
            expected["gamma_deg"].to_numpy(), abs=1e-5
        )
        assert table["speed_m_s"].to_numpy()[rows] == pytest.approx(
            expected["speed_m_s"].to_numpy(), abs=1e-6
        )
