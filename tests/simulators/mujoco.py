"""MuJoCo, from the Python index, with a model that holds the exported lines as they are."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
from simulators.shots import RADIUS, Rebounds, Shots

_RADIUS = 1.0  # m: the overlap of an export's soft contact is 3 mm at 2 m/s, and belongs to no larger share
_MODEL = """<mujoco><option gravity="0 0 0" {option}/><worldbody>
<geom name="wall" type="plane" size="1 1 1"/>
<body><freejoint/><geom name="sphere" type="sphere" size="{radius}" mass="0.3"/></body>
</worldbody>{pair}</mujoco>"""


def version() -> str:
    """What runs here; empty without it."""
    try:
        import mujoco
    except ImportError:
        return ""
    return str(mujoco.__version__)


def shoot(lines: Sequence[str], shots: Shots) -> Rebounds:
    """One after the other; a contact begins a third of a time step after its start."""
    import mujoco

    found = re.search(r"within option: (.*) -->", lines[0])
    assert found is not None
    text = _MODEL.format(option=found.group(1), radius=_RADIUS, pair="\n".join(lines[1:]))
    model = mujoco.MjModel.from_xml_string(text)
    rows = []
    for along, down, omega in zip(shots.along, shots.approach, shots.omega * RADIUS / _RADIUS, strict=True):
        data = mujoco.MjData(model)
        data.qpos[2] = _RADIUS + down * model.opt.timestep / 3.0
        data.qvel[:] = along, 0.0, -down, *omega
        for _ in range(20000):
            mujoco.mj_step(model, data)
            if data.qpos[2] > _RADIUS and data.qvel[2] > 0.0:
                break
        spin = np.zeros(3)  # the free joint's spin is in the frame of the body
        mujoco.mju_rotVecQuat(spin, data.qvel[3:6], data.qpos[3:7])
        rows.append((*data.qvel[:3], *spin))
    velocity, spins = np.hsplit(np.array(rows), 2)
    return shots.rebounds(velocity, spins * _RADIUS / RADIUS)
