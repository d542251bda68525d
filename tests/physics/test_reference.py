"""All rows of tests/reference/impacts.csv, to the tolerances stated in the README beside it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ifrfit.physics import Rebound, rebound

Columns = dict[str, NDArray[Any]]


@pytest.fixture(scope="module")
def result(impacts: Columns) -> Rebound:
    return rebound(
        impacts["gamma_deg"],
        impacts["spin_x"],
        impacts["spin_y"],
        e_n=impacts["e_n"],
        e_t=impacts["e_t"],
        mu=impacts["mu"],
        degrees=True,
    )


def spin_scale(impacts: Columns) -> NDArray[Any]:
    return np.asarray(1.0 + np.abs(impacts["spin_x"]) + np.abs(impacts["spin_y"]))


def cancelling(impacts: Columns) -> NDArray[Any]:
    """The one row where the slip cancels to the last bits."""
    return np.asarray((impacts["gamma_deg"] == 89.999999) & (impacts["spin_y"] == -1.0))


def cosine(impacts: Columns) -> NDArray[Any]:
    return np.asarray(np.sin(np.radians(90.0 - impacts["gamma_deg"])))


def rows_off(
    impacts: Columns, got: NDArray[Any], expected: NDArray[Any], tolerance: NDArray[Any] | float
) -> list[str]:
    """Line numbers and numbers of the rows that do not hold, nan required where the reference is nan."""
    off = np.isnan(got) != np.isnan(expected)
    off |= np.nan_to_num(np.abs(got - expected)) > tolerance
    return [f"line {i + 2} ({impacts['tag'][i]}): {got[i]!r} for {expected[i]!r}" for i in np.nonzero(off)[0]]


def test_has_all_rows(impacts: Columns) -> None:
    assert len(impacts["tag"]) == 440
    assert cancelling(impacts).sum() == 1


@pytest.mark.parametrize(
    ("name", "column"),
    [
        ("v_x", "v_x"),
        ("v_y", "v_y"),
        ("spin_x", "ROmega_x"),
        ("spin_y", "ROmega_y"),
        ("contact_x", "V_x"),
        ("contact_y", "V_y"),
    ],
)
def test_velocities_and_spins(impacts: Columns, result: Rebound, name: str, column: str) -> None:
    got = getattr(result, name)
    assert rows_off(impacts, got, impacts[column], 1e-13 * spin_scale(impacts)) == []


def test_normal_velocity_is_the_magnitude_of_the_signed_one(impacts: Columns, result: Rebound) -> None:
    assert rows_off(impacts, result.v_n, -impacts["v_z"], 1e-13) == []
    assert (result.v_n >= 0.0).all()


@pytest.mark.parametrize(
    ("name", "column"),
    [("beta", "beta"), ("beta_cm", "beta_cm"), ("beta_tot", "beta_tot"), ("energy_change", "dE")],
)
def test_observables(impacts: Columns, result: Rebound, name: str, column: str) -> None:
    expected = impacts[column]
    # relative where spins of 1e15 make the quantity itself huge
    tolerance = 1e-12 * np.maximum(1.0, np.nan_to_num(np.abs(expected)))
    assert rows_off(impacts, getattr(result, name), expected, tolerance) == []


@pytest.mark.parametrize(("name", "column"), [("mu_app", "mu_app"), ("mu_app_magnitude", "mu_app_mag")])
def test_apparent_friction(impacts: Columns, result: Rebound, name: str, column: str) -> None:
    expected = impacts[column]
    tolerance = np.where(cancelling(impacts), 1e-9, 1e-12)
    tolerance = tolerance * np.maximum(1.0, np.nan_to_num(np.abs(expected)))
    assert rows_off(impacts, getattr(result, name), expected, tolerance) == []


@pytest.mark.parametrize(
    ("name", "opposite", "adjacent"),
    [
        ("delta", lambda c: c["v_x"], lambda c: -c["v_z"]),
        ("lambda_", lambda c: c["v_y"], lambda c: c["v_x"]),
        ("psi_after", lambda c: c["V_x"], cosine),
        ("psi_out", lambda c: c["V_x"], lambda c: -c["v_z"]),
    ],
)
def test_angles(
    impacts: Columns,
    result: Rebound,
    name: str,
    opposite: Callable[[Columns], NDArray[Any]],
    adjacent: Callable[[Columns], NDArray[Any]],
) -> None:
    y, x = opposite(impacts), adjacent(impacts)
    expected = np.where((y == 0.0) & (x == 0.0), np.nan, np.arctan2(y, x))
    turn = getattr(result, name) - expected
    turn -= 2.0 * np.pi * np.round(turn / (2.0 * np.pi))
    # psi divides the cancelling slip by cos(gamma) = 2e-8: the last bit of the slip is 5e-9 there
    loose = cancelling(impacts) & name.startswith("psi")
    assert rows_off(impacts, expected + turn, expected, np.where(loose, 5e-9, 1e-12)) == []


@pytest.mark.parametrize(
    ("angle", "column"),
    [("delta", "tan_delta"), ("lambda_", "tan_lambda")],
)
def test_tangents_where_they_are_defined(impacts: Columns, result: Rebound, angle: str, column: str) -> None:
    tangents = {"delta": (result.v_x, result.v_n), "lambda_": (result.v_y, result.v_x)}
    defined = ~np.isnan(impacts[column])
    opposite, adjacent = (part[defined] for part in tangents[angle])
    expected = impacts[column][defined]
    assert np.allclose(opposite / adjacent, expected, rtol=1e-11, atol=1e-12)


def test_regimes(impacts: Columns, result: Rebound) -> None:
    tag, regime = impacts["tag"].astype(str), impacts["regime"].astype(str)
    clear = ~np.char.startswith(tag, "transition") & (tag != "Ut_zero") & (regime != "none")
    assert clear.sum() > 400
    expected = regime[clear] == "sticking"
    wrong = np.nonzero(result.sticking[clear] != expected)[0]
    assert [tag[clear][i] for i in wrong] == []


def test_a_wrong_coefficient_would_be_seen(impacts: Columns) -> None:
    """Negative control: the contact form of the friction in sticking is another model."""
    other = rebound(
        impacts["gamma_deg"],
        impacts["spin_x"],
        impacts["spin_y"],
        e_n=impacts["e_n"],
        e_t=impacts["e_t"],
        mu=impacts["mu"],
        degrees=True,
        closure="ifr-contact",
    )
    wrong = rows_off(impacts, other.v_x, impacts["v_x"], 1e-13 * spin_scale(impacts))
    assert len(wrong) > 100
