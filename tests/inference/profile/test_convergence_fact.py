from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest
from hard_cases.synthetic import FAN, HEADER, STEEP, noise, question, rows, table, values

from ifrfit.inference.diagnostics.thresholds import FACTS
from ifrfit.inference.optimize.batched_search import BatchedSearch
from ifrfit.inference.profile.profile_all import profile_all, profile_converged
from ifrfit.inference.profile.types import ProfileLikelihood
from ifrfit.inference.result.types import Fact

SETTLED = Fact(True, "the noise has settled", {"change": 1e-9}, FACTS["converged"])


@pytest.fixture
def profiles(tmp_path: Path) -> dict[str, ProfileLikelihood]:
    return profile_all(*question(tmp_path, table(STEEP, sigma=0.01, seed=1)), curves=False)


def test_closed_or_open_to_the_end_is_converged(profiles: dict[str, ProfileLikelihood]) -> None:
    assert profiles["mu"].interval95[1] == math.inf  # open, but that is where mu ends
    fact = profile_converged(profiles, SETTLED)
    assert fact.ok
    assert fact.says == "the noise has settled, and every profile closes or reaches the end of its domain"
    assert fact.figures == {"change": 1e-9, "n_profiles": len(profiles), "stopped": []}
    assert fact.threshold == FACTS["converged"]


def test_a_profile_that_was_stopped_is_named(profiles: dict[str, ProfileLikelihood]) -> None:
    why = "it does not close up to 1e+18"
    profiles["mu"] = replace(profiles["mu"], stopped=why)
    fact = profile_converged(profiles, SETTLED)
    assert not fact.ok
    assert fact.says == (
        f"the profile of mu was stopped early ({why}): compare the intervals with --method exact"
    )
    profiles["kappa"] = profiles["mu"].mapped("kappa", lambda x: 1.94 * x)
    fact = profile_converged(profiles, SETTLED)
    assert fact.says.startswith("the profiles of mu, kappa were stopped early (")
    assert fact.figures["stopped"] == ["mu", "kappa"]


def test_noise_that_has_not_settled_comes_first(profiles: dict[str, ProfileLikelihood]) -> None:
    restless = replace(SETTLED, ok=False, says="the noise has not settled")
    fact = profile_converged(profiles, restless)
    assert (fact.ok, fact.says) == (False, "the noise has not settled")


def test_a_search_that_runs_out_of_steps_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = HEADER
    for seed, (series, size) in enumerate((("calm", 0.01), ("wild", 0.08)), start=1):
        beta = values(FAN, "beta", e_t=-0.9) + noise(len(FAN), size, seed)
        text += rows(FAN, beta, None, "beta", series)
    problem, fit = question(tmp_path, text, separate="noise")
    assert profile_converged(profile_all(problem, fit, curves=False), SETTLED).ok
    run = BatchedSearch.run
    monkeypatch.setattr(BatchedSearch, "run", lambda self, *at, **more: run(self, *at, **more, steps=1))
    found = profile_all(problem, fit, curves=False)
    assert "the search has not settled at" in found["e_t"].stopped
    assert not profile_converged(found, SETTLED).ok
