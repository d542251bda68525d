"""Groups of rows with noises of their own that disagree: quadrature meets the mass about every mode."""

from __future__ import annotations

import numpy as np
import pytest
from factories import rest_long
from strangers import draw

from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.inference.posterior.integrators import exact_posterior, sampled_posterior


@pytest.mark.parametrize("number", rest_long([124, 233]))
def test_quadrature_sees_the_modes_that_importance_sampling_sees(tmp_path, number):
    """Drawn tables: 88 % and 5 % of the mass lay where no node was, and the error claimed to be 6e-5 sd."""
    path = tmp_path / "table.csv"
    table = draw(12, number)
    path.write_text(table.text, encoding="utf-8")
    problem = table.problem(path)
    start = least_squares(problem)
    assert start.rivals
    grid = exact_posterior(problem, start=start, integrator="quadrature")
    draws = sampled_posterior(problem, start)
    # of 233 means and sds move by 8e-4, but the end of a noise's long tail by 1.9e-3: quantiles count, too
    assert grid.converged or grid.error < 2e-3
    assert draws.converged
    assert abs(grid.log_evidence - draws.log_evidence) < 5.0 * draws.error_evidence
    for name in problem.parameters.free_names:
        assert abs(grid.mean(name) - draws.mean(name)) < 5.0 * draws.error * draws.sd(name)
        assert grid.sd(name) == pytest.approx(draws.sd(name), rel=0.1)


def test_known_rows_of_e_n_beside_others_have_no_say_in_the_closure_constant(tmp_path):
    """A drawn table under `mixed`: rows of known sigma, of e_n among them, beside others of unknown sigma."""
    path = tmp_path / "table.csv"
    table = draw(13, 275)
    path.write_text(table.text, encoding="utf-8")
    assert np.isfinite(exact_posterior(table.problem(path)).log_evidence)
