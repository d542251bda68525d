"""The law of the bootstrap: known answers, seeds, failures, and a control that must come out too narrow."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from bootstrap_scenes import TRUTH, fitted, scene, with_values
from refusals import refused
from scipy import stats

from ifrfit.errors import DataError, UsageError
from ifrfit.inference.bootstrap import BootstrapDraws, bootstrap
from ifrfit.inference.bootstrap.batched_solver import BatchedSolver
from ifrfit.inference.bootstrap.estimator import each, fit_lot
from ifrfit.inference.bootstrap.replicate_fits import NO_E_N, NO_SLIDING, concatenate_fits
from ifrfit.inference.bootstrap.schemes import SCHEMES, Cases
from ifrfit.inference.bootstrap.sequential_solver import SequentialSolver


def made(problem, **options: object) -> BootstrapDraws:
    return bootstrap(*fitted(problem), **options)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_the_mean_of_gaussian_rows_scatters_by_sigma_over_root_n(scheme) -> None:
    n, replicates = 40, 4000
    problem = scene(n, ("e_n",), noise="unknown")
    value = problem.rows.value
    found = made(problem, scheme=scheme, replicates=replicates)
    e_n = found.draws["e_n"]
    # conditional on the data all four have one known answer, the scatter of the rows themselves: with n
    # degrees of freedom for cases and centred residuals over sqrt(1 - 1/n), with n - 1 for wild weights
    squares = value.var() / (n if scheme == "cases" else n - 1)
    assert e_n.std() == pytest.approx(math.sqrt(squares), rel=5.0 / math.sqrt(2.0 * replicates))
    assert e_n.mean() == pytest.approx(value.mean(), abs=5.0 * math.sqrt(squares / replicates))
    if scheme in ("cases", "residual"):
        noise = found.draws["noise[s0/e_n]"]
        assert np.median(noise) == pytest.approx(value.std(ddof=1), rel=0.05)
        assert noise.std() == pytest.approx(value.std() / math.sqrt(2.0 * n), rel=0.4)
    else:  # the size of every residual is kept
        assert set(found.draws) == {"e_n", "e_t", "mu"}


def test_quantiles_of_the_mean_are_those_of_its_known_law() -> None:
    n = 8
    problem = scene(n, ("e_n",), noise="known", bounds={"e_n": (0.0, 2.0)})
    found = made(problem, scheme="wild", replicates=8000)
    # Rademacher weights of eight residuals: all 256 outcomes, without chance
    value = problem.rows.value
    off = (value - value.mean()) / math.sqrt(1.0 - 1.0 / n)
    signs = 1.0 - 2.0 * ((np.arange(256)[:, None] >> np.arange(n)) & 1)
    law = np.sort(value.mean() + signs @ off / n)
    share = np.searchsorted(np.sort(found.draws["e_n"]), law + 1e-12) / 8000
    expected = np.searchsorted(law, law + 1e-12) / 256
    assert np.abs(share - expected).max() < 1.95 / math.sqrt(8000)


def test_the_sd_of_all_constants_agrees_with_the_covariance_where_the_model_holds() -> None:
    problem, found = fitted(scene(150, noise="unknown", seed=5))
    sd = np.sqrt(
        np.diag(found.gaussian.to_theta @ found.gaussian.covariance(capped=True) @ found.gaussian.to_theta.T)
    )
    for scheme in SCHEMES:
        draws = bootstrap(problem, found, scheme=scheme, replicates=600).draws
        own = np.array([draws[name].std() for name in ("e_n", "e_t", "mu")])
        assert own == pytest.approx(sd, rel=0.25)


def same(one: BootstrapDraws, other: BootstrapDraws, rel: float = 0.0) -> None:
    assert one.reasons == other.reasons
    assert set(one.draws) == set(other.draws)
    for name, draws in one.draws.items():
        assert draws == pytest.approx(other.draws[name], rel=rel, abs=1e-12 if rel else 0.0)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_neither_chunks_nor_the_number_of_replicates_change_a_replicate(scheme) -> None:
    problem, found = fitted(scene(15, noise="unknown"))
    base = bootstrap(problem, found, scheme=scheme, replicates=100, seed=4)
    same(base, bootstrap(problem, found, scheme=scheme, replicates=100, seed=4))
    for at_once in (1, 700, 10**9):
        same(
            base, bootstrap(problem, found, scheme=scheme, replicates=100, seed=4, at_once=at_once), rel=1e-9
        )
    more = bootstrap(problem, found, scheme=scheme, replicates=150, seed=4)
    assert more.draws["e_t"][:100] == pytest.approx(base.draws["e_t"], rel=1e-9)
    other = bootstrap(problem, found, scheme=scheme, replicates=100, seed=5)
    assert np.abs(other.draws["e_t"] - base.draws["e_t"]).max() > 1e-3


def test_the_number_of_workers_changes_no_draw() -> None:
    problem, found = fitted(scene(6, ("beta",), fix={"e_n": 0.9}))
    task = partial(fit_lot, SequentialSolver.of(problem, found), Cases.of(problem))
    seeds = np.random.SeedSequence(2).spawn(12)
    lots = [seeds[:5], seeds[5:10], seeds[10:]]
    one, two = (concatenate_fits(list(each(task, lots, workers))) for workers in (1, 2))
    assert one.reason == two.reason
    assert (one.theta == two.theta).all()
    assert (one.certified == two.certified).all()


def test_progress_is_told_up_to_the_end() -> None:
    told: list[tuple[int, int]] = []
    made(scene(10), replicates=100, at_once=600, progress=lambda *at: told.append(at))
    assert told == [(30, 100), (60, 100), (90, 100), (100, 100)]


@pytest.mark.long
def test_what_is_fitted_one_by_one_is_the_same_by_any_number_of_workers() -> None:
    problem, found = fitted(scene(6, series=2, separate=("mu",), fix={"e_n": 0.9}))
    assert BatchedSolver.of(problem, found) is None
    one = bootstrap(problem, found, replicates=100)
    same(one, bootstrap(problem, found, replicates=100, workers=2))
    assert one.answered > 90


def test_rows_drawn_in_the_place_of_impacts_come_out_too_narrow() -> None:
    """The control that must fail: every row four times, as four readings of one impact with one error."""
    copies = 4
    problem, found = fitted(scene(30, copies=copies, seed=2))
    impacts = bootstrap(problem, found, replicates=1000).draws
    rows = Cases.of(problem, np.arange(problem.rows.value.size))
    apart = bootstrap(problem, found, scheme=rows, replicates=1000)
    once = bootstrap(*fitted(scene(30, seed=2)), replicates=1000).draws
    assert apart.scheme.splits_impacts
    for name in ("e_n", "e_t", "mu"):
        assert impacts[name].std() == pytest.approx(once[name].std(), rel=0.2)
        ratio = apart.draws[name].std() / impacts[name].std()
        assert ratio == pytest.approx(1.0 / math.sqrt(copies), rel=0.2)


def test_replicates_without_an_answer_are_counted_with_their_reasons() -> None:
    gamma = [5.0, 10.0, 15.0, 20.0, 22.0, 24.0, 26.0, 28.0, 60.0]
    problem = scene(gamma=gamma)
    problem = with_values(problem, problem.predict(np.array(list(TRUTH.values()))))
    found = made(problem, replicates=2000)
    # the one sliding impact of nine is missing with probability (8/9)^9
    expected = (8.0 / 9.0) ** 9
    assert set(found.reasons) == {NO_SLIDING}
    error = 5.0 * math.sqrt(expected * (1.0 - expected) / 2000)
    assert found.failed / 2000 == pytest.approx(expected, abs=error)
    assert found.undetermined == {"mu": {NO_SLIDING: found.failed}}
    assert found.draws["mu"].size == found.answered == 2000 - found.failed
    joint = made(scene(9, ("beta", "e_n"), joint=True).with_rows(np.arange(10)), replicates=2000)
    assert set(joint.reasons) == {NO_E_N}
    assert joint.failed / 2000 == pytest.approx(expected, abs=error)


def test_a_constant_that_rests_on_its_prior_scatters_as_the_prior_does() -> None:
    for scheme in SCHEMES:
        found = made(scene(20, ("beta",), prior={"e_n": (0.9, 0.02)}), scheme=scheme, replicates=2000)
        assert found.draws["e_n"].std() == pytest.approx(0.02, rel=0.1)
        # mu is what kappa leaves of it
        assert np.corrcoef(found.draws["e_n"], found.draws["mu"])[0, 1] < -0.1


def test_what_kappa_alone_leaves_open_is_drawn_from_its_prior() -> None:
    found = made(scene(30, ("beta",)), replicates=1000)
    assert stats.kstest(found.draws["e_n"], "uniform").pvalue > 1e-4
    kappa = found.kappas["kappa"]
    assert kappa.mean() == pytest.approx(TRUTH["mu"] * (1.0 + TRUTH["e_n"]), abs=0.03)
    assert abs(np.corrcoef(kappa, found.draws["e_n"])[0, 1]) < 0.15


def test_bounds_hold_in_every_replicate() -> None:
    problem = scene(30, bounds={"e_t": (-0.79, -0.4), "e_n": (0.0, 0.89), "mu": (0.0, 0.149)})
    for scheme in SCHEMES:
        draws = made(problem, scheme=scheme, replicates=300).draws
        assert draws["e_t"].min() >= -0.79
        assert draws["e_n"].max() <= 0.89
        assert draws["mu"].max() <= 0.149
        assert (draws["e_n"] == 0.89).mean() > 0.2


def test_numbers_that_make_no_sense_are_refused() -> None:
    problem, found = fitted(scene(12))
    with refused(UsageError, match="--replicates 99: choose from 100 to 1,000,000"):
        bootstrap(problem, found, replicates=99)
    with refused(UsageError, match="--workers 0"):
        bootstrap(problem, found, workers=0)


def test_kept_replicates_are_taken_up_and_change_nothing(tmp_path: Path) -> None:
    problem = scene(10)
    whole = made(problem, replicates=200, at_once=600)
    told: list[int] = []

    def interrupt(done: int, _most: int) -> None:
        told.append(done)
        if done >= 90:
            raise KeyboardInterrupt

    with pytest.raises(
        KeyboardInterrupt, match=r"replicates are kept in .*: the same command goes on with them"
    ):
        made(problem, replicates=200, at_once=600, keep=tmp_path / "u", progress=interrupt)
    fresh: list[int] = []
    again = made(
        problem, replicates=200, at_once=600, keep=tmp_path / "u", progress=lambda done, _: fresh.append(done)
    )
    assert min(fresh) > told[-1]
    for name, draws in whole.draws.items():
        np.testing.assert_array_equal(draws, again.draws[name])
    # done, all are kept until the results are there: fewer are the first of them
    fewer = made(problem, replicates=100, at_once=600, keep=tmp_path / "u", progress=fresh.append)
    for name, draws in whole.draws.items():
        np.testing.assert_array_equal(draws[: fewer.answered], fewer.draws[name])


def test_replicates_of_another_question_are_not_taken_up_and_damaged_ones_refused(tmp_path: Path) -> None:
    problem = scene(10)
    made(problem, replicates=100, keep=tmp_path)
    other = made(problem, replicates=100, keep=tmp_path, seed=1)
    alone = made(problem, replicates=100, seed=1)
    for name, draws in alone.draws.items():
        np.testing.assert_array_equal(draws, other.draws[name])
    (tmp_path / "replicates.npz").write_bytes(b"junk")
    with pytest.raises(DataError, match=r"replicates\.npz: cannot be read as replicates\. Remove it"):
        made(problem, replicates=100, keep=tmp_path)
