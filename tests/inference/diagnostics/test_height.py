"""Velocities as they were above a floor, which gravity changed there, are no law of the speed."""

from __future__ import annotations

import numpy as np
import pytest
from factories import rest_long, table_file

from ifrfit.inference.fit import fit
from ifrfit.physics import rebound

N = 40
GRAVITY = 9.81


def as_read(gamma, speed, before, after):
    """Velocities of impacts that were read some metres above the floor, over the speed that was read."""
    gained, lost = (2.0 * GRAVITY * height / speed**2 for height in (before, after))
    along, towards = np.sin(np.radians(gamma)), np.sqrt(np.cos(np.radians(gamma)) ** 2 + gained)
    at_wall = np.hypot(along, towards)
    true = np.degrees(np.arctan2(along, towards))
    state = rebound(true, e_n=0.9, e_t=-0.7, mu=0.15, degrees=True)
    away = np.sqrt(np.maximum((at_wall * state.v_n) ** 2 - lost, 0.0))
    read = {"v_x": at_wall * state.v_x, "v_n": away, "spin_y_after": at_wall * state.spin_y}
    return read | {
        "e_n": away / np.cos(np.radians(gamma)),
        "beta": -(read["v_x"] + read["spin_y_after"]) / along,
    }


def fitted(path, seed, names, *, before=0.0, after=0.0, speeds=True, one_speed=False, noise=0.01):
    rng = np.random.default_rng([seed, 17])
    gamma = rng.uniform(10.0, 65.0, N)
    speed = np.full(N, 1.5) if one_speed else rng.uniform(1.2, 4.0, N)
    values = as_read(gamma, speed, before, after)
    columns = {name: values[name] + noise * rng.standard_normal(N) for name in names}
    columns |= {"speed_m_s": speed} if speeds else {}
    return fit(table_file(path / "t.csv", {"gamma_deg": gamma, **columns}, "%.6f"), method="lsq").facts


@pytest.mark.parametrize("names", [("beta", "e_n"), ("v_x", "v_n", "spin_y_after")])
@pytest.mark.parametrize("which", ["", "-before", "-after"])
@pytest.mark.parametrize("speeds", rest_long(("one", "several", "none")))
@pytest.mark.parametrize("seed", rest_long(range(6)))
def test_a_height_above_the_floor_is_named(tmp_path, seed, names, which, speeds):
    heights = {"": (0.02, 0.02), "-before": (0.01, 0.0), "-after": (0.0, 0.01)}[which]
    before, after = heights
    one, stated = speeds != "several", speeds != "none"
    facts = fitted(tmp_path, seed, names, before=before, after=after, one_speed=one, speeds=stated)
    slips = facts["slips"]
    assert slips.figures["called"][0] == f"{'height' if stated else 'fall'}{which}", slips.says
    assert "above the wall, by " in slips.says
    assert slips.says.endswith("carry the tracks on to the wall")
    if stated:
        found = slips.figures["tests"][f"height{which}"]
        assert abs(found["size"] - max(heights)) < max(4.0 * found["sd"], 0.2 * max(heights))


@pytest.mark.parametrize("seeds", rest_long((10, 100)))
def test_velocities_at_the_wall_have_no_height(tmp_path, seeds):
    """Control."""
    for seed in range(seeds):
        facts = fitted(tmp_path, seed, ("v_x", "v_n"), speeds=seed % 2 == 0)
        assert facts["slips"].ok
        assert facts["effects"].ok
