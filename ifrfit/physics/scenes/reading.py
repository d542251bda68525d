"""A scene, and how it is read from its file."""

from __future__ import annotations

import hashlib
import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ifrfit.errors import DataError, UsageError
from ifrfit.physics.angles import Array
from ifrfit.physics.closures import CLOSURES
from ifrfit.physics.effects import EFFECTS
from ifrfit.physics.effects.plan import Requested
from ifrfit.physics.observables import OBSERVABLES
from ifrfit.physics.scenes.bodies import Bodies, read_bodies
from ifrfit.physics.scenes.toml_table import Quantity, Table

AXES = ("gamma_deg", "speed_m_s", "spin_x", "spin_y", "diameter_m")
# the ranges of the common schema, so that a fit can read what was simulated
SPEEDS = (1e-9, 1e5)
SPINS = (-1e6, 1e6)
MOST_AXES = 2


@dataclass(frozen=True, kw_only=True)
class Scene(Bodies):
    """What a scene file says: the bodies, and the impacts.

    Attributes
    ----------
    name : str
        File without its suffix.
    title : str
    sha256 : str
        Of the file, hexadecimal.
    conditions : mapping
        `AXES` to their quantities: degrees, m/s, spins as `spin_unit` says, m.
    spin_unit : str
        ``""``: R omega/u; ``"rad/s"``: omega.
    closure : str
    constants : mapping
        Name to quantity; empty where they come from a fit.
    result : Path or None
        result.json whose posterior is propagated.
    series : str
        Whose constants, where the fit has separate ones.
    effects : "auto" or tuple of str
    observables : tuple of str
    accuracy : float
        Change of an observable allowed to all dropped effects together; angles in radians.
    noise : mapping
        Observable to the standard deviation of the noise that is added.
    """

    name: str
    title: str
    sha256: str
    conditions: Mapping[str, Quantity]
    spin_unit: str
    closure: str
    constants: Mapping[str, Quantity]
    result: Path | None
    series: str
    effects: Requested
    observables: tuple[str, ...]
    accuracy: float
    noise: Mapping[str, float] = field(default_factory=dict)

    @property
    def axes(self) -> tuple[str, ...]:
        """Conditions that run over a grid."""
        return tuple(name for name in AXES if self.conditions[name].kind == "grid")

    @property
    def points(self) -> int:
        """Number of grid points."""
        return math.prod(self.conditions[name].grid.size for name in AXES)

    def grid(self) -> dict[str, Array]:
        """Each condition at each grid point, flat; nan where it is drawn. `AXES` vary slowest first."""
        grids = np.meshgrid(*(self.conditions[name].grid for name in AXES), indexing="ij")
        return {name: grid.ravel() for name, grid in zip(AXES, grids, strict=True)}

    @property
    def random(self) -> bool:
        """Whether anything is drawn."""
        drawn = (*self.conditions.values(), *self.constants.values())
        return self.result is not None or any(quantity.random for quantity in drawn)


def read_scene(path: str | Path) -> Scene:
    """Read and check a scene file.

    Parameters
    ----------
    path : str or Path
        A TOML file; docs/scenes/README.md describes it.

    Returns
    -------
    Scene

    Raises
    ------
    DataError
        The file is missing, broken or contradicts itself; the message names the key and what to do.
    """
    if not isinstance(path, str | PathLike):
        raise UsageError(f"A {type(path).__name__} is no scene: name a TOML file, as docs/scenes/*.toml.")
    path = Path(path)
    content, sha256 = load(path)
    return _scene(content, path, sha256)


@dataclass(frozen=True, kw_only=True)
class Surroundings(Bodies):
    """What a scene file says of the bodies, and the speed (m/s) where it gives one."""

    speed: Quantity | None


def read_surroundings(path: str | Path) -> Surroundings:
    """Read of a scene file what hits what, for impacts that were measured.

    Parameters
    ----------
    path : str or Path
        A scene file; [sphere] is needed, [wall], [contact], [fluid] and the speed of [impact] are taken where
        they are there. The rest of it may be missing and is not read.

    Raises
    ------
    DataError
        As `read_scene`.
    """
    content, _ = load(Path(path))
    top = Table(content, "", str(path))
    bodies = read_bodies(top)
    speed = top.table("impact").quantity("speed", "speed", low=SPEEDS[0], high=SPEEDS[1])
    for key in ("title", "effects", "accuracy", "constants", "observables", "noise"):
        top.raw(key)
    top.done()
    return Surroundings(**vars(bodies), speed=speed)


def load(path: Path) -> tuple[dict[str, Any], str]:
    """Content of a TOML file, and its SHA-256.

    Raises
    ------
    DataError
        If it is missing or is no TOML.
    """
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise DataError(f"{path}: there is no such file. Name a scene, as docs/scenes/*.toml.") from None
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror or error}). Name a scene file.") from None
    try:
        content = tomllib.loads(data.decode("utf-8"))
    except UnicodeDecodeError:
        raise DataError(f"{path}: is not text in UTF-8. Save it as such.") from None
    except tomllib.TOMLDecodeError as error:
        raise DataError(f"{path}: is not TOML ({error}). Correct it there.") from None
    except RecursionError:
        raise DataError(f"{path}: is nested too deeply to be a scene. Correct it.") from None
    return content, hashlib.sha256(data).hexdigest()


def _scene(content: dict[str, Any], path: Path, sha256: str) -> Scene:
    top = Table(content, "", str(path))
    title = top.text("title", path.stem)
    effects = _effects(top)
    accuracy = top.number("accuracy", low=1e-12, high=1.0)
    impact = top.table("impact")
    bodies = read_bodies(top)
    table = top.table("constants")
    closure, constants, result, series = _constants(table, path, bodies.contact.inertia_factor)
    conditions, spin_unit = _conditions(impact, bodies.diameter)
    observables = _observables(top, conditions)
    noise = _noise(top.table("noise"), observables)
    top.done()
    scene = Scene(
        **vars(bodies),
        name=path.stem,
        title=title,
        sha256=sha256,
        conditions=conditions,
        spin_unit=spin_unit,
        closure=closure,
        constants=constants,
        result=result,
        series=series,
        effects=effects,
        observables=observables,
        accuracy=1e-3 if accuracy is None else accuracy,
        noise=noise,
    )
    if len(scene.axes) > MOST_AXES:
        raise DataError(
            f"{path}: {', '.join(scene.axes)} all run over a grid. Keep two at most, and give the rest one "
            "value or a distribution."
        )
    return scene


def _effects(top: Table) -> Requested:
    if top.raw("effects") in (None, "auto"):
        return "auto"
    names = top.texts("effects") or ()
    for name in names:
        if name not in EFFECTS:
            raise DataError(
                f"{top.at('effects')}: there is no effect '{name}'. Known are {', '.join(EFFECTS)}; "
                'effects = "auto" chooses.'
            )
    return tuple(dict.fromkeys(names))


def _conditions(impact: Table, diameter: Quantity) -> tuple[dict[str, Quantity], str]:
    gamma = impact.quantity("gamma", "angle", low=0.0, high=90.0)
    if gamma is None:
        raise DataError(f"{impact.at('gamma_deg')} is missing: the incidence angle from the wall's normal.")
    speed = impact.quantity("speed", "speed", low=SPEEDS[0], high=SPEEDS[1])
    if speed is None:
        raise DataError(f"{impact.at('speed_m_s')} is missing: the incoming speed.")
    spins, unit = {}, ""
    rates = [impact.has(f"omega_{axis}", "rate") for axis in "xy"]
    if any(rates) and any(impact.has(f"spin_{axis}") for axis in "xy"):
        raise DataError(f"{impact.at('spin_x')}: spins are given as R omega/u and as omega. Keep one form.")
    for axis in "xy":
        if any(rates):
            unit = "rad/s"
            found = impact.quantity(f"omega_{axis}", "rate")
        else:
            found = impact.quantity(f"spin_{axis}", low=SPINS[0], high=SPINS[1])
        spins[f"spin_{axis}"] = found or Quantity.of(0.0)
    impact.done()
    return {"gamma_deg": gamma, "speed_m_s": speed, **spins, "diameter_m": diameter}, unit


def _constants(table: Table, path: Path, j: float) -> tuple[str, dict[str, Quantity], Path | None, str]:
    result, series = table.raw("result"), table.text("series")
    if result is not None:
        name = table.text("result")
        for key in table.content:
            if key not in ("result", "series"):
                raise DataError(f"{table.at(key)}: constants come from {name} already. Remove one of them.")
        return "", {}, path.parent / name, series
    if series:
        raise DataError(f"{table.at('series')}: belongs to constants.result, which is not given. Remove it.")
    closure = table.text("closure", "ifr").lower()
    if closure not in CLOSURES:
        raise DataError(
            f"{table.at('closure')}: there is no closure '{closure}'. Known are {', '.join(CLOSURES)}."
        )
    found = {"e_n": table.quantity("e_n", low=0.0, high=1.0)}
    # the constant of a closure whose law is an effect is that of the effect, which chi gives
    own = None if CLOSURES[closure].effect else CLOSURES[closure].constant
    if own is not None:
        low, high = CLOSURES[closure].domain(j)  # beyond it kinetic energy would be created
        found[own] = table.quantity(own, low=low, high=high)
    found["mu"] = table.quantity("mu", low=0.0, high=100.0)
    found["chi"] = table.quantity("chi", low=0.0, high=100.0)
    if own is not None and found[own] is not None and found["chi"] is not None:
        raise DataError(f"{table.at('chi')}: takes the place of {own}, which is given. Remove one.")
    for name in dict.fromkeys(each.own.name for each in CLOSURES.values() if each.own and not each.effect):
        if name != own and table.has(name):
            raise DataError(
                f"{table.at(name)}: closure {CLOSURES[closure].title} has no {name}; it takes "
                f"{', '.join(CLOSURES[closure].constants)}. Remove it, or choose another closure."
            )
    if found["mu"] is None:
        raise DataError(f"{table.at('mu')} is missing: the friction.")
    table.done()
    for name, quantity in found.items():
        if quantity is not None and quantity.kind == "grid":
            raise DataError(f"{table.at(name)}: a constant has one value or a distribution, not a grid.")
    return closure, {name: q for name, q in found.items() if q is not None}, None, ""


def _observables(top: Table, conditions: dict[str, Quantity]) -> tuple[str, ...]:
    names = top.texts("observables")
    if names is None:
        lateral = any(number != 0.0 for number in conditions["spin_x"].numbers)
        return ("e_n", "beta", "delta_deg", *(("lambda_deg",) if lateral else ()))
    known = [name for name, each in OBSERVABLES.items() if each.kind != "friction"]
    for name in names:
        if name not in known:
            raise DataError(
                f"{top.at('observables')}: there is no observable '{name}' of an impact. Known are "
                f"{', '.join(known)}."
            )
    if not names:
        raise DataError(f"{top.at('observables')} is empty. Name one, or leave the line out.")
    return tuple(dict.fromkeys(names))


def _noise(table: Table, observables: tuple[str, ...]) -> dict[str, float]:
    found = {}
    for key in table.content:
        if key not in observables:
            raise DataError(f"{table.at(key)}: is not among the observables. Remove it, or ask for it.")
        value = table.number(key, low=1e-15, high=1e6)
        found[key] = value if value is not None else math.nan
    return found
