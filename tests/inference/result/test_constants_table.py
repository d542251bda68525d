"""The constants of a fit by name, by attribute, and as other libraries hold them."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

import ifrfit
from ifrfit.errors import UsageError


@pytest.fixture(scope="module")
def fit():
    return ifrfit.fit("cornell-glass")


def test_by_name_and_attribute(fit):
    assert fit.constants.mu is fit.constants["mu"]
    assert fit.constants.mu.value == dict(fit.constants)["mu"].value
    assert list(fit.constants) == ["e_n", "e_t", "mu"]
    with pytest.raises(KeyError, match=r"no constant 'en'\. It has e_n, e_t and mu\. Did you mean e_n"):
        fit.constants["en"]
    with pytest.raises(AttributeError, match="no constant 'en'"):
        _ = fit.constants.en


def test_completion_shows_what_users_want(fit):
    assert dir(fit.constants) == ["e_n", "e_t", "items", "keys", "mu", "to_frame", "values"]
    assert not [name for name in dir(fit) if name.startswith("_") and not name.startswith("__")]


def test_as_a_frame(fit):
    table = fit.constants.to_frame()
    assert table.loc["mu", "value"] == fit.constants.mu.value
    assert table.loc["e_t", ["lo95", "hi95"]].tolist() == list(fit.constants.e_t.interval95)
    assert table["status"].tolist() == ["determined", "one_sided", "determined"]
    kharaz = ifrfit.fit("kharaz-2001").constants.to_frame()
    assert np.isnan(kharaz.loc["mu", "value"])


def test_formats(fit):
    mu = fit.constants.mu
    assert f"{mu:.2uS}" == "0.0894(88)"
    assert f"{mu:.1u}" == "0.089+/-0.009"
    assert str(mu) == "0.0894±0.0088"
    assert str(fit.constants.e_t).endswith("one_sided")
    fixed = ifrfit.fit("cornell-glass", fix={"e_n": 0.97}).constants.e_n
    assert str(fixed) == "0.97 fixed"
    assert f"{fixed:.3f}" == "0.970"
    assert str(ifrfit.fit("kharaz-2001").constants.mu) == "not determined"


def test_uncertainties_are_correlated(fit):
    found = fit.to_uncertainties()
    mu, e_t = found["mu"], found["e_t"]
    assert mu.std_dev == pytest.approx(fit.constants.mu.stderr)
    names = fit.correlation.names
    r = fit.correlation.matrix[names.index("mu"), names.index("e_t")]
    both = fit.constants.mu.stderr**2 + fit.constants.e_t.stderr**2
    expected = both + 2.0 * r * fit.constants.mu.stderr * fit.constants.e_t.stderr
    assert (mu + e_t).std_dev == pytest.approx(np.sqrt(expected))
    with pytest.raises(UsageError, match="the data do not determine it"):
        ifrfit.fit("kharaz-2001").to_uncertainties()


def test_one_line_and_summary(fit):
    assert repr(fit) == (
        "<FitResult ifr, exact: e_n 0.9744(81), e_t -0.966(35), mu 0.0894(88); 48 values of cornell-glass>"
    )
    assert str(fit) == fit.summary()
    comparison = ifrfit.compare("cornell-glass", ["ifr", "fr"], loo=False)
    assert repr(comparison).count("\n") == 0
    assert str(comparison) == comparison.summary()
    assert "<table" in comparison._repr_html_()


def test_copies(fit):
    assert copy.deepcopy(fit.constants) == fit.constants
    assert pickle.loads(pickle.dumps(fit.constants)) == fit.constants


def test_separate_constants():
    table = {"steel": _table(0.15), "glass": _table(0.25)}
    fit = ifrfit.fit(table, fix={"e_n": 0.9}, separate="mu")
    assert set(fit.constants.mu) == {"steel", "glass"}
    assert "mu[steel]" in fit.constants.to_frame().index
    assert "mu[steel]" in repr(fit)
    assert set(fit.to_uncertainties()) == {"e_n", "e_t", "mu[steel]", "mu[glass]"}


def _table(mu):
    gamma = np.linspace(5.0, 80.0, 20)
    beta = ifrfit.rebound(gamma, e_n=0.9, e_t=-0.7, mu=mu, degrees=True).beta
    return {"gamma_deg": gamma, "beta": beta + np.random.default_rng(1).normal(0.0, 0.02, gamma.size)}
