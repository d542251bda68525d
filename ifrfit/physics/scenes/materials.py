"""Materials and fluids that a scene can name; their numbers and sources are in materials.toml beside this."""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass
from importlib.resources import files
from itertools import chain
from typing import Any

from ifrfit.physics.effects.contact import Fluid


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
