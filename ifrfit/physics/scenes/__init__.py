"""Scenes: TOML files that say which impacts to simulate."""

from ifrfit.physics.scenes.materials import FLUIDS, MATERIALS, Material, recognised
from ifrfit.physics.scenes.quantities import Quantity
from ifrfit.physics.scenes.reading import Surroundings, read_scene, read_surroundings
from ifrfit.physics.scenes.scene import Scene

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
