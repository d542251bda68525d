"""Single entries of separate constants that are fixed stay so, and the rest is at its best about them."""

from __future__ import annotations

import pytest

import ifrfit
from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.inference.optimize.multistart import multistart

SERIES = ["no spin", "spin 0.225"]


@pytest.mark.parametrize("separate", [("mu",), ("e_t", "mu"), ("e_t",)], ids="+".join)
@pytest.mark.parametrize("noise", ["known", "scaled"])
def test_a_fixed_entry_stays_where_it_is(separate, noise):
    fit = ifrfit.fit(
        "cross-2019", method="lsq", fix={"e_n": 0.94}, series=SERIES, separate=separate, noise=noise
    )
    free = fit.problem
    name, value = f"{separate[0]}[no spin]", {"mu": 0.15, "e_t": -0.8}[separate[0]]
    problem = free.with_fixed({name: value})
    found = least_squares(problem)
    at = problem.parameters.names.index(name)
    assert found.optimum.theta[at] == value
    assert found.optimum.certified
    # an independent search, at the noise that was found
    searched = multistart(problem, found.sigma)
    assert found.optimum.objective == pytest.approx(searched.objective, rel=1e-8)
    assert found.optimum.theta == pytest.approx(searched.theta, rel=1e-4)
    # the control: left free it goes elsewhere
    assert abs(least_squares(free).optimum.theta[at] - value) > 0.02
