"""What is drawn anew: how often, together with what, and with which moments."""

from __future__ import annotations

import math

import numpy as np
import pytest
from bootstrap_scenes import fitted, scene
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refused

from ifrfit.errors import UsageError
from ifrfit.inference.bootstrap.schemes import (
    Cases,
    Residuals,
    Wild,
    corrected,
    draw_replicates,
    kinds_of,
    make_scheme,
    number_impacts,
)

N = 2000


def draws(scheme, n: int = N) -> np.ndarray:
    """Counts or shifts of n replicates."""
    drawn = [scheme.draw(np.random.default_rng(seed)) for seed in np.random.SeedSequence(7).spawn(n)]
    return np.array([count if shift is None else shift for count, shift in drawn])


@settings(max_examples=25)
@given(n=st.integers(5, 12), series=st.integers(1, 3), joint=st.booleans(), seed=st.integers(0, 2**32))
def test_cases_keep_the_number_of_impacts_of_each_series_and_kind(n, series, joint, seed) -> None:
    problem = scene(n, series=series, joint=joint)
    counts, shift = Cases.of(problem).draw(np.random.default_rng(seed))
    assert shift is None
    for number in range(series):
        for which in range(2):
            own = (problem.rows.series == number) & (problem.rows.which == which)
            assert counts[own].sum() == n
    impact = number_impacts(problem)
    for one in np.unique(impact):
        assert np.unique(counts[impact == one]).size == 1


def test_counts_are_multinomial() -> None:
    n = 10
    counts = draws(Cases.of(scene(n, ("beta",), fix={"e_n": 0.9})))
    error = 5.0 / math.sqrt(N)
    assert counts.mean(axis=0) == pytest.approx(np.ones(n), abs=error)
    assert counts.var(axis=0) == pytest.approx(np.full(n, 1.0 - 1.0 / n), abs=3.0 * error)
    assert np.corrcoef(counts.T)[0, 1:] == pytest.approx(np.full(n - 1, -1.0 / (n - 1)), abs=error)


def test_a_missing_cell_makes_no_kind_of_its_own_but_another_experiment_does() -> None:
    joint = scene(8, ("beta", "e_n"), joint=True)
    names = np.array(joint.rows.names)[joint.rows.which]
    first_e_n = int(np.flatnonzero(names == "e_n")[0])
    part = joint.with_rows(np.delete(np.arange(16), first_e_n))
    (kind,) = kinds_of(part, number_impacts(part))
    assert kind.impacts.size == 8
    assert kind.observables == ("beta", "e_n")
    apart = scene(8)
    assert [kind.observables for kind in kinds_of(apart, number_impacts(apart))] == [("beta",), ("e_n",)]


def test_impacts_that_a_third_one_links_are_of_one_kind() -> None:
    problem = scene(3, ("beta", "e_n", "tan_psi_after"), joint=True)
    names = np.array(problem.rows.names)[problem.rows.which]
    impact = number_impacts(problem)
    kept = ((impact == 0) & (names == "beta")) | ((impact == 1) & (names == "e_n"))
    kept |= (impact == 2) & (names != "tan_psi_after")
    problem = problem.with_rows(np.flatnonzero(kept))
    (kind,) = kinds_of(problem, number_impacts(problem))
    assert kind.impacts.tolist() == [0, 1, 2]


def test_residuals_are_centred_and_have_the_variance_of_their_noise() -> None:
    problem, found = fitted(scene(60, noise="unknown", seed=3))
    scheme = Residuals.of(problem, found)
    drawn = problem.rows.value + draws(scheme) - problem.predict(found.optimum.theta)
    for name, rows in problem.groups().items():
        sigma = found.noise[name]
        assert drawn[:, rows].mean() == pytest.approx(0.0, abs=5.0 * sigma / math.sqrt(N * rows.size))
        # leverage-corrected residuals have the variance that the fit gives the noise, but for centring
        assert drawn[:, rows].std() == pytest.approx(sigma, rel=0.03)


def test_unknown_noises_do_not_mix_and_given_ones_do() -> None:
    problem, found = fitted(scene(30, noise="unknown"))
    pools = Residuals.of(problem, found).pools
    assert [rows.size for rows, _ in pools] == [30, 30]
    problem, found = fitted(scene(30, noise="known"))
    ((rows, pool),) = Residuals.of(problem, found).pools
    assert rows.size == pool.size == 60
    assert pool.std() == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize(("name", "third"), [("wild", 0.0), ("wild-mammen", 1.0)])
def test_wild_weights_have_the_moments_they_are_named_for(name, third) -> None:
    problem, found = fitted(scene(12, joint=True))
    scheme = make_scheme(name, problem, found)
    assert isinstance(scheme, Wild)
    residual = corrected(problem, found)
    weight = (draws(scheme, 2 * N) + problem.rows.value - problem.predict(found.optimum.theta)) / residual
    error = 5.0 / math.sqrt(len(weight))
    assert weight.mean(axis=0) == pytest.approx(np.zeros(24), abs=error)
    assert (weight**2).mean(axis=0) == pytest.approx(np.ones(24), abs=2.0 * error)
    assert (weight**3).mean(axis=0) == pytest.approx(np.full(24, third), abs=4.0 * error)
    # beta and e_n of one impact share their weight, those of two impacts do not
    assert weight[:, :12] == pytest.approx(weight[:, 12:], rel=1e-9)
    assert abs(np.corrcoef(weight[:, 0], weight[:, 1])[0, 1]) < error


@pytest.mark.parametrize("name", ["cases", "residual", "wild"])
def test_means_of_priors_are_drawn_about_the_data_or_the_fit(name) -> None:
    problem, found = fitted(scene(12, prior={"e_n": (0.8, 0.03)}))
    lot = draw_replicates(problem, make_scheme(name, problem, found), np.random.SeedSequence(1).spawn(N))
    center = 0.8 if name == "cases" else found.optimum.theta[0]
    assert lot.prior[:, 0].mean() == pytest.approx(center, abs=5.0 * 0.03 / math.sqrt(N))
    assert lot.prior[:, 0].std() == pytest.approx(0.03, rel=0.06)
    assert np.isnan(lot.prior[:, 1:]).all()


def test_too_little_to_draw_from_is_said_with_the_remedy() -> None:
    problem, found = fitted(scene(12).with_rows(np.arange(14)))
    assert "2 impacts with e_n in s0" in Cases.of(problem).shortage
    assert "--prior" in Cases.of(problem).shortage
    assert Residuals.of(problem, found).shortage == ""  # known noise: all rows share their residuals
    alone = fitted(scene(12).with_rows(np.arange(13)))
    assert "1 row met exactly" in Wild.of(*alone).shortage
    assert Cases.of(scene(12)).shortage == ""
    assert Wild.of(*fitted(scene(12))).shortage == ""
    assert "4 in s0/beta; 4 in s0/e_n" in Residuals.of(*fitted(scene(4, noise="unknown"))).shortage


def test_what_cannot_be_drawn_is_refused() -> None:
    problem, found = fitted(scene(12))
    with refused(UsageError, match="choose one of cases, residual, wild, wild-mammen"):
        make_scheme("jackknife", problem, found)
    problem, found = fitted(scene(12, series=2, separate=("mu", "e_n", "e_t"), prior={"mu": (0.15, 0.1)}))
    with refused(UsageError, match="one prior of mu"):
        make_scheme("wild", problem, found)
    assert make_scheme("cases", problem, found).name == "cases"
