"""ArviZ's object: what is in it, that it survives a file, and that its draws count as independent."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from arviz_stats.base.array import array_stats

import ifrfit
from ifrfit.inference.model.log_posterior import Density

ANGLES = [5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0]


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    rng = np.random.default_rng(1)
    rows = ["series,observable,gamma_deg,value,sigma,impact_id"]
    for series, mu in (("dry", 0.12), ("wet", 0.2)):
        for i, angle in enumerate(ANGLES):
            state = ifrfit.rebound(angle, e_n=0.9, e_t=-0.8, mu=mu, degrees=True)
            beta, e_n = float(state.beta) + 0.05 * rng.standard_normal(), 0.9 + 0.02 * rng.standard_normal()
            rows += [f"{series},beta,{angle},{beta},0.05,{series}{i}"]
            rows += [f"{series},e_n,{angle},{e_n},0.02,{series}{i}"]
    found = tmp_path_factory.mktemp("arviz") / "impacts.csv"
    found.write_text("\n".join(rows) + "\n")
    return found


@pytest.fixture(scope="module")
def by_mcmc(path: Path) -> ifrfit.FitResult:
    # shorter than to convergence, which none of these tests asks for
    return ifrfit.fit(path, method=ifrfit.MCMC(max_steps=300), separate="mu", noise="unknown", seed=3)


@pytest.fixture(scope="module")
def by_exact(path: Path) -> ifrfit.FitResult:
    return ifrfit.fit(path, separate="mu", seed=3)


@pytest.fixture(params=["by_mcmc", "by_exact"])
def fit(request: pytest.FixtureRequest) -> ifrfit.FitResult:
    return request.getfixturevalue(request.param)


def test_groups_and_names(fit: ifrfit.FitResult) -> None:
    tree = fit.to_arviz()
    assert set(tree.children) == {"posterior", "sample_stats", "log_likelihood", "observed_data"}
    posterior = tree["posterior"]
    noise = {"noise"} if fit.noise.policy == "unknown" else set()
    assert set(posterior.data_vars) == {"e_n", "e_t", "mu", "kappa"} | noise
    assert posterior["mu"].dims == ("chain", "draw", "series")
    assert list(posterior["mu"].series.values) == ["dry", "wet"]
    if noise:
        groups = ["dry/beta", "dry/e_n", "wet/beta", "wet/e_n"]
        assert list(posterior["noise"].noise_of.values) == groups
    kappa = posterior["mu"] * (1.0 + posterior["e_n"])
    assert np.allclose(kappa.transpose(*posterior["kappa"].dims), posterior["kappa"])
    assert tree["observed_data"]["value"].shape == (44,)
    assert tree["log_likelihood"]["impact"].shape[2] == 22  # by impact, not by row
    about = tree.attrs
    assert about["method"] == fit.method
    assert about["seed"] == 3
    assert about["sha256"] == fit.inputs[0].sha256
    assert about["provenance"] == "not stated"
    assert f"numpy {np.__version__}" in about["versions"]


def test_its_moments_are_those_of_the_result(fit: ifrfit.FitResult) -> None:
    posterior = fit.to_arviz()["posterior"]
    for name in ("e_n", "e_t"):
        one = fit.constants[name]
        draws = posterior[name].values
        assert abs(draws.mean() - one.mean) < 6.0 * draws.std() / np.sqrt(0.5 * draws.size)


def test_densities_are_those_of_the_problem(fit: ifrfit.FitResult) -> None:
    tree = fit.to_arviz()
    draw = {"chain": 1, "draw": 7}
    at = tree["posterior"].isel(draw)
    mu = at["mu"].values
    noise = np.log(at["noise"].values) if "noise" in at.data_vars else []
    point = np.array([[at["e_n"].item(), at["e_t"].item(), *mu, *noise]])
    density = Density(fit.problem)
    assert tree["sample_stats"]["lp"].isel(draw).item() == pytest.approx(float(density(point)[0]), rel=1e-9)
    impacts = tree["log_likelihood"]["impact"].isel(draw).values
    assert impacts == pytest.approx(density.impacts(point)[0], rel=1e-8)


def test_its_draws_count_as_independent(by_mcmc: ifrfit.FitResult) -> None:
    tree = by_mcmc.to_arviz()
    assert tree.attrs["ensembles"] == 4
    assert tree.attrs["discarded"] == by_mcmc.files["chains.npz"].evidence.discarded
    for name in ("e_n", "e_t"):
        draws = tree["posterior"][name].values
        assert draws.shape[0] == 4
        stated = float(array_stats.ess(draws, method="bulk"))
        assert stated == pytest.approx(draws.size, rel=0.2)
        # and honestly so: thinned like this, the chains' own effective number is not much smaller
        walkers = tree.attrs["walkers"]
        in_time = draws.reshape(4, -1, walkers).mean(axis=2)
        assert in_time.var() == pytest.approx(draws.var() / walkers, rel=0.6)


def test_it_survives_a_file(fit: ifrfit.FitResult, tmp_path: Path) -> None:
    import xarray

    tree = fit.to_arviz()
    tree.to_netcdf(tmp_path / "fit.nc")
    with xarray.open_datatree(tmp_path / "fit.nc") as again:
        assert np.array_equal(again["posterior"]["mu"], tree["posterior"]["mu"])
        assert again.attrs["data"] == "impacts.csv"


def test_other_methods_have_no_posterior(path: Path) -> None:
    with pytest.raises(ifrfit.UsageError, match="gives no posterior"):
        ifrfit.fit(path, method="lsq").to_arviz()


def test_a_result_from_a_file_has_no_problem(by_exact: ifrfit.FitResult, tmp_path: Path) -> None:
    by_exact.save(tmp_path / "result.json")
    with pytest.raises(ifrfit.UsageError, match="Fit the data again"):
        ifrfit.load_result(tmp_path / "result.json").to_arviz()


def test_without_arviz_it_says_what_to_install(
    by_exact: ifrfit.FitResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "arviz_base", None)
    with pytest.raises(ifrfit.UsageError, match=r"pip install 'ifrfit\[arviz\]'"):
        by_exact.to_arviz()
