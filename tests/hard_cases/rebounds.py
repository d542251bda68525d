"""Hard cases of the rebound itself."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
from hard_cases.case import HardCase

from ifrfit import rebound

_REFERENCE = Path(__file__).with_name("rebound_extremes.csv")
_STATE = {
    "v_x": "v_x",
    "v_y": "v_y",
    "v_z": "v_n",
    "ROmega_x": "spin_x",
    "ROmega_y": "spin_y",
    "V_x": "contact_x",
    "V_y": "contact_y",
}
_OBSERVABLES = ("beta", "beta_cm", "beta_tot", "mu_app")
Row = dict[str, float]


def _reference(tag: str) -> list[Row]:
    lines = [x for x in _REFERENCE.read_text().splitlines() if not x.startswith("#")]
    return [
        {key: float(value) for key, value in row.items() if key != "tag"}
        for row in csv.DictReader(lines)
        if row["tag"] == tag
    ]


def _run(tag: str) -> list[tuple[Row, Row]]:
    pairs = []
    for row in _reference(tag):
        inputs = {key: row[key] for key in ("spin_x", "spin_y", "e_n", "e_t", "mu")}
        r = rebound(row["gamma_deg"], degrees=True, **inputs)
        got = {ours: float(getattr(r, name)) for ours, name in _STATE.items()}
        got["v_z"] = -got["v_z"]
        got |= {name: float(getattr(r, name)) for name in _OBSERVABLES}
        got["tan_delta"] = float(r.v_x / r.v_n) if r.v_n else np.nan
        got["tan_lambda"] = float(r.v_y / r.v_x) if r.v_x else np.nan
        got |= {"delta": float(r.delta), "lambda": float(r.lambda_)}
        pairs.append((row, got))
    return pairs


def _as_reference(pairs: list[tuple[Row, Row]]) -> None:
    assert pairs
    for row, got in pairs:
        scale = 1.0 + abs(row["spin_x"]) + abs(row["spin_y"])
        for name in _STATE:
            assert abs(got[name] - row[name]) <= 1e-13 * scale, (name, row, got)
        for name in (*_OBSERVABLES, "tan_delta", "tan_lambda"):
            expected = row[name]
            assert np.isnan(got[name]) == np.isnan(expected), (name, row, got)
            if not np.isnan(expected):
                assert abs(got[name] - expected) <= 1e-12 * max(1.0, abs(expected)), (name, row, got)
        # the angles stay defined where their tangents are not
        for name, x, y in (("delta", -row["v_z"], row["v_x"]), ("lambda", row["v_x"], row["v_y"])):
            expected = np.nan if x == y == 0.0 else np.arctan2(y, x)
            assert np.isnan(got[name]) == np.isnan(expected), (name, row, got)
            if not np.isnan(expected):
                assert abs(got[name] - expected) <= 1e-12 * scale, (name, row, got)


def _case(name: str, tag: str, what: str, answer: str) -> HardCase:
    return HardCase(name, "rebound", what, answer, lambda folder: _run(tag), _as_reference)


CASES = (
    _case(
        "gamma 0 and 90",
        "edge_gamma",
        "Rebound at exactly 0 and 90 degrees, with and without spin.",
        "The 50-digit reference; nan only for beta_cm at 0 degrees, mu_app and tan(delta) at 90, "
        "beta without slip, lambda at rest.",
    ),
    _case(
        "no slip",
        "Ut_zero",
        "Rebound with U_t = 0: normal incidence, pure rolling, rolling at grazing incidence.",
        "The impulse along the wall is 0, beta is nan, everything else is the reference.",
    ),
    _case(
        "e_n 0 and 1, mu 0 and 1e6",
        "extreme_en_mu",
        "Rebound with e_n of 0 and 1 and mu of 0 and a million, from 0 to 90 degrees, with spin.",
        "The 50-digit reference; at 90 degrees friction does nothing, however large mu.",
    ),
    _case(
        "mu beyond reason",
        "extreme_mu",
        "Rebound with mu of 1e12 and 1e300.",
        "Plain sticking: the 50-digit reference, and no overflow.",
    ),
    _case(
        "spins of 1e15",
        "huge_spin",
        "Rebound with R omega/u of 1e15 in either direction and both.",
        "The 50-digit reference, to 1e-13 of the spin.",
    ),
)
