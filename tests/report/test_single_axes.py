"""Pictures on axes that the user has, in his style."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib import pyplot

import ifrfit
from ifrfit.errors import UsageError


@pytest.fixture(scope="module")
def fit():
    return ifrfit.fit("cornell-glass")


@pytest.fixture
def ax():
    figure, axes = pyplot.subplots()
    yield axes
    pyplot.close(figure)


def test_data_on_given_axes(fit, ax):
    assert fit.plot(ax=ax) is ax
    beta = fit.points[fit.points["observable"] == "beta_cm"]
    drawn = np.concatenate([line.get_xydata() for line in ax.lines if line.get_linestyle() == "None"])
    np.testing.assert_allclose(np.sort(drawn[:, 1]), np.sort(beta["value"]))
    curve = max(ax.lines, key=lambda line: line.get_xdata().size)
    at = fit.predict([40.0], observable="beta_cm")["value"].item()
    assert np.interp(40.0, curve.get_xdata(), curve.get_ydata()) == pytest.approx(at, abs=1e-3)


def test_another_observable(fit, ax):
    fit.plot(ax=ax, observable="e_n")
    assert "e_n" in ax.get_ylabel()
    with pytest.raises(UsageError, match=r"There is no 'beta' in this fit\. There is e_n and beta_cm"):
        fit.plot(ax=ax, observable="beta")


def test_residuals(fit, ax):
    assert fit.plot_residuals(ax=ax) is ax
    beta = fit.points[fit.points["observable"] == "beta_cm"]
    marks = np.concatenate([line.get_ydata() for line in ax.lines if line.get_linestyle() == "None"])
    for z in beta["standardised"]:
        assert np.isclose(marks, z).any()


def test_profile(fit, ax):
    assert fit.plot_profile("mu", ax=ax) is ax
    x, rise = ax.lines[0].get_data()
    assert rise.min() == pytest.approx(0.0, abs=1e-9)
    best = fit.least_squares.optimum.theta[2]
    assert x[np.argmin(rise)] == pytest.approx(best, abs=fit.constants.mu.stderr / 20.0)
    assert ax.get_xlabel() == r"$\mu$"
    assert {text.get_text() for text in ax.texts} == {"68 %", "95 %"}
    with pytest.raises(UsageError, match=r"no profile of 'kapa'.*Did you mean kappa\?"):
        fit.plot_profile("kapa", ax=ax)


def test_compare(fit, ax):
    assert fit.plot_compare(ax=ax) is ax
    assert len(ax.patches) >= 4


def test_corner(fit):
    figure, axes = pyplot.subplots(3, 3)
    assert fit.plot_corner(axes) is not None
    assert axes[2, 2].get_xlabel() == r"$\mu$"
    low, high = axes[2, 2].get_xlim()
    assert low < fit.constants.mu.interval95[0] < fit.constants.mu.interval95[1] < high
    assert not axes[0, 1].axison
    with pytest.raises(UsageError, match=r"take \(2, 2\)"):
        fit.plot_corner(axes, names=["mu", "e_t"])
    with pytest.raises(UsageError, match="no draws of 'x'"):
        fit.plot_corner(names=["x"])
    pyplot.close(figure)
    pyplot.close(fit.plot_corner(names="kappa")[0, 0].figure)


def test_a_corner_has_the_density_that_was_integrated_or_the_draws(fit):
    (line,) = fit.plot_corner(names=["mu"])[0, 0].lines
    x, density = line.get_data()
    below = fit.distribution.cdf("mu", np.array([x[0], x[-1]]))
    assert np.trapezoid(density, x) == pytest.approx(np.diff(below).item(), abs=1e-3)
    assert x[np.argmax(density)] == pytest.approx(fit.constants.mu.value, abs=0.2 * fit.constants.mu.stderr)
    (steps,) = ifrfit.fit("cornell-glass", method="bootstrap").plot_corner(names=["mu"])[0, 0].patches
    assert steps.get_xy().shape[0] > 90
    pyplot.close("all")


def test_style_is_the_users(fit):
    with pyplot.rc_context({"axes.labelsize": 21.0, "lines.markersize": 3.0}):
        figure, axes = pyplot.subplots()
        fit.plot(ax=axes)
        assert axes.xaxis.label.get_size() == 21.0
        pyplot.close(figure)


def test_a_stand_in_is_marked(ax):
    ifrfit.fit("cross-2019", fix={"e_n": 0.9}).plot(ax=ax)
    assert any("STAND-IN" in text.get_text().upper() for text in ax.texts)
