"""Ends of domains that cut what groups say: named where they may move a population, and nowhere else."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from ifrfit.campaign.population.coordinate import Coordinate
from ifrfit.campaign.population.domain_ends import _of_cut_laws, cuts_of, cuts_of_limits, moved_by_ends
from ifrfit.campaign.population.limits import Limits
from ifrfit.campaign.report.text import cut_by_ends
from ifrfit.campaign.run import run_campaign
from ifrfit.inference.model.parameters import Parameter
from ifrfit.physics import rebound

E_T = Parameter("e_t", -1.0, -0.4)
MU = Parameter("mu", 0.0, np.inf)


def row(middle, half, correlation=0.5, **others):
    return {
        "failure": "",
        "e_t_lo68": middle - half,
        "e_t_hi68": middle + half,
        "mu_lo68": 0.19,
        "mu_hi68": 0.21,
        "correlation_e_t_mu": correlation,
        **others,
    }


@pytest.mark.parametrize("mean", [-1.5, -0.5, 0.0, 1.0, 2.5])
def test_the_law_of_a_mean_that_an_end_moves(mean):
    law = stats.truncnorm(-mean, np.inf, loc=mean)
    low, high = law.ppf([0.16, 0.84])
    moved = np.interp((high + low) / (high - low), *_of_cut_laws())
    assert moved == pytest.approx(min((law.mean() - mean) / law.std(), 1.0), rel=0.01, abs=1e-4)


def test_an_end_near_all_groups_moves_what_is_correlated():
    rows = [row(-0.98, 0.015)] * 40
    ours, theirs = (
        cuts_of(name, np.arange(40), rows, moved_by_ends(rows, (E_T, MU))) for name in ("e_t", "mu")
    )
    assert [(each.constant, each.end, each.groups) for each in (*ours, *theirs)] == [("e_t", -1.0, 40)] * 2
    assert theirs[0].shift == pytest.approx(0.5 * ours[0].shift)
    assert cuts_of("kappa", np.arange(40), rows, moved_by_ends(rows, (E_T, MU))) == theirs


@pytest.mark.parametrize(
    ("rows", "parameter"),
    [
        ([row(-0.7, 0.05)] * 40, E_T),  # far from both ends
        ([row(-0.98, 0.015)] + [row(-0.7, 0.05)] * 39, E_T),  # one of forty
        ([row(-0.98, 0.015, correlation=0.001)] * 40, E_T),  # mu does not go along
        ([row(-0.98, 0.015, failure="no data")] * 40, E_T),
        ([row(-0.98, 0.015)] * 40, Parameter("e_t", -1.0, -0.4, fixed=-0.98)),
        ([row(-0.98, 0.015)] * 40, Parameter("e_t", -0.999, -0.4, passive=(-1.0, -0.4))),  # told elsewhere
    ],
    ids=["far", "one", "uncorrelated", "failed", "fixed", "bounds of the user"],
)
def test_an_end_that_moves_nothing_is_not_named(rows, parameter):
    assert cuts_of("mu", np.arange(len(rows)), rows, moved_by_ends(rows, (parameter, MU))) == ()


def limits(upper, lower=0):
    side = np.concatenate((-np.ones(upper), np.ones(lower)))
    return Limits(np.zeros(side.size), np.ones(side.size), side, np.ones(side.size))


def test_many_limits_near_an_end_are_named():
    by = Coordinate(-1.0, 1.0)
    (found,) = cuts_of_limits("e_t", by, limits(40), 60, 0.9)
    assert (found.constant, found.end, found.groups) == ("e_t", -1.0, 40)
    assert found.shift == pytest.approx(0.55 * np.sqrt(60))
    (upper,) = cuts_of_limits("e_n", Coordinate(0.0, 1.0), limits(2, 20), 78, 0.9)
    assert (upper.end, upper.groups) == (1.0, 20)
    assert 0.0 < upper.shift < found.shift


@pytest.mark.parametrize(
    ("by", "of", "shrinkage"),
    [
        (Coordinate(-1.0, 1.0), limits(5), 0.9),  # few
        (Coordinate(-1.0, 1.0), limits(40), 0.1),  # groups that differ
        (Coordinate(0.0, np.inf), limits(0, 40), 0.9),  # no end: mu where no impact slides
        (Coordinate(-1.0, 1.0), Limits.none(), 0.9),
    ],
    ids=["few", "unlike", "no end", "none"],
)
def test_limits_that_move_nothing(by, of, shrinkage):
    assert cuts_of_limits("e_t", by, of, 60, shrinkage) == ()


def test_e_t_of_like_groups_of_which_many_give_limits_is_not_far_off_without_a_word(tmp_path):
    """The median was up to 6 standard errors low, and nothing was said."""
    off = [_off_where_many_give_limits(tmp_path / f"{seed}", seed) for seed in range(4)]
    assert np.mean(off) < -1.0


def _off_where_many_give_limits(folder, seed):
    """By how many standard errors the median of equal groups is off, which has to be said."""
    folder.mkdir()
    rng = np.random.default_rng(seed)
    groups, impacts, sigma, e_t = 150, 12, 0.04, -0.95
    gamma = rng.uniform(20.0, 75.0, groups * impacts)
    state = rebound(gamma, 0.0, 0.0, degrees=True, e_n=0.8, e_t=e_t, mu=0.2)
    noise = sigma * rng.standard_normal((2, gamma.size))
    columns = {"run": np.repeat(np.arange(groups), impacts).astype(str), "gamma_deg": gamma}
    columns |= {"beta": state.beta + noise[0], "e_n": 0.8 + noise[1], "sigma_beta": sigma, "sigma_e_n": sigma}
    path = folder / "all.parquet"
    pd.DataFrame(columns).to_parquet(path, index=False)
    found, _ = run_campaign([path], ["run"], folder / "out", lambda _: [], facts=False)
    one = next(each for each in found.populations if each.name == "e_t")
    assert one.limits > 0.1 * groups
    error = 0.25 * np.diff(one.by.to(np.array([one.centre.lo95, one.centre.hi95]).ravel()))[0]
    off = float(one.by.to(np.array([one.centre.median]).ravel())[0] - one.by.to(np.array([e_t]))[0]) / error
    (said,) = (each for each in one.cut if each.constant == "e_t" and each.groups == one.limits)
    assert abs(off) < said.shift + 2.0
    assert any("e_t: the end -1 of its own domain" in line for line in cut_by_ends(found))
    return off
