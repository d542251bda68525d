"""Drake, from the Python index, with models that hold the exported lines as they are."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from importlib.metadata import version as version_of

import numpy as np
from simulators.shots import RADIUS, Rebounds, Shots

_MASS, _STIFFNESS = 0.01, 1e6  # kg; N/m of the pair: the export gives each body twice that
DURATION = math.pi * math.sqrt(_MASS / _STIFFNESS)  # of an elastic contact, s
_SDF = """<?xml version="1.0"?>
<sdf xmlns:drake="http://drake.mit.edu" version="1.9"><model name="{name}">{body}</model></sdf>"""
_WALL = """<static>true</static><link name="body"><collision name="c">
<geometry><plane><normal>0 0 1</normal></plane></geometry>{lines}</collision></link>"""
_SPHERE = """<link name="body"><inertial><mass>{mass}</mass>
<inertia><ixx>{inertia}</ixx><iyy>{inertia}</iyy><izz>{inertia}</izz></inertia></inertial>
<collision name="c"><geometry><sphere><radius>{radius}</radius></sphere></geometry>{lines}
</collision></link>"""


def version() -> str:
    """What runs here; empty without it."""
    try:
        import pydrake  # noqa: F401
    except ImportError:
        return ""
    return version_of("drake")


def shoot(lines: Sequence[str], shots: Shots, *, time_step: float = 0.0) -> Rebounds:
    """One after the other, a plant each; integrated with an error control where the time step is 0."""
    logging.getLogger("drake").setLevel(logging.ERROR)
    text = "\n".join(lines)
    inertia = 0.4 * _MASS * RADIUS**2
    models = (
        _SDF.format(name="wall", body=_WALL.format(lines=text)),
        _SDF.format(
            name="sphere", body=_SPHERE.format(mass=_MASS, inertia=inertia, radius=RADIUS, lines=text)
        ),
    )
    rows = [
        _one(models, time_step, *row) for row in zip(shots.along, shots.approach, shots.omega, strict=True)
    ]
    return shots.rebounds(*np.hsplit(np.array(rows), 2))


def _one(
    models: tuple[str, str], time_step: float, along: float, down: float, omega: np.ndarray
) -> np.ndarray:
    from pydrake.math import RigidTransform
    from pydrake.multibody.math import SpatialVelocity
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlantConfig
    from pydrake.systems.analysis import Simulator
    from pydrake.systems.framework import DiagramBuilder

    builder = DiagramBuilder()
    # a slip below the tolerance counts as sticking: small beside those of the shots
    config = MultibodyPlantConfig(
        time_step=time_step, discrete_contact_approximation="lagged", contact_model="point",
        stiction_tolerance=1e-4,
    )  # fmt: skip
    plant, _ = AddMultibodyPlant(config, builder)
    for model in models:
        Parser(plant).AddModelsFromString(model, "sdf")
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, 0.0])
    plant.Finalize()
    simulator = Simulator(builder.Build())
    if time_step == 0.0:
        simulator.get_mutable_integrator().set_target_accuracy(1e-6)
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    sphere = plant.GetBodyByName("body", plant.GetModelInstanceByName("sphere"))
    plant.SetFreeBodyPose(context, sphere, RigidTransform([0.0, 0.0, RADIUS + 1e-9]))
    plant.SetFreeBodySpatialVelocity(context, sphere, SpatialVelocity(omega, [along, 0.0, -down]))
    simulator.AdvanceTo(20.0 * DURATION)
    state = plant.EvalBodySpatialVelocityInWorld(context, sphere)
    after, spin = state.translational(), state.rotational()
    if after[2] < 0.0:
        raise RuntimeError("Drake: the sphere has not left the wall.")
    return np.concatenate((after, spin))
