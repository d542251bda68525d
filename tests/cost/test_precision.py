"""Where single precision is enough, in tables and sentences."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ifrfit.cost.arithmetic_costs import DOUBLE, GIVEN, HARD, SINGLE, VELOCITIES, arithmetic_costs
from ifrfit.cost.report.text import precision_lines, precision_sentences, precision_table
from ifrfit.cost.timing import Cost, Timing


def cost(method, kind, quantity, error, ns):
    return Cost("arithmetic", method, kind, quantity, Timing(1e-9 * ns, 0.0, 1.0, 5), error, "1")


def both(single, double=1e-16):
    return [
        cost(name, kind, quantity, error if name == SINGLE else double, 1.0 if name == SINGLE else 2.0)
        for name in (SINGLE, DOUBLE)
        for kind, quantity, error in single
    ]


EASY = [(GIVEN, VELOCITIES, 5e-8), ("spins", VELOCITIES, 8e-8), ("spins", "beta", 2e-7)]
HARDER = [*EASY, ("grazing", "mu_app", 8e-3), ("grazing", "beta", math.inf), ("slip", "beta", 0.12)]


def test_enough_everywhere():
    said = precision_sentences(both(EASY), 1e-3)
    assert said == [
        "Single precision keeps velocities and spins to 8e-8 of 1 + |s| in all of these",
        "Single precision is enough for 0.001 of everything that is read off them",
        "Double precision loses at most 1e-16: beta, spins",
        "An impact takes 1 ns in single and 2 ns in double precision",
    ]


def test_not_enough_is_named():
    said = precision_sentences(both(HARDER), 1e-3, times=False)
    assert said[1:3] == [
        "What is read off them loses more than 0.001 there: grazing (mu_app 8e-3, beta lost); slip (beta "
        "1e-1)",
        "Single precision is enough for 0.001 of everything else that is read off them",
    ]
    assert "grazing" not in " ".join(precision_sentences(both(EASY), 1e-3))
    assert "spins (beta 2e-7)" in precision_sentences(both(EASY), 1e-8)[1]


def test_a_cell_for_each_and_none_where_there_is_none():
    table = precision_table(both(HARDER), SINGLE)
    assert table[0] == ["impacts", "v, spin", "beta", "mu_app"]
    assert table[1:] == [
        [GIVEN, "5e-8", "", ""],
        ["spins", "8e-8", "2e-7", ""],
        ["grazing", "", "lost", "8e-3"],
        ["slip", "", "1e-1", ""],
    ]


@pytest.fixture(scope="module")
def real():
    return arithmetic_costs(
        gamma_deg=np.linspace(5, 80, 9), spin_y=0.0, e_n=0.94, e_t=-0.93, mu=0.12, quick=True
    )


def test_real_ones_fit_a_terminal(real):
    lines = precision_lines(real)
    assert max(map(len, lines)) <= 100
    assert [line for line in lines if line != line.rstrip()] == []
    assert sum(line.startswith(f"  {kind}") for line in lines for kind in (GIVEN, *HARD)) == 20


def test_real_ones_name_what_cancels(real):
    lost = precision_sentences(real)[1]
    assert "slip cancels to 1e-6 (beta " in lost
    assert "grazing, from 89.999 deg (mu_app " in lost
    assert GIVEN not in lost
