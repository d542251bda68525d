"""The search from many starts, where no proof is known."""

from __future__ import annotations

import numpy as np
import pytest
from simulated import simulated
from strangers import draw

from ifrfit import fit, rebound
from ifrfit.inference.optimize.multistart import multistart


@pytest.mark.parametrize("seed", range(4))
def test_repeated_angles_do_not_crowd_the_starts(seed):
    """Six readings at each of two angles: the optimum is no worse than the constants that made them."""
    rng = np.random.default_rng(seed)
    gamma = np.repeat([15.4, 43.4], 6)
    made = rebound(gamma, degrees=True, e_n=0.664, e_t=-0.82, mu=0.19)
    exact = np.concatenate([np.degrees(np.arctan2(made.v_x, made.v_n)), np.full(12, 0.664)])
    sigma, errors = np.repeat([0.48, 0.008], 12), rng.standard_normal(24)
    values = np.round(exact + sigma * errors, 6)
    data = simulated(np.repeat(["delta_deg", "e_n"], 12), np.tile(gamma, 2), values, sigma)
    result = fit(data, method="lsq")
    assert result.fit.chi2 < errors @ errors + 1e-3
    assert result.facts["lack_of_fit"].ok


@pytest.mark.parametrize(("number", "better"), [(130, (0.182, -0.4, 0.386)), (246, (1.0, -0.407, 0.0804))])
def test_the_best_of_many_minima_is_among_those_that_are_followed(tmp_path, number, better):
    """Drawn tables whose lowest minimum lies downhill from none of the eight lowest starts."""
    path = tmp_path / "table.csv"
    table = draw(11, number)
    path.write_text(table.text, encoding="utf-8")
    problem = table.problem(path)
    found = multistart(problem, problem.noise.base)
    near = multistart(problem, problem.noise.base, np.array(better))
    assert found.objective <= near.objective + 1e-6
