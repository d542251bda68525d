"""Where e_n (or mu) is fixed, kappa = mu (1 + e_n) is the other one times a number, by every method."""

from __future__ import annotations

import math
from typing import Any

import pytest
from factories import rest_long

import ifrfit
from ifrfit import Bootstrap
from ifrfit.inference.result.types import Estimate

GAMMA = [5.0, 15.0, 25.0, 35.0, 45.0, 60.0, 75.0]
METHODS = {
    "lsq": {"method": "lsq"},
    "profile": {"method": "profile"},
    "exact": {"method": "exact"},
    "bootstrap": {"method": Bootstrap(replicates=100)},
    "wild": {"method": Bootstrap("wild", replicates=100)},
}
CHOICES: dict[str, dict[str, Any]] = {
    "free": {},
    "on the upper bound": {"bounds": {"mu": (0.0, 0.085)}},
    "near the upper bound": {"bounds": {"mu": (0.0, 0.091)}},
    "on the lower bound": {"bounds": {"mu": (0.1, 0.4)}},
    "between near bounds": {"bounds": {"mu": (0.08, 0.095)}},
    "hardly open": {"bounds": {"mu": (0.0895, 0.0896)}},
    "prior": {"prior": {"mu": (0.09, 0.0002)}},
    "prior and bound": {"prior": {"mu": (0.08, 0.001)}, "bounds": {"mu": (0.0, 0.085)}},
    "only sticking": {"gamma_max": 20.0, "gamma_min": None},
    "known noise": {"noise": "known", "bounds": {"mu": (0.0, 0.085)}},
    "unknown noise": {"noise": "unknown", "bounds": {"mu": (0.0, 0.085)}},
}


def times(interval: tuple[float, float], factor: float) -> tuple[float, float]:
    return interval[0] * factor, interval[1] * factor


def assert_scaled(one: Estimate, other: Estimate, factor: float) -> None:
    assert one.status == other.status
    assert (one.value is None) == (other.value is None)
    size = (
        1e-4 * abs(other.interval95[0] - other.interval95[1]) if math.isfinite(other.interval95[1]) else 1e-9
    )
    assert one.interval68 == pytest.approx(times(other.interval68, factor), rel=1e-9, abs=size)
    assert one.interval95 == pytest.approx(times(other.interval95, factor), rel=1e-9, abs=size)
    if other.value is not None:
        assert one.value == pytest.approx(factor * other.value, rel=1e-9, abs=size)
        assert one.stderr == pytest.approx(factor * (other.stderr or 0.0), rel=1e-3, abs=1e-15)


# every choice by the optimum and the posterior, every method by choices of each kind
EVERYWHERE = ("lsq", "exact")
KINDS = ("free", "on the upper bound", "prior and bound")
PAIRS = [
    pytest.param(method, choice, marks=() if method in EVERYWHERE or choice in KINDS else pytest.mark.long)
    for choice in CHOICES
    for method in METHODS
]


@pytest.mark.parametrize(("method", "choice"), PAIRS)
def test_mu_and_kappa_agree_where_e_n_is_fixed(method: str, choice: str) -> None:
    found = ifrfit.fit(
        "kharaz-2001", fix={"e_n": 0.98}, **{"gamma_min": 15.0, **CHOICES[choice], **METHODS[method]}
    )
    mu, kappa = found.constants["mu"], found.derived["kappa"]
    assert isinstance(mu, Estimate)
    assert_scaled(kappa, mu, 1.98)
    low, high = CHOICES[choice].get("bounds", {}).get("mu", (0.0, math.inf))
    for estimate, factor in ((mu, 1.0), (kappa, 1.98)):
        slack = 1e-12 * factor
        assert estimate.interval95[0] >= factor * low - slack
        assert estimate.interval95[1] <= factor * high + slack
    if choice.startswith("on the"):
        bound = low if "lower" in choice else high
        assert mu.status == kappa.status == "one_sided"
        assert mu.reason == f"lies on its bound {bound:g}"
        assert kappa.reason == f"lies on its bound {1.98 * bound:g}"


@pytest.mark.parametrize("method", METHODS)
def test_e_n_and_kappa_agree_where_mu_is_fixed(method: str) -> None:
    found = ifrfit.fit(
        "kharaz-2001", fix={"mu": 0.09}, prior={"e_n": (0.98, 0.01)}, gamma_min=15.0, **METHODS[method]
    )
    e_n, kappa = found.constants["e_n"], found.derived["kappa"]
    assert isinstance(e_n, Estimate)
    assert e_n.status == kappa.status
    expected = tuple(0.09 * (1.0 + end) for end in e_n.interval95)
    assert kappa.interval95 == pytest.approx(expected, abs=1e-4 * (expected[1] - expected[0]))


@pytest.mark.parametrize("method", rest_long(("exact", "lsq", "profile", "bootstrap", "wild"), 2))
def test_by_series_each_kappa_follows_its_own_mu(impacts, method: str) -> None:
    one = {"gamma": GAMMA, "noise": 0.03, "series": "a"}
    path = impacts(one, {**one, "series": "b", "mu": 0.2, "seed": 1})
    found = ifrfit.fit(
        path, fix={"e_n": 0.94}, separate=["mu"], bounds={"mu": (0.0, 0.17)}, **METHODS[method]
    )
    for series in ("a", "b"):
        mu = found.constants["mu"]
        assert not isinstance(mu, Estimate)
        assert_scaled(found.derived["kappa"][series], mu[series], 1.94)
    assert found.derived["kappa"]["b"].status == "one_sided"


def test_what_follows_from_a_constant_names_whose_bound_it_lies_on():
    """An angle in degrees and a beta lie on no bound of kappa or e_t."""
    found = ifrfit.fit(
        "kharaz-2001", fix={"e_n": 0.98}, bounds={"mu": (0.0, 0.085)}, gamma_min=15, method="lsq"
    )
    assert found.derived["kappa"].reason == "lies on its bound 0.1683"
    assert found.transitions["kratos"].reason == "kappa lies on its bound 0.1683"
    glass = ifrfit.fit("cornell-glass", method="lsq")
    assert glass.constants["e_t"].reason == "lies on its bound -1"
    assert glass.derived["beta_sticking"].reason == "e_t lies on its bound -1"


@pytest.mark.parametrize("method", rest_long(("bootstrap", "lsq", "profile", "exact")))
def test_no_transition_where_its_own_constant_is_open(method: str) -> None:
    # e_n and mu alone: sticking ends at kappa/(1 + beta0), and no row says anything of beta0
    of_fr = ifrfit.fit("netl-glass-acrylic", closure="fr", method=method)
    assert of_fr.constants["beta0"].value is None
    assert of_fr.derived["transition_angle_deg"] == {"glass-acrylic": None}
    of_ifr = ifrfit.fit("netl-glass-acrylic", method=method)  # at 2/7 of kappa, whatever e_t is
    assert of_ifr.derived["transition_angle_deg"]["glass-acrylic"].status == "determined"
