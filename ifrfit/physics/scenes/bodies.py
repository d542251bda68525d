"""Sphere, wall, what lies between them and the fluid around, from a scene file and from materials.toml."""

from __future__ import annotations

import math
import re
import tomllib
from dataclasses import dataclass, replace
from importlib.resources import files
from itertools import chain
from typing import Any

from ifrfit.errors import DataError
from ifrfit.physics.effects import EFFECTS, Contact, Fluid
from ifrfit.physics.effects.contact import SOLID
from ifrfit.physics.effects.plasticity import LIMITING_PRESSURE
from ifrfit.physics.scenes.toml_table import Quantity, Table
from ifrfit.physics.units import dimension_of

DIAMETERS = (1e-10, 100.0)


@dataclass(frozen=True)
class Material:
    """An isotropic elastic material, in SI units; None where no number is known.

    Attributes
    ----------
    name : str
    young, poisson, density : float or None
    limiting_pressure : float or None
        Contact pressure at which it yields; None: it is taken as not yielding.
    source : str
    """

    name: str
    young: float | None = None
    poisson: float | None = None
    density: float | None = None
    limiting_pressure: float | None = None
    source: str = ""


_TABLES: dict[str, Any] = tomllib.loads(
    files("ifrfit.physics.scenes").joinpath("materials.toml").read_text(encoding="utf-8")
)
MATERIALS = {name: Material(name, **numbers) for name, numbers in _TABLES["materials"].items()}
FLUIDS = {name: Fluid(name, **numbers) for name, numbers in _TABLES["fluids"].items()}
_WITHOUT_MEANING = frozenset(chain.from_iterable(_TABLES["without_meaning"].values()))


def recognised(name: str) -> Material | None:
    """Material of the library that a name means, by its own name or a stated other one.

    Parameters
    ----------
    name : str
        As ``thick soda-lime glass``: case, hyphens and words of shape and finish do not count.

    Returns
    -------
    Material or None
        None where the name leaves open which material is meant (``steel``, ``glass``) or is not known.
    """
    words = [word for word in re.split(r"[\s-]+", name.casefold().strip()) if word]
    plain = " ".join(word for word in words if word not in _WITHOUT_MEANING)
    by_name = {known.replace("-", " "): known for known in MATERIALS}
    found = by_name.get(plain) or _TABLES["aliases"].get(plain)
    return None if found is None else MATERIALS[found]


@dataclass(frozen=True, kw_only=True)
class Bodies:
    """What hits what.

    Attributes
    ----------
    contact : Contact
    gives_inertia : bool
        Whether the file states the inertia factor.
    diameter : Quantity
        m.
    body, wall : str
        What they are made of, in words; may be empty.
    sources : tuple of str
        Where the numbers of named materials come from.
    """

    contact: Contact
    gives_inertia: bool
    diameter: Quantity
    body: str
    wall: str
    sources: tuple[str, ...] = ()


def read_bodies(top: Table) -> Bodies:
    """Read [sphere], [wall], [contact] and [fluid].

    Parameters
    ----------
    top : Table
        The whole file.

    Raises
    ------
    DataError
        Something is missing, unknown or contradicts itself.
    """
    sphere, wall, between = top.table("sphere"), top.table("wall"), top.table("contact")
    diameter = sphere.quantity("diameter", "length", low=DIAMETERS[0], high=DIAMETERS[1])
    if diameter is None:
        raise DataError(f"{sphere.at('diameter_mm')} is missing.")
    inertia = sphere.number("inertia_factor", low=1e-6, high=1e6)
    j = SOLID if inertia is None else inertia
    mass = sphere.number("mass", "mass", low=1e-30, high=1e9)
    ball, plane = _material(sphere), _material(wall)
    sphere.done()
    wall.done()
    contact = replace(contact_of(ball, plane, j), mass=mass, fluid=_fluid(top))
    for each in (number for effect in EFFECTS.values() for number in effect.numbers):
        value = between.number(each.name, dimension_of(each.unit), low=each.low, high=each.high)
        if value is not None:
            contact = contact.with_numbers(**{each.name: value})
    between.done()
    sources = tuple(f"{m.name}: {m.source}" for m in dict.fromkeys((ball, plane)) if m.source)
    return Bodies(
        contact=contact,
        gives_inertia=inertia is not None,
        diameter=diameter,
        body=ball.name,
        wall=plane.name,
        sources=sources,
    )


def contact_of(ball: Material, plane: Material, inertia_factor: float = SOLID) -> Contact:
    """What two materials say of a sphere on a wall; nothing else is known.

    Parameters
    ----------
    ball, plane : Material
    inertia_factor : float
        J = I/(m R^2).
    """
    modulus, stiffness_ratio = _elastic(ball, plane)
    return Contact(
        inertia_factor=inertia_factor,
        # a material says how heavy a body is only where the body is full of it
        density=ball.density if math.isclose(inertia_factor, SOLID, rel_tol=1e-9) else None,
        modulus=modulus,
        stiffness_ratio=stiffness_ratio,
    ).with_numbers(**{LIMITING_PRESSURE.name: _softer(ball, plane)})


def _material(table: Table) -> Material:
    given: Any = table.raw("material")
    if given is None:
        return Material("")
    if isinstance(given, str):
        if given not in MATERIALS:
            raise DataError(
                f"{table.at('material')}: there is no material '{given}'. Known are "
                f"{', '.join(MATERIALS)}; or give your own numbers in [{table.path}.material]."
            )
        return MATERIALS[given]
    own = table.table("material")
    material = Material(
        own.text("name", "own material"),
        own.number("young", "pressure", low=1.0, high=1e13),
        own.number("poisson", low=0.0, high=0.5),
        own.number("density", "density", low=1e-3, high=1e5),
        own.number("limiting_pressure", "pressure", low=LIMITING_PRESSURE.low, high=LIMITING_PRESSURE.high),
        own.text("source"),
    )
    own.done()
    return material


def _elastic(ball: Material, plane: Material) -> tuple[float | None, float | None]:
    """E* of the pair, and 4 G*/E*, where 1/G* is the sum of (2 - nu)/G; None where a number is not known."""
    normal = tangential = 0.0
    for body in (ball, plane):
        if body.young is None or body.poisson is None:
            return None, None
        normal += (1.0 - body.poisson**2) / body.young
        tangential += (2.0 - body.poisson) * 2.0 * (1.0 + body.poisson) / body.young
    return 1.0 / normal, 4.0 * normal / tangential


def _softer(ball: Material, plane: Material) -> float | None:
    known = [body.limiting_pressure for body in (ball, plane) if body.limiting_pressure is not None]
    return min(known) if known else None


def _fluid(top: Table) -> Fluid | None:
    if top.raw("fluid") is None:
        return None
    table = top.table("fluid")
    name = table.text("name")
    viscosity = table.number("viscosity", "viscosity", low=1e-9, high=1e6)
    path = table.number("mean_free_path", "length", low=1e-12, high=1.0)
    table.done()
    if viscosity is not None:
        return Fluid(name or "own fluid", viscosity, path)
    if path is not None:
        raise DataError(f"{table.at('mean_free_path')}: needs the viscosity beside it. Give viscosity_Pa_s.")
    if name not in FLUIDS:
        raise DataError(
            f"{table.at('name')}: there is no fluid '{name}'. Known are {', '.join(FLUIDS)}; or give "
            "viscosity_Pa_s."
        )
    return FLUIDS[name]
