"""Profiles of series that share some constants, against everything held on a fine grid."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from factories import rest_long
from hard_cases.synthetic import FAN, HEADER, noise, rows, values

import ifrfit
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, least_squares
from ifrfit.inference.optimize.solve import solve
from ifrfit.inference.profile.objective import Misfit
from ifrfit.inference.profile.profile_all import profile_all
from ifrfit.inference.profile.quantities import entry
from ifrfit.inference.profile.searched_profile import SearchedProfile
from ifrfit.inference.profile.types import ProfileLikelihood

DROPS = (5.0, 10.0)
# what profiles cost grows with the rows and the constants
SPARSE, E_T = FAN[::3], {"e_t": -0.9}


def two_series(sigma_e_n: float | None) -> str:
    """Beta in two series of different friction; drops in the first where sigma_e_n is given."""
    text = HEADER
    for seed, (series, mu) in enumerate((("first", 0.12), ("second", 0.2)), start=1):
        beta = values(SPARSE, "beta", e_t=-0.9, mu=mu) + noise(len(SPARSE), 0.02, seed)
        text += rows(SPARSE, beta, 0.02, "beta", series)
    if sigma_e_n is not None:
        text += rows(DROPS, np.array([0.9, 0.7]), sigma_e_n, "e_n", "first")
    return text


def question(folder: Path, sigma_e_n: float | None, **options: object) -> tuple[Problem, LeastSquaresFit]:
    path = folder / "impacts.csv"
    path.write_text(two_series(sigma_e_n))
    problem = ifrfit.fit(path, method="lsq", **options).problem
    return problem, least_squares(problem)


def test_mu_of_a_series_goes_with_an_open_restitution(tmp_path: Path) -> None:
    problem, fit = question(tmp_path, None, separate="mu", fix=E_T)
    found = profile_all(problem, fit, curves=False)
    assert found["e_n"].shape == "flat"
    for series in ("first", "second"):
        mu, kappa = found[f"mu[{series}]"], found[f"kappa[{series}]"]
        assert kappa.status == "determined"
        assert (mu.status, mu.has_value) == ("not_determined", False)
        for level in ("central68", "central95"):
            low, high = getattr(kappa, level)
            assert getattr(mu, level) == pytest.approx((low / 2.0, high), rel=1e-5)
    # the control: with the restitution given nothing is left to go along with
    known = profile_all(*question(tmp_path, None, separate="mu", fix={**E_T, "e_n": 0.94}), curves=False)
    low, high = found["kappa[first]"].central95
    assert known["mu[first]"].central95 == pytest.approx((low / 1.94, high / 1.94), rel=1e-5)


@pytest.mark.parametrize("separate", [("mu",), ("e_t", "mu"), ("e_n", "mu"), ("e_t",)], ids="+".join)
@pytest.mark.parametrize("sigma_e_n", rest_long((0.3, None, 0.02)))
@pytest.mark.parametrize("places", [4, pytest.param(21, marks=pytest.mark.long)])
def test_a_held_mu_leaves_e_n_to_the_slope(
    separate: tuple[str, ...], sigma_e_n: float | None, places: int, tmp_path: Path
) -> None:
    problem, fit = question(tmp_path, sigma_e_n, separate=separate)
    misfit, positions = Misfit.of(problem, fit), problem.parameters.positions
    i_e, i_mu = int(positions["e_n"][0]), int(positions["mu"][0])
    mu = float(fit.optimum.theta[i_mu])
    for value in (mu * np.array([0.5, 0.75, 1.2])).tolist():  # one value alone, without neighbours to follow
        searched = SearchedProfile(misfit, entry(problem, fit, i_mu).constraint, mu)
        rise = float(searched(np.array([value]))[0])
        names = problem.parameters.names
        for e_n in np.linspace(0.0, 1.0, places).tolist():
            held = problem.with_fixed({names[i_mu]: value, names[i_e]: e_n})
            assert rise <= misfit.rise(solve(held, fit.sigma).theta) + 1e-7


@pytest.mark.parametrize("prior", [{}, {"e_n": (0.8, 0.15)}], ids=["rows", "prior"])
def test_a_weak_restitution_widens_mu_of_each_series(
    prior: dict[str, tuple[float, float]], tmp_path: Path
) -> None:
    problem, fit = question(tmp_path, None if prior else 0.2, separate="mu", prior=prior, fix=E_T)
    found = profile_all(problem, fit, curves=False)
    mu, kappa, e_n = found["mu[second]"], found["kappa[second]"], found["e_n"]

    def relative(profile: ProfileLikelihood, of: float) -> float:
        low, high = profile.central68
        return (high - low) / (2.0 * of)

    # errors of kappa and 1 + e_n add in quadrature, as kappa = mu (1 + e_n)
    together = math.hypot(relative(kappa, kappa.value), relative(e_n, 1.0 + e_n.value))
    assert relative(mu, mu.value) == pytest.approx(together, rel=0.15)
    assert relative(mu, mu.value) > 1.5 * relative(kappa, kappa.value)
