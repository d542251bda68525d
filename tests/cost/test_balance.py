"""The impulse balance in many digits, against the kept reference values and against the package."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest
from mpmath import mpf, workdps

from ifrfit.cost.impulse_balance import exact_impact, ifr, impact

REFERENCE = Path(__file__).parents[1] / "reference" / "impacts.csv"
COLUMNS = {"v_x": "v_x", "v_y": "v_y", "spin_x": "ROmega_x", "spin_y": "ROmega_y"}


def test_agrees_with_the_kept_values_to_all_their_digits():
    with REFERENCE.open(encoding="utf-8", newline="") as handle:
        rows = list(csv.DictReader(handle))
    assert len(rows) == 440
    with workdps(50):
        for row in rows:
            gamma, s_x, s_y = (float(row[name]) for name in ("gamma_deg", "spin_x", "spin_y"))
            constants = {name: float(row[name]) for name in ("e_n", "mu")}
            found = exact_impact(gamma, s_x, s_y, law=ifr, constant=float(row["e_t"]), **constants)
            scale = 1 + abs(s_x) + abs(s_y)
            for ours, theirs in COLUMNS.items():
                assert abs(found[ours] - mpf(row[theirs])) < mpf(10) ** -16 * scale, (row["tag"], ours)
            assert abs(found["v_n"] + mpf(row["v_z"])) < mpf(10) ** -16


def test_more_digits_change_what_lies_beyond_the_fewer():
    with workdps(70):
        more = exact_impact(33.0, 0.1, -0.4, law=ifr, constant=-0.9, e_n=0.9, mu=0.2)
    with workdps(50):
        found = exact_impact(33.0, 0.1, -0.4, law=ifr, constant=-0.9, e_n=0.9, mu=0.2)
        assert abs(found["v_x"] - more["v_x"]) < mpf(10) ** -48
    double = impact(33.0, 0.1, -0.4, law=ifr, constant=-0.9, e_n=0.9, mu=0.2)
    assert double["v_x"] == pytest.approx(float(more["v_x"]), abs=1e-15)
    assert abs(more["v_x"] - double["v_x"]) > mpf(10) ** -30  # a double is a double


def test_grazing_has_no_approach_at_all():
    assert exact_impact(90.0, 0.0, 0.0, law=ifr, constant=-0.9, e_n=0.9, mu=1e6)["v_n"] == 0
