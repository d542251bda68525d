from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest

import ifrfit
from ifrfit.errors import UsageError
from ifrfit.report import side_by_side

COLUMNS = [f"{method}_{end}" for method in ("covariance", "profile", "exact") for end in ("low", "high")]


def table(**rows):
    """A table of `FitResult.intervals`: name to six ends, then the domain and the shape."""
    made = {
        name: dict(zip((*COLUMNS, "lower", "upper", "shape", "noise_dof"), values, strict=True))
        for name, values in rows.items()
    }
    return pd.DataFrame.from_dict(made, orient="index")


AGREEING = (0.112, 0.128, 0.1121, 0.1279, 0.1119, 0.1281, 0.0, 2.0, "bounded", math.inf)
BEYOND = (-1.017, -0.931, -1.0, -0.933, -0.998, -0.932, -1.0, -0.4, "one_sided", 15.0)
OPEN = (-math.inf, math.inf, 0.0, 1.0, 0.017, 0.966, 0.0, 1.0, "flat", math.inf)


def test_intervals_that_agree_stand_side_by_side():
    text = side_by_side(table(mu=AGREEING))
    assert text == (
        "  central 95 % intervals by three methods\n"
        "\n"
        "       covariance         profile            exact\n"
        "  mu   [0.1120, 0.1280]   [0.1121, 0.1279]   [0.1119, 0.1281]\n"
        "\n"
        "  ok    the three methods agree"
    )


def test_intervals_that_disagree_are_told_in_a_sentence_each_and_columns_stay_aligned():
    text = side_by_side(table(e_n=OPEN, e_t=BEYOND, **{"mu[run 1]": AGREEING}))
    lines = text.splitlines()
    assert "any value" in lines[3]
    assert "mu [run 1]" in lines[5]
    assert len({line.index("[", 14) for line in lines[4:6]}) == 1
    series_styles = [line for line in lines if line.startswith("  LOOK")]
    assert [line.split()[1] for line in series_styles] == ["e_n:", "e_t:"]
    assert max(map(len, lines)) <= 100
    assert "the three methods agree" not in text


def test_nothing_to_compare_is_said():
    assert side_by_side(table()) == "  every constant is fixed: there are no intervals to compare"


@pytest.mark.parametrize("method", ["exact", "lsq", "profile"])
def test_a_fit_of_any_method_gives_all_three(impacts, method):
    path = impacts(gamma=np.linspace(4.0, 86.0, 40), noise=0.03, sigma=0.03, c=-0.7)
    found = ifrfit.fit(path, fix={"e_n": 0.94}, method=method).intervals()
    assert list(found.index) == ["e_t", "mu", "kappa"]
    assert np.isfinite(found[COLUMNS].to_numpy(dtype=float)).all()
    # both regimes, far from any bound, known noise: all the same
    assert "the three methods agree" in side_by_side(found)


def test_a_result_that_was_read_has_none(impacts, tmp_path):
    path = impacts(gamma=np.linspace(4.0, 86.0, 40), noise=0.03, sigma=0.03)
    ifrfit.fit(path, fix={"e_n": 0.94}).save(tmp_path / "result.json")
    with pytest.raises(UsageError, match=r"it was read from a file, or .* Fit the data again"):
        ifrfit.load_result(tmp_path / "result.json").intervals()
