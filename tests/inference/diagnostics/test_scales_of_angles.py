"""Angles in gon, and scales that look like one of the angles: named together, the likeliest first."""

from __future__ import annotations

from dataclasses import replace

import pytest
import slips_study
from slips_scenes import Cause, Scene, experiment

from ifrfit.inference.fit import fit

BETA = Scene(("beta",), fixed={"e_n": 0.8}, ordered=False)
BOTH = Scene(("beta", "e_n"), ordered=False)


def _slips(scene, cause, seed):
    return fit(experiment(scene, cause, seed), method="lsq", independent=True, fix=scene.fixed).facts["slips"]


@pytest.mark.parametrize("policy", ["known", "unknown"])
@pytest.mark.parametrize("names", [("beta", "e_n"), ("beta_cm", "e_n"), ("v_x", "v_n", "spin_y_after")])
def test_angles_in_gon_are_named_with_their_factor(names, policy):
    scene = replace(BOTH, observables=names, policy=policy)
    fact = _slips(scene, Cause("angle-in-gon"), 2)
    assert fact.figures["called"][0] == "angle-in-gon"
    assert "multiply them by 0.9" in fact.says


def test_both_angles_in_gon_are_named():
    scene = Scene(("delta_deg", "e_n"), ordered=False, noise=0.003)
    named, _ = slips_study.called(scene, Cause("angles-in-gon delta_deg"), 1)
    assert named[0] == "angles-in-gon delta_deg"


@pytest.mark.parametrize("size", [0.06, -0.08, 0.1])
@pytest.mark.parametrize("scene", [BETA, BOTH])
def test_a_scale_of_beta_is_named_in_the_order_of_the_likelihood(scene, size):
    for seed in (0, 2, 3):
        fact = _slips(scene, Cause("contact-scale", size), seed)
        named, tests = fact.figures["called"], fact.figures["tests"]
        assert "contact-scale" in named
        assert tests["contact-scale"]["size"] == pytest.approx(size, abs=4.0 * tests["contact-scale"]["sd"])
        if named[0] != "contact-scale":
            assert named[0] == "angle-scale"
            assert abs(tests["angle-scale"]["drop"] - tests["contact-scale"]["drop"]) < 4.0


def test_the_scale_of_beta_says_what_to_divide():
    fact = _slips(BOTH, Cause("contact-scale", 0.1), 0)
    assert "velocities of the contact point after impact 1" in fact.says
    assert "divide those of the contact point after" in fact.says
