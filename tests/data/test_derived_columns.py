"""A column that was computed from the velocities beside it is held against them."""

from __future__ import annotations

import numpy as np
import pytest
from factories import rest_long, table_file

from ifrfit import fit, rebound

WRONG = {
    "from the wall": ("delta_deg", lambda x: np.minimum(90.0 - x, 90.0), "measured from the wall"),
    "sign": ("delta_deg", lambda x: -x, "of the opposite sign"),
    "energies": ("beta_tot", lambda x: x**2, "its square, a ratio of energies"),
    "percent": ("beta_tot", lambda x: 100.0 * x, "in percent"),
    "of the contact": ("beta_cm", lambda x: x + 0.6, "not by scatter"),
}


def notes(folder, seed, name, definition, *, noise=0.01, apart=False, spin=0.0):
    """Of a table with velocities, and what was computed from them or read beside them."""
    rng = np.random.default_rng([seed, 83])
    gamma = rng.uniform(10.0, 80.0, 30)
    state = rebound(gamma, spin_y=spin, e_n=0.9, e_t=-0.7, mu=0.15, degrees=True)
    read = {"v_x": state.v_x, "v_n": state.v_n, "spin_y_after": state.spin_y}
    read = {key: value + noise * rng.standard_normal(30) for key, value in read.items()}
    v_x, v_n, after = read.values()
    sine, cosine = np.sin(np.radians(gamma)), np.cos(np.radians(gamma))
    made = {
        "delta_deg": np.degrees(np.arctan2(v_x, v_n)),
        "beta_tot": np.hypot(v_x, v_n),
        "beta_cm": -v_x / sine,
        "beta": -(v_x + after) / (sine + spin),
        "e_n": v_n / cosine,
        "tan_psi_after": (v_x + after) / cosine,
    }
    errors = noise * (57.3 if name == "delta_deg" else 1.0) * apart * rng.standard_normal(30)
    columns = {"gamma_deg": gamma, "spin_y": spin, **read, name: definition(made[name]) + errors}
    return [
        n
        for n in fit(table_file(folder / "t.csv", columns, "%.5f"), method="lsq").warnings
        if "contradicts" in n
    ]


@pytest.mark.parametrize("noise", [0.01, 0.05])
@pytest.mark.parametrize(("name", "definition", "words"), WRONG.values(), ids=list(WRONG))
@pytest.mark.parametrize("seed", rest_long(range(4)))
def test_a_wrong_definition_is_said(tmp_path, seed, name, definition, words, noise):
    (note,) = notes(tmp_path, seed, name, definition, noise=noise)
    assert note.startswith(f"{name} contradicts v_x, v_n and spin_y_after of the same impacts")
    assert words in note


@pytest.mark.parametrize("apart", [False, True])
@pytest.mark.parametrize("spin", [0.0, 0.3])
@pytest.mark.parametrize("name", ["delta_deg", "beta_tot", "beta_cm", "beta", "e_n", "tan_psi_after"])
@pytest.mark.parametrize("seed", rest_long(range(10)))
def test_a_right_one_is_not(tmp_path, seed, name, spin, apart):
    """Control: computed, or read by itself with an error of its own."""
    assert not notes(tmp_path, seed, name, lambda x: x, noise=0.05 if apart else 0.02, apart=apart, spin=spin)
