"""A wall that moves, an e_n that goes with the speed: what explains as much stands beside what is named."""

from __future__ import annotations

import re

import numpy as np
import pytest
from factories import rest_long, table_file

from ifrfit.inference.diagnostics.omitted_effects.effect_signatures import dissipating
from ifrfit.inference.fit import fit
from ifrfit.physics import rebound

N = 30
TRUTH = {"e_n": 0.9, "e_t": -0.7, "mu": 0.15}
ACROSS = ("zero-across", "zero-across-after")
MOVING = "velocities across the wall before impact and after"


def fitted(
    path, seed, *, names=("beta", "e_n"), noise=0.005, known=True, across=0.0, between=0.0, falls=False
):
    """A fit of ratios beside speeds of 2 to 4 m/s; velocities across the wall read too large by some m/s.

    Gravity acts for seconds `between` reading and impact.

    Or e_n `falls` with the speed, as that of a viscoelastic sphere.
    """
    rng = np.random.default_rng([seed, 4711])
    gamma, speed = np.radians(np.linspace(8.0, 70.0 if falls else 80.0, N)), rng.uniform(2.0, 4.0, N)
    rng.shuffle(speed)
    along, towards = speed * np.sin(gamma), speed * np.cos(gamma)
    e_n = dissipating(TRUTH["e_n"])(towards / np.median(towards)) if falls else np.full(N, TRUTH["e_n"])
    each = [rebound(one, **{**TRUTH, "e_n": float(e)}) for one, e in zip(gamma, e_n, strict=True)]
    v_x, v_n, spin = (np.array([float(getattr(s, of)) for s in each]) for of in ("v_x", "v_n", "spin_y"))
    away, towards = speed * v_n - across - 9.81 * between, towards + across - 9.81 * between
    read = np.hypot(along, towards)
    values = {"e_n": away / towards, "beta": -(v_x + spin) * speed / along, "v_n": away / read}
    columns = {"gamma_deg": np.degrees(np.arctan2(along, towards)), "speed_m_s": read}
    for name in names:
        columns[name] = values[name] + noise * rng.standard_normal(N)
        if known:
            columns[f"sigma_{name}"] = np.full(N, noise)
    return fit(table_file(path / "t.csv", columns, "%.6f"), method="lsq")


def said(found):
    """Slips that are named, and all words of slips and effects that show."""
    shown = [found.facts[name] for name in ("slips", "effects") if name in found.facts]
    called = found.facts["slips"].figures["called"] if "slips" in found.facts else []
    return called, " ".join(fact.says for fact in shown if not fact.ok)


@pytest.mark.parametrize(
    ("seed", "case"),
    [
        (0, {"across": 0.01, "noise": 0.01}),
        (8, {"across": 0.01, "known": False}),
        (5, {"across": -0.01, "known": False}),
        (3, {"across": -0.01, "known": False}),
    ],
)
def test_a_wall_that_moves_stands_beside_a_turned_camera_or_a_height(tmp_path, seed, case):
    """Which a test of so many showed, that of the wall, by a little, not."""
    called, words = said(fitted(tmp_path, seed, **case))
    assert called
    assert set(ACROSS) & set(called), words
    assert MOVING in words


@pytest.mark.parametrize("seed", [6, 8])
def test_a_wall_that_moves_stands_beside_a_law_of_the_speed(tmp_path, seed):
    _, words = said(fitted(tmp_path, seed, across=-0.01, known=False))
    assert words.startswith("the residuals call for viscoelastic restitution")
    assert MOVING in words


@pytest.mark.parametrize("names", [("beta", "e_n"), ("v_n", "beta")])
@pytest.mark.parametrize("seeds", rest_long((12, 40)))
def test_a_law_of_the_speed_stands_beside_a_wall_that_moves(tmp_path, names, seeds):
    """Where speeds range twofold, three of four at least: another slip explains more in the rest."""
    findings = [said(fitted(tmp_path, seed, names=names, falls=True)) for seed in range(seeds)]
    words = [words for called, words in findings if set(called) & set(ACROSS)]
    assert words
    assert sum("viscoelasticity" in one for one in words) >= 0.75 * len(words)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("known", [True, False])
def test_ratios_beside_speeds_take_a_wall_at_rest_for_granted(tmp_path, seed, known):
    """1 cm/s moves e_n by several sd and hardly shows: the fit says so of readings of e_n, too."""
    moved, rest = (fitted(tmp_path, seed, known=known, noise=0.01, across=w) for w in (0.01, 0.0))
    (words,) = [one for one in moved.assumed if one.startswith("wall and tracking at rest")]
    by, in_sd = re.search(
        r"0\.01 m/s across the wall would move e_n by ([\d.]+), ([\d.]+) sd", words
    ).groups()
    change = rest.constants["e_n"].value - moved.constants["e_n"].value
    assert abs(float(by) - change) < 0.25 * change
    assert float(in_sd) > 3.0


@pytest.mark.parametrize("seed", range(3))
def test_ratios_beside_speeds_take_no_time_at_the_wall_for_granted(tmp_path, seed):
    """Gravity for 5 ms on either side moves mu by several sd and hardly shows."""
    late, at_impact = (fitted(tmp_path, seed, noise=0.01, between=t) for t in (0.005, 0.0))
    (words,) = [
        one for one in late.assumed if one.startswith("speeds those at impact (on a floor, gravity for 5")
    ]
    by, in_sd = re.search(r"would move mu by ([\d.]+), ([\d.]+) sd", words).groups()
    change = abs(late.constants["mu"].value - at_impact.constants["mu"].value)
    assert abs(float(by) - change) < 0.4 * change
    assert float(in_sd) > 3.0
