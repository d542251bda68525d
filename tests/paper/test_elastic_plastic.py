"""The elastic-plastic line of Fig. 5 against Thornton's formulas written out."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ifrfit.paper.figures import FIGURES, SPEED, ElasticPlastic


def line():
    figure = next(f for f in FIGURES if f.name == "5")
    return figure, next(m for m in figure.models if isinstance(m, ElasticPlastic))


def test_restitution_is_thorntons():
    _, model = line()
    quartz, steel = (94.5e9, 0.074, 2650.0), (193e9, 0.29)
    modulus = 1.0 / ((1 - quartz[1] ** 2) / quartz[0] + (1 - steel[1] ** 2) / steel[0])
    onset = 1.5605 * math.sqrt((2.8 * 0.215e9) ** 5 / (modulus**4 * quartz[2]))  # sphere on a plane
    gamma = np.array([0.0, 30.0, 60.0, 85.0])
    r = onset / (SPEED * np.cos(np.radians(gamma)))
    expected = (1.2 * math.sqrt(3.0)) ** 0.5 * np.sqrt(1 - r**2 / 6)
    expected *= (r / (r + 2 * np.sqrt(1.2 - r**2 / 5))) ** 0.25
    assert model.restitution(gamma) == pytest.approx(expected, rel=1e-3)  # 1.5605 has five digits


def test_line_is_beta_tot_with_that_restitution():
    figure, model = line()
    curve = model.curve(figure.x, figure.y, figure.settings[0])
    assert curve.kind == "other"
    e_n = model.restitution(curve.x)
    # near the normal all of it is e_n; at grazing incidence the wall never yields and e_n is 1
    assert curve.y[0] == pytest.approx(e_n[0], abs=1e-6)
    assert 0.2 < e_n[0] < 0.4
    assert e_n[-1] == 1.0
