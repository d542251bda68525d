"""What a flawed measurement makes of the impacts of a fit: angles set off, a turned camera, wrong scales."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.problem import Problem
from ifrfit.physics.angles import Incidence
from ifrfit.physics.rebound import Rebound, rebound_with

Array = NDArray[np.float64]
Size = float | Array


@dataclass(frozen=True)
class Flaw:
    """By how much a measurement is off; nothing by default. Of several, each field is a column, (m, 1).

    Attributes
    ----------
    offset : float or ndarray
        Degrees by which the true angle of incidence exceeds the given one.
    turn : float or ndarray
        Degrees by which the camera is turned against the normal of the wall: the angle it reads before
        impact is larger by so much, the one after impact smaller.
    speed : float or ndarray
        Share by which velocities after impact are read too large.
    along : float or ndarray
        Share by which components along the wall, before impact and after, are read too large beside those
        across it: pixels that are no squares, or a camera that looks at an angle.
    spin : float or ndarray
        Share by which spins, before and after, are read too large.
    constant_spin : float or ndarray
        R omega_y/u of every impact that the table does not hold.
    rolled : float or ndarray
        Share of pure rolling before impact, R omega_y = -u sin(gamma), that the table does not hold.
    spin_zero : float or ndarray
        R omega_y/u by which the true spin before every impact exceeds the given one.
    """

    offset: Size = 0.0
    turn: Size = 0.0
    speed: Size = 0.0
    along: Size = 0.0
    spin: Size = 0.0
    constant_spin: Size = 0.0
    rolled: Size = 0.0
    spin_zero: Size = 0.0


class Reading(Rebound):
    """A rebound as it is read: its parts need not obey the mechanics of one impulse."""

    @property
    def contact_x(self) -> Array:
        """Velocity of the contact point along x, from those as read."""
        return self.v_x + self.spin_y

    @property
    def contact_y(self) -> Array:
        """Velocity of the contact point along y, from those as read."""
        return self.v_y + self.spin_x

    @property
    def beta(self) -> Array:
        """Tangential restitution of the contact point, from its velocities as read."""
        before = self.incidence
        along = self.contact_x * before.slip_x + self.contact_y * before.slip_y
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.where(before.slip == 0.0, np.nan, -along / before.slip**2))


def readings(problem: Problem, theta: Array, flaw: Flaw) -> Array:
    """Value of each row, without noise, as a flawed measurement has it.

    Parameters
    ----------
    problem : Problem
        With angles and spins as given.
    theta : ndarray, (..., p)
    flaw : Flaw

    Returns
    -------
    ndarray, (..., n)
    """
    given, true = problem.rows.incidence, _true_incidence(problem, flaw)
    e_n, c, mu = problem.per_row(theta)
    law = problem.closure.law(problem.inertia_factor)
    k, sticks = law.impulse(true, c, mu * (1.0 + e_n))
    state = rebound_with(true, k, sticks.astype(bool), e_n, problem.inertia_factor)
    if _is_of_incidence(flaw):  # the values are those of the true impact
        return _values(problem, state, mu)
    cosine, sine = np.cos(np.radians(flaw.turn)), np.sin(np.radians(flaw.turn))
    # everything is over the incoming speed as it is read
    length = _speed_before(true, flaw)
    speed, spin, stretch = (1.0 + flaw.speed) / length, (1.0 + flaw.spin) / length, 1.0 + flaw.along
    v_x = speed * stretch * (state.v_x * cosine - state.v_n * sine)
    v_n = speed * (state.v_n * cosine + state.v_x * sine)
    v_y, spin_x, spin_y = speed * stretch * state.v_y, spin * state.spin_x, spin * state.spin_y
    with np.errstate(divide="ignore", invalid="ignore"):
        own_e_n = np.where(given.cosine == 0.0, np.nan, v_n / given.cosine)
        impulse = np.where(given.slip_x == 0.0, np.nan, (given.sine - v_x) / given.slip_x)
    parts = (v_x, v_y, v_n, spin_x, spin_y, sticks.astype(bool), impulse)
    return _values(problem, Reading(*parts, given, own_e_n, problem.inertia_factor), mu)


def _true_incidence(problem: Problem, flaw: Flaw) -> Incidence:
    """The impacts as they were, from what is given of them."""
    given = problem.rows.incidence
    gamma = problem.rows.gamma_deg + flaw.offset - flaw.turn
    if np.any(flaw.along):
        gamma = np.degrees(
            np.arctan2(np.sin(np.radians(gamma)), (1.0 + flaw.along) * np.cos(np.radians(gamma)))
        )
    sine, cosine = np.sin(np.radians(gamma)), np.cos(np.radians(gamma))
    scale = np.hypot((1.0 + flaw.along) * sine, cosine) / (1.0 + flaw.spin)
    spin_y = scale * given.spin_y + flaw.constant_spin + flaw.spin_zero - flaw.rolled * sine
    return Incidence.of(np.clip(gamma, 0.0, 90.0), scale * given.spin_x, spin_y, degrees=True)


def _speed_before(true: Incidence, flaw: Flaw) -> Size:
    """The incoming speed as it is read, over the true one."""
    if not np.any(flaw.along):
        return 1.0
    return np.hypot((1.0 + flaw.along) * true.sine, true.cosine)


def _is_of_incidence(flaw: Flaw) -> bool:
    """Whether nothing but the angle of incidence or the zero of the spin before impact is off."""
    others = (flaw.turn, flaw.speed, flaw.along, flaw.spin, flaw.constant_spin, flaw.rolled)
    return not any(np.any(size) for size in others)


def _values(problem: Problem, state: Rebound, mu: Array) -> Array:
    out = np.empty(mu.shape)
    for observable, at, _ in problem.rows.by_observable:
        out[..., at] = np.broadcast_to(observable.value(state, mu), out.shape)[..., at]
    return out


def of_inertia(problem: Problem, theta: Array, share: Array) -> Array:
    """Value of each row with inertia factors that are larger by shares of themselves, (m, n).

    The closure's own constant keeps its place within its domain, which depends on the inertia factor.
    """
    out = np.empty((len(theta), len(problem.rows)))
    for one in np.unique(share):
        at = share == one
        other = replace(problem, inertia_factor=problem.inertia_factor * (1.0 + float(one)))
        out[at] = other.predict(_within_domain(other, theta[at], problem.inertia_factor))
    return out


def _within_domain(problem: Problem, theta: Array, before: float) -> Array:
    """Constants of another inertia factor, `before`, carried over to the domain of that of the problem."""
    name, closure = problem.closure.constant, problem.closure
    if not name or not closure.bilinear or problem.parameters[name].passive is not None:
        return theta
    (from_low, from_high), (low, high) = closure.domain(before), closure.domain(problem.inertia_factor)
    places = np.unique(problem.parameters.positions[name])
    moved = theta.copy()
    moved[:, places] = low + (theta[:, places] - from_low) * (high - low) / (from_high - from_low)
    return moved
