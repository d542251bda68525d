"""The suite's share of ``scripts/calibrate_closures.py``, and the test itself tried on known laws."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from calibrate_closures import page, verdict
from calibration_verdict import FAMILY, binomial_p
from closure_study import (
    BILINEAR,
    CLOSURES,
    RIGHT,
    SWAPPED,
    WRONG_SIGMA,
    Seen,
    lines_of,
    poisson_binomial_p,
    run_many,
    seen_by,
    tasks_of,
)
from closure_ties import ties

SEED = 11
PAGE = Path(__file__).parents[3] / "docs" / "closure-recovery.md"


def drawn(n: int, *, claimed: float = 1.0, seed: int = SEED) -> Seen:
    """Experiments whose probabilities are right by construction; `claimed` sharpens what is said of them."""
    rng = np.random.default_rng(seed)
    logits = rng.normal(0.0, 2.0, (n, len(CLOSURES)))
    chance = np.exp(logits)
    chance /= chance.sum(axis=1, keepdims=True)
    truth = (rng.random(n)[:, None] > chance.cumsum(axis=1)).sum(axis=1)
    said = chance**claimed
    said /= said.sum(axis=1, keepdims=True)
    ordered = np.sort(said, axis=1)
    return Seen(RIGHT, truth.astype(np.intp), said, np.log(ordered[:, -1] / ordered[:, -2]))


def test_law_of_unequal_chances_is_the_binomial_where_they_are_equal():
    for k, n, p in ((0, 10, 0.5), (7, 10, 0.3), (29, 30, 0.95)):
        assert poisson_binomial_p(k, np.full(n, p)) == pytest.approx(binomial_p(k, n, p), rel=1e-9)
    assert poisson_binomial_p(1, np.array([1.0, 0.0])) == 1.0


def test_right_probabilities_pass_and_sharpened_ones_fail():
    alarms = sum(any(not line.holds for line in lines_of(drawn(1000, seed=i))) for i in range(20))
    assert alarms <= 1  # 20 times 1e-3
    assert any(not line.holds for line in lines_of(drawn(1000, claimed=2.0)))
    assert any(not line.holds for line in lines_of(drawn(1000, claimed=0.5)))


@pytest.fixture(scope="module")
def seen():
    """Reduced study of the closures that are quick; the full one is `make calibrate`."""
    return {one.method: one for one in seen_by(list(run_many(tasks_of(SEED, 6, 3, BILINEAR), 1)))}


def test_probabilities_are_right_as_often_as_they_say(seen):
    right = seen[RIGHT]
    assert right.truth.size == 6 * len(BILINEAR)
    bad = [(line.scene, line.name, line.adjusted) for line in lines_of(right) if not line.holds]
    assert not bad
    hits, chances = int((right.picked == right.truth).sum()), right.probability.max(axis=1)
    assert poisson_binomial_p(hits, chances) > FAMILY


def test_swapped_labels_fail(seen):
    assert any(not line.holds for line in lines_of(seen[SWAPPED]))


def test_a_sigma_that_claims_too_little_is_too_sure(seen):
    """That it fails the bins takes more experiments: the published page has them."""
    wrong, right = seen[WRONG_SIGMA], seen[RIGHT]
    assert wrong.probability.max(axis=1).mean() > right.probability.max(axis=1).mean()


def test_ties_have_the_evidence_of_one_dimensional_integrals():
    found = ties(SEED, 6)
    for one in found:
        assert one.exact == pytest.approx(one.by_hand, abs=3e-4)
    assert sum(one.kind == "undecided" for one in found) >= 4


@pytest.mark.long
def test_with_compliance_probabilities_are_right_as_often_as_they_say():
    right = seen_by(list(run_many(tasks_of(SEED, 15, 1), 2)))[0]
    assert right.closures == CLOSURES
    assert not [(line.scene, line.name) for line in lines_of(right) if not line.holds]
    own = right.truth == CLOSURES.index("maw")
    assert right.probability[own, -1].mean() > 2.0 * right.probability[~own, -1].mean()


@pytest.mark.long
def test_workers_do_not_change_the_study():
    tasks = tasks_of(SEED, 1, 1)
    assert list(run_many(tasks, 2)) == list(run_many(tasks, 1))


def test_page_tells_good_from_bad(seen):
    ties_ = ties(SEED, 3)
    text = page(list(seen.values()), ties_, SEED)
    assert "| IFR-contact |" in text
    swapped = [replace(seen[SWAPPED], method=RIGHT)]
    assert any("adjusted p" in sentence for sentence in verdict(swapped, ties_))
    holds = replace(seen[RIGHT], method=SWAPPED)
    assert f"control passes: {SWAPPED}" in verdict([seen[RIGHT], holds], ties_)


def test_published_page_is_of_a_full_study_that_holds():
    text = PAGE.read_text(encoding="utf-8")
    assert "are right as often as they say; every negative control fails" in text
    assert "500 experiments of each closure" in text
