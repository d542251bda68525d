"""For those who live in lmfit: a Model, Parameters in, a MinimizerResult out."""

from __future__ import annotations

import lmfit
import numpy as np
import pytest

import ifrfit
from ifrfit import UsageError

GAMMA = np.linspace(4.0, 86.0, 34)


@pytest.mark.parametrize(("closure", "own", "value"), [("ifr", "e_t", -0.8), ("fr", "beta0", 0.3)])
def test_the_model_is_an_lmfit_model_and_fits(closure, own, value):
    model = ifrfit.lmfit_model("beta", closure=closure)
    assert isinstance(model, lmfit.Model)
    truth = ifrfit.rebound(GAMMA, e_n=0.94, mu=0.12, closure=closure, degrees=True, **{own: value}).beta
    params = model.make_params()
    params["e_n"].set(value=0.94, vary=False)
    found = model.fit(truth, params, gamma=GAMMA)
    assert found.params[own].value == pytest.approx(value, abs=1e-6)
    assert found.params["mu"].value == pytest.approx(0.12, abs=1e-6)


def test_the_models_hints_are_the_passive_domain():
    params = ifrfit.lmfit_model("beta", inertia_factor=0.5).make_params()
    assert (params["e_t"].min, params["e_t"].max) == (-1.0, -0.5)
    assert params["mu"].min == 0.0


def test_parameters_bring_fixed_values_and_bounds(impacts):
    path = impacts(gamma=GAMMA, noise=0.03, sigma=0.03, c=-0.8)
    params = lmfit.Parameters()
    params.add("e_n", value=0.94, vary=False)
    params.add("e_t", value=-0.8, min=-0.9, max=-0.5)
    found = ifrfit.fit(path, params=params)
    same = ifrfit.fit(path, fix={"e_n": 0.94}, bounds={"e_t": (-0.9, -0.5)})
    assert found.constants["mu"].value == same.constants["mu"].value
    assert found.constants["e_n"].status == "fixed"


def test_an_expression_of_other_constants_is_a_tie(impacts):
    params = lmfit.Parameters()
    params.add("e_n", value=0.94)
    params.add("mu", expr="0.1 * e_n")
    path = impacts(gamma=GAMMA, noise=0.03, sigma=0.03)
    found = ifrfit.fit(path, params=params, method="lsq").constants
    assert found == ifrfit.fit(path, tie={"mu": "0.1 * e_n"}, method="lsq").constants
    with pytest.raises(UsageError, match="does not know tie"):
        ifrfit.fit(path, params=params)


def test_undetermined_constants_are_held_in_the_lmfit_result(impacts):
    found = ifrfit.fit(impacts(gamma=GAMMA, noise=0.03, sigma=0.03, c=-0.8)).lmfit_result
    assert not found.params["e_n"].vary
    assert found.params["e_t"].vary
    assert found.params["e_t"].stderr is not None


def test_a_result_from_a_file_has_no_lmfit_result(impacts, tmp_path):
    ifrfit.fit(impacts(gamma=GAMMA), fix={"e_n": 0.94}).save(tmp_path / "result.json")
    with pytest.raises(UsageError, match="needs the fit itself"):
        ifrfit.load_result(tmp_path / "result.json").lmfit_result  # noqa: B018
