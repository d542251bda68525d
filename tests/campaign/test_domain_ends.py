"""Ends of domains that cut what groups say: named where they may move a population, and nowhere else."""

import numpy as np
import pytest
from scipy import stats

from ifrfit.campaign.population.domain_ends import _of_cut_laws, cuts_of, moved_by_ends
from ifrfit.inference.model.parameters import Parameter

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
