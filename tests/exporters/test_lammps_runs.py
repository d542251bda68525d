"""LAMMPS itself reads the export and rebounds as the integrated law says; skipped where it does not run."""

from __future__ import annotations

import numpy as np
import pytest
from lammps_impacts import lammps_here, shoot

from ifrfit.exporters.exported_constants import ExportedConstants
from ifrfit.exporters.protocol import Conditions
from ifrfit.exporters.registry import EXPORTERS
from ifrfit.physics.angles import Incidence
from ifrfit.physics.closures import get_closure


@pytest.mark.parametrize("speed", [0.5, 2.0])
def test_lammps_does_what_the_export_says(speed):
    engine = lammps_here()
    if engine is None:
        pytest.skip("LAMMPS does not run here")
    given = ExportedConstants(get_closure("fr"), 0.4, {"e_n": 0.9, "beta0": 0.4, "mu": 0.15})
    found = EXPORTERS["lammps"].translate(given, Conditions())
    angles = np.array([5.0, 20.0, 45.0, 75.0])
    law = found.response(Incidence.of(angles, degrees=True))
    rows = np.array([shoot(engine, found.lines, angle, speed) for angle in angles])
    np.testing.assert_allclose(rows[:, 1], law.v_n, atol=1e-4)
    # LAMMPS steps a hundredth of the integrated contact's steps: the slider's error is the larger one
    np.testing.assert_allclose(rows[:, 0], law.v_x, atol=3e-3)
