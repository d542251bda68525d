"""Constants at the ends of their domains: a text with finite numbers, or a refusal in words; nothing else."""

from __future__ import annotations

import re

import pytest
from factories import each_once

import ifrfit
from ifrfit.exporters.comment_block import residual_words
from ifrfit.exporters.exported_constants import ExportedConstants
from ifrfit.exporters.protocol import Conditions
from ifrfit.exporters.registry import EXPORTERS
from ifrfit.physics.closures import get_closure

ENDS = (
    *(("fr", {"e_n": e_n, "beta0": beta0, "mu": 2.0}) for e_n in (0.0, 1.0) for beta0 in (-1.0, 1.0)),
    *(("ifr", {"e_n": 1.0, "e_t": -1.0, "mu": mu}) for mu in (0.0, 1e-6)),
    ("ifr", {"e_n": 1e-3, "e_t": -0.4, "mu": 0.5}),
)


@pytest.mark.parametrize(("target", "end"), each_once(EXPORTERS, ENDS))
def test_finite_numbers_or_a_refusal(target, end):
    closure, values = end
    if target in ("mujoco", "pybullet"):
        pytest.importorskip(target)
    at = Conditions(
        angle=89.0 if target == "openfoam" else None,
        speed=1.0 if "speed" in EXPORTERS[target].takes else None,
    )
    constants = ExportedConstants(get_closure(closure), 0.4, values)
    try:
        found = EXPORTERS[target].translate(constants, at)
    except ifrfit.UsageError:
        return
    said = "\n".join((*found.lines, *found.mapping, residual_words(constants, found)))
    assert re.findall(r"(?<![a-z])(?:nan|inf)(?![a-z])", said) == []
