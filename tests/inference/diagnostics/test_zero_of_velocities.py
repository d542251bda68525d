"""Velocities whose zero is off, of a wall that moves or a camera that drifts, are no law of the speed."""

from __future__ import annotations

import re

import numpy as np
import pytest
from factories import rest_long, table_file

from ifrfit.inference.fit import fit
from ifrfit.physics import rebound

N = 40
RADIUS = 0.005
TRUTH = {"e_n": 0.9, "e_t": -0.7, "mu": 0.15}


def raw(seed, *, before=(0.0, 0.0), after=(0.0, 0.0), spins=True, noise=0.01):
    """Raw velocities, x along the wall and z into it, which read too large by some m/s."""
    rng = np.random.default_rng([seed, 19])
    gamma, speed = np.linspace(8.0, 80.0, N), rng.uniform(2.0, 4.0, N)
    state = rebound(gamma, degrees=True, **TRUTH)
    angle = np.radians(gamma)
    columns = {
        "u_x_m_s": speed * np.sin(angle) + before[0],
        "u_z_m_s": speed * np.cos(angle) + before[1],
        "v_x_m_s": speed * state.v_x + after[0],
        "v_z_m_s": -speed * state.v_n + after[1],
    }
    columns = {name: x + noise * rng.standard_normal(N) for name, x in columns.items()}
    if spins:
        read = speed * state.spin_y + 0.4 * noise * rng.standard_normal(N)
        columns |= {"omega_y_after_rad_s": read / RADIUS, "radius_mm": 1000.0 * RADIUS}
    return columns


def fitted(path, columns):
    return fit(table_file(path / "t.csv", columns, "%.6f"), method="lsq")


MOVING = [
    ("zero-across", (0.0, 1.0), (0.08, -0.1, 0.3)),
    ("zero-along", (1.0, 0.0), (0.06, -0.1, 0.3, 1.0)),
]


@pytest.mark.parametrize(
    ("name", "way", "size"), [(name, way, size) for name, way, sizes in MOVING for size in sizes]
)
@pytest.mark.parametrize("seed", rest_long(range(6)))
def test_a_wall_that_moves_is_named_with_its_speed(tmp_path, seed, name, way, size):
    shift = tuple(size * x for x in way)
    facts = fitted(tmp_path, raw(seed, before=shift, after=shift)).facts
    slips = facts["slips"]
    assert slips.figures["called"][0] == name, slips.says
    found = slips.figures["tests"][name]
    assert abs(found["size"] - size) < max(4.0 * found["sd"], 0.2 * abs(size))
    of, large = name.partition("-")[2], "large" if size > 0.0 else "small"
    assert f"velocities {of} the wall before impact and after " in slips.says
    assert f" m/s too {large} (" in slips.says
    mend = f"take {found['size']:.2g} m/s off" if size > 0.0 else f"add {-found['size']:.2g} m/s to"
    assert slips.says.endswith(f"does the wall move, or the tracking drift? To try it, {mend} them")
    assert "effects" not in facts


@pytest.mark.parametrize("seed", rest_long(range(6)))
def test_a_wall_that_moves_much_is_named_without_spins(tmp_path, seed):
    """No line shows it there: nearly all impacts seem to slide, and friction to go with the speed."""
    slips = fitted(tmp_path, raw(seed, before=(1.0, 0.0), after=(1.0, 0.0), spins=False)).facts["slips"]
    assert slips.figures["called"][0] == "zero-along", slips.says
    assert abs(slips.figures["tests"]["zero-along"]["size"] - 1.0) < 0.2


@pytest.mark.parametrize("spins", [True, False])
@pytest.mark.parametrize(("name", "after"), [("zero-along-after", 0.15), ("zero-across-after", -0.1)])
@pytest.mark.parametrize("seed", rest_long(range(6)))
def test_a_zero_of_velocities_after_is_named_before_another_body(tmp_path, seed, name, after, spins):
    shift = (after, 0.0) if name == "zero-along-after" else (0.0, -after)
    facts = fitted(tmp_path, raw(seed, after=shift, spins=spins)).facts
    slips = facts["slips"]
    alike = () if spins else (name.removesuffix("-after"),)  # which is nothing else there
    assert slips.figures["called"][0] in (name, *alike), slips.says
    assert "inertia-factor" not in slips.figures["called"]
    if spins and name == "zero-along-after":
        assert "--inertia-factor" not in facts["angular_momentum"].says


@pytest.mark.parametrize("seed", rest_long(range(6)))
def test_gravity_between_reading_and_impact_is_named(tmp_path, seed):
    """10 ms on either side."""
    slips = fitted(tmp_path, raw(seed, before=(0.0, -0.1), after=(0.0, 0.1))).facts["slips"]
    assert slips.figures["called"][0] == "fall-between", slips.says
    (time,) = re.findall(r"gravity acts for ([\d.]+) ms between reading and impact", slips.says)
    assert 5.0 < float(time) < 15.0
    assert slips.says.endswith("carry the tracks on to the wall")


@pytest.mark.parametrize("seeds", rest_long((10, 100)))
def test_velocities_to_the_wall_have_no_zero_to_mend(tmp_path, seeds):
    """Control."""
    for seed in range(seeds):
        facts = fitted(tmp_path, raw(seed, spins=seed % 2 == 0)).facts
        assert facts["slips"].ok, facts["slips"].says
        assert facts["effects"].ok, facts["effects"].says


@pytest.mark.parametrize("seed", range(3))
def test_what_the_data_hardly_show_is_assumed(tmp_path, seed):
    """1 cm/s moves e_n by several of its sd and shows in no test: the fit says what it takes for granted."""
    truth, moved = (fitted(tmp_path, raw(seed, before=(0.0, w), after=(0.0, w))) for w in (0.0, 0.01))
    (said,) = [words for words in moved.assumed if words.startswith("wall and tracking at rest")]
    by, in_sd = re.search(r"0\.01 m/s across the wall would move e_n by ([\d.]+), ([\d.]+) sd", said).groups()
    change = truth.constants["e_n"].value - moved.constants["e_n"].value
    assert abs(float(by) - change) < 0.2 * change
    assert float(in_sd) > 2.0


def test_an_effect_stands_beside_a_zero_that_takes_as_much(tmp_path):
    """Of so many slips no test alone shows 2 cm/s; adhesion, of few effects, is not named alone."""
    beside = 0
    for seed in range(6):
        facts = fitted(tmp_path, raw(seed, before=(0.0, 0.02), after=(0.0, 0.02))).facts
        for name in ("slips", "effects"):
            if name in facts and not facts[name].ok:
                assert "m/s too" in facts[name].says
                beside += 1
    assert beside
