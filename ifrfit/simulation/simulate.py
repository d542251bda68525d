"""`simulate`: from a scene to rebounds, with only the effects that the scene calls for; tables and JSON."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ifrfit._version import __version__
from ifrfit.data.schema import SCHEMA, STAND_IN, TINY
from ifrfit.data.validate import without_value
from ifrfit.errors import DataError, UsageError
from ifrfit.inference.distributions.protocol import BANDS
from ifrfit.inference.io.plain import to_plain
from ifrfit.inference.model.entry_names import entry_name, split_name
from ifrfit.inference.option_fields import check_form
from ifrfit.inference.result.display import Display
from ifrfit.physics.angles import Incidence
from ifrfit.physics.closures import get_closure
from ifrfit.physics.effects import EFFECTS, Contact, Impacts, Outcome, Plan, PlanLine, compose, make_plan
from ifrfit.physics.observables import OBSERVABLES
from ifrfit.physics.scenes import Scene, read_scene

if TYPE_CHECKING:
    import pandas as pd

    from ifrfit.inference.result.fit_result import FitResult

Array = NDArray[np.float64]

VERSION = "ifrfit/simulation/1"
SAMPLES = 200  # a grid point, where anything is drawn
MOST = 2_000_000


@dataclass(frozen=True, repr=False)
class Simulation(Display):
    """Simulated impacts of a scene. Frozen.

    Attributes
    ----------
    scene : Scene
    contact : Contact
        With the inertia factor that was used.
    impacts : Impacts
        Flat: the samples of a grid point follow one another.
    outcome : Outcome
        Of the same shape.
    plan : Plan
    points : int
        Number of grid points.
    samples : int
        Impacts at each.
    noise : mapping
        Observable to the noise added to each impact.
    closure : str
    seed : int
    notes : tuple of str
        What the user should know.

    Examples
    --------
    >>> import ifrfit
    >>> import tempfile
    >>> from pathlib import Path
    >>> toml = '''
    ... sphere = {diameter_mm = 5, material = "alumina"}
    ... wall = {material = "soda-lime-glass"}
    ... impact = {gamma_deg = [20, 60], speed_m_s = 3.9}
    ... constants = {e_n = 0.98, e_t = -0.9, mu = 0.09}
    ... '''
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     scene = Path(folder, "glass.toml")
    ...     written = scene.write_text(toml)
    ...     found = ifrfit.simulate(scene)
    >>> found
    <Simulation glass, ifr: 2 impacts>
    >>> found.rebounds()[["gamma_deg", "observable", "value"]].round(3).head(2)
       gamma_deg observable  value
    0       20.0        e_n   0.98
    1       60.0        e_n   0.98
    """

    scene: Scene
    contact: Contact
    impacts: Impacts
    outcome: Outcome
    plan: Plan
    points: int
    samples: int
    noise: Mapping[str, Array]
    closure: str
    seed: int
    notes: tuple[str, ...]
    drawn_by: ClassVar[str] = "ifrfit.report.simulation"

    def _headline(self) -> str:
        return f"{self.scene.name}, {self.closure}: {self.impacts.speed.size} impacts"

    def rebounds(self) -> pd.DataFrame:
        """Observations in the common schema, one observable of one impact a row.

        Returns
        -------
        DataFrame
            Columns of the schema; provenance ``simulated``. What is undefined, and all but e_n of a captured
            impact, is nan: not measured. sigma is that of the noise that was added; without noise it is the
            accuracy of the scene, which the dropped effects may use up.
        """
        import pandas as pd

        given = conditions(self)
        n, parts = self.impacts.speed.size, []
        for name in self.scene.observables:
            accuracy = self.plan.accuracy
            if OBSERVABLES[name].unit == "deg":
                accuracy = math.degrees(accuracy)
            sigma = self.scene.noise.get(name, accuracy)
            frame = {
                "series": self.scene.name,
                "observable": name,
                "value": observed(self, name),
                "sigma": np.full(n, sigma),
                "impact_id": [str(i + 1) for i in range(n)],
                "provenance": "simulated",
            }
            frame |= {key: given[key] for key in ("gamma_deg", "spin_x", "spin_y", "speed_m_s")}
            columns = [column for column in SCHEMA if column in frame]
            parts.append(pd.DataFrame(frame)[columns])
        return pd.concat(parts, ignore_index=True)

    def table(self) -> pd.DataFrame:
        """One impact a row: conditions, constants and the state after, without noise.

        Returns
        -------
        DataFrame
            impact_id, gamma_deg, speed_m_s, spin_x, spin_y, diameter_m, e_n (of this impact, all effects
            included), mu, outcome (rebounds or captured), regime (sticks or slides), v_x, v_y, v_n and
            spin_x_after, spin_y_after per incoming speed, energy_change over m u^2/2.
        """
        import pandas as pd

        outcome = self.outcome
        columns: dict[str, Any] = {"impact_id": np.arange(1, self.impacts.speed.size + 1)}
        columns |= conditions(self)
        columns |= {
            "e_n": outcome.e_n,
            "mu": self.impacts.mu,
            "outcome": np.where(outcome.captured, "captured", "rebounds"),
            "regime": np.where(outcome.sticking, "sticks", "slides"),
            "v_x": outcome.v_x,
            "v_y": outcome.v_y,
            "v_n": outcome.v_n,
            "spin_x_after": outcome.spin_x,
            "spin_y_after": outcome.spin_y,
            "energy_change": outcome.energy_change,
        }
        return pd.DataFrame(columns)

    def curves(self) -> pd.DataFrame:
        """Each observable at each grid point.

        Returns
        -------
        DataFrame
            observable, the conditions that run over a grid, value (median where anything is drawn), lo68,
            hi68, lo95, hi95 (nan where nothing is), captured (share of the impacts). Values are of the
            impacts that have one.
        """
        import pandas as pd

        scene, shape = self.scene, (self.points, self.samples)
        given = {name: column.reshape(shape)[:, 0] for name, column in conditions(self).items()}
        axis_values = scene.grid()
        captured = self.outcome.captured.reshape(shape).mean(axis=1)
        parts = []
        for name in scene.observables:
            middle, band = _bands(observed(self, name).reshape(shape))
            frame: dict[str, Any] = {"observable": name}
            frame |= {axis: axis_values[axis] if scene.spin_unit else given[axis] for axis in scene.axes}
            frame |= {"value": middle}
            frame |= dict(zip(BANDS, band, strict=True))
            parts.append(pd.DataFrame(frame | {"captured": captured}))
        return pd.concat(parts, ignore_index=True)

    def to_dict(self) -> dict[str, Any]:
        """Exactly the content of simulation.json: strict JSON, nan and infinity as null."""
        scene, outcome, plan = self.scene, self.outcome, self.plan
        content: dict[str, Any] = to_plain(
            {
                "schema": VERSION,
                "ifrfit": __version__,
                "scene": {"name": scene.name, "title": scene.title, "sha256": scene.sha256},
                "provenance": "simulated",
                "seed": self.seed,
                "closure": self.closure,
                "inertia_factor": self.contact.inertia_factor,
                "observables": scene.observables,
                "points": self.points,
                "samples": self.samples,
                "outcomes": {
                    "impacts": outcome.captured.size,
                    "captured": outcome.captured.sum(),
                    "sticking": outcome.sticking.sum(),
                },
                "plan": {
                    "accuracy": plan.accuracy,
                    "dropped_together": plan.dropped,
                    "effects": [_line(line) for line in plan.lines],
                },
                "curves": self.curves().to_dict("records"),
                "materials": scene.sources,
                "notes": self.notes,
            }
        )
        return content


def observed(simulation: Simulation, name: str) -> Array:
    """An observable of every impact in its unit, with noise; nan where undefined or captured.

    Of a captured impact only e_n = 0 is an observation, and that is exact.
    """
    outcome, given = simulation.outcome, conditions(simulation)
    value = np.array(OBSERVABLES[name].value(outcome, simulation.impacts.mu), dtype=float)
    where = without_value(given["gamma_deg"], given["spin_x"], given["spin_y"])
    for reason in OBSERVABLES[name].undefined:
        value[where[reason]] = math.nan
    if name != "e_n":
        value[outcome.captured] = math.nan
    value[np.abs(value) < TINY] = 0.0
    return value + np.where(outcome.captured, 0.0, simulation.noise.get(name, 0.0))


def conditions(simulation: Simulation) -> dict[str, Array]:
    """Angle, speed, spins per speed and diameter of every impact."""
    impacts = simulation.impacts
    # the angle as it was asked for: its sine would not give it back to the last bit
    gamma = np.degrees(np.arctan2(impacts.incidence.sine, impacts.incidence.cosine))
    axis = simulation.scene.conditions["gamma_deg"]
    if axis.kind in ("value", "grid"):
        gamma = np.repeat(simulation.scene.grid()["gamma_deg"], simulation.samples)
    return {
        "gamma_deg": gamma,
        "speed_m_s": impacts.speed,
        "spin_x": impacts.incidence.spin_x,
        "spin_y": impacts.incidence.spin_y,
        "diameter_m": 2.0 * impacts.radius,
    }


def _bands(values: Array) -> tuple[Array, Array]:
    """Median and quantiles along the samples, without those that have no value."""
    if values.shape[1] == 1:
        return values[:, 0], np.full((4, values.shape[0]), math.nan)
    with warnings.catch_warnings():  # nan where no impact has a value
        warnings.simplefilter("ignore", RuntimeWarning)
        return np.nanmedian(values, axis=1), np.nanquantile(values, tuple(BANDS.values()), axis=1)


def _line(line: PlanLine) -> dict[str, Any]:
    criterion = line.criterion
    return {
        "effect": line.effect,
        "state": line.state,
        "number": criterion.symbol if criterion else None,
        "value": criterion.value if criterion else None,
        "threshold": criterion.threshold if criterion else None,
        "matters": ("above" if criterion.above else "below") if criterion else None,
        "change": line.change,
        "decides_existence": line.change is not None and math.isinf(line.change),
        "observable": line.observable,
        "reason": line.reason,
        "remark": line.remark,
        "cost_ns": EFFECTS[line.effect].cost_ns,
        "source": EFFECTS[line.effect].source,
        "alarm": line.alarm,
    }


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

    Examples
    --------
    >>> import ifrfit
    >>> import tempfile
    >>> from pathlib import Path
    >>> toml = '''
    ... sphere = {diameter_mm = 5, material = "alumina"}
    ... wall = {material = "soda-lime-glass"}
    ... impact = {gamma_deg = [20, 60], speed_m_s = 3.9}
    ... constants = {e_n = 0.98, e_t = -0.9, mu = 0.09}
    ... '''
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     scene = Path(folder, "glass.toml")
    ...     written = scene.write_text(toml)
    ...     found = ifrfit.simulate(scene)
    >>> found.impacts.speed.size
    2
    """
    given = scene if isinstance(scene, Scene) else read_scene(scene)
    n = samples if samples is not None else (SAMPLES if given.random else 1)
    check_form("--samples", "integer", n)
    check_form("--seed", "integer", seed)
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
