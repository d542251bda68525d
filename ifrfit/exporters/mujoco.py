"""Target mujoco: ``solref``, ``solimp`` and ``friction`` of a contact pair, found by running MuJoCo.

MuJoCo has no restitution: a contact is a spring and a dashpot, ``solref = (-stiffness, -damping)``, and what
comes back depends on the time step too. So the stiffness makes a contact of a hundred time steps, and the
damping is searched until the rebound at the asked speed is the fitted one, over the phases of a time step at
which a contact may begin. Friction would be damped as weakly as the normal, so the pair has a
``solreffriction`` of its own, searched over oblique impacts.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ifrfit.errors import UsageError
from ifrfit.exporters.exported_constants import Array, ExportedConstants
from ifrfit.exporters.protocol import IN_XML, Comments, Conditions, Response, Translation
from ifrfit.exporters.soft_sphere import only_solid_sphere
from ifrfit.physics.angles import Incidence

TIME_STEP = 5e-5  # s
_STEPS_OF_CONTACT = 100
PHASES = (0.1, 0.3, 0.5, 0.7, 0.9)  # of a time step at which a contact may begin
# of the friction, per time step: more stops the slip sooner and takes more of the normal velocity with it
_SLIP_DAMPINGS = (0.1, 0.07, 0.05, 0.035, 0.025, 0.018, 0.0125, 0.009, 0.006)
_RADIUS_OVER_OVERLAP = 50.0
_LEAST = 1e-6  # of critical damping
CLOSE = 0.01  # relative, of e_n
ANGLES = (5.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0)

_MODEL = """<mujoco>
  <option timestep="{step:g}" gravity="0 0 0" cone="elliptic" impratio="10" integrator="implicitfast"/>
  <worldbody>
    <geom name="wall" type="plane" size="1 1 1"/>
    <body name="sphere"><freejoint/><geom name="sphere" type="sphere" size="{radius:g}" mass="1"/></body>
  </worldbody>
  <contact><pair geom1="wall" geom2="sphere" {contact}/></contact>
</mujoco>"""


@dataclass(frozen=True)
class MuJoCo:
    """A geom pair, at one speed."""

    name: str = "mujoco"
    title: str = "MuJoCo"
    comments: Comments = IN_XML
    takes: frozenset[str] = frozenset({"speed"})

    def translate(self, constants: ExportedConstants, at: Conditions) -> Translation:
        """Damping by simulation; friction as it is."""
        only_solid_sphere(constants, self.title)
        if at.speed is None:
            raise UsageError(
                "MuJoCo's rebound depends on the speed, and its parameters are found at one: name the normal "
                "speed of approach with --speed M_S."
            )
        engine = _engine()
        stiffness = (math.pi / (_STEPS_OF_CONTACT * TIME_STEP)) ** 2
        damping, backs = _damping(engine, constants, stiffness, at.speed)
        contact = _oblique_contact(engine, constants, stiffness, damping, at.speed)
        off = np.max(np.abs(backs - constants.e_n)) / constants.e_n if constants.e_n > 0.0 else math.inf
        verdict = "within 1 %" if off <= CLOSE else "NOT within 1 %: take what came back"
        speed = at.speed

        response = partial(_response, engine, contact, speed)

        return Translation(
            lines=[
                f'<!-- within option: timestep="{TIME_STEP:g}" cone="elliptic" impratio="10"'
                ' integrator="implicitfast" -->',
                "<contact>",
                f'  <pair geom1="wall" geom2="sphere" {contact}/>',
                "</contact>",
            ],
            law="a spring and a dashpot along the normal, regularised Coulomb friction along the wall; no "
            "restitution and no tangential restitution of its own.",
            mapping=[
                f"solref: asked was e_n = {constants.e_n:.6g} at {speed:g} m/s, head-on {backs.min():.5g} to "
                f"{backs.max():.5g} came back, as the contact begins within a time step: {verdict}; "
                f"{oblique_words(response)}.",
                f"friction = mu; there is no place for {constants.closure.constant or 'beta'}: contacts that "
                "stick stop the contact point, or nearly.",
                "geom1 and geom2 are yours to name; solreffriction damps the slip, and takes some of the "
                "normal velocity with it in oblique impacts: of its values the one whose v_x and v_n come "
                "closest to the fitted curve.",
            ],
            holds=f"at the time step {TIME_STEP:g} s and the normal speed {speed:g} m/s, without gravity, "
            "of a "
            f"sphere of any mass whose radius is well above the overlap, up to {_overlap(speed):.2g} m; "
            "angles as the residual says.",
            response=response,
            how="run",
            ran=f"MuJoCo {engine.__version__}",
            angles=ANGLES,
        )


def _overlap(speed: float) -> float:
    """Deepest overlap of a contact without loss, m."""
    return speed * _STEPS_OF_CONTACT * TIME_STEP / math.pi


def oblique_words(response: Callable[[Incidence], Response]) -> str:
    """What comes back of the normal velocity in oblique impacts without spin."""
    incidence = Incidence.of(ANGLES, degrees=True)
    back = response(incidence).v_n / incidence.cosine
    low, high = int(np.argmin(back)), int(np.argmax(back))
    where = f"in oblique impacts without spin, from {ANGLES[0]:g} to {ANGLES[-1]:g} degrees,"
    if back[high] - back[low] < 1e-4:
        return f"{where} {back[low]:.4g}"
    return f"{where} {back[low]:.4g} ({ANGLES[low]:g} degrees) to {back[high]:.4g} ({ANGLES[high]:g} degrees)"


def _engine() -> Any:
    try:
        import mujoco
    except ImportError:
        raise UsageError(
            "Target mujoco is found by running MuJoCo, which is not installed: 'pip install mujoco' installs "
            "it."
        ) from None
    return mujoco


def _contact(stiffness: float, damping: float, mu: float, slip_damping: float = _SLIP_DAMPINGS[0]) -> str:
    return (
        f'condim="3" solref="{-stiffness:.10g} {-damping:.10g}" solreffriction="{-stiffness:.10g} '
        f'{-slip_damping / TIME_STEP:.10g}" solimp="0.99 0.99 0.001 0.5 2" '
        f'friction="{max(mu, 1e-5):.10g} {max(mu, 1e-5):.10g} 0 0 0"'
    )


def _response(engine: Any, contact: str, speed: float, incidence: Incidence) -> Response:
    """Rebounds without spin at a normal speed."""
    rows = [
        shoot(engine, contact, speed * float(s / c), speed)
        for s, c in zip(incidence.sine, incidence.cosine, strict=True)
    ]
    v_x, v_n, slip = np.array(rows).T * incidence.cosine / speed
    return Response(v_n, v_x, -slip / incidence.slip_x)


def _oblique_contact(
    engine: Any, constants: ExportedConstants, stiffness: float, damping: float, speed: float
) -> str:
    """The contact whose damping of the slip comes closest to the fitted velocities over the angles."""
    incidence = Incidence.of(ANGLES, degrees=True)
    fitted = constants.rebound(incidence)

    def misfit(contact: str) -> float:
        found = _response(engine, contact, speed, incidence)
        return float(np.sum((found.v_x - fitted.v_x) ** 2 + (found.v_n - fitted.v_n) ** 2))

    return min((_contact(stiffness, damping, constants.mu, x) for x in _SLIP_DAMPINGS), key=misfit)


def shoot(
    engine: Any, contact: str, along: float, down: float, phase: float = 0.5
) -> tuple[float, float, float]:
    """Shoot one sphere at the wall: velocity along it, away from it, and slip of the contact after, m/s.

    Parameters
    ----------
    engine : module
        MuJoCo.
    contact : str
        Attributes of the geoms.
    along, down : float
        Velocity of the centre before, m/s; without spin.
    phase : float
        Share of a time step until the contact begins.
    """
    radius = _RADIUS_OVER_OVERLAP * _overlap(down)
    text = _MODEL.format(step=TIME_STEP, contact=contact, radius=radius)
    model = engine.MjModel.from_xml_string(text)
    data = engine.MjData(model)
    data.qpos[2] = radius + phase * down * TIME_STEP
    data.qvel[:3] = along, 0.0, -down
    for _ in range(50 * _STEPS_OF_CONTACT):
        engine.mj_step(model, data)
        if data.qpos[2] > radius and data.qvel[2] > 0.0:
            break
    # of the freejoint's velocities the last three are the spin, in the frame of the body
    spin = np.zeros(3)
    engine.mju_rotVecQuat(spin, data.qvel[3:6], data.qpos[3:7])
    return float(data.qvel[0]), float(data.qvel[2]), float(data.qvel[0] - radius * spin[1])


def _damping(
    engine: Any, constants: ExportedConstants, stiffness: float, speed: float
) -> tuple[float, Array]:
    """Damping whose mean rebound over the phases comes closest, and these rebounds."""
    critical = 2.0 * math.sqrt(stiffness)

    def back(share: float) -> Array:
        contact = _contact(stiffness, share * critical, constants.mu)
        return np.array([shoot(engine, contact, 0.0, speed, phase)[1] for phase in PHASES]) / speed

    low, high = _LEAST, 1.5  # MuJoCo takes no damping of 0 in this form of solref
    for _ in range(30):
        middle = 0.5 * (low + high)
        if back(middle).mean() > constants.e_n:
            low = middle
        else:
            high = middle
    share = min((low, high), key=lambda x: abs(back(x).mean() - constants.e_n))
    return share * critical, back(share)


EXPORTER = MuJoCo()
