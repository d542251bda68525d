"""Target pybullet: ``changeDynamics`` of sphere and wall, and the engine parameters that make it true.

Bullet multiplies restitution and friction of two bodies, so the wall has 1. With its default ``contactERP``
the correction of the overlap adds to the rebound, by a share that depends on when within a time step the
contact begins; without it the given restitution comes back. By default PyBullet cuts each component of
velocity and spin at 100 m/s or rad/s, which ``maxJointVelocity`` lifts. PyBullet is run to say what came
back.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ifrfit.errors import UsageError
from ifrfit.exporters.exported_constants import ExportedConstants
from ifrfit.exporters.mujoco import ANGLES, CLOSE, PHASES, oblique_words
from ifrfit.exporters.protocol import HASH, Comments, Conditions, Response, Translation
from ifrfit.exporters.soft_sphere import only_solid_sphere
from ifrfit.physics.angles import Incidence

_TIME_STEP = 1.0 / 240.0  # s, Bullet's default
_RADIUS = 0.05  # m
_MOST_VELOCITY = 1e6  # m/s and rad/s, numerical
_STEPS_BEFORE = 20
_ENGINE = {"contactERP": 0.0, "frictionERP": 0.0, "restitutionVelocityThreshold": 0.0}


@dataclass(frozen=True)
class PyBullet:
    """Restitution and Coulomb friction of a time-stepping engine."""

    name: str = "pybullet"
    title: str = "PyBullet"
    comments: Comments = HASH
    takes: frozenset[str] = frozenset({"speed"})

    def translate(self, constants: ExportedConstants, at: Conditions) -> Translation:
        """e_n and mu as they are, and what comes back of them."""
        only_solid_sphere(constants, self.title)
        if at.speed is None:
            raise UsageError(
                "PyBullet is run to say what comes back: name the normal speed of approach with --speed M_S."
            )
        engine, speed = _engine(), at.speed
        backs = np.array([shoot(engine, constants, 0.0, speed, phase)[1] for phase in PHASES]) / speed
        off = np.max(np.abs(backs - constants.e_n))
        verdict = "within 1 %" if off <= CLOSE * constants.e_n else "NOT within 1 %: take what came back"

        def response(incidence: Incidence) -> Response:
            tangents = incidence.sine / incidence.cosine
            rows = [shoot(engine, constants, speed * float(t), speed) for t in tangents]
            v_x, v_n, slip = np.array(rows).T * incidence.cosine / speed
            return Response(v_n, v_x, -slip / incidence.slip_x)

        settings = ", ".join(f"{name}={value:g}" for name, value in _ENGINE.items())
        return Translation(
            lines=[
                f"pybullet.setPhysicsEngineParameter({settings})",
                "pybullet.changeDynamics(wall, -1, restitution=1.0, lateralFriction=1.0)",
                f"pybullet.changeDynamics(sphere, -1, restitution={constants.e_n:.10g}, "
                f"lateralFriction={constants.mu:.10g}, linearDamping=0, angularDamping=0, "
                f"contactProcessingThreshold=0, maxJointVelocity={_MOST_VELOCITY:g})",
            ],
            law="v_n = -restitution u_n, and Coulomb friction that at most stops the contact point.",
            mapping=[
                f"restitution = e_n = {constants.e_n:.6g}: head-on at {speed:g} m/s {backs.min():.5g} to "
                f"{backs.max():.5g} came back, as the contact begins within a time step: {verdict}; "
                f"{oblique_words(response)}.",
                f"lateralFriction = mu; there is no place for {constants.closure.constant or 'beta'}: "
                "contacts that stick stop the contact point.",
                "contactERP = 0 keeps the correction of overlaps out of the rebound; what rests may sink. "
                "maxJointVelocity: without it PyBullet cuts velocities and spins at 100 m/s and rad/s.",
            ],
            holds=f"at the normal speed {speed:g} m/s and the time step {_TIME_STEP:.4g} s, without gravity; "
            "angles as the residual says.",
            response=response,
            how="run",
            ran=f"PyBullet, interface {engine.getAPIVersion()}",
            angles=ANGLES,
        )


def _engine() -> Any:
    try:
        import pybullet
    except ImportError:
        raise UsageError(
            "Target pybullet is checked by running PyBullet, which is not installed: 'pip install pybullet' "
            "installs it."
        ) from None
    return pybullet


def shoot(
    engine: Any, constants: ExportedConstants, along: float, down: float, phase: float = 0.5
) -> tuple[float, float, float]:
    """Shoot one sphere at the wall: velocity along it, away from it, and slip of the contact after, m/s.

    Parameters
    ----------
    engine : module
        PyBullet.
    constants : ExportedConstants
    along, down : float
        Velocity of the centre before, m/s; without spin.
    phase : float
        Share of a time step until the contact begins.
    """
    world = engine.connect(engine.DIRECT)
    on = {"physicsClientId": world}
    try:
        engine.setTimeStep(_TIME_STEP, **on)
        engine.setPhysicsEngineParameter(**_ENGINE, **on)
        wall = engine.createMultiBody(0, engine.createCollisionShape(engine.GEOM_PLANE, **on), **on)
        shape = engine.createCollisionShape(engine.GEOM_SPHERE, radius=_RADIUS, **on)
        height = _RADIUS + (_STEPS_BEFORE + phase) * down * _TIME_STEP
        sphere = engine.createMultiBody(1.0, shape, basePosition=[0.0, 0.0, height], **on)
        engine.changeDynamics(wall, -1, restitution=1.0, lateralFriction=1.0, **on)
        engine.changeDynamics(
            sphere,
            -1,
            restitution=constants.e_n,
            lateralFriction=constants.mu,
            linearDamping=0,
            angularDamping=0,
            contactProcessingThreshold=0,
            maxJointVelocity=_MOST_VELOCITY,
            **on,
        )
        engine.resetBaseVelocity(sphere, [along, 0.0, -down], [0.0, 0.0, 0.0], **on)
        for _ in range(3 * _STEPS_BEFORE):
            engine.stepSimulation(**on)
            velocity, spin = engine.getBaseVelocity(sphere, **on)
            if velocity[2] > 0.0:
                break
    finally:
        engine.disconnect(**on)
    return float(velocity[0]), float(velocity[2]), float(velocity[0] - _RADIUS * spin[1])


EXPORTER = PyBullet()
