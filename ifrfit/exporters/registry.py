"""All targets. A further one is one more file and one more line."""

from __future__ import annotations

from ifrfit.exporters import (
    c_function,
    chrono,
    csv_table,
    drake,
    dynamo,
    json_record,
    lammps,
    liggghts,
    mercurydpm,
    mfix,
    mujoco,
    openfoam,
    pybullet,
    python_function,
    yade,
    yade_mindlin,
)
from ifrfit.exporters.protocol import Exporter
from ifrfit.registry import Registry

EXPORTERS: Registry[Exporter] = Registry(
    "export target",
    Exporter,
    (
        python_function.EXPORTER,
        c_function.EXPORTER,
        json_record.EXPORTER,
        csv_table.EXPORTER,
        lammps.EXPORTER,
        liggghts.EXPORTER,
        yade.EXPORTER,
        yade_mindlin.EXPORTER,
        mercurydpm.EXPORTER,
        mfix.EXPORTER,
        dynamo.EXPORTER,
        openfoam.EXPORTER,
        mujoco.EXPORTER,
        pybullet.EXPORTER,
        drake.EXPORTER,
        chrono.EXPORTER,
    ),
)
