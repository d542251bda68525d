"""`simulate`: from a scene to rebounds, with only the effects that the scene calls for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.schema import STAND_IN
from ifrfit.errors import DataError, UsageError
from ifrfit.inference.model.entry_names import entry_name, split_name
from ifrfit.physics.angles import Incidence
from ifrfit.physics.closures import get_closure
from ifrfit.physics.effects import EFFECTS, Contact, Impacts, Plan, compose, make_plan
from ifrfit.physics.scenes import Scene, read_scene
from ifrfit.simulation.result import Simulation

if TYPE_CHECKING:
    from ifrfit.inference.result.fit_result import FitResult

Array = NDArray[np.float64]

SAMPLES = 200  # a grid point, where anything is drawn
MOST = 2_000_000


def simulate(scene: str | Path | Scene, *, samples: int | None = None, seed: int = 0) -> Simulation:
    """Simulate the impacts of a scene.

    Parameters
    ----------
    scene : str, Path or Scene
        A TOML file, or what `read_scene` returns.
    samples : int, optional
        Impacts at each grid point; by default 200 where anything is drawn, else 1.
    seed : int
        Of everything that is drawn.

    Returns
    -------
    Simulation

    Raises
    ------
    DataError
        The scene is refused.
    UsageError
        For a number of samples or a seed that cannot be.
    """
    given = scene if isinstance(scene, Scene) else read_scene(scene)
    n = samples if samples is not None else (SAMPLES if given.random else 1)
    if n < 1:
        raise UsageError(f"--samples {n}: it must be 1 or more.")
    if seed < 0:
        raise UsageError(f"--seed {seed}: it must be 0 or more.")
    conditions_rng, constants_rng, noise_rng = (
        np.random.default_rng(child) for child in np.random.SeedSequence(seed).spawn(3)
    )
    conditions, points = _conditions(given, n, conditions_rng)
    try:
        constants = _constants(given, n, points, constants_rng)
        impacts = _impacts(constants, conditions, given.spin_unit)
        plan = make_plan(
            constants.contact,
            impacts,
            given.observables,
            accuracy=given.accuracy,
            requested=given.effects,
            given=constants.given,
        )
    except DataError as error:
        raise DataError(f"{given.name}.toml: {error}") from None
    outcome = compose(constants.contact, impacts, plan.on)
    noise = {name: sd * noise_rng.standard_normal(points * n) for name, sd in given.noise.items()}
    return Simulation(
        scene=given,
        contact=constants.contact,
        impacts=impacts,
        outcome=outcome,
        plan=plan,
        points=points,
        samples=n,
        noise=noise,
        closure=constants.closure,
        seed=seed,
        notes=(*constants.notes, *_notes(plan)),
    )


@dataclass(frozen=True)
class _Constants:
    """Constants of every impact, and where they come from."""

    closure: str
    contact: Contact
    values: Mapping[str, Array]
    given: Mapping[str, str]
    notes: tuple[str, ...]


def _conditions(scene: Scene, n: int, rng: np.random.Generator) -> tuple[dict[str, Array], int]:
    """Angle, speed, spins and diameter of every impact; grid points vary slowest."""
    points = scene.points
    if points * n > MOST:
        raise UsageError(
            f"{scene.name}.toml: {points} grid points with {n} samples each are more than {MOST} impacts. "
            "Lower --samples or the counts of the scene."
        )
    found = {}
    for name, grid in scene.grid().items():
        quantity = scene.conditions[name]
        found[name] = quantity.draw(points * n, rng) if quantity.random else np.repeat(grid, n)
    return found, points


def _impacts(constants: _Constants, conditions: Mapping[str, Array], spin_unit: str) -> Impacts:
    radius, speed = 0.5 * conditions["diameter_m"], conditions["speed_m_s"]
    per_speed = radius / speed if spin_unit else 1.0
    spin_x, spin_y = (conditions[name] * per_speed for name in ("spin_x", "spin_y"))
    incidence = Incidence.of(conditions["gamma_deg"], spin_x, spin_y, degrees=True)
    closure, values = get_closure(constants.closure), constants.values
    constant: Array | None = None  # where an effect computes the closure's law
    if not closure.effect:
        constant = np.zeros_like(speed) if closure.constant is None else values.get(closure.constant)
    return Impacts(
        incidence=incidence,
        speed=speed,
        radius=radius,
        closure=closure,
        e_n=values.get("e_n", np.ones_like(speed)),
        constant=constant,
        mu=values["mu"],
        chi=values.get("chi"),
    )


def _constants(scene: Scene, n: int, points: int, rng: np.random.Generator) -> _Constants:
    """One set of constants for each sample, the same at all grid points; or their one value."""
    if scene.result is not None:
        return _from_fit(scene, n, points, rng)
    values = {
        name: np.tile(quantity.draw(n, rng) if quantity.random else np.full(n, quantity.numbers[0]), points)
        for name, quantity in scene.constants.items()
    }
    closure = get_closure(scene.closure)
    given = {"e_n": "constants.e_n"} if "e_n" in values else {}
    if closure.constant is None:
        given["tangential"] = "constants.closure"
    elif closure.constant in values and not closure.effect:
        given["tangential"] = f"constants.{closure.constant}"
    return _Constants(scene.closure, scene.contact, values, given, ())


def _from_fit(scene: Scene, n: int, points: int, rng: np.random.Generator) -> _Constants:
    """Draws of a fit's posterior."""
    from dataclasses import replace

    from ifrfit.inference.io.read_result import load_result

    result = load_result(str(scene.result))
    draws = result.draws(n, rng)
    closure = get_closure(result.closure)
    values = {
        name: np.tile(draws[_column([str(column) for column in draws], name, scene)].to_numpy(), points)
        for name in closure.constants
    }
    given = {"e_n": "the fit's e_n"}
    if not closure.effect:
        given["tangential"] = f"the fit's {closure.constant or 'closure'}"
    contact = replace(scene.contact, inertia_factor=_inertia(scene, result))
    return _Constants(result.closure, contact, values, given, tuple(_fit_warnings(result)))


def _column(columns: list[str], name: str, scene: Scene) -> str:
    series = [own for quantity, own in map(split_name, columns) if quantity == name and own]
    if not series:
        return name
    if scene.series not in series:
        raise DataError(
            f"constants.series: the fit has {name} for each series apart. Name one of {', '.join(series)}."
        )
    return entry_name(name, scene.series)


def _inertia(scene: Scene, result: FitResult) -> float:
    factor = scene.contact.inertia_factor
    if abs(factor - result.inertia_factor) > 1e-9 * result.inertia_factor:
        raise DataError(
            f"sphere.inertia_factor is {factor:g}, but the fit was made with {result.inertia_factor:g}. Give "
            "the same, or take constants of your own."
        )
    return result.inertia_factor


def _fit_warnings(result: FitResult) -> list[str]:
    """What must not be lost of the fit: stand-ins, and constants its data leave open."""
    warnings = [
        f"The constants come from a fit to {source.name}, a STAND-IN: generated from printed constants, not "
        "an experiment."
        for source in result.inputs
        if STAND_IN in source.provenance
    ]
    open_ones = [name for name, entry in result.flat_constants().items() if entry.status == "not_determined"]
    if open_ones:
        warnings.append(
            f"The fit does not determine {', '.join(open_ones)}: the draws fill what its prior allows."
        )
    return warnings


def _notes(plan: Plan) -> list[str]:
    acting = [line for line in plan.lines if line.state == "on"]
    modifying = [line.title for line in acting if EFFECTS[line.effect].stage in ("adhesion", "fluid")]
    if not modifying:
        return []
    return [f"e_n before {' and '.join(modifying)} is that of the dry contact without adhesion."]
