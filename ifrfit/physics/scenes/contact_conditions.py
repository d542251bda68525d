"""What a scene file says of the bodies, for impacts that were measured."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ifrfit.physics.effects import Contact
from ifrfit.physics.scenes.bodies import read_contact
from ifrfit.physics.scenes.quantities import Quantity
from ifrfit.physics.scenes.reading import SPEEDS, load
from ifrfit.physics.scenes.toml_table import Table


@dataclass(frozen=True)
class Surroundings:
    """What a scene file says of the bodies, apart from its impacts.

    Attributes
    ----------
    contact : Contact
    diameter : Quantity
        m.
    speed : Quantity or None
        m/s.
    body, wall : str
        Materials in words; may be empty.
    sources : tuple of str
        Where the numbers of named materials come from.
    gives_inertia : bool
        Whether the file states an inertia factor.
    sha256 : str
        Of the file, hexadecimal.
    """

    contact: Contact
    diameter: Quantity
    speed: Quantity | None
    body: str
    wall: str
    sources: tuple[str, ...]
    gives_inertia: bool
    sha256: str


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
    path = Path(path)
    content, sha256 = load(path)
    top = Table(content, "", str(path))
    contact, diameter, body, wall, sources = read_contact(top)
    speed = top.table("impact").quantity("speed", "speed", low=SPEEDS[0], high=SPEEDS[1])
    for key in ("title", "effects", "accuracy", "constants", "observables", "noise"):
        top.raw(key)
    top.done()
    stated = top.table("sphere").has("inertia_factor")
    return Surroundings(contact, diameter, speed, body, wall, sources, stated, sha256)
