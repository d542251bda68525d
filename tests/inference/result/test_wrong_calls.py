"""What is asked of a result in a wrong way is answered by a sentence with the remedy."""

from __future__ import annotations

import numpy as np
import pytest

import ifrfit

GAMMA = np.linspace(5.0, 80.0, 20)


def table(mu):
    """Impacts with noise of 0.02."""
    beta = ifrfit.rebound(GAMMA, e_n=0.9, e_t=-0.7, mu=mu, degrees=True).beta
    return {"gamma_deg": GAMMA, "beta": beta + np.random.default_rng(1).normal(0.0, 0.02, GAMMA.size)}


TWO = {"a": table(0.15), "b": table(0.25)}


@pytest.fixture(scope="module")
def fit():
    return ifrfit.fit("cornell-glass")


@pytest.fixture(scope="module", params=["exact", "lsq"])
def separate(request):
    return ifrfit.fit(TWO, separate="mu", fix={"e_n": 0.9}, method=request.param)


def test_a_fact_that_is_not_there(fit):
    with pytest.raises(
        ifrfit.UsageError, match=r"^There is no 'convergd'\. There are converged, .*mean conv"
    ):
        fit.facts["convergd"]
    assert fit.facts.get("convergd") is None
    assert "convergd" not in fit.facts


def test_a_quantity_that_is_not_there(fit, separate):
    for method in (
        fit.distribution.mean,
        fit.distribution.sd,
        lambda name: fit.distribution.covariance([name]),
    ):
        with pytest.raises(ifrfit.UsageError, match=r"quantity 'muu'\. There are e_n, .*Did you mean mu\?"):
            method("muu")
    with pytest.raises(KeyError, match="mu is the same in all series"):
        fit.distribution.quantile("mu[a]", 0.5)
    with pytest.raises(ifrfit.UsageError, match=r"no quantity 'mu'\. .* Name one of mu\[a\] or mu\[b\]\."):
        separate.distribution.quantile("mu", 0.5)
    with pytest.raises(ifrfit.UsageError, match="Name one of"):
        separate.distribution.cdf("mu", 0.1)


def test_a_separate_constant_is_no_estimate(separate):
    mu = separate.constants.mu
    assert f"{mu:.2uS}" == f"a: {mu['a']:.2uS}, b: {mu['b']:.2uS}"
    with pytest.raises(AttributeError, match=r'of a and b\. Take constants\.mu\["a"\]\.value'):
        _ = mu.value
    with pytest.raises(ifrfit.UsageError, match=r"no series 'c' with a mu\. There are a and b"):
        mu["c"]
    with pytest.raises(ifrfit.UsageError, match=r'Take constants\.mu\["a"\]'):
        separate.constants["mu[a]"]


def test_draws_take_a_number_and_a_generator(fit):
    with pytest.raises(ifrfit.UsageError, match=r"rng: 1 draws nothing\. .*default_rng\(1\)"):
        fit.draws(5, 1)
    with pytest.raises(ifrfit.UsageError, match="'5' draws: it must be a whole number"):
        fit.draws("5", np.random.default_rng(1))
    assert len(fit.draws(np.int64(5), np.random.default_rng(1))) == 5


def test_axes_are_those_of_matplotlib(fit):
    for drawn in (fit.plot, fit.plot_residuals):
        with pytest.raises(ifrfit.UsageError, match="ax: 'x' is no Axes"):
            drawn(ax="x")
    with pytest.raises(ifrfit.UsageError, match="ax: 1 is no Axes"):
        fit.plot_corner(axes=np.ones((3, 3), dtype=int))


def test_a_file_goes_into_a_folder_that_is_there(fit, tmp_path):
    with pytest.raises(
        ifrfit.UsageError, match=r"a folder lies there\. Name a file in it, as .*result\.json"
    ):
        fit.save(tmp_path)
    with pytest.raises(ifrfit.UsageError, match=r"the folder .*not-there does not exist"):
        fit.save(tmp_path / "not-there" / "result.json")
