"""Priors by name: their densities, what least squares take for them, and posteriors under them."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy import integrate, stats

import ifrfit
from ifrfit.errors import UsageError
from ifrfit.inference.model.prior_density import kappa_prior_density, prior_density
from ifrfit.inference.model.prior_laws import LAWS, read_law

GAMMA = np.linspace(5.0, 80.0, 16)
# that never slide: mu is known from below alone
STICKING = {"gamma_deg": GAMMA[:5], "beta": 0.4 + 0.01 * np.cos(5.0 * GAMMA[:5]), "sigma": 0.02}
TABLE = {
    "gamma_deg": GAMMA,
    "beta": ifrfit.rebound(GAMMA, e_n=0.9, e_t=-0.7, mu=0.15, degrees=True).beta
    + np.random.default_rng(3).normal(0.0, 0.05, GAMMA.size),
    "sigma": 0.05,
}


@pytest.mark.parametrize(
    ("law", "ends", "reference"),
    [
        (ifrfit.LogNormal(0.1, 0.3), (0.0, 2.0), stats.lognorm(0.3, scale=0.1)),
        (ifrfit.LogNormal(0.1, 1.5), (0.05, 0.4), stats.lognorm(1.5, scale=0.1)),
        (ifrfit.Beta(2.0, 5.0), (0.0, 1.0), stats.beta(2.0, 5.0)),
        (ifrfit.Beta(1.0, 3.5), (-1.0, -0.4), stats.beta(1.0, 3.5, loc=-1.0, scale=0.6)),
    ],
    ids=("lognormal", "cut lognormal", "beta", "beta of e_t"),
)
def test_densities_are_those_of_scipy(law, ends, reference):
    x = np.linspace(*ends, 41)[1:-1]
    share = reference.cdf(ends[1]) - reference.cdf(ends[0])
    expected = reference.logpdf(x) - math.log(share)
    np.testing.assert_allclose(law.log_density(x, *ends), expected, rtol=1e-10, atol=1e-10)
    low = max(ends[0], reference.support()[0])
    at = sorted(
        {low, ends[1], *np.quantile(reference.rvs(2000, random_state=1), (0.05, 0.5, 0.95)).clip(*ends)}
    )

    def moment(k):
        parts = pairwise(at)
        return sum(integrate.quad(lambda v: v**k * reference.pdf(v), a, b)[0] for a, b in parts) / share

    mean, sd = law.moments(*ends)
    assert mean == pytest.approx(moment(1), rel=1e-6)
    assert sd == pytest.approx(math.sqrt(moment(2) - moment(1) ** 2), rel=1e-5)


def test_laws_of_least_squares():
    plain = ifrfit.fit(TABLE, fix={"e_n": 0.9}, prior={"mu": (0.15, 0.01)}).constants.mu
    named = ifrfit.fit(TABLE, fix={"e_n": 0.9}, prior={"mu": ifrfit.Normal(0.15, 0.01)}).constants.mu
    assert named == plain
    cut = ifrfit.fit(TABLE, fix={"e_n": 0.9}, prior={"mu": ifrfit.TruncatedNormal(0.15, 0.01, 0.14, 0.16)})
    bound = ifrfit.fit(
        TABLE, fix={"e_n": 0.9}, prior={"mu": (0.15, 0.01)}, bounds={"mu": (0.14, 0.16)}
    ).constants.mu
    assert cut.constants.mu == bound
    flat = ifrfit.fit(TABLE, fix={"e_n": 0.9}, prior={"mu": ifrfit.Uniform(0.14, 0.16)}).constants.mu
    assert flat == ifrfit.fit(TABLE, fix={"e_n": 0.9}, bounds={"mu": (0.14, 0.16)}).constants.mu
    half = ifrfit.fit(TABLE, fix={"e_n": 0.9}, prior={"mu": ifrfit.HalfNormal(0.2)}).constants.mu
    assert half == ifrfit.fit(TABLE, fix={"e_n": 0.9}, prior={"mu": (0.0, 0.2)}).constants.mu


def _posterior_of_mu(law, table, sigma):
    """Mean and sd of mu by brute force over (e_t, mu), e_n fixed at 0.9."""
    mu = np.linspace(0.02, 1.2, 1200)
    e_t = np.linspace(-1.0, -0.4, 301)
    chi2 = np.zeros((e_t.size, mu.size))
    for gamma, beta in zip(table["gamma_deg"], table["beta"], strict=True):
        cot = 1.0 / math.tan(math.radians(gamma))
        k = 2.0 / 7.0 * (1.0 + e_t[:, None]) + np.minimum(0.4, mu * 1.9 * cot)
        chi2 += ((3.5 * k - 1.0 - beta) / sigma) ** 2
    log_p = -0.5 * chi2 + law(mu)
    p = np.exp(log_p - log_p.max())
    p[:, 0] *= 0.5
    p[:, -1] *= 0.5
    p[0] *= 0.5
    p[-1] *= 0.5
    mass = p.sum(axis=0) / p.sum()
    mean = mass @ mu
    return mean, math.sqrt(mass @ (mu - mean) ** 2)


@pytest.mark.parametrize("method", ["exact", "mcmc"])
def test_posterior_under_a_law(method):
    law = ifrfit.LogNormal(0.12, 0.05)
    fit = ifrfit.fit(TABLE, fix={"e_n": 0.9}, prior={"mu": law}, method=method)
    mean, sd = _posterior_of_mu(lambda mu: stats.lognorm(0.05, scale=0.12).logpdf(mu), TABLE, 0.05)
    found = fit.constants.mu
    assert found.mean == pytest.approx(mean, abs=0.1 * sd)
    assert found.stderr == pytest.approx(sd, rel=0.1)
    without = ifrfit.fit(TABLE, fix={"e_n": 0.9}).constants.mu
    assert abs(without.mean - mean) > 0.5 * sd  # the law matters


def test_what_the_data_do_not_see_rests_on_the_law():
    law = ifrfit.LogNormal(0.5, 0.2)
    found = ifrfit.fit(STICKING, fix={"e_n": 0.9}, prior={"mu": law}).constants.mu
    assert found.status == "prior"
    assert "your prior of mu" in found.reason
    whole = stats.lognorm(0.2, scale=0.5)
    assert found.value == pytest.approx(whole.median(), rel=0.03)
    assert found.interval95 == pytest.approx(whole.interval(0.95), rel=0.05)


def test_saved_and_repeated(tmp_path):
    law = ifrfit.LogNormal(0.12, 0.123456789012345)
    fit = ifrfit.fit(TABLE, fix={"e_n": 0.9}, prior={"mu": law})
    fit.save(tmp_path / "result.json")
    again = ifrfit.load_result(tmp_path / "result.json")
    assert again.asked[2].shape == law
    from ifrfit.report.page.sections.repeat import from_points

    assert "mu=lognormal:0.12,0.123456789012345" in from_points(fit, "points.csv")


@pytest.mark.parametrize(
    "law", [ifrfit.Normal(0.1, 0.02), ifrfit.Beta(2.0, 3.0), ifrfit.Uniform(0.0, 0.5)], ids=str
)
def test_text_and_back(law):
    assert read_law(law.exactly) == law
    assert read_law(str(law)) == law
    assert set(LAWS) == {"normal", "truncated", "halfnormal", "uniform", "lognormal", "beta"}


@pytest.mark.parametrize("method", ["lsq", "profile", "bootstrap"])
def test_other_methods_refuse_in_words(method):
    with pytest.raises(UsageError, match=f'method="{method}" knows normal and uniform priors only'):
        ifrfit.fit(TABLE, fix={"e_n": 0.9}, prior={"mu": ifrfit.LogNormal(0.1, 0.3)}, method=method)


def test_quadrature_alone_refuses():
    with pytest.raises(UsageError, match="a law that the quadrature does not take on"):
        ifrfit.fit(
            TABLE, prior={"mu": ifrfit.LogNormal(0.1, 0.3)}, method=ifrfit.Exact(integrator="quadrature")
        )


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: ifrfit.LogNormal(-0.1, 0.3), "the median must be positive"),
        (lambda: ifrfit.LogNormal(0.1, 0.0), "must lie above 0"),
        (lambda: ifrfit.Beta(0.5, 2.0), "from 1 to 1000"),
        (lambda: ifrfit.Normal(0.1, float("nan")), "finite numbers"),
        (lambda: ifrfit.Uniform(0.2, 0.1), "must lie below"),
        (lambda: ifrfit.HalfNormal(-1.0), "must be positive"),
        (lambda: ifrfit.Normal("a", 1.0), "write finite numbers"),
        (lambda: read_law("gamma:1,2"), "'gamma' is no law"),
        (lambda: read_law("beta:1"), "takes beta:A,B"),
        (lambda: read_law("beta:1,x"), "beta:1,x takes beta:A,B"),
    ],
)
def test_numbers_that_make_no_law(make, said):
    with pytest.raises(UsageError, match=said):
        make()


def test_laws_that_do_not_fit_their_constant():
    for prior, said in (
        ({"e_t": ifrfit.HalfNormal(0.2)}, "begins at 0"),
        ({"e_t": ifrfit.LogNormal(0.2, 0.1)}, "positive constant"),
        ({"mu": ifrfit.Beta(2.0, 2.0)}, "no upper end"),
        ({"mu": 3.0}, "is not two numbers"),
    ):
        with pytest.raises(UsageError, match=said):
            ifrfit.fit(TABLE, fix={"e_n": 0.9}, prior=prior)
    with pytest.raises(UsageError, match="contradicts bounds"):
        ifrfit.fit(TABLE, fix={"e_n": 0.9}, prior={"mu": ifrfit.Uniform(0.1, 0.2)}, bounds={"mu": (0.1, 0.3)})


def test_the_page_draws_and_names_the_law(tmp_path):
    fit = ifrfit.fit(TABLE, prior={"e_n": ifrfit.Beta(20.0, 3.0), "mu": ifrfit.LogNormal(0.15, 0.1)})
    e_n, _, mu = fit.asked
    x = np.linspace(0.05, 0.4, 30)
    reference = stats.lognorm(0.1, scale=0.15)
    np.testing.assert_allclose(prior_density(mu, x), reference.pdf(x), rtol=1e-9)
    drawn = (1.0 + stats.beta(20.0, 3.0).rvs(200_000, random_state=1)) * reference.rvs(
        200_000, random_state=2
    )
    share, edges = np.histogram(drawn, bins=20, range=(0.2, 0.4), density=True)
    share *= np.mean((drawn >= 0.2) & (drawn <= 0.4))
    middle = 0.5 * (edges[1:] + edges[:-1])
    np.testing.assert_allclose(kappa_prior_density(e_n, mu, middle), share, rtol=0.1, atol=0.1)
    fit.report(tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text("utf-8")
    assert "log-normal with median 0.15 and 0.1 as sd of the logarithm" in page
    assert "as Beta(20, 3)" in page


@pytest.mark.parametrize(("median", "log_sd"), [(0.15, 0.003), (0.1, 0.001), (0.25, 0.001), (0.1, 1.5)])
def test_moments_of_narrow_and_wide_laws(median, log_sd):
    mean, sd = ifrfit.LogNormal(median, log_sd).moments(0.0, math.inf)
    assert mean == pytest.approx(median * math.exp(0.5 * log_sd**2), rel=1e-12)
    assert sd == pytest.approx(mean * math.sqrt(math.expm1(log_sd**2)), rel=1e-9)
    with pytest.raises(UsageError, match=r"nothing of it lies between 0\.5 and 0\.6"):
        ifrfit.LogNormal(0.1, 0.001).moments(0.5, 0.6)


def test_a_class_is_no_law():
    with pytest.raises(UsageError, match="is not two numbers, mean and sd, nor a law"):
        ifrfit.fit(TABLE, prior={"mu": ifrfit.LogNormal})


def test_a_prior_far_from_any_impact_is_refused_and_one_beside_the_domain_is_said():
    columns = {"gamma_deg": [10.0, 30.0, 50.0, 70.0], "beta": [0.4, 0.4, 0.1, -0.5], "sigma": 0.02}
    with pytest.raises(UsageError, match=r'"mu": \(50, 0\.01\).*beyond 2 .*bounds=\{"mu": \(0, HI\)\}'):
        ifrfit.fit(**columns, prior={"mu": (50.0, 0.01)})
    ifrfit.fit(**columns, prior={"mu": (50.0, 0.01)}, bounds={"mu": (0.0, 60.0)}, method="lsq")
    found = ifrfit.fit(**columns, prior={"e_n": (1.01, 0.01)}, method="lsq")
    assert any("1.01 +- 0.01, cut off at the end of the domain [0, 1]" in said for said in found.assumed)
    inside = ifrfit.fit(**columns, prior={"e_n": (0.99, 0.01)}, method="lsq")
    assert not any("cut off" in said for said in inside.assumed)
