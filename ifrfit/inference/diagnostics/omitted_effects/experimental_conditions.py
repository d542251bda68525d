"""The scene of measured impacts: what hit what, from the conditions of a dataset or from a scene file.

Nothing is guessed: a material counts as known only where its name says exactly which one of the library it
is, and a number only where its source states it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from ifrfit.data import Observations, Source
from ifrfit.errors import DataError
from ifrfit.inference.diagnostics.omitted_effects.types import SceneOfData
from ifrfit.inference.option_fields import check_form
from ifrfit.physics.effects import Contact
from ifrfit.physics.effects.contact import SOLID
from ifrfit.physics.scenes import Material, Quantity, Surroundings, read_surroundings, recognised
from ifrfit.physics.scenes.bodies import contact_of

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_SPAN = re.compile(rf"({_NUMBER})(?: to ({_NUMBER}))?")


@dataclass(frozen=True)
class Setting:
    """The scene of the data in numbers.

    Attributes
    ----------
    contact : Contact
    diameter : tuple of float
        m: one value, or the ends of a range; empty where not known.
    speed : tuple of float
        m/s, for rows that state none; as `diameter`.
    scene : SceneOfData
    """

    contact: Contact
    diameter: tuple[float, ...]
    speed: tuple[float, ...]
    scene: SceneOfData


def setting_of(
    observations: Observations, inertia_factor: float, scene: str | Path | None = None
) -> Setting | None:
    """The scene of these data.

    Parameters
    ----------
    observations : Observations
    inertia_factor : float
        Of the fit.
    scene : str or Path, optional
        A scene file: its bodies take the place of the conditions of a dataset, its impacts are not looked at
        but for the speed of rows that have none.

    Returns
    -------
    Setting or None
        None where nothing is known, or several sources differ.

    Raises
    ------
    DataError
        If the scene file is broken, or contradicts the fit or the conditions of a dataset.
    """
    sources = [source for source in observations.sources if source.rows_used > 0]
    if scene is not None:
        check_form("--scene", "path", scene)
        return _from_file(Path(scene), sources, inertia_factor)
    conditions = [source.descriptor.conditions if source.descriptor else {} for source in sources]
    if not conditions or not conditions[0] or any(one != conditions[0] for one in conditions[1:]):
        return None
    return _from_conditions(sources[0].name, conditions[0], inertia_factor)


def _from_conditions(name: str, conditions: Mapping[str, object], j: float) -> Setting:
    known: list[str] = []
    unknown: list[str] = []
    bodies = {}
    for key, role in (("material", "sphere"), ("wall", "wall")):
        text, where = condition_of(conditions, key)
        material = recognised(text)
        if material is None:
            unknown.append(f"material of the {role}: '{text}' is none of the library" if text else
                           f"material of the {role}")  # fmt: skip
        else:
            known.append(f"{role} of {text}{_by(where)}, taken as {material.name}: {material.source}")
        bodies[role] = (text, material or Material(text))
    numbers = {}
    for key, role, unit, factor in (
        ("diameter_mm", "diameter", "mm", 1e-3),
        ("speed_m_s", "speed of rows that state none", "m/s", 1.0),
    ):
        text, where = condition_of(conditions, key)
        ends = _ends(text)
        if ends:
            known.append(f"{role} {text} {unit}{_by(where)}")
        else:
            unknown.append(f"{role}: '{text}'" if text else role)
        numbers[key] = tuple(factor * end for end in ends)
    scene = SceneOfData(name, bodies["sphere"][0], bodies["wall"][0], tuple(known), tuple(unknown))
    contact = contact_of(bodies["sphere"][1], bodies["wall"][1], j)
    return Setting(contact, numbers["diameter_mm"], numbers["speed_m_s"], scene)


def condition_of(conditions: Mapping[str, object], key: str) -> tuple[str, str]:
    """Value and where it was read; empty where it is not among the conditions."""
    entry = conditions.get(key)
    if isinstance(entry, Mapping):
        return str(entry.get("value", "")).strip(), str(entry.get("where", "")).strip()
    return ("" if entry is None else str(entry).strip()), ""


def _by(where: str) -> str:
    return f" ({where})" if where else ""


def _ends(text: str) -> tuple[float, ...]:
    """A positive number, or the ends of ``LO to HI``; empty for any other text."""
    match = _SPAN.fullmatch(text)
    if match is None:
        return ()
    ends = tuple(float(number) for number in match.groups() if number is not None)
    return ends if all(0.0 < end < math.inf for end in ends) else ()


def _from_file(path: Path, sources: list[Source], j: float) -> Setting:
    found = read_surroundings(path)
    contact = found.contact
    if found.gives_inertia and not math.isclose(contact.inertia_factor, j, rel_tol=1e-3):
        raise DataError(
            f"{path}: sphere.inertia_factor = {contact.inertia_factor:g}, but the fit takes {j:g}. Correct "
            f"it, or give --inertia-factor {contact.inertia_factor:g}."
        )
    solid = math.isclose(j, SOLID, rel_tol=1e-9)
    contact = replace(contact, inertia_factor=j, density=contact.density if solid else None)
    diameter = _range(found.diameter)
    for source in sources:
        if source.descriptor is not None:
            _agree(path, found, diameter, source.name, source.descriptor.conditions)
    speed = () if found.speed is None else _range(found.speed)
    known = [f"diameter {_text(diameter, 1e3)} mm ({path.name})", *found.sources]
    if speed:
        known.append(f"speed of rows that state none {_text(speed, 1.0)} m/s ({path.name})")
    unknown = [
        f"material of the {role}" for role, name in (("sphere", found.body), ("wall", found.wall)) if not name
    ]
    scene = SceneOfData(path.name, found.body, found.wall, tuple(known), tuple(unknown))
    return Setting(contact, diameter, speed, scene)


def _range(quantity: Quantity) -> tuple[float, ...]:
    """A value, or both ends of a grid or a uniform distribution; of any other its centre."""
    if quantity.kind in ("grid", "uniform"):
        return min(quantity.numbers), max(quantity.numbers)
    return quantity.numbers[:1]


def _text(ends: tuple[float, ...], factor: float) -> str:
    return " to ".join(f"{end * factor:.6g}" for end in ends)


def _agree(
    path: Path,
    found: Surroundings,
    diameter: tuple[float, ...],
    name: str,
    conditions: Mapping[str, object],
) -> None:
    """Refuse a scene of other bodies than those of a dataset."""
    stated = tuple(1e-3 * end for end in _ends(condition_of(conditions, "diameter_mm")[0]))
    slack = 1.0 + 1e-6
    if stated and (min(diameter) > max(stated) * slack or max(diameter) * slack < min(stated)):
        raise DataError(
            f"{path}: the diameter is {_text(diameter, 1e3)} mm, but that of {name} is "
            f"{_text(stated, 1e3)} mm. Leave --scene out, or correct it."
        )
    for key, role, own in (("material", "sphere", found.body), ("wall", "wall", found.wall)):
        text, _ = condition_of(conditions, key)
        theirs, ours = recognised(text), recognised(own)
        if theirs is not None and ours is not None and theirs.name != ours.name:
            raise DataError(
                f"{path}: {role}.material is {own}, but that of {name} is {text}. Leave --scene out, or "
                "correct it."
            )
