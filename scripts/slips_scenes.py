"""Simulated experiments with a slip of the hand in their table, with a physical effect, or with neither."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.observations import Observations, make_table
from ifrfit.physics.angles import Incidence
from ifrfit.physics.closures import get_closure
from ifrfit.physics.effects import Contact, Impacts, compose
from ifrfit.physics.observables import OBSERVABLES

Array = NDArray[np.float64]
VELOCITIES = ("v_x", "v_n", "spin_y_after")
MISSTATED = 1.5  # times sigma that is written where the fit scales it
_GLASS = {"density": 2563.0, "modulus": 38.3e9, "stiffness_ratio": 0.875}
_UNITS = {
    "spins-doubled": 2.0,
    "spins-halved": 0.5,
    "spins-in-hertz": 0.5 / np.pi,
    "spins-in-rpm": 30.0 / np.pi,
}
# by how many times its size velocities along the wall and across it read too large, before and after
_ZEROS = {
    "zero-along": (1.0, 0.0, 1.0, 0.0),
    "zero-across": (0.0, 1.0, 0.0, -1.0),
    "fall-between": (0.0, -1.0, 0.0, -1.0),
    "zero-along-after": (0.0, 0.0, 1.0, 0.0),
    "zero-across-after": (0.0, 0.0, 0.0, 1.0),
}
_EFFECTS = {
    "compliance": {},
    "viscoelastic": {"dissipation_time": 8e-7},
    "plasticity": {"limiting_pressure": 0.5e9},
    "rolling": {"rolling_friction": 0.01},
}


@dataclass(frozen=True)
class Scene:
    """An experiment: what is measured, how often, and how well.

    Attributes
    ----------
    observables : tuple of str
    n : int
        Impacts.
    noise : float
        Of every value; of angles that many radians.
    policy : {"known", "scaled", "unknown", "mixed"}
        What the table says of sigma, and what the fit makes of it. scaled: all of them half as large again as
        they should be. mixed: none for the last observable; of a single one, none in the last series.
    spins : bool
        Whether the sphere spins before impact.
    lateral : bool
        Whether it spins across the plane of incidence, too.
    closure : str
    fixed : mapping
        What the fit fixes.
    prior : mapping
        Constant to the mean and sd of its truth, which the fit takes for a prior.
    separate : tuple of str
        Constants that the fit lets each series have.
    ordered : bool
        Whether the angles rise through the table.
    series : int
        The first, "run", takes every impact that no other takes in turn: "B", "C" and so on.
    repeats : int
        Impacts at each angle.
    """

    observables: tuple[str, ...] = VELOCITIES
    n: int = 60
    noise: float = 0.01
    policy: str = "known"
    spins: bool = False
    lateral: bool = False
    closure: str = "ifr"
    fixed: dict[str, float] = field(default_factory=dict)
    prior: dict[str, tuple[float, float]] = field(default_factory=dict)
    separate: tuple[str, ...] = ()
    ordered: bool = True
    series: int = 1
    repeats: int = 1


@dataclass(frozen=True)
class Impact:
    """What happens: angles, spins, speeds, and the values that a flawless measurement has."""

    gamma: Array
    spin_y: Array
    speed: Array
    values: dict[str, Array]


@dataclass(frozen=True)
class Cause:
    """A slip or an effect of some size.

    Attributes
    ----------
    name : str
        As the facts call it; empty for none; "no-errors" for a table without a slip and without errors.
    size : float
    in_b : bool
        Whether it is in series B alone.
    """

    name: str = ""
    size: float = 0.0
    in_b: bool = False


def experiment(scene: Scene, cause: Cause, seed: int) -> Observations:
    """The table of one experiment.

    Parameters
    ----------
    scene : Scene
    cause : Cause
    seed : int
    """
    found, _ = _experiment(scene, cause, seed)
    table = (_experiment(scene, Cause(), seed)[0] if cause.in_b else found).table.copy()
    turn = table["impact_id"].astype(int) % scene.series
    table[turn == 1] = found.table[turn == 1]
    for number in range(1, scene.series):
        table.loc[turn == number, "series"] = chr(ord("A") + number)
    if scene.policy == "unknown":
        table["sigma"] = np.nan
    elif scene.policy == "scaled":
        table["sigma"] *= MISSTATED
    elif scene.policy == "mixed":
        several = len(scene.observables) > 1
        unstated = table["observable"] == scene.observables[-1] if several else turn == scene.series - 1
        table.loc[unstated, "sigma"] = np.nan
    return Observations(table)


def truth(scene: Scene, seed: int) -> dict[str, float]:
    """The constants of an experiment without a cause, by the closure's names."""
    return _experiment(scene, Cause("no-errors"), seed)[1]


def _experiment(scene: Scene, cause: Cause, seed: int) -> tuple[Observations, dict[str, float]]:
    """The table with the cause in every row, and the constants that made it."""
    rng = np.random.default_rng([seed, 13])
    gamma = rng.uniform(3.0, 80.0, scene.n)
    if scene.repeats > 1:
        gamma = np.repeat(gamma[:: scene.repeats], scene.repeats)
    if scene.ordered:
        gamma.sort()
    given_spin = np.resize([0.0, 0.3, -0.15], scene.n) if scene.spins else np.zeros(scene.n)
    speed = np.exp(rng.uniform(np.log(0.5), np.log(3.0), scene.n))
    constants = {"e_n": rng.uniform(0.6, 0.95), "mu": rng.uniform(0.08, 0.25)} | scene.fixed
    constants |= {name: mean + sd * rng.standard_normal() for name, (mean, sd) in scene.prior.items()}
    own = get_closure(scene.closure)
    c = 0.0
    if own.constant:
        low, high = own.domain(0.4)
        c = constants[own.constant] = rng.uniform(low + 0.02 * (high - low), low + 0.5 * (high - low))
    e_n = np.full(scene.n, constants["e_n"])
    body = {"restitution": e_n, "c": c, "mu": constants["mu"]}
    true_gamma, true_spin, j = gamma, given_spin, 0.4
    if cause.name == "angle-offset":
        true_gamma = gamma + cause.size
    elif cause.name in ("angle-scale", "angles-scale"):
        true_gamma = gamma / (1.0 + cause.size)
    elif cause.name == "angle-scatter":
        true_gamma = np.clip(gamma + cause.size * rng.standard_normal(scene.n), 0.1, 89.9)
    elif cause.name == "camera-turn":
        true_gamma = gamma - cause.size
    elif cause.name == "incoming-spin":
        true_spin = cause.size * (1.0 + 0.3 * rng.standard_normal(scene.n))
    elif cause.name == "incoming-roll":
        true_spin = -cause.size * np.sin(np.radians(gamma))
    elif cause.name == "inertia-factor":
        j = 0.4 * (1.0 + cause.size)
    elif cause.name == "restitution-drift":
        body["restitution"] = e_n + np.where(np.arange(scene.n) < 0.4 * scene.n, 0.0, -cause.size)
    elif cause.name == "two-kinds":
        body["mu"] = constants["mu"] * (1.0 + cause.size * (rng.random(scene.n) < 0.5))
    elif cause.name == "another-mu":
        body["mu"] = 1.4 * constants["mu"]
    elif cause.name == "spin-scale":
        true_spin = given_spin / (1.0 + cause.size)
    elif cause.name == "scale-along-wall":
        true_gamma = np.degrees(np.arctan(np.tan(np.radians(gamma)) / (1.0 + cause.size)))
        true_spin = given_spin * _speed_as_read(true_gamma, cause)
    elif cause.name in _ZEROS:
        along, across = _true_velocity(cause, gamma, speed)
        true_gamma = np.degrees(np.arctan2(along, across))
        true_spin = given_spin / np.hypot(along, across)
    lateral = np.resize([0.2, -0.4, 0.1, 0.3], scene.n) if scene.lateral else np.zeros(scene.n)
    incidence = Incidence.of(true_gamma, lateral, true_spin, degrees=True)
    state = _rebound(scene, cause, incidence, speed, j, body)
    values = _read(scene, cause, state, true_gamma, gamma, given_spin, speed, body["mu"])
    return _written(scene, cause, gamma, given_spin, lateral, speed, values, rng), constants


def _rebound(scene, cause, incidence, speed, j, body):
    one = np.ones(scene.n)
    impacts = Impacts(
        incidence, speed, 2.5e-3 * one, get_closure(scene.closure),
        body["restitution"], body["c"] * one, body["mu"] * one,
    )  # fmt: skip
    numbers = {key: x * cause.size for key, x in _EFFECTS.get(cause.name, {}).items()}
    if cause.name == "plasticity":
        numbers = {"limiting_pressure": 0.5e9 / max(cause.size, 1e-9)}
    contact = Contact(**_GLASS, inertia_factor=j).with_numbers(**numbers)
    return compose(contact, impacts, ("lateral-spin", *((cause.name,) if cause.name in _EFFECTS else ())))


def _speed_as_read(true_gamma, cause):
    """Incoming speed over the true one, where lengths along the wall are read too large."""
    angle = np.radians(true_gamma)
    return np.sqrt((1.0 + cause.size) ** 2 * np.sin(angle) ** 2 + np.cos(angle) ** 2)


def _true_velocity(cause, gamma, speed):
    """Along the wall and towards it before impact, over the speed as read; none from beyond either."""
    off = cause.size / speed
    along, across = (by * off for by in _ZEROS[cause.name][:2])
    angle = np.radians(gamma)
    return np.maximum(np.sin(angle) - along, 0.0), np.maximum(np.cos(angle) - across, 1e-3)


def _read(scene, cause, state, true_gamma, gamma, spin, speed, mu):
    """What is read of each observable: by components, as an instrument has them."""
    v_x, v_n, after = state.v_x, state.v_n, state.spin_y
    if cause.name == "camera-turn":
        cosine, sine = np.cos(np.radians(cause.size)), np.sin(np.radians(cause.size))
        v_x, v_n = v_x * cosine - v_n * sine, v_n * cosine + v_x * sine
    elif cause.name == "speed-scale":
        v_x, v_n = v_x * (1.0 + cause.size), v_n * (1.0 + cause.size)
    elif cause.name == "contact-scale":
        v_x, after = v_x * (1.0 + cause.size), after * (1.0 + cause.size)
    elif cause.name == "spin-scale":
        after = after * (1.0 + cause.size)
    elif cause.name == "scale-along-wall":
        speed = _speed_as_read(true_gamma, cause)
        v_x, v_n, after = v_x * (1.0 + cause.size) / speed, v_n / speed, after / speed
    elif cause.name in _ZEROS:
        true, (along, away) = np.hypot(*_true_velocity(cause, gamma, speed)), _ZEROS[cause.name][2:]
        v_x, v_n = true * v_x + along * cause.size / speed, true * v_n + away * cause.size / speed
        after = true * after
    by_angle = (
        true_gamma
        if cause.name in ("angle-offset", "angle-scale", "angles-scale", "angle-scatter")
        else gamma
    )
    sine, cosine = np.sin(np.radians(by_angle)), np.cos(np.radians(by_angle))
    slip = sine + spin
    with np.errstate(divide="ignore", invalid="ignore"):
        if cause.name in ("", "no-errors"):
            return {name: OBSERVABLES[name].value(state, mu) * np.ones(scene.n) for name in scene.observables}
        return {
            "v_x": v_x,
            "v_n": v_n,
            "spin_y_after": after,
            "e_n": v_n / cosine,
            "beta_cm": -v_x / sine,
            "beta": -(v_x + after) / slip,
            "tan_psi_after": (v_x + after) / cosine,
            "delta_deg": np.degrees(np.arctan2(v_x, v_n))
            * (1.0 + (cause.size if cause.name in ("rebound-scale", "angles-scale") else 0.0))
            + (cause.size if cause.name == "rebound-zero" else 0.0),
        }


def _correlated(errors, correlation):
    """Errors of variance 1, each like the one before."""
    found = errors.copy()
    for i in range(1, errors.size):
        found[i] = correlation * found[i - 1] + np.sqrt(1.0 - correlation**2) * errors[i]
    return found


def _written(scene, cause, gamma, spin, lateral, speed, values, rng):
    """The table, with noise, and with what is wrong in the writing of it."""
    n, names = scene.n, scene.observables
    rows, sigmas = [], []
    for name in names:
        sigma = scene.noise * (57.3 if OBSERVABLES[name].unit == "deg" else 1.0)
        errors = rng.standard_normal(n)
        if cause.name == "correlated":
            errors = _correlated(errors, cause.size)
        elif cause.name == "no-errors":
            errors[:] = 0.0
        elif cause.name == "outlier" and name == names[0]:
            errors[n // 2] = cause.size
        elif cause.name == "scatter-by-angle" and name == names[0]:
            errors = errors * cause.size ** (gamma / 90.0)
        rows.append(values[name] + sigma * errors)
        sigmas.append(np.full(n, sigma))
    written = dict(zip(names, rows, strict=True))
    kind, _, of = cause.name.partition(" ")
    names = list(names)
    if kind == "sign" or (kind.endswith("-after") and kind.startswith("sign")):
        written[of or "spin_y_after"] = -written[of or "spin_y_after"]
    elif kind == "sign-of-spin-y-before":
        spin = -spin
    elif kind == "sign-of-spins-y":
        spin, written["spin_y_after"] = -spin, -written["spin_y_after"]
    elif kind == "angle-from-wall":
        gamma = 90.0 - gamma
    elif kind == "angle-in-radians":
        gamma = np.radians(gamma)
    elif kind == "size-of-spin-y-before":
        spin = np.abs(spin)
    elif kind == "mixed-sign-of-spin-y-before":
        spin = np.where(rng.random(n) < 1.0 / 3.0, -spin, spin)
    elif kind == "mixed-squared":
        third = rng.permutation(n) < n // 3
        written[of] = np.where(third, written[of] ** 2, written[of])
    elif kind == "sorted":
        written[of] = np.sort(written[of])
    elif kind == "shifted-down":
        written[of] = np.roll(written[of], 1)
    elif kind == "unrelated":
        written[of] = rng.permutation(written[of])
    elif kind in ("angle-in-gon", "angles-in-gon"):
        gamma = gamma / 0.9
        if of:
            written[of] = written[of] / 0.9
            sigmas[names.index(of)] = sigmas[names.index(of)] / 0.9
    elif kind == "percent":
        written[of] = 100.0 * written[of]
        sigmas[names.index(of)] = 100.0 * sigmas[names.index(of)]
    elif kind in _UNITS:
        spin = _UNITS[kind] * spin
        written[of] = _UNITS[kind] * written[of]
        sigmas[names.index(of)] = _UNITS[kind] * sigmas[names.index(of)]
    elif kind == "size":
        written[of] = np.abs(written[of])
    elif kind == "from-wall":
        written[of] = 90.0 - written[of]
    elif kind == "exchanged":
        written["v_x"], written["v_n"] = written["v_n"], written["v_x"]
    elif kind == "radians":
        written[of] = np.radians(written[of])
        sigmas[names.index(of)] = np.radians(sigmas[names.index(of)])
    elif kind.startswith("meant-"):
        written = {(of if name == kind[6:] else name): x for name, x in written.items()}
        names = [of if name == kind[6:] else name for name in names]
    elif kind == "zero-for-missing":
        gone = rng.choice(n, size=max(int(cause.size), 1), replace=False)
        written[of][gone] = 0.0
    columns = {
        "series": "run",
        "observable": np.repeat(names, n),
        "gamma_deg": np.tile(gamma, len(names)),
        "spin_y": np.tile(spin, len(names)),
        "spin_x": np.tile(lateral, len(names)),
        "speed_m_s": np.tile(speed, len(names)),
        "value": np.concatenate([written[name] for name in names]),
        "sigma": np.concatenate(sigmas),
        "impact_id": np.tile(np.arange(n).astype(str), len(names)),
        "source": "study",
        "provenance": "simulated",
    }
    if cause.name == "duplicates":
        twice = np.concatenate([np.arange(n), rng.choice(n, size=int(cause.size), replace=False)])
        take = (np.arange(len(names))[:, None] * n + twice).ravel()
        columns = {k: v[take] if isinstance(v, np.ndarray) else v for k, v in columns.items()}
        columns["impact_id"] = np.tile(np.arange(twice.size).astype(str), len(names))
    return Observations(make_table(columns))
