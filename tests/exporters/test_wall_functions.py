"""Targets python and c: run, compiled, and compared with the package's own rebound to the last digits."""

from __future__ import annotations

import shutil
import subprocess

import numpy as np
import pytest
from factories import BILINEAR, own_constant

import ifrfit
from ifrfit.exporters.exported_constants import ExportedConstants
from ifrfit.exporters.protocol import Conditions
from ifrfit.exporters.registry import EXPORTERS
from ifrfit.physics.closures import get_closure

GAMMA = np.linspace(0.0, 90.0, 31)
SPINS = ((0.0, 0.0), (0.0, 0.4), (0.3, -0.7), (-1.2, 0.1))


def constants(closure, j=0.4):
    values = {"e_n": 0.9, **own_constant(closure, inertia_factor=j), "mu": 0.13}
    entry = get_closure(closure)
    return ExportedConstants(entry, j, {name: values[name] for name in entry.constants})


def text(target, given):
    return "\n".join(EXPORTERS[target].translate(given, Conditions()).lines) + "\n"


def expected(given):
    """States of `ifrfit.rebound`, and what goes in, a row an impact."""
    rows, out = [], []
    for spin_x, spin_y in SPINS:
        state = ifrfit.rebound(
            GAMMA, spin_x, spin_y, **given.values, closure=given.closure.name,
            inertia_factor=given.inertia_factor, degrees=True,
        )  # fmt: skip
        before = state.incidence
        zero = np.zeros_like(GAMMA)
        rows.append(np.column_stack([before.sine, zero, before.cosine, zero + spin_x, zero + spin_y]))
        out.append(np.column_stack([state.v_x, state.v_y, state.v_n, state.spin_x, state.spin_y]))
    return np.concatenate(rows), np.concatenate(out)


def assert_same(found, wanted):
    # relative to the speed of approach, and to the spin where that is faster
    size = np.maximum(1.0, np.abs(wanted).max(axis=1, keepdims=True))
    assert np.max(np.abs(found - wanted) / size) <= 1e-15


@pytest.mark.parametrize("j", [0.4, 2.0 / 3.0])
@pytest.mark.parametrize("closure", BILINEAR)
def test_python_is_the_rebound(closure, j):
    given = constants(closure, j)
    space = {}
    exec(text("python", given), space)
    rows, wanted = expected(given)
    assert_same(np.array([space["rebound"](*row) for row in rows]), wanted)


@pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")
@pytest.mark.parametrize("closure", BILINEAR)
def test_c_is_the_rebound(closure, tmp_path):
    given = constants(closure)
    program = (
        text("c", given)
        + """
#include <stdio.h>
int main(void) {
    double x[5];
    while (scanf("%lf %lf %lf %lf %lf", x, x + 1, x + 2, x + 3, x + 4) == 5) {
        const ifrfit_state s = ifrfit_rebound(x[0], x[1], x[2], x[3], x[4]);
        printf("%.17g %.17g %.17g %.17g %.17g\\n", s.v_x, s.v_y, s.v_n, s.spin_x, s.spin_y);
    }
    return 0;
}
"""
    )
    (tmp_path / "wall.c").write_text(program)
    command = ["gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off", "-O2", "wall.c", "-o"]
    subprocess.run([*command, "wall", "-lm"], cwd=tmp_path, check=True)
    rows, wanted = expected(given)
    said = "\n".join(" ".join(repr(float(x)) for x in row) for row in rows)
    run = subprocess.run(["./wall"], cwd=tmp_path, input=said, capture_output=True, text=True, check=True)
    assert_same(np.array([line.split() for line in run.stdout.splitlines()], dtype=float), wanted)


@pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")
def test_c_compiles_by_itself_without_a_warning(tmp_path):
    (tmp_path / "wall.c").write_text(text("c", constants("fr")))
    command = ["gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-c", "wall.c", "-o", "wall.o"]
    subprocess.run(command, cwd=tmp_path, check=True)


def test_a_wrong_sign_would_be_seen():
    given = constants("ifr")
    space = {}
    exec(text("python", given).replace("u_x - push_x", "u_x + push_x"), space)
    rows, wanted = expected(given)
    with pytest.raises(AssertionError):
        assert_same(np.array([space["rebound"](*row) for row in rows]), wanted)


def test_a_law_without_a_formula_is_refused():
    with pytest.raises(ifrfit.UsageError, match="closure MAW is no formula of a line"):
        text("c", constants("maw"))
