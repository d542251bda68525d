"""A noise that rests on one degree of freedom is said, and printed numbers keep their digits."""

from __future__ import annotations

import numpy as np
import pytest
from factories import table_file

from ifrfit import fit, rebound


def fitted(folder, n, seed=5, **choices):
    rng, gamma = np.random.default_rng(300 + seed), np.linspace(10.0, 75.0, n)
    state = rebound(gamma, e_n=0.9, e_t=-0.7, mu=0.15, degrees=True)
    beta, e_n = state.beta + 0.01 * rng.standard_normal(n), 0.9 + 0.01 * rng.standard_normal(n)
    columns = {"gamma_deg": gamma, "beta": beta, "e_n": e_n}
    return fit(table_file(folder / "t.csv", columns), **choices)


@pytest.mark.parametrize("method", ["lsq", "profile", "exact"])
def test_three_impacts_say_that_their_noise_is_a_guess(tmp_path, method):
    found = fitted(tmp_path, 3, method=method)
    fact = found.facts["noise_dof"]
    assert fact.says.startswith("the noise of beta rests on 1 degree of freedom")
    assert list(fact.figures["dof"].values()) == pytest.approx([1.0])
    assert found.summary().startswith("LOOK  a noise rests on one degree of freedom")


@pytest.mark.parametrize("choices", [{}, {"fix": {"e_t": -0.7}}], ids=str)
def test_more_do_not(tmp_path, choices):
    assert "noise_dof" not in fitted(tmp_path, 5, method="lsq", **choices).facts


def test_intervals_have_the_tails_of_student(tmp_path):
    e_t = fitted(tmp_path, 3, method="lsq").constants["e_t"]
    assert np.ptp(e_t.interval95) / 2.0 == pytest.approx(12.7062 * e_t.stderr, rel=1e-2)


def test_heavy_tails_hide_no_digit(tmp_path):
    """The sd of a posterior with such tails is many times the width of its interval."""
    found = fitted(tmp_path, 3)
    e_t = found.constants["e_t"]
    line = next(line for line in found.summary().splitlines() if line.startswith("  e_t"))
    low, high = (float(x) for x in line.partition("[")[2].partition("]")[0].split(","))
    assert high - low == pytest.approx(np.ptp(e_t.interval95), rel=0.1)
    noise = next(line for line in found.summary().splitlines() if line.startswith("  noise"))
    assert float(noise.split()[1]) > 0.0
