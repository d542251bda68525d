"""A question put again from a file is the question of the fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from json_schemas import validator

import ifrfit
from ifrfit.errors import DataError, UsageError
from ifrfit.inference.io.read_result import from_dict
from ifrfit.inference.result.restore import question


@pytest.fixture(scope="module")
def fits():
    return (
        ifrfit.fit("kharaz-2001", prior={"e_n": (0.98, 0.01)}, gamma_min=15, method="lsq"),
        ifrfit.fit(
            "cross-2019", series=("no spin", "spin 0.225"), fix={"e_n": 0.94}, separate="mu", method="lsq",
            bounds={"e_t": (-1.2, 0.0)}, inertia_factor=0.41,
        ),
    )  # fmt: skip


def test_the_question_comes_back_from_the_file(fits):
    for fit in fits:
        loaded = from_dict(fit.to_dict())
        assert loaded.asked == fit.asked == fit.problem.parameters.parameters
        problem, optimum = question(loaded)
        assert problem.parameters.names == fit.problem.parameters.names
        assert problem.series == fit.problem.series
        assert problem.noise.policy == fit.problem.noise.policy
        assert np.array_equal(problem.rows.value, fit.problem.rows.value)
        np.testing.assert_array_equal(optimum.optimum.theta, fit.least_squares.optimum.theta)
        assert question(fit) == (fit.problem, fit.least_squares)


def test_what_was_asked_is_in_the_schema(fits):
    schema = validator("result")
    for fit in fits:
        content = fit.to_dict()
        schema.validate(content)
    assert content["asked"]["mu"] == {"bounds": [0.0, None], "fixed": None, "prior": None, "separate": True}
    assert content["asked"]["e_n"]["fixed"] == 0.94
    content["asked"]["e_n"]["fixed"] = "0.94"
    assert not schema.is_valid(content)


def test_what_is_missing_or_wrong_is_said(fits):
    loaded = from_dict(fits[0].to_dict())
    with pytest.raises(UsageError, match="does not say with which bounds and priors"):
        question(replace(loaded, asked=()))
    with pytest.raises(UsageError, match="holds no points"):
        question(replace(loaded, points=loaded.points.iloc[:0]))
    with pytest.raises(UsageError, match="names other constants than closure F has"):
        question(replace(loaded, closure="f"))
    content = fits[0].to_dict()
    content["asked"]["e_n"]["prior"] = [0.98]
    with pytest.raises(DataError, match=r"asked\.e_n\.prior"):
        from_dict(content, name="result.json")
