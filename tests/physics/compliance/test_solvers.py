"""The solvers of tangential compliance: against one another, against known numbers, and in their limits."""

from __future__ import annotations

from importlib.resources import files
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from ifrfit.errors import UsageError
from ifrfit.physics.compliance import METHODS, chi_of, poisson_ratio, rebound_ratio
from ifrfit.physics.compliance.law import compliance_table

NU_03 = float(chi_of(0.3))

# Maw-Barber-Fawcett solution for a solid sphere, computed independently by a memory function with 4000 steps
# on another grid: Poisson ratio, psi1, psi2
REFERENCE = (
    (0.00, 0.100, 0.03799), (0.00, 1.000, 0.28475), (0.00, 1.800, -0.14135), (0.00, 3.000, -1.03747),
    (0.00, 4.400, -1.54189), (0.05, 4.000, -1.49285), (0.30, 0.100, 0.0206), (0.30, 0.500, 0.0478),
    (0.30, 1.000, -0.0598), (0.30, 1.400, -0.3424), (0.30, 2.000, -0.8371), (0.30, 2.600, -1.2146),
    (0.30, 3.000, -1.3795), (0.30, 3.600, -1.4809), (0.30, 4.000, -1.4363), (0.30, 4.600, -1.1455),
)  # fmt: skip


@pytest.mark.parametrize("method", ["table", "memory"])
def test_known_numbers(method: str) -> None:
    nu, psi1, psi2 = np.array(REFERENCE).T
    found = rebound_ratio(psi1, chi_of(nu), method=method)
    assert np.abs(found - psi2).max() < (2e-3 if method == "table" else 3e-4)


def test_largest_restitution_by_poisson_ratio() -> None:
    psi1 = np.linspace(0.5, 5.0, 901)
    for nu, largest in ((0.0, 0.371), (0.2, 0.427), (0.25, 0.446), (0.3, 0.467), (0.35, 0.492), (0.5, 0.596)):
        beta = -rebound_ratio(psi1, chi_of(nu)) / psi1
        assert beta.max() == pytest.approx(largest, abs=2e-3)
        if nu == 0.3:
            assert 2.6 <= psi1[beta.argmax()] <= 2.7
            assert psi1[np.flatnonzero(beta > 0.0)[0]] == pytest.approx(0.81, abs=0.01)


@given(st.floats(0.65, 3.0), st.floats(0.0, 1.1))
@settings(max_examples=200, deadline=None)
def test_table_between_its_nodes(chi: float, share: float) -> None:
    psi1 = share * (4.0 * chi - 1.0)
    exact = rebound_ratio(psi1, chi, method="memory", steps=16_000)
    assert rebound_ratio(psi1, chi) == pytest.approx(float(exact), abs=1.5e-3)
    if 7 / 6 <= chi <= 7 / 4:
        assert rebound_ratio(psi1, chi) == pytest.approx(float(exact), abs=1e-4)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("chi", [7 / 6, NU_03, 7 / 4])
def test_gross_slip_is_linear(method: str, chi: float) -> None:
    psi1 = (4.0 * chi - 1.0) * np.array([1.0, 1.1, 2.0]) + 1e-9
    expected = psi1 - 4.0 * chi
    tolerance = 0.02 if method == "annuli" else 1e-7
    assert np.abs(rebound_ratio(psi1, chi, method=method) - expected).max() < tolerance
    below = (4.0 * chi - 1.0) * 0.95  # and below it is not
    assert abs(float(rebound_ratio(below, chi, method="memory")) - (below - 4.0 * chi)) > 1e-3


@pytest.mark.parametrize("method", METHODS)
def test_finite_and_odd_everywhere(method: str) -> None:
    psi1 = np.array([0.0, 1e-12, 1.0, 4.0 * NU_03 - 1.0, 1e6, 1e12])
    found = rebound_ratio(psi1, NU_03, method=method)
    assert np.isfinite(found).all()
    assert found[0] == 0.0
    assert (rebound_ratio(-psi1, NU_03, method=method) == -found).all()
    assert np.isnan(rebound_ratio(np.nan, NU_03, method=method))
    assert np.isnan(rebound_ratio(1.0, np.nan, method=method))


@given(st.floats(0.65, 3.0), st.floats(0.0, 12.0), st.sampled_from(["table", "memory", "stronge"]))
@settings(max_examples=200, deadline=None)
def test_no_energy_is_created(chi: float, psi1: float, method: str) -> None:
    assert abs(rebound_ratio(psi1, chi, method=method)) <= psi1 * (1.0 + 1e-9) + 1e-13


def test_memory_function_converges() -> None:
    psi1 = np.linspace(0.1, 4.7, 24)
    exact = rebound_ratio(psi1, NU_03, method="memory", steps=64_000)
    errors = [
        np.abs(rebound_ratio(psi1, NU_03, method="memory", steps=n) - exact).max() for n in (250, 1000, 4000)
    ]
    assert errors[0] < 1e-3
    assert errors[1] < errors[0] / 4.0
    assert errors[2] < 2e-6


def test_annuli_converge_to_the_memory_function() -> None:
    psi1 = np.array([0.5, 1.2, 2.0, 3.0])
    exact = rebound_ratio(psi1, NU_03, method="memory")
    errors = [
        np.abs(rebound_ratio(psi1, NU_03, method="annuli", steps=n) - exact).max() for n in (20, 40, 80, 160)
    ]
    assert all(fine < 0.65 * coarse for coarse, fine in pairwise(errors))
    assert errors[-1] < 0.01


@pytest.mark.parametrize(
    ("psi1", "lumped", "continuous"),
    [
        (0.3, 0.140, 0.046),
        (0.8, 0.172, 0.003),
        (2.0, -0.792, -0.837),
        (3.0, -1.368, -1.380),
        (4.0, -1.435, -1.436),
    ],
)
def test_stronge_and_maw_side_by_side(psi1: float, lumped: float, continuous: float) -> None:
    """Known numbers of both at nu = 0.3 and e_n = 1: alike beyond psi1 = 2, apart near the normal."""
    assert rebound_ratio(psi1, NU_03, method="stronge") == pytest.approx(lumped, abs=6e-4)
    assert rebound_ratio(psi1, NU_03) == pytest.approx(continuous, abs=6e-4)


@pytest.mark.parametrize("e_n", [1.0, 0.8])
@pytest.mark.parametrize("psi1", [0.4, 1.3, 2.5, 3.6, 5.0])
def test_stronge_against_small_steps(e_n: float, psi1: float) -> None:
    """A spring that is cut off at the friction limit, followed in small time steps."""
    chi, n = 1.4, 200_000
    t = np.linspace(0.0, 0.5 * np.pi * (1.0 + e_n), n + 1)
    phase = np.where(t <= 0.5 * np.pi, t, 0.5 * np.pi + (t - 0.5 * np.pi) / e_n)
    velocity, stretch, h = psi1, 0.0, t[1] - t[0]
    for limit in np.sin(0.5 * (phase[1:] + phase[:-1])).tolist():
        stretch = min(max(stretch + h * velocity, -limit), limit)
        velocity -= h * 2.0 * chi * stretch
    assert rebound_ratio(psi1, chi, method="stronge", e_n=e_n) == pytest.approx(velocity, abs=2e-4)


def test_purely_elastic_limit_of_stronge_is_an_oscillator() -> None:
    """A sphere that sticks swings freely until the contact opens: checked by an ordinary integrator."""
    chi, psi1 = 1.0, 0.3
    swung = solve_ivp(
        lambda t, y: [y[1], -2.0 * chi * y[0]],
        (0.0, np.pi),
        [0.0, psi1],
        events=lambda t, y: abs(y[0]) - np.sin(t) if t > 0.1 else -1.0,
        rtol=1e-10,
        atol=1e-12,
    )
    slips = swung.t_events[0][0]
    stretch, velocity = swung.y_events[0][0]
    after = velocity - np.sign(stretch) * 2.0 * chi * (1.0 + np.cos(slips))
    assert rebound_ratio(psi1, chi, method="stronge") == pytest.approx(after, abs=1e-6)


@given(st.floats(0.0, 0.5), st.sampled_from([0.4, 0.5, 2.0 / 3.0]))
def test_poisson_ratio_is_the_inverse_of_chi(nu: float, j: float) -> None:
    assert poisson_ratio(chi_of(nu, j), j) == pytest.approx(nu, abs=1e-14)


def test_chi_of_known_bodies() -> None:
    assert chi_of(0.5) == pytest.approx(7 / 6)
    assert chi_of(0.0) == pytest.approx(7 / 4)
    assert chi_of(0.28, 0.5) == pytest.approx(1.2558, abs=1e-4)  # disc: Maw, Barber & Fawcett (1977)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        ({"method": "hertz"}, "There is no method 'hertz'. Choose one of table, memory, annuli, stronge."),
        ({"chi": 5.0}, "chi = 5: the table of closure MAW reaches from 0.65 to 3."),
        ({"chi": -1.0, "method": "memory"}, "chi = -1: it must be positive."),
        ({"steps": 10}, "steps belongs to the methods memory and annuli"),
        ({"steps": 1, "method": "memory"}, "must be 2 or more"),
    ],
)
def test_refused(call: dict[str, object], says: str) -> None:
    arguments = {"psi1": 1.0, "chi": 1.4} | call
    with pytest.raises(UsageError, match=says.replace("(", r"\(").replace(".", r"\.")):
        rebound_ratio(**arguments)  # type: ignore[arg-type]


def test_the_splines_go_through_the_values_of_the_table() -> None:
    """The two files belong together: cubics of either range, not-a-knot at its ends, through table.csv."""
    with (files("ifrfit.physics.compliance") / "table.csv").open(encoding="utf-8") as lines:
        rows = np.loadtxt(lines, delimiter=",", comments="#")
    table = compliance_table()
    assert table.chi.tolist() == rows[1:, 0].tolist()
    assert rows[0, 1 + table.first] == 1.0
    values = rows[1:, 1:]
    for part, own in (
        (table.nodes[:, : table.first], values[:, : table.first + 1]),
        (table.nodes[:, table.first :], values[:, table.first :]),
    ):
        spline = CubicSpline(np.arange(own.shape[1]), own, axis=1)
        assert np.allclose(part[1:-1], spline.c[::-1].transpose(2, 1, 0), rtol=0.0, atol=1e-14)
    # one row more at either end, on the parabola through the next three
    third = np.diff(table.nodes, n=3, axis=0)
    assert np.allclose(third[[0, -1]], 0.0, atol=1e-14)
    assert not np.allclose(third[1:-1], 0.0, atol=1e-6)


def test_nothing_can_write_into_the_table() -> None:
    table = compliance_table()
    for array in (table.chi, table.nodes):
        with pytest.raises(ValueError, match="read-only"):
            array.flat[0] = 1.0
