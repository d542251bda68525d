from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from factories import rest_long
from hard_cases.synthetic import GRAZING, STEEP, question, table
from scipy import special

import ifrfit
from ifrfit.inference.diagnostics.interval_comparison import intervals
from ifrfit.inference.diagnostics.interval_disagreements import disagreements
from ifrfit.inference.posterior import integrate

Z = float(special.ndtri(0.975))


@dataclass(frozen=True)
class Gaussian:
    """A stand-in for the posterior: a normal law a quantity."""

    laws: Mapping[str, tuple[float, float]]

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.laws)

    def quantile(self, name: str, p: np.ndarray) -> np.ndarray:
        mean, sd = self.laws[name]
        return mean + sd * special.ndtri(p)


def row(**values) -> pd.DataFrame:
    default = {
        "covariance_low": -1.0, "covariance_high": 1.0, "profile_low": -1.0, "profile_high": 1.0,
        "exact_low": -1.0, "exact_high": 1.0, "lower": -9.0, "upper": 9.0, "shape": "bounded",
        "noise_dof": math.inf,
    }  # fmt: skip
    return pd.DataFrame([{**default, **values}], index=["e_t"])


def test_linear_data_have_one_interval(tmp_path: Path) -> None:
    problem, fit = question(tmp_path, table(GRAZING, sigma=0.01, seed=1, e_t=-0.9))
    sd = {
        name: math.sqrt(fit.gaussian.variance(fit.gaussian.to_theta[i], 1.0))
        for i, name in enumerate(problem.parameters.names)
    }
    value = dict(zip(problem.parameters.names, fit.optimum.theta.tolist(), strict=True))
    laws = {name: (value[name], sd[name]) for name in ("e_t", "mu")}
    laws["kappa"] = value["mu"] * 1.94, sd["mu"] * 1.94
    found = intervals(problem, fit, Gaussian(laws))
    assert list(found.index) == ["e_t", "mu", "kappa"]
    for name, (mean, spread) in laws.items():
        for method in ("covariance", "profile", "exact"):
            ends = found.loc[name, [f"{method}_low", f"{method}_high"]].tolist()
            assert ends == pytest.approx([mean - Z * spread, mean + Z * spread], abs=1e-6)
    assert disagreements(found) == ()
    # the control: a posterior half as wide is noticed
    narrow = Gaussian({name: (mean, 0.5 * spread) for name, (mean, spread) in laws.items()})
    assert len(disagreements(intervals(problem, fit, narrow))) == 3


def test_the_covariance_is_not_cut(tmp_path: Path) -> None:
    problem, fit = question(tmp_path, table(sigma=0.05, seed=1))
    found = intervals(problem, fit, None)
    assert found.loc["e_t", "covariance_low"] < -1.0 == found.loc["e_t", "profile_low"]
    middle = 0.5 * (found.loc["e_t", "covariance_low"] + found.loc["e_t", "covariance_high"])
    assert middle == pytest.approx(float(fit.optimum.theta[1]))
    assert found["exact_low"].isna().all()
    assert disagreements(found) == ()


def test_open_and_unknown(tmp_path: Path) -> None:
    problem, fit = question(tmp_path, table(STEEP, seed=1, true_sigma=0.01))
    found = intervals(problem, fit, None)
    assert found.loc["mu", "covariance_low"] == -math.inf
    assert found.loc["mu", "profile_high"] == math.inf
    assert found.loc["e_t", "noise_dof"] == pytest.approx(len(STEEP) - 1)


@pytest.mark.parametrize(
    ("values", "says"),
    [
        (
            {"covariance_low": -2.0, "covariance_high": 2.0, "lower": -1.5},
            "e_t: the covariance interval [-2.00, 2.00] is 2 times as wide as the exact one; believe the "
            "exact one, [-1.00, 1.00]: the covariance goes on beyond the bound -1.5.",
        ),
        (
            {"covariance_low": -0.5, "covariance_high": 0.5, "noise_dof": 4.0},
            "e_t: the covariance interval [-0.50, 0.50] has 50 % of the width of the exact one; believe the "
            "exact one, [-1.00, 1.00]: the noise rests on few points (4 degrees of freedom).",
        ),
        (
            {"profile_low": -1.6, "profile_high": 0.4},
            "e_t: the profile interval [-1.60, 0.40] has an end off by 30 % of the width; believe the exact "
            "one, [-1.00, 1.00]: the misfit is no parabola: it bends where impacts begin to slide.",
        ),
        (
            {"profile_low": -0.1, "profile_high": 0.2, "noise_dof": 23.0},
            "e_t: the profile interval [-0.100, 0.200] has 15 % of the width of the exact one; believe the "
            "exact one, [-1.00, 1.00]: far from its least the misfit rises no further, and the width of the "
            "prior counts there.",
        ),
        (
            {"covariance_low": 0.4, "shape": "multimodal"},
            "e_t: the covariance interval [0.400, 1.000] has 30 % of the width of the exact one; believe the "
            "exact one, [-1.00, 1.00]: several optima describe the data, and it weighs them.",
        ),
        (
            {"covariance_low": -math.inf, "covariance_high": math.inf},
            "e_t: the covariance interval [-inf, inf] is open; believe the exact one, [-1.00, 1.00]: "
            "the data alone leave it open, so its ends come from the domain and the prior.",
        ),
    ],
)
def test_each_disagreement_has_its_sentence(values: dict[str, object], says: str) -> None:
    assert disagreements(row(**values)) == (says,)


def test_widths_disagree_beyond_a_factor() -> None:
    assert disagreements(row(covariance_low=-1.24, covariance_high=1.24)) == ()
    assert len(disagreements(row(covariance_low=-1.26, covariance_high=1.26))) == 1


def test_the_exact_posterior_itself(tmp_path: Path) -> None:
    problem, fit = question(tmp_path, table(GRAZING, sigma=0.01, seed=1, e_t=-0.9))
    found = intervals(problem, fit, integrate(problem, start=fit))
    assert disagreements(found) == ()
    both = found[["covariance_low", "covariance_high"]].to_numpy()
    width = (both[:, 1] - both[:, 0])[:, None]
    assert (np.abs(found[["exact_low", "exact_high"]].to_numpy() - both) <= 0.01 * width).all()
    # at a bound they part, and the exact one is named
    problem, fit = question(tmp_path, table(sigma=0.1, seed=1))
    said = disagreements(intervals(problem, fit, integrate(problem, start=fit)))
    assert any(one.startswith("e_t: ") and "beyond the bound -1" in one for one in said)


@pytest.mark.parametrize(
    "choices",
    rest_long(
        ({"separate": "mu", "fix": {"e_n": 0.94}}, {"separate": "e_n", "prior": {"e_n": (0.94, 0.01)}})
    ),
)
def test_one_series_with_a_constant_of_its_own_has_its_kappa_beside_it(choices):
    found = ifrfit.fit("cross-2019", series="no spin", method="profile", **choices)
    table = found.intervals()
    assert "kappa" in found.distribution.names
    assert "kappa" in table.index
    assert set(found.distribution.names) <= set(found.profiles)
    shared = ifrfit.fit(
        "cross-2019", series="no spin", method="lsq", **choices | {"separate": ()}
    ).intervals()
    assert table.loc["kappa", "profile_low"] == pytest.approx(shared.loc["kappa", "profile_low"], rel=1e-6)
