"""What tests of exporters share: impacts that were integrated once."""

from __future__ import annotations

import numpy as np
import pytest

from ifrfit.exporters import soft_sphere, spring_dashpot, yade_mindlin
from ifrfit.exporters.spring_dashpot import STEPS

SEEN: dict[object, tuple[float, np.ndarray]] = {}


@pytest.fixture(autouse=True)
def integrated_once(monkeypatch):
    """The same contact at the same slip ratios, which several exports ask for, is integrated once."""
    own = spring_dashpot.impact

    def impact(contact, tau, inertia_factor, steps=STEPS):
        key = (contact, tau.tobytes(), inertia_factor, steps)
        if key not in SEEN:
            SEEN[key] = own(contact, tau, inertia_factor, steps)
        e_n, slip = SEEN[key]
        return e_n, slip.copy()

    for module in (spring_dashpot, soft_sphere, yade_mindlin):
        monkeypatch.setattr(module, "impact", impact)
