"""Our own move against known laws, with a control that must fail."""

from __future__ import annotations

from typing import Any

import emcee
import numpy as np
import pytest
from emcee.moves import RedBlueMove
from mcmc_targets import Corner, Normal

from ifrfit.inference.mcmc.moves import StudentMove, moves

STEPS, WALKERS = 1500, 32


class WithoutTheWayBack(StudentMove):  # type: ignore[misc]
    """The control: the asymmetry of the proposal is forgotten."""

    def get_proposal(self, s: Any, c: Any, random: Any) -> Any:
        q, factors = super().get_proposal(s, c, random)
        return q, np.zeros_like(factors)


def walked(target: Any, move: RedBlueMove) -> np.ndarray:
    sampler = emcee.EnsembleSampler(WALKERS, 2, target, moves=move, vectorize=True)
    start = emcee.State(target.starts(1)[0], random_state=np.random.MT19937(7).state)
    sampler.run_mcmc(start, STEPS)
    return np.asarray(sampler.get_chain(discard=200))


def far_off(draws: np.ndarray, mean: float, sd: float) -> float:
    """Largest of the differences in mean and in variance, in standard errors."""
    tau = emcee.autocorr.integrated_time(draws[:, :, None], tol=0)[0]
    n = draws.size / tau
    kurtosis = float((((draws - mean) / sd) ** 4).mean())
    of_mean = abs(draws.mean() - mean) / (sd / np.sqrt(n))
    of_variance = abs(draws.var() / sd**2 - 1.0) / np.sqrt((kurtosis - 1.0) / n)
    return float(max(of_mean, of_variance))


def test_student_move_draws_a_normal_law() -> None:
    draws, target = walked(Normal(), StudentMove()), Normal()
    assert far_off(draws[..., 0], 1.0, 1.0) < 5.0
    assert far_off(draws[..., 1], -2.0, 0.1) < 5.0
    assert np.corrcoef(draws.reshape(-1, 2).T)[0, 1] == pytest.approx(target.rho, abs=0.01)


def test_student_move_draws_a_law_that_ends_at_its_mode() -> None:
    draws = walked(Corner(), StudentMove())
    assert draws.min() >= 0.0
    assert far_off(draws[..., 0], 1.0, 1.0) < 5.0


def test_without_the_way_back_it_would_draw_another_law() -> None:
    draws = walked(Normal(), WithoutTheWayBack())
    assert not 0.5 < draws[..., 0].var() < 2.0


def test_a_normal_law_is_forgotten_in_a_few_steps() -> None:
    ours, theirs = walked(Normal(), StudentMove()), walked(Normal(), emcee.moves.StretchMove())
    times = [emcee.autocorr.integrated_time(draws, tol=0).max() for draws in (ours, theirs)]
    assert times[0] < 3.0
    assert times[1] > 5.0 * times[0]


def test_walkers_on_one_line_do_not_stop_it() -> None:
    line = np.outer(np.arange(32.0), [1.0, 2.0])
    q, factors = StudentMove().get_proposal(line[:16], [line[16:]], np.random.default_rng(1))
    assert np.isfinite(q).all()
    assert np.isfinite(factors).all()


def test_weights_of_the_moves_are_shares() -> None:
    assert sum(weight for _, weight in moves()) == pytest.approx(1.0)
