"""Series of one figure that are imported one by one share the errors of its calibration."""

from __future__ import annotations

import numpy as np
import pytest
from project_files import CLICKS, as_json, axes, calibration, dataset, pixel, version_4

import ifrfit
from ifrfit.data import combine, read
from ifrfit.data.read_figure import read_figure
from ifrfit.data.common_errors import loadings_of
from ifrfit.data.table_text import table_text

GAMMA = np.array([10.0, 25.0, 40.0, 55.0, 70.0])
AXES = {"x": "gamma_deg", "y": "beta"}


def project(path, clicks=CLICKS, **more):
    sets = [
        dataset(name=name, points=[pixel(gamma, beta) for gamma, beta in zip(GAMMA, values, strict=True)])
        for name, values in (("glass", [0.5, 0.4, 0.1, -0.3, -0.7]), ("steel", [0.6, 0.5, 0.4, -0.1, -0.4]))
    ]
    coll = [axes(calibrationPoints=calibration(clicks), **more)]
    path.write_bytes(as_json(version_4(axes_coll=coll, dataset_coll=sets)))
    return path


def covariance(observations):
    """Of values and angles by the common errors."""
    both = np.vstack(loadings_of(observations.table)[:2])
    return both @ both.T


def through_csv(folder, observations, name):
    path = folder / name
    path.write_text(table_text(observations), encoding="utf-8")
    return read(path)


@pytest.mark.parametrize("more", [{}, {"noRotation": True}])
def test_one_by_one_is_as_together(tmp_path, more):
    file = project(tmp_path / "figure.json", **more)
    together = read_figure(file, **AXES)
    # 1e-10 of the largest: columns of a CSV have ten digits
    close = {"atol": 1e-9 * np.abs(covariance(together)).max(), "rtol": 0.0}
    alone = [read_figure(file, **AXES, dataset=name) for name in ("glass", "steel")]
    written = [through_csv(tmp_path, each, f"{i}.csv") for i, each in enumerate(alone)]
    apart = combine(written)
    np.testing.assert_allclose(covariance(apart), covariance(together), **close)
    assert [each.calibration for each in written] == [together.calibration] * 2
    assert apart.calibration == ""


def test_the_control_axes_that_were_clicked_anew_are_another_error(tmp_path):
    first = project(tmp_path / "one.json")
    moved = [(x + 1e-6, y) for x, y in CLICKS]
    second = project(tmp_path / "two.json", clicks=moved)
    files = [read_figure(first, **AXES, dataset="glass"), read_figure(second, **AXES, dataset="steel")]
    found = covariance(combine(files)).reshape(2, 10, 2, 10)
    assert np.abs(found[:, :5, :, :5]).max() > 0.0
    np.testing.assert_array_equal(found[:, :5, :, 5:], 0.0)


def test_a_fit_of_both_is_that_of_one_import(tmp_path):
    file = project(tmp_path / "figure.json")
    for name in ("glass", "steel"):
        text = table_text(read_figure(file, **AXES, dataset=name))
        (tmp_path / f"{name}.csv").write_text(text, encoding="utf-8")
    choices = {"fix": {"e_n": 0.9}, "method": "lsq", "noise": "scaled"}
    apart = ifrfit.fit([tmp_path / "glass.csv", tmp_path / "steel.csv"], **choices)
    together = ifrfit.fit(file, convention=["x=gamma_deg", "y=beta"], **choices)
    for name in ("e_t", "mu"):
        one, other = apart.constants[name], together.constants[name]
        assert (one.value, one.stderr) == pytest.approx((other.value, other.stderr), rel=1e-6)
    # the six errors themselves, to the digits of a CSV
    of_each = [each.noise.common_errors.fitted for each in (apart, together)]
    np.testing.assert_allclose(*of_each, atol=1e-6)


def test_two_words_for_the_calibration_are_none(tmp_path):
    text = table_text(read_figure(project(tmp_path / "figure.json"), **AXES))
    (tmp_path / "twice.csv").write_text("# calibration: another\n" + text, encoding="utf-8")
    assert read(tmp_path / "twice.csv").calibration == ""
