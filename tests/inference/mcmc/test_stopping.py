"""Every rule in both directions, and what it foretells."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest
from mcmc_targets import autoregressive

from ifrfit.inference.mcmc.stopping import RULES, Evidence, Finding, Verdict, is_met, verdict_of


def evidence(**changes: Any) -> Any:
    """Evidence with which every rule holds: 1,000 steps kept."""
    fine = {
        "steps": 1100,
        "discarded": 100,
        "tau": {"e_t": 10.0, "mu": 20.0},
        "late_tau": {"e_t": 11.0, "mu": 19.0},
        "rhat": {"e_t": 1.001, "mu": 1.009},
        "bulk": {"e_t": 2500.0, "mu": 2000.0},
        "tail": {"e_t": 2000.0, "mu": 2100.0},
    }
    return SimpleNamespace(**(fine | changes))


# rule, what just misses it, what just meets it, words, steps more
CASES = [
    (
        "length",
        {"tau": {"e_t": 10.0, "mu": 20.5}},
        {"tau": {"e_t": 10.0, "mu": 20.0}},
        "49 autocorrelation times of mu, for 50 wanted",
        25.0,
    ),
    (
        "stable",
        {"late_tau": {"e_t": 13.0, "mu": 20.0}},
        {"late_tau": {"e_t": 12.0, "mu": 16.0}},
        "autocorrelation time of e_t differs by 30 % in the later half",
        1250.0,
    ),
    (
        "rhat",
        {"rhat": {"e_t": 1.001, "mu": 1.02}},
        {"rhat": {"e_t": 1.0099, "mu": 1.0}},
        "R-hat of mu is 1.02 over the ensembles, for less than 1.01 wanted",
        1000.0 * (0.0404 / 0.0201 - 1.0),
    ),
    (
        "bulk",
        {"bulk": {"e_t": 1000.0, "mu": 3000.0}},
        {"bulk": {"e_t": 2000.0, "mu": 3000.0}},
        "1,000 effective draws of e_t in the bulk, for 2,000 wanted",
        1000.0,
    ),
    (
        "tail",
        {"tail": {"e_t": 5000.0, "mu": 1600.0}},
        {"tail": {"e_t": 5000.0, "mu": 2000.0}},
        "1,600 effective draws of mu in the tail, for 2,000 wanted",
        250.0,
    ),
]


@pytest.mark.parametrize(("rule", "missed", "met", "words", "more"), CASES, ids=[case[0] for case in CASES])
def test_each_rule_alone(rule: str, missed: Any, met: Any, words: str, more: float) -> None:
    assert verdict_of(evidence(**met)).ok
    assert is_met(evidence(**met))
    verdict = verdict_of(evidence(**missed))
    assert verdict.failed == (rule,)
    assert not is_met(evidence(**missed))
    assert words in verdict.says
    (finding,) = (f for f in verdict.findings if not f.ok)
    assert finding.steps_more == pytest.approx(more)
    assert verdict.steps_more is not None
    assert more <= verdict.steps_more <= 1.1 * more + 1.0


def test_every_rule_has_a_case() -> None:
    assert sorted(case[0] for case in CASES) == sorted(f.rule for f in verdict_of(evidence()).findings)
    assert len(RULES) == len(CASES)


def test_ensembles_that_have_not_met_foretell_nothing() -> None:
    verdict = verdict_of(evidence(rhat={"e_t": 1.0, "mu": 1.5}))
    assert verdict.steps_more is None
    assert "not in the same place" in verdict.says


@pytest.mark.parametrize(
    ("nothing", "rule"),
    [
        ({"tau": {"mu": math.inf}, "late_tau": {"mu": math.inf}}, "length"),
        ({"bulk": {"mu": 0.0}}, "bulk"),
        ({"tail": {"mu": 0.0}}, "tail"),
        ({"rhat": {"mu": math.inf}}, "rhat"),
    ],
)
def test_what_does_not_move_foretells_nothing(nothing: Any, rule: str) -> None:
    verdict = verdict_of(evidence(**nothing))
    assert rule in verdict.failed
    assert verdict.steps_more is None


@pytest.mark.parametrize(
    ("most", "rounded"), [(0.2, 1), (7.3, 8), (25.0, 25), (101.0, 110), (1234.0, 1300), (99_100.0, 100_000)]
)
def test_steps_more_have_two_digits_and_never_too_few(most: float, rounded: int) -> None:
    found = Verdict((Finding("a", False, "", most), Finding("b", True, "", 0.0)))
    assert found.steps_more == rounded


@pytest.mark.parametrize("phi", [0.7, 0.8, 0.9])
def test_so_many_steps_more_are_about_enough(phi: float) -> None:
    tau = (1.0 + phi) / (1.0 - phi)
    begun = int(30.0 * tau)
    whole = autoregressive((4, 20_000, 8), phi, seed=3)
    more = verdict_of(Evidence({"x": whole[:, :begun]})).steps_more
    assert more is not None
    assert not verdict_of(Evidence({"x": whole[:, : begun + more // 3]})).ok
    assert verdict_of(Evidence({"x": whole[:, : begun + 3 * more // 2]})).ok
