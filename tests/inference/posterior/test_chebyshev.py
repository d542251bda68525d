"""Sums of squares between computed ones: right where a polynomial is offered, and none where it is wrong."""

from __future__ import annotations

import numpy as np
import pytest

import ifrfit
from ifrfit.inference.posterior import chebyshev as smooth
from ifrfit.inference.posterior import integrate
from ifrfit.inference.posterior import sum_of_squares as misfit

E_N, X = np.linspace(0.85, 0.95, 60), np.linspace(0.2, 3.0, 7)
C = np.linspace(-1.0, -0.6, 80) + 0.02 * E_N[:, None, None] + 0.01 * X[:, None]
ROWS = np.linspace(0.1, 1.4, 30)


def squares(e_n, x, c):
    angle = np.arctan2(np.sin(ROWS) + c[..., None] * np.minimum(1.0, x[..., None]), e_n[..., None])
    return ((angle - 0.3) ** 2).sum(axis=-1) / 0.05**2


def everywhere(function):
    return function(*np.broadcast_arrays(E_N[:, None, None], X[:, None], C))


class Counted:
    def __init__(self, function):
        self.function, self.count = function, 0

    def __call__(self, e_n, x, c):
        assert e_n.shape == x.shape == c.shape
        self.count += c.size
        return self.function(e_n, x, c)


def test_a_smooth_sum_is_had_from_few_places():
    direct = Counted(squares)
    found = smooth.between(direct, E_N, X, C, ROWS.size)
    np.testing.assert_allclose(found, everywhere(squares), rtol=1e-9)
    assert direct.count < 0.2 * C.size


@pytest.mark.parametrize(
    "odd",
    [
        lambda e_n, x, c: squares(e_n, x, c) + 3.0 * np.abs(c + 0.8),
        lambda e_n, x, c: squares(e_n, x, c) + 3.0 * np.abs(e_n - 0.9),
        lambda e_n, x, c: squares(e_n, x, c) * (1.0 + 1e-6 * np.sin(300.0 * c)),
    ],
    ids=["kink in c", "kink in e_n", "wave in c"],
)
def test_no_polynomial_is_offered_for_a_sum_that_is_none(odd):
    assert smooth.between(odd, E_N, X, C, ROWS.size) is None
    found = smooth.on_grid(odd, E_N[None, :, None, None], X[None, None, :, None], C[None], ROWS.size)
    np.testing.assert_array_equal(found[0], everywhere(odd))


def test_nothing_is_gained_at_few_places():
    few = slice(None, None, 10)
    assert smooth.between(squares, E_N[few], X, C[few][..., few], ROWS.size) is None


@pytest.mark.parametrize("of", ["c", "x"])
def test_outer_nodes_have_sums_of_their_own(of):
    e_n, x, c = E_N[None, :, None, None], X[None, None, :, None], C[None]
    if of == "c":
        c = np.concatenate((c, c + 0.05))
    else:
        x = np.concatenate((x, 1.1 * x))
    direct = Counted(squares)
    found = smooth.on_grid(direct, e_n, x, c, ROWS.size)
    np.testing.assert_allclose(found, squares(*np.broadcast_arrays(e_n, x, c)), rtol=1e-9)
    assert direct.count < 0.2 * found.size


@pytest.mark.parametrize(
    ("closure", "choices", "tolerance"),
    [
        ("ifr", {}, 1e-2),
        pytest.param(  # coarser grids have too few places for a polynomial
            "ifr", {"noise": "unknown"}, 1e-3, marks=pytest.mark.long
        ),
        ("ifr", {"noise": "scaled", "prior": {"e_n": (0.9, 0.02)}}, 1e-2),
        ("ifr-contact", {"prior": {"mu": (0.15, 0.01)}}, 1e-2),
        ("fr", {"fix": {"e_n": 0.9}}, 1e-2),
    ],
)
def test_the_posterior_of_rebound_angles_is_the_same(monkeypatch, impacts, closure, choices, tolerance):
    gamma = np.linspace(4.0, 84.0, 16)
    path = impacts(gamma=gamma, observables=("delta_deg",), noise=1.0, sigma=1.0, c=-0.85, mu=0.15, e_n=0.9)
    start = ifrfit.fit(path, closure=closure, method="lsq", **choices)
    offered = []
    between = smooth.between

    def watched(*arguments):
        offered.append(between(*arguments))
        return offered[-1]

    monkeypatch.setattr(smooth, "between", watched)
    found = []
    for many in (np.inf, 1):
        monkeypatch.setattr(misfit, "_MANY", many)
        found.append(integrate(start.problem, tolerance, start.least_squares))
    assert any(each is not None for each in offered)
    direct, between_them = found
    # alike to a tenth of the tolerance
    assert between_them.log_evidence == pytest.approx(direct.log_evidence, abs=1e-3)
    for name in direct.names:
        assert between_them.mean(name) == pytest.approx(direct.mean(name), abs=1e-3 * direct.sd(name))
        assert between_them.sd(name) == pytest.approx(direct.sd(name), rel=1e-3)


def test_one_place_of_e_n_and_of_the_transition_is_a_grid_too():
    c = np.linspace(-0.9, -0.7, 40)[None, None]
    found = smooth.between(squares, E_N[:1], X[:1], c, ROWS.size)
    np.testing.assert_allclose(found, squares(*np.broadcast_arrays(E_N[0], X[0], c)), rtol=1e-9)
