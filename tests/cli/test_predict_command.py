"""`ifrfit predict`: CSV from a saved result."""

from __future__ import annotations

import io
import json

import numpy as np
import pandas as pd
import pytest
from factories import impacts_file

import ifrfit

CREDIBLE = ["lo95", "lo68", "value", "hi68", "hi95"]
PREDICTIVE = ["new_lo95", "new_lo68", "new_hi68", "new_hi95"]
COLUMNS = [
    "observable", "gamma_deg", "spin_x", "spin_y", "value", "lo68", "hi68", "lo95", "hi95",
    "new_lo68", "new_hi68", "new_lo95", "new_hi95",
]  # fmt: skip


def fitted(folder, method, *parts, **choices):
    """The file of a result; by default with interior constants: beta with sigma, e_n known."""
    parts = parts or ({"gamma": range(5, 85, 5), "sigma": 0.02, "noise": 0.02},)
    path = impacts_file(folder / "impacts.csv", *parts)
    ifrfit.fit(path, fix={"e_n": 0.94}, method=method, **choices).save(folder / "result.json")
    return folder / "result.json"


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """Of least squares: the curve is the one of the constants, to the last digit."""
    return fitted(tmp_path_factory.mktemp("saved"), "lsq")


def table(outcome):
    assert (outcome.returncode, outcome.stderr) == (0, "")
    return pd.read_csv(io.StringIO(outcome.stdout))


def test_columns_bands_and_curve(cli, saved):
    found = table(cli("predict", saved, "--gamma", "10,35,60"))
    assert list(found.columns) == COLUMNS
    assert list(found["gamma_deg"]) == [10, 35, 60]
    assert set(found["observable"]) == {"beta"}
    assert (np.diff(found[CREDIBLE].to_numpy()) >= 0).all()
    assert (np.diff(found[PREDICTIVE].to_numpy()) > 0).all()
    assert (found["new_hi95"] - found["new_lo95"] > found["hi95"] - found["lo95"]).all()
    constants = {k: v["value"] for k, v in json.loads(saved.read_text(encoding="utf-8"))["constants"].items()}
    curve = ifrfit.rebound([10, 35, 60], **constants, degrees=True).beta
    np.testing.assert_allclose(found["value"], curve, rtol=1e-9)


def test_a_posterior_is_predicted_from_the_draws_that_the_file_keeps(cli, tmp_path):
    path = fitted(tmp_path, "exact")
    found = table(cli("predict", path, "--gamma", "10,35,60"))
    content = json.loads(path.read_text(encoding="utf-8"))
    sample = content["state"]["sample"]
    constants = {name: np.array(sample[name])[:, None] for name in ("e_n", "e_t")}
    mu = np.array(sample["kappa"])[:, None] / (1.0 + constants["e_n"])
    curves = ifrfit.rebound([10, 35, 60], **constants, mu=mu, degrees=True).beta
    for end, level in (("lo95", 2.5), ("lo68", 16.0), ("hi68", 84.0), ("hi95", 97.5)):
        np.testing.assert_allclose(found[end], np.percentile(curves, level, axis=0), rtol=1e-9)
    # the curve is that of the medians, up to the scatter of 2000 draws
    medians = {name: found["value"] for name, found in content["constants"].items()}
    curve = ifrfit.rebound([10, 35, 60], **medians, degrees=True).beta
    assert (np.abs(found["value"] - curve) < 0.1 * (found["hi68"] - found["lo68"])).all()


def test_a_range_includes_its_end(cli, saved):
    assert list(table(cli("predict", saved, "--gamma", "0.5:80.5:20"))["gamma_deg"]) == [
        0.5,
        20.5,
        40.5,
        60.5,
        80.5,
    ]
    assert list(table(cli("predict", saved, "--gamma", "30:30:1"))["gamma_deg"]) == [30]
    assert len(table(cli("predict", saved, "--gamma", "0.1:0.9:0.1"))) == 9


@pytest.mark.parametrize(
    ("options", "asked"),
    [
        (
            ("--observable", "delta_deg", "--observable", "mu_app"),
            [{"observable": "delta_deg"}, {"observable": "mu_app"}],
        ),
        (("--spin-y", "-0.3", "--spin-x", "0.1"), [{"spin_y": -0.3, "spin_x": 0.1}]),
    ],
)
def test_options_are_those_of_the_library(cli, saved, options, asked):
    found = table(cli("predict", saved, "--gamma", "20:60:20", *options))
    result = ifrfit.load_result(saved)
    parts = [result.predict([20.0, 40.0, 60.0], **choices) for choices in asked]
    assert list(found["observable"]) == [c.get("observable", "beta") for c in asked for _ in range(3)]
    for name in ("spin_x", "spin_y", *CREDIBLE, *PREDICTIVE):
        np.testing.assert_allclose(found[name], np.concatenate([part[name] for part in parts]), rtol=1e-9)
    # of what was not measured the scatter is not known
    assert found[PREDICTIVE].isna().all().all() == ("delta_deg" in options)


def test_what_is_undefined_is_empty(cli, saved):
    found = cli("predict", saved, "--gamma", "0,90", "--observable", "beta_cm")
    lines = found.stdout.splitlines()
    assert lines[1].startswith("beta_cm,0,0,0,,,")
    assert table(found)["value"].notna().tolist() == [False, True]


def test_the_curve_lies_in_its_own_band_where_a_constant_lies_on_its_bound(cli, tmp_path):
    part = {"gamma": range(5, 85, 5), "sigma": 0.02, "noise": 0.02, "c": -1.0, "seed": 3}
    path = fitted(tmp_path, "lsq", part)
    constants = json.loads(path.read_text(encoding="utf-8"))["constants"]
    if constants["e_t"]["value"] != -1.0:
        pytest.fail("choose another seed: e_t does not lie on its bound")
    found = table(cli("predict", path, "--gamma", "5,10,15"))
    assert (found["lo95"] <= found["value"]).all()
    assert (found["value"] <= found["hi95"]).all()


@pytest.mark.parametrize("sigma", [0.01, None])
def test_an_unknown_series_is_refused_where_constants_are_shared(cli, tmp_path, sigma):
    gamma = range(5, 85, 5)
    parts = ({"gamma": gamma, "series": name, "sigma": sigma, "noise": 0.01} for name in ("dry", "wet"))
    saved = fitted(tmp_path, "lsq", *parts)
    refused = cli("predict", saved, "--gamma", "60", "--series", "foo")
    assert refused.returncode == 2
    assert refused.stderr == "ifrfit: There is no series 'foo'. Choose one of dry, wet.\n"
    assert not refused.stdout
    assert cli("predict", saved, "--gamma", "60", "--series", "wet").returncode == 0


def test_separate_constants_ask_for_a_series(cli, tmp_path):
    parts = (
        {"gamma": range(5, 85, 5), "series": "dry", "sigma": 0.01, "mu": 0.1},
        {"gamma": range(5, 85, 5), "series": "wet", "sigma": 0.01, "mu": 0.2},
    )
    saved = fitted(tmp_path, "exact", *parts, separate="mu")
    refused = cli("predict", saved, "--gamma", "60")
    assert refused.returncode == 2
    assert refused.stderr == "ifrfit: Constants are separate by series: name one of dry, wet.\n"
    assert "no series 'c'" in cli("predict", saved, "--gamma", "60", "--series", "c").stderr
    dry, wet = (
        table(cli("predict", saved, "--gamma", "60", "--series", s))["value"].item() for s in ("dry", "wet")
    )
    assert wet > dry + 0.1


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--gamma", "91"), "--gamma 91: incidence angles lie between 0 and 90 degrees from the normal."),
        (("--gamma", "-5"), "--gamma -5: incidence angles lie between 0 and 90 degrees"),
        (("--gamma", "nan"), "--gamma nan: "),
        (("--gamma", "0:90:1e-7"), "--gamma 0:90:1e-7: more than 1,000,000 numbers. Take a larger step."),
        (("--gamma", "ten"), "--gamma ten: write numbers as 10,20,30 or as FROM:TO:STEP."),
        (("--gamma", "10:20"), "--gamma 10:20: write numbers as"),
        (("--gamma", "20:10:1"), "--gamma 20:10:1: write numbers as"),
        (("--gamma", "0:90:0"), "--gamma 0:90:0: write numbers as"),
        (("--gamma", "10", "--observable", "betta"), "betta"),
    ],
)
def test_wrong_questions_are_2(cli, saved, options, says):
    found = cli("predict", saved, *options)
    assert found.returncode == 2
    assert found.stdout == ""
    assert says in found.stderr


def test_more_friction_than_two_mu_is_told_once(cli, saved):
    outcome = cli("predict", saved, "--gamma", "45,89", "--observable", "mu_app", "--observable", "beta")
    assert outcome.returncode == 0
    assert len(outcome.stdout.splitlines()) == 5
    (line,) = outcome.stderr.splitlines()
    assert line.startswith("ifrfit: The apparent friction exceeds 2 mu at 1 of 2 incidences and is ")
