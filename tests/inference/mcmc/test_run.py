"""Walking: until the evidence suffices, resumed, by several processes, and over two modes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcmc_targets import Modes, Normal

from ifrfit.inference.mcmc import begin, run, verdict_of
from ifrfit.inference.mcmc.run import MAX_STEPS, Chains, walk
from ifrfit.inference.mcmc.stopping import Evidence

SEED = np.random.SeedSequence(20)


def begun(seed: int = 20) -> Chains:
    return begin(Normal(), Normal().starts(), np.random.SeedSequence(seed))


def same(one: Chains, other: Chains) -> bool:
    arrays = all(
        np.array_equal(getattr(one, x), getattr(other, x)) for x in ("at", "log_density", "accepted")
    )
    ends = zip(one.ends, other.ends, strict=True)
    return arrays and all(
        np.array_equal(a.random[1], b.random[1]) and a.random[2:] == b.random[2:] for a, b in ends
    )


def test_it_stops_when_the_evidence_suffices_and_the_answer_is_right() -> None:
    chains, evidence = run(Normal(), begun())
    assert chains.steps < MAX_STEPS
    assert verdict_of(evidence).ok
    for name, mean, sd in (("x", 1.0, 1.0), ("y", -2.0, 0.1)):
        kept = evidence.kept[name]
        assert abs(kept.mean() - mean) < 5.0 * sd / np.sqrt(evidence.bulk[name])
        below = (kept <= mean - 1.6448536 * sd).mean()
        assert abs(below - 0.05) < 5.0 * np.sqrt(0.05 * 0.95 / evidence.tail[name])
    assert 0.2 < chains.acceptance < 1.0


def test_it_stops_at_the_budget_all_the_same() -> None:
    chains, evidence = run(Normal(), begun(), max_steps=50)
    assert chains.steps == 50
    assert not verdict_of(evidence).ok


def test_the_budget_of_chains_that_are_longer_already_adds_nothing() -> None:
    chains, _ = run(Normal(), begun(), max_steps=50)
    again, evidence = run(Normal(), chains, max_steps=30)
    assert again is chains
    assert evidence.steps == 50


@settings(max_examples=10)
@given(st.lists(st.integers(1, 15), min_size=1, max_size=4))
def test_a_walk_in_pieces_is_the_walk_in_one(pieces: list[int]) -> None:
    rest = begun().ends[0]
    whole = walk(Normal(), rest, sum(pieces))
    parts = []
    for steps in pieces:
        parts.append(walk(Normal(), rest, steps))
        rest = parts[-1].ends[0]
    assert np.array_equal(np.concatenate([part.at for part in parts], axis=1), whole.at)
    assert np.array_equal(np.concatenate([part.log_density for part in parts], axis=1), whole.log_density)
    assert sum(part.accepted for part in parts) == whole.accepted


def test_resumed_chains_are_those_that_never_stopped() -> None:
    target, budgets = Modes(3.0), (1, 37, 200, 249, 263)
    first = begin(target, target.starts(signs([0.5, 0.75, 0.25, 0.5])), SEED)
    whole, _ = run(target, first)
    assert whole.steps > max(budgets)
    chains = first
    for budget in budgets:
        chains, _ = run(target, chains, max_steps=budget)
        assert chains.steps == budget
    resumed, _ = run(target, chains)
    assert same(resumed, whole)


def test_two_processes_give_the_same_chains() -> None:
    one, two = (run(Normal(), begun(), workers=workers, max_steps=250)[0] for workers in (1, 2))
    assert same(one, two)


def test_another_seed_gives_others() -> None:
    assert not same(run(Normal(), begun(1), max_steps=20)[0], run(Normal(), begun(2), max_steps=20)[0])


def test_ensembles_share_no_random_numbers() -> None:
    same_starts = np.repeat(Normal().starts(1), 4, axis=0)
    chains, _ = run(Normal(), begin(Normal(), same_starts, SEED), max_steps=5)
    assert len({chains.at[k, -1].tobytes() for k in range(4)}) == 4


def test_progress_is_told_at_every_look() -> None:
    told: list[tuple[int, int]] = []
    chains, _ = run(Normal(), begun(), max_steps=300, progress=lambda *x: told.append(x))
    assert (200, 300) in told
    assert told[-1] == (chains.steps, 300)
    assert sorted(set(told)) == told


class Interrupted(Normal):
    """A density whose caller is interrupted after so many calls."""

    def __init__(self, at_call: int) -> None:
        self.left = at_call

    def __call__(self, at: np.ndarray) -> np.ndarray:
        self.left -= 1
        if self.left == 0:
            raise KeyboardInterrupt
        return super().__call__(at)


@pytest.mark.parametrize("at_call", [3, 500])
def test_an_interrupted_walk_is_kept_and_goes_on_as_if_nothing_had_been(at_call: int) -> None:
    kept: list[Chains] = []
    with pytest.raises(KeyboardInterrupt):
        run(Interrupted(at_call), begun(), max_steps=250, keep=kept.append)
    assert kept[0].steps < 250
    assert (kept[0].steps > 0) == (at_call == 500)
    assert same(run(Normal(), kept[0], max_steps=250)[0], run(Normal(), begun(), max_steps=250)[0])


def test_an_interrupt_between_the_steps_loses_none(monkeypatch: pytest.MonkeyPatch) -> None:
    kept: list[Chains] = []

    def interrupt(_evidence: Evidence) -> bool:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(Normal(), begun(), max_steps=500, halt=interrupt, keep=kept.append)
    assert kept[0].steps == 200


def test_chains_cannot_be_written_to() -> None:
    chains, _ = run(Normal(), begun(), max_steps=2)
    with pytest.raises(ValueError, match="read-only"):
        chains.at[0, 0, 0, 0] = 1.0


FAR = Modes(10.0)


def signs(shares: list[float], walkers: int = 32) -> np.ndarray:
    """Of each ensemble so many walkers in the upper mode."""
    return np.where(np.arange(walkers) < np.multiply(shares, walkers)[:, None], 1.0, -1.0)


def only_local(target: Modes, starts: np.ndarray, steps: int) -> Evidence:
    """Chains that cannot jump: emcee's stretch move alone."""
    import emcee

    chains = []
    for number, start in enumerate(starts):
        sampler = emcee.EnsembleSampler(start.shape[0], 2, target, vectorize=True)
        sampler.run_mcmc(emcee.State(start, random_state=np.random.MT19937(number).state), steps)
        chains.append(sampler.get_chain())
    return Evidence(target.quantities(np.stack(chains)))


def test_a_mode_that_all_ensembles_miss_is_missed() -> None:
    # why starts are put at every optimum: no diagnostic can see what no walker ever saw
    evidence = only_local(FAR, FAR.starts(signs([1.0, 1.0, 1.0, 1.0])), 500)
    assert evidence.rhat["x"] < 1.01
    assert evidence.kept["x"].min() > 0.0


def test_ensembles_in_different_modes_are_caught() -> None:
    evidence = only_local(FAR, FAR.starts(signs([1.0, 0.0, 1.0, 0.0])), 500)
    verdict = verdict_of(evidence)
    assert evidence.rhat["x"] > 1.5
    assert "rhat" in verdict.failed
    assert verdict.steps_more is None


def test_shares_that_do_not_settle_are_caught() -> None:
    # every ensemble has walkers in both modes, and none of them ever changes over
    evidence = only_local(FAR, FAR.starts(signs([0.5, 0.75, 0.25, 0.5])), 500)
    assert evidence.rhat["x"] > 1.01
    assert not verdict_of(evidence).ok


def test_our_moves_find_the_weights_of_two_far_modes() -> None:
    start = begin(FAR, FAR.starts(signs([0.5, 0.75, 0.25, 0.5])), SEED)
    _, evidence = run(FAR, start)
    assert verdict_of(evidence).ok
    share = float((evidence.kept["x"] > 0.0).mean())
    assert abs(share - 0.7) < 5.0 * np.sqrt(0.7 * 0.3 / evidence.bulk["x"])
