"""Directions against the simulation: what an effect does, computed by the effect itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ifrfit.inference.diagnostics.omitted_effects.effect_signatures import (
    computed,
    directions,
    impacts_of,
)
from ifrfit.inference.fit import fit
from ifrfit.physics import rebound
from ifrfit.physics.compliance import chi_of
from ifrfit.physics.effects import Contact
from ifrfit.physics.effects.adhesion import sticking_speed

RADIUS = 5e-6
GLASS = Contact(density=2563.0, modulus=38e9)


@pytest.fixture(scope="module")
def problem(make):
    data = make("", 1, ("v_x", "v_n", "spin_y_after", "delta_deg"), noise=1e-4)
    found = fit(data, method="lsq", independent=True, fix={"e_n": 0.9, "e_t": -0.95, "mu": 0.15})
    return found.problem, found.least_squares.optimum.theta


def by_name(problem, theta, **choices):
    sigma = np.ones(problem.noise.sigma.size)
    return {d.name: d for d in directions(problem, theta, problem.jacobian(theta), sigma, **choices)}


def effect(problem, theta, contact, name, radius=RADIUS):
    impacts = impacts_of(problem, theta, problem.speeds, np.full(problem.noise.sigma.size, radius))
    return computed(problem, contact, impacts, (name,)) - computed(problem, contact, impacts, ())


def test_rolling_friction(problem):
    contact = Contact().with_numbers(rolling_friction=1e-5)
    change = effect(*problem, contact, "rolling")
    assert np.allclose(by_name(*problem)["rolling"].change * 1e-5, change, rtol=1e-4, atol=1e-12)


def test_adhesion(problem):
    """Per square of the sticking speed, to first order."""
    contact = GLASS.with_numbers(interface_energy=1e-3)
    square = float(sticking_speed(contact, np.array(RADIUS))) ** 2
    change = effect(*problem, contact, "adhesion")
    # adhesion takes its part before friction presses, so the derivative holds for what follows, too
    assert np.allclose(by_name(*problem)["adhesion"].change * square, change, rtol=2e-3, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "contact"),
    [
        ("viscoelastic", GLASS.with_numbers(dissipation_time=2e-9)),
        ("plasticity", GLASS.with_numbers(limiting_pressure=3e8)),
    ],
)
def test_laws_of_e_n(problem, name, contact):
    """From the constant e_n that would be fitted to a law, a direction leads to the very law."""
    problem, theta = problem
    law = effect(problem, theta, contact, name) + problem.predict(theta)
    at = problem.rows.rows_of("v_n")
    cosine = problem.rows.incidence.cosine[at]
    # the constant that would be fitted to the law's own v_n = e_n cos(gamma)
    middle = float(law[at] @ cosine / (cosine @ cosine))
    there = np.where(np.array(problem.parameters.names) == "e_n", middle, theta)
    only = np.where(problem.rows.which == problem.rows.names.index("v_n"), 1.0, 1e9)
    found = directions(problem, there, problem.jacobian(there), only)
    direction = next(one for one in found if one.name == name)
    assert direction.whole
    assert direction.figures["fall"] > 0.0
    assert np.allclose(problem.predict(there) + direction.change, law, rtol=2e-3, atol=2e-3)


def test_compliance(problem):
    problem, theta = problem
    i = problem.rows.incidence
    at = problem.rows.rows_of("v_x")
    gamma = np.degrees(np.arctan2(i.sine, i.cosine))[at]
    same = {"e_n": 0.9, "mu": 0.15, "spin_y": i.spin_y[at], "degrees": True}
    before = rebound(gamma, e_t=-0.95, **same).v_x
    jacobian, one = problem.jacobian(theta), np.ones(i.sine.size)
    every = directions(problem, theta, jacobian, one)
    found = [d for d in every if d.name == "compliance"]
    assert [d.figures["chi"] for d in found] == pytest.approx([float(chi_of(nu)) for nu in (0.1, 0.3, 0.45)])
    for d in found:
        maw = rebound(gamma, chi=d.figures["chi"], closure="maw", **same).v_x
        # but for the noise of 1e-4, from which the step of kappa comes
        assert np.allclose(d.change[at], maw - before, atol=1e-3)
    own = directions(problem, theta, jacobian, one, chi=1.2)
    assert [d.figures["chi"] for d in own if d.name == "compliance"] == [1.2]


def test_an_open_e_n_leaves_the_size_of_its_laws_open(problem):
    found = by_name(*problem, e_n_known=False)
    assert found["viscoelastic"].by_kappa
    assert not found["viscoelastic"].whole


def test_without_speeds_nothing_is_said_of_them(problem):
    problem, theta = problem
    table = problem.observations.table
    table["speed_m_s"] = np.nan
    still = replace(problem, observations=replace(problem.observations, table=table))
    without = {"compliance", "sticking-law", "sticking-by-angle", "rolling", "inertia-factor"}
    # of impacts of one speed the normal speed goes as the cosine of the angle
    assert set(by_name(still, theta)) == without | {"restitution-by-angle", "friction-by-load"}


def test_a_hollow_ball_has_no_hertzian_law(make):
    data = make("", 1, ("e_n",))
    found = fit(data, method="lsq", inertia_factor=2.0 / 3.0)
    directed = by_name(found.problem, found.least_squares.optimum.theta)
    assert not directed["viscoelastic"].whole
    assert "compliance" not in directed
