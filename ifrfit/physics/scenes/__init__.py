"""Scenes: TOML files that say which impacts to simulate."""

from ifrfit.physics.scenes.bodies import FLUIDS, MATERIALS, Material, recognised
from ifrfit.physics.scenes.reading import Scene, Surroundings, read_scene, read_surroundings
from ifrfit.physics.scenes.toml_table import Quantity

__all__ = [
    "FLUIDS",
    "MATERIALS",
    "Material",
    "Quantity",
    "Scene",
    "Surroundings",
    "read_scene",
    "read_surroundings",
    "recognised",
]
