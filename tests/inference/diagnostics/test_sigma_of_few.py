"""Sigmas of few readings each are guesses; sigmas that go with the angle or the value are none."""

from __future__ import annotations

import numpy as np
import pytest
from factories import at_most, table_file

from ifrfit import Noise, fit
from ifrfit.physics import rebound


def means(path, seed, *, readings, gamma):
    """Means of some readings of beta and e_n at each angle, with their standard errors."""
    rng = np.random.default_rng(seed)
    beta = rebound(gamma, degrees=True, e_n=0.9, e_t=-0.9, mu=0.12).beta
    columns = {"gamma_deg": gamma}
    for name, value, noise in (("beta", beta, 0.05), ("e_n", np.full(gamma.size, 0.9), 0.015)):
        each = value + noise * rng.standard_normal((readings, gamma.size))
        columns |= {name: each.mean(axis=0), f"sigma_{name}": each.std(axis=0, ddof=1) / np.sqrt(readings)}
    return table_file(path, columns, "%.5g")


@pytest.mark.parametrize(("n", "least"), [(5, 7), (16, 9)])
def test_standard_errors_of_three_readings_are_named(tmp_path, n, least):
    said = []
    for seed in range(12):
        path = means(tmp_path / "t.csv", seed, readings=3, gamma=np.linspace(10.0, 75.0, n))
        said.append(fit(path, method="lsq").facts.get("sigma_of_few"))
    assert sum(fact is not None for fact in said) >= least
    assert all("--tails student-t --dof" in fact.says for fact in said if fact)


def test_students_law_takes_them_as_they_are(tmp_path):
    path = means(tmp_path / "t.csv", 1, readings=3, gamma=np.linspace(10.0, 75.0, 16))
    assert "sigma_of_few" not in fit(path, method="lsq", noise=Noise(tails="student-t", dof=2)).facts


@pytest.mark.parametrize("kind", ["one", "of the value", "of the angle", "two kinds", "in turns"])
@pytest.mark.parametrize("seeds", [5, pytest.param(100, marks=pytest.mark.long)])
def test_sigmas_that_are_known_are_none(tmp_path, kind, seeds):
    alarms = 0
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        gamma = np.sort(rng.uniform(5.0, 80.0, rng.integers(8, 40)))
        beta = rebound(gamma, degrees=True, e_n=0.9, e_t=-0.8, mu=0.15).beta
        sigma = {
            "one": np.full(gamma.size, 0.02),
            "of the value": 0.03 * np.abs(beta) + 0.005,
            "of the angle": 0.01 + 0.05 * np.radians(gamma) ** 2,
            "in turns": np.where(np.arange(gamma.size) % 2, 0.01, 0.03),
            "two kinds": np.where(np.arange(gamma.size) < gamma.size // 2, 0.01, 0.03),
        }[kind]
        columns = {"gamma_deg": gamma, "beta": beta + sigma * rng.standard_normal(gamma.size), "sigma": sigma}
        facts = fit(table_file(tmp_path / "t.csv", columns, "%.5g"), method="lsq", fix={"e_n": 0.9}).facts
        alarms += "sigma_of_few" in facts
    assert alarms <= at_most(seeds, 0.001)


def one_error(seed, kind):
    """Velocities with errors of one size each: in m/s, or as ratios with the sigma that follows, exactly."""
    rng = np.random.default_rng(seed)
    n = 30
    gamma, speed = rng.uniform(8.0, 78.0, n), rng.uniform(1.0, 8.0, n)
    spin = 0.3 * rng.standard_normal(n) if "spin" in kind else np.zeros(n)
    out = rebound(gamma, spin_y=spin, degrees=True, e_n=0.9, e_t=-0.9, mu=0.12)
    sine, cosine = np.sin(np.radians(gamma)), np.cos(np.radians(gamma))
    if kind.startswith("velocities"):
        v_x, v_z = (0.05 * rng.standard_normal(n) + speed * each for each in (out.v_x, -out.v_n))
        sigma = dict.fromkeys(("sigma_v_x_m_s", "sigma_v_z_m_s"), np.full(n, 0.05))
        incoming = {"u_x_m_s": speed * sine, "u_z_m_s": speed * cosine, "radius_mm": np.full(n, 20.0)}
        return incoming | {"v_x_m_s": v_x, "v_z_m_s": v_z} | sigma
    slip = np.abs(sine + spin)
    keep = slip > 0.1
    speed = np.full(n, 2.0) if "one speed" in kind else speed
    columns = {"gamma_deg": gamma, "spin_y": spin, "speed_m_s": speed}
    for name, value, sigma in (("beta", out.beta, 0.05 / speed / slip), ("e_n", 0.9, 0.05 / speed / cosine)):
        columns |= {name: value + sigma * rng.standard_normal(n), f"sigma_{name}": sigma}
    return {name: column[keep] for name, column in columns.items()}


@pytest.mark.parametrize("kind", ["velocities", "ratios", "ratios, spin", "ratios, spin, one speed"])
@pytest.mark.parametrize("seeds", [5, pytest.param(100, marks=pytest.mark.long)])
def test_errors_of_one_size_in_metres_per_second_are_none(tmp_path, kind, seeds):
    alarms = 0
    for seed in range(seeds):
        path = table_file(tmp_path / "t.csv", one_error(seed, kind), "%.5g")
        alarms += "sigma_of_few" in fit(path, method="lsq").facts
    assert alarms <= at_most(seeds, 0.001)


def test_few_readings_are_named_at_speeds_and_spins_that_vary(tmp_path):
    named = 0
    for seed in range(12):
        rng = np.random.default_rng(seed)
        columns = one_error(seed, "ratios, spin")
        for name in ("beta", "e_n"):
            columns[f"sigma_{name}"] = columns[f"sigma_{name}"] * np.sqrt(
                rng.chisquare(2, columns["gamma_deg"].size) / 2.0
            )
        path = table_file(tmp_path / "t.csv", columns, "%.5g")
        named += "sigma_of_few" in fit(path, method="lsq").facts
    assert named >= 9
