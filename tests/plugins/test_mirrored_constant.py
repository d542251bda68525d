"""A closure whose constant is that of another one, counted from the other end, has the same posterior."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from extensions.closure import GRIP
from factories import impacts_file

import ifrfit
from ifrfit.physics.closure import rotational_share
from ifrfit.physics.impulse_laws import Coefficients
from ifrfit.registry import registered


def _slack(j: float) -> Coefficients:
    return Coefficients(0.0, 0.0, 2.0 * rotational_share(j), -2.0 * rotational_share(j))


assert GRIP.own is not None
SLACK = replace(GRIP, name="slack", title="SLACK", law=_slack, own=replace(GRIP.own, name="slack"))
CASES: list[dict[str, Any]] = [
    {"fix": {"e_n": 0.9}},
    {"prior": {"e_n": (0.9, 0.02)}},
    {"fix": {"e_n": 0.9}, "bounds": {"mu": (0.05, 0.125)}},
    {"fix": {"e_n": 0.9}, "prior": {"mu": (0.12, 0.003)}},
    {"fix": {"e_n": 0.9, "mu": 0.12}},
    {"fix": {"e_n": 0.9}, "noise": "unknown"},
    {"fix": {"e_n": 0.9}, "noise": ifrfit.Noise("known", tails="student-t")},
    {"fix": {"e_n": 0.9}, "separate": "mu"},
]


@pytest.mark.parametrize("case", CASES)
def test_a_bound_that_falls_is_integrated(toys: None, tmp_path: Path, case: dict[str, Any]) -> None:
    gamma = np.linspace(4.0, 80.0, 20)
    made = {"closure": "grip", "e_n": 0.9, "c": 0.7, "noise": 0.03, "sigma": 0.03, "gamma": gamma}
    path = impacts_file(tmp_path / "impacts.csv", made, {**made, "series": "second", "mu": 0.13, "seed": 1})
    with registered(SLACK):
        one, two = (ifrfit.fit(path, closure=name, method="exact", **case) for name in ("grip", "slack"))
        grip, slack = one.constants[GRIP.constant], two.constants["slack"]
        assert slack.status == grip.status
        assert 1.0 - slack.value == pytest.approx(grip.value, abs=1e-9)
        assert 1.0 - np.array(slack.interval95[::-1]) == pytest.approx(grip.interval95, abs=1e-9)
        for name, entry in one.flat_constants().items():
            if name.startswith("mu"):
                assert two.flat_constants()[name].interval95 == pytest.approx(entry.interval95, abs=1e-9)
        if "separate" not in case:
            kappa = one.derived["kappa"].interval95
            assert two.derived["kappa"].interval95 == pytest.approx(kappa, abs=1e-9)
        drawn = two.draws(2000, np.random.default_rng(1))["slack"]
        assert np.mean(drawn) == pytest.approx(slack.mean, abs=5.0 * slack.stderr / np.sqrt(2000))


def test_a_domain_where_sticking_has_no_meaning_is_refused(toys: None, tmp_path: Path) -> None:
    path = impacts_file(tmp_path / "impacts.csv", {"gamma": np.linspace(4.0, 80.0, 20)})
    words = "needs slack <= 1, where sticking has a meaning"
    with registered(SLACK), pytest.raises(ifrfit.UsageError, match=words):
        ifrfit.fit(path, closure="slack", fix={"e_n": 0.9}, bounds={"slack": (0.0, 1.1)})
