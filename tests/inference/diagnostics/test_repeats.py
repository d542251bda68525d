"""Repeats that share an error are named before the law is doubted; what is wrong in one observable counts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from factories import rest_long, table_file
from scipy import stats

from ifrfit import fit, rebound
from ifrfit.inference.diagnostics.quadratic_forms import sum_exceeds
from ifrfit.inference.diagnostics.repeats import _weights
from ifrfit.inference.result.fit_result import FitResult

ANGLES = np.arange(10.0, 81.0, 10.0)


def fitted(
    folder: Path, gamma: np.ndarray, true_gamma: np.ndarray, off: dict[str, np.ndarray], seed: int = 0
):
    """A fit of beta and e_n with noise of 0.03 and 0.02, read from a file."""
    rng = np.random.default_rng(seed)
    state = rebound(true_gamma, e_n=0.9, e_t=-0.85, mu=0.14, degrees=True)
    beta = state.beta + 0.03 * rng.standard_normal(gamma.size) + off.get("beta", 0.0)
    e_n = 0.9 + 0.02 * rng.standard_normal(gamma.size) + off.get("e_n", 0.0)
    path = table_file(folder / "repeats.csv", {"gamma_deg": gamma, "beta": beta, "e_n": e_n})
    return fit(path, method="lsq")


def failing(result: FitResult) -> set[str]:
    return {name for name, fact in result.facts.items() if not fact.ok}


@pytest.mark.parametrize("seeds", rest_long((2, 6)))
def test_one_angle_that_is_off_is_named(tmp_path, seeds):
    gamma = np.repeat(ANGLES, 5)
    seen = 0
    for seed in range(seeds):
        result = fitted(tmp_path, gamma, gamma, {"beta": np.where(gamma == 40.0, 0.12, 0.0)}, seed)
        assert failing(result) <= {"repeats"}
        if "repeats" in result.facts:
            seen += 1
            fact = result.facts["repeats"]
            assert "the 5 repeats of beta at 40 degrees are off together, by 0." in fact.says
            assert fact.says.endswith(" ".join(f"--exclude {line}" for line in range(17, 22)))
            assert fact.figures["observables"] == ["beta"]
    assert seen >= seeds - seeds // 6


@pytest.mark.parametrize("seeds", rest_long((2, 6)))
def test_angles_that_were_set_wrongly_are_no_contradiction(tmp_path, seeds):
    angles = np.linspace(8.0, 78.0, 15)
    gamma = np.repeat(angles, 4)
    seen = 0
    for seed in range(seeds):
        set_wrongly = np.repeat(angles + 2.0 * np.random.default_rng(seed).standard_normal(15), 4)
        result = fitted(tmp_path, gamma, set_wrongly, {}, seed)
        fact = result.facts.get("repeats")
        if fact is not None and "settings scatter by" in fact.says:
            seen += 1
            assert fact.says.endswith("give the mean of each angle as one row")
            assert "the angle as it was set" in fact.says
            assert "lack_of_fit" not in failing(result)
    assert 2 * seen >= seeds


def test_readings_of_one_impact_are_no_repeats(tmp_path):
    rng = np.random.default_rng(1)
    gamma = np.tile(np.round(rng.uniform(5.0, 80.0, 30), 1), 2)
    of_impact = {"beta": 0.1 * rng.standard_normal(30), "e_n": 0.1 * rng.standard_normal(30)}
    result = fitted(tmp_path, gamma, gamma, {name: np.tile(x, 2) for name, x in of_impact.items()})
    assert failing(result) == {"repeats"}
    says = result.facts["repeats"].says
    assert "Repeated readings of one impact are not repeats of an experiment" in says
    assert "impact_id" in says
    assert result.facts["lack_of_fit"].figures["test"] == "smooth departure of means"
    # the remedy holds: of rows of one impact_id one counts
    table = pd.read_csv(tmp_path / "repeats.csv")
    numbers = np.tile(np.arange(30), 2)
    numbered = fit(table_file(tmp_path / "numbered.csv", table.assign(impact_id=numbers)), method="lsq")
    assert len(numbered.points) == 60
    assert failing(numbered) == set()


def test_a_law_that_does_not_hold_stays_a_contradiction(tmp_path):
    gamma = np.repeat(np.linspace(5.0, 80.0, 16), 4)
    result = fitted(tmp_path, gamma, gamma, {"beta": 0.3 * np.sin(np.radians(3.0 * gamma))})
    assert "repeats" not in result.facts
    assert "lack_of_fit" in failing(result)


@pytest.mark.parametrize("seeds", rest_long((2, 6)))
def test_repeats_of_the_law_are_fine(tmp_path, seeds):
    for seed in range(seeds):
        gamma = np.repeat(ANGLES, 5)
        result = fitted(tmp_path, gamma, gamma, {}, seed)
        assert failing(result) == set()
        assert set(result.facts["lack_of_fit"].figures["p_pure"]) == {"all", "beta", "angles of beta", "e_n"}
        assert "errors independent of one another, also those of repeats at one angle" in result.assumed
    assert "errors independent of one another" in fitted(tmp_path, ANGLES, ANGLES, {}).assumed


def test_too_few_angles_say_so(tmp_path):
    angles = np.array([10.0, 25.0, 40.0, 50.0, 60.0, 70.0])
    gamma = np.repeat(angles, 8)
    off = (
        np.where(gamma == 40.0, 0.2, 0.0)
        - np.where(gamma == 60.0, 0.2, 0.0)
        + np.where(gamma == 70.0, 0.2, 0)
    )
    result = fitted(tmp_path, gamma, gamma, {"beta": off})
    says = result.facts["lack_of_fit"].says
    assert "the data contradict one set of constants" in says
    assert says.endswith("then give the mean of each angle as one row")


def test_the_tail_of_a_weighted_sum_is_that_of_f():
    """Equal weights of either sign make the F law."""
    for k, dof, f in ((3, 20, 8.0), (6, 32, 5.0), (1, 10, 21.0)):
        weights = np.concatenate((np.full(k, 1.0 / k), np.full(dof, -f / dof)))
        assert sum_exceeds(weights) == pytest.approx(stats.f.sf(f, k, dof), rel=0.15)


def test_angles_that_constants_explain_contradict_nothing(tmp_path):
    """Of two settings of closure F one sticks, whose value no angle moves; mu takes the other one."""
    gamma = np.repeat([12.0, 52.0], 6)
    rng = np.random.default_rng(0)
    state = rebound(gamma, closure="f", e_n=0.73, mu=0.165, degrees=True)
    frame = pd.DataFrame({"gamma_deg": gamma, "beta_cm": state.beta_cm, "tan_psi_out": state.tan_psi_out})
    frame.iloc[:, 1:] += 0.008 * rng.standard_normal((gamma.size, 2))
    path = table_file(tmp_path / "repeats.csv", frame)
    fact = fit(path, closure="f", fix={"e_n": 0.73}, method="lsq").facts["lack_of_fit"]
    assert fact.ok, fact.says
    assert all(p > 0.001 for p in fact.figures["p_pure"].values())


def test_many_settings_take_no_square_of_their_number():
    """The form of an error of each angle is a matrix of settings by settings: of 1e5 of them 70 GB."""
    rng = np.random.default_rng(3)
    by_angle, own = rng.uniform(0.1, 1.0, 1200), np.linalg.qr(rng.standard_normal((1200, 3)))[0]
    exact = np.linalg.eigvalsh(np.diag(by_angle) @ (np.eye(1200) - own @ own.T) @ np.diag(by_angle))
    found = np.sort(_weights(by_angle, own))
    # three columns move no eigenvalue beyond the third one below
    assert (exact[3:] <= found[3:] + 1e-12).all()
    assert (exact[3:] >= found[:-3] - 1e-12).all()
    np.testing.assert_allclose(np.sort(_weights(by_angle[:50], own[:50] * 0.0)), np.sort(by_angle[:50] ** 2))
    assert _weights(np.ones(100_000), np.zeros((100_000, 1))).size == 100_000
