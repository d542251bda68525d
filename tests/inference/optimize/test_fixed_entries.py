"""Single entries of separate constants that are fixed stay so, and the rest is at its best about them."""

from __future__ import annotations

import pytest

import ifrfit
from ifrfit.errors import UsageError
from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.inference.optimize.multistart import multistart
from ifrfit.inference.posterior import integrate

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


def test_the_posterior_of_a_series_with_a_fixed_entry_is_that_of_the_series_alone():
    choices = {"method": "lsq", "noise": "known"}
    both = ifrfit.fit("cross-2019", series=SERIES, separate=("mu", "e_t"), fix={"e_n": 0.94}, **choices)
    alone = ifrfit.fit("cross-2019", series=SERIES[0], fix={"e_n": 0.94, "e_t": -0.8}, **choices)
    found = integrate(both.problem.with_fixed({"e_t[no spin]": -0.8}))
    right = integrate(alone.problem)
    assert "e_t[no spin]" not in found.names
    assert found.mean("mu[no spin]") == pytest.approx(right.mean("mu"), rel=1e-5)
    assert found.sd("mu[no spin]") == pytest.approx(right.sd("mu"), rel=1e-3)


def test_a_fixed_entry_that_ties_e_n_to_kappa_is_never_separated_from_it():
    free = ifrfit.fit("cross-2019", series=SERIES, separate="mu", prior={"e_n": (0.94, 0.02)}, method="lsq")
    with pytest.raises(UsageError, match="does not fit into memory"):
        integrate(free.problem.with_fixed({"mu[no spin]": 0.15}))
