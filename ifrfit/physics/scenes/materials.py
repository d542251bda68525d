"""Materials and fluids that a scene can name, each number with its source."""

from __future__ import annotations

import re
from dataclasses import dataclass

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


MATERIALS: dict[str, Material] = {
    material.name: material
    for material in (
        Material(
            "bearing-steel",
            203e9,
            0.29,
            7810.0,
            2.8 * 2.03e9,
            "AISI 52100, hardened, suppliers' data sheets (29.5 Mpsi, 295 ksi, nu 0.27 to 0.30); limiting "
            "pressure 2.8 times the yield strength",
        ),
        Material(
            "stainless-304",
            193e9,
            0.29,
            8000.0,
            2.8 * 0.215e9,
            "AISI 304, annealed, suppliers' data sheets (yield strength 215 MPa); limiting pressure 2.8 "
            "times the yield strength",
        ),
        Material(
            "granite",
            43e9,
            0.333,
            2650.0,
            None,
            "Quincy granite by seismic velocities, Leet & Ewing (1932), Physics 2, 160; granites vary widely",
        ),
        Material(
            "soda-lime-glass",
            72.8e9,
            0.222,
            2563.0,
            5.6e9,
            "pristine glass of Scientific Reports (2021), doi 10.1038/s41598-021-04045-6, table 1; limiting "
            "pressure: Knoop hardness 570 kgf/mm2 of soda-lime glass",
        ),
        Material(
            "alumina",
            416e9,
            0.230,
            3984.0,
            None,
            "sintered alpha-alumina, Munro (1997), J. Am. Ceram. Soc. 80, 1919 (NIST SRD 30), nu from the "
            "bulk modulus of 257 GPa",
        ),
        Material(
            "quartz",
            94.5e9,
            0.074,
            2650.0,
            None,
            "isotropic aggregate from K = 37.0 GPa and G = 44.0 GPa, Mavko, Mukerji & Dvorkin, The Rock "
            "Physics Handbook, table of mineral properties",
        ),
    )
}

FLUIDS: dict[str, Fluid] = {
    fluid.name: fluid
    for fluid in (
        # CRC Handbook of Chemistry and Physics; mean free path Jennings (1988), J. Aerosol Sci. 19, 159
        Fluid("air", 1.81e-5, 66e-9),
        # IAPS (1985), 20 degrees Celsius
        Fluid("water", 1.002e-3),
    )
}

# other names of exactly these materials; a name that leaves open which one is meant, as steel, is not here
_ALIASES = {
    "52100 steel": "bearing-steel",
    "aisi 52100": "bearing-steel",
    "aisi 52100 steel": "bearing-steel",
    "304 stainless steel": "stainless-304",
    "aisi 304": "stainless-304",
    "aisi 304 stainless steel": "stainless-304",
    "sae 304 stainless steel": "stainless-304",
    "stainless steel 304": "stainless-304",
    "soda lime silica glass": "soda-lime-glass",
    "aluminium oxide": "alumina",
    "aluminum oxide": "alumina",
    "alpha alumina": "alumina",
}
# words that say nothing of what a body is made of
_SHAPES = frozenset(
    {"ball", "balls", "bead", "beads", "block", "plane", "plate", "sphere", "spheres", "wall"}
    | {"polished", "smooth", "spherical", "thick"}
)


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
    plain = " ".join(word for word in words if word not in _SHAPES)
    by_name = {known.replace("-", " "): known for known in MATERIALS}
    found = by_name.get(plain) or _ALIASES.get(plain)
    return None if found is None else MATERIALS[found]
