"""A closure of one's own leaves through every target, and every target of one's own takes every closure."""

from __future__ import annotations

import numpy as np
import pytest

import ifrfit
from ifrfit.exporters.registry import EXPORTERS

pytestmark = pytest.mark.usefixtures("toys")
GAMMA = np.arange(5.0, 86.0, 5.0)


def fitted(closure, **constants):
    rng = np.random.default_rng(3)
    beta = ifrfit.rebound(GAMMA, e_n=0.9, mu=0.12, closure=closure, degrees=True, **constants).beta
    data = {"gamma_deg": GAMMA, "beta": beta + rng.normal(0.0, 0.02, GAMMA.size), "sigma": 0.02}
    return ifrfit.fit(data, closure=closure, fix={"e_n": 0.9}, method="lsq")


@pytest.mark.parametrize("target", list(EXPORTERS))
def test_a_closure_of_ones_own_leaves_through_every_target(target):
    choices = {name: {"angle": 40.0, "speed": 2.0}[name] for name in EXPORTERS[target].takes}
    if target in ("mujoco", "pybullet"):  # they are run
        pytest.importorskip(target)
    text = fitted("grip", g_rip=0.7).export(target, **choices)
    assert "Closure GRIP" in text
    assert "g_rip = " in text


def test_a_target_of_ones_own_takes_every_closure(cli, tmp_path):
    for closure, own in (("grip", {"g_rip": 0.7}), ("ifr", {"e_t": -0.9}), ("f", {})):
        path = tmp_path / f"{closure}.json"
        fitted(closure, **own).save(path)
        text = cli("export", path, "--to", "arcade")
        assert "bounciness = 0.9\n" in text
        assert "e_n within 1e-12; v_x/u off by" in text
