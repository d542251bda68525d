"""Grids stay within the memory, or are refused in words before they are begun."""

from __future__ import annotations

import importlib
import math
import tracemalloc
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from factories import each_once, rest_long
from posterior_questions import Question, Row, measured

import ifrfit
from ifrfit.errors import UsageError
from ifrfit.inference.distributions.protocol import LEVELS
from ifrfit.inference.posterior import QuadraturePosterior, integrate
from ifrfit.inference.posterior.quadrature_axis import rule


def test_the_size_of_a_grid_is_foreseen(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = measured(
        "beta", [10.0, 30.0, 50.0, 70.0], seed=1, sigma=0.05, closure="ifr", c=-0.9, mu=0.15, e_n=0.9
    )
    problem = Question(rows, "ifr", fix={"e_n": 0.9}).problem()
    density = integrate(problem).density
    assert density.integral.size() == sum(grid.f.size for grid in density.grids)
    # the module, which is hidden by its function of the same name
    module = importlib.import_module("ifrfit.inference.posterior.adaptive_quadrature")
    monkeypatch.setattr(module, "_MEMORY", density.integral.size() // 4)
    with pytest.raises(UsageError, match="does not fit into memory"):
        integrate(problem)


def test_the_last_grid_that_fits_is_what_there_is(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = ifrfit.fit("wang-2020", closure="fr", method="lsq").problem
    whole = integrate(problem, tolerance=1e-3)
    module = importlib.import_module("ifrfit.inference.posterior.adaptive_quadrature")
    with monkeypatch.context() as once:
        once.setattr(module, "_ROUNDS", 1)
        first = integrate(problem, tolerance=1e-3)
    monkeypatch.setattr(module, "_MEMORY", first.density.integral.size())
    post = integrate(problem, tolerance=1e-3)
    assert post.density.integral.size() == first.density.integral.size() < whole.density.integral.size()
    assert not post.converged
    assert post.quantile("mu", 0.5) == pytest.approx(whole.quantile("mu", 0.5), abs=1e-3)
    assert all(np.isfinite(x).all() for x in post.draws(50, np.random.default_rng(1)).values())


def test_the_error_of_a_grid_that_work_ends_counts_the_quantiles() -> None:
    """Its means and standard deviations moved by 4e-4 sd, a quantile by 7e-3, and 4e-4 were reported."""
    rows = measured("delta_deg", (8.0, 17.0, 26.0, 35.0, 50.0, 70.0), seed=4, sigma=0.4)
    post = integrate(Question(rows).problem(), 1e-4, most_work=1.5e6)
    assert not post.converged
    for name, law in post.marginals.items():
        sd, at = post.sd(name), np.asarray(post.quantile(name, np.array(LEVELS)))
        fine, coarse = law.cdf(at, 2)
        density = (law.cdf(at + 0.02 * sd, 1)[0] - law.cdf(at - 0.02 * sd, 1)[0]) / (0.04 * sd)
        assert np.all(np.abs(fine - coarse) / (density * sd) <= 1.05 * post.error), name


def test_of_panels_that_do_not_all_fit_the_worst_are_split(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = measured("delta_deg", (8.0, 17.0, 26.0, 35.0, 50.0, 70.0), seed=4, sigma=0.4)
    problem = Question(rows).problem()
    first = integrate(problem, most_work=1.5e6)
    whole = integrate(problem)
    assert whole.converged
    module = importlib.import_module("ifrfit.inference.posterior.adaptive_quadrature")
    most = (first.density.integral.size() + whole.density.integral.size()) // 2
    monkeypatch.setattr(module, "_MEMORY", most)
    post = integrate(problem)
    assert first.density.integral.size() < post.density.integral.size() <= most
    assert post.error < 0.5 * first.error


def test_the_covariance_takes_no_array_larger_than_the_grid() -> None:
    """With a prior of mu e_n has an axis on which c does not depend: their product is larger than either."""
    gamma = [61.0, 64.0, 67.0, 70.0, 73.0, 76.0, 79.0, 82.0, 85.0, 88.0]
    rows = measured("beta_cm", gamma, seed=2, sigma=0.003, c=-0.66, mu=1.0, e_n=0.45)
    post = integrate(Question(rows, "ifr", prior={"mu": (1.0, 1e-3)}).problem(), tolerance=1e-3)
    grid = post.density.grids[0]
    assert grid.f.shape[1] == 1 < grid.nodes.e_n.shape[1]
    tracemalloc.start()
    found = post.covariance(("e_n", "e_t"))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 40 * post.density.integral.size()  # bytes: five numbers a value
    mean = grid.expectation(lambda nodes: nodes.e_n[..., None] * nodes.c)[0]
    product = float((mean * post.density.share[0]).sum())
    assert found[0, 1] == pytest.approx(product - post.mean("e_n") * post.mean("e_t"), rel=1e-6)


FAN = (8.0, 17.0, 26.0, 35.0, 50.0, 70.0)
ROWS = (*measured("beta", FAN, seed=4, closure="fr", c=0.4), Row("e_n", 7.0, 0.91, 0.03))
FACTOR = {"noise": "scaled", "noise_bounds": {"": (0.05, 20.0)}}


ASKED = {
    "no more": Question(ROWS, "fr", **FACTOR),  # type: ignore[arg-type]
    "a prior on mu": Question(ROWS, "fr", prior={"mu": (0.15, 0.05)}, **FACTOR),  # type: ignore[arg-type]
    "a row of mu": Question((*ROWS, Row("mu", 5.0, 0.15, 0.03)), "fr", **FACTOR),  # type: ignore[arg-type]
}


@cache
def posterior(name: str) -> QuadraturePosterior:
    return integrate(ASKED[name].problem(), tolerance=1e-2)


@pytest.mark.parametrize("name", rest_long(ASKED))
def test_a_common_factor_under_a_tilted_bound_makes_no_fourth_axis(name: str) -> None:
    # e_n, the transition and the closure constant meet in mu
    post = posterior(name)
    assert post.converged
    assert post.density.integral.size() < 4_000_000


@pytest.mark.parametrize("name", rest_long(ASKED))
def test_a_common_factor_is_the_mixture_over_its_values(name: str) -> None:
    asked, (low, high) = ASKED[name], FACTOR["noise_bounds"][""]  # type: ignore[index]
    x, w = np.polynomial.legendre.leggauss(16)
    start, end = math.log(0.2), math.log(high)  # a fifth of the stated noise is out of the question
    log_factor = 0.5 * (start + end) + 0.5 * (end - start) * x
    weight = 0.5 * (end - start) * w / math.log(high / low)
    each = []
    for s in np.exp(log_factor):
        rows = tuple(replace(r, sigma=float(s) * r.sigma) for r in asked.rows if r.sigma is not None)
        known = replace(asked, rows=rows, noise="known", noise_bounds={})
        each.append(integrate(known.problem(), tolerance=1e-2))
    log_z = np.array([p.log_evidence for p in each])
    share = weight * np.exp(log_z - log_z.max())
    post = posterior(name)
    assert abs(post.log_evidence - math.log(share.sum()) - log_z.max()) < 2e-2
    share /= share.sum()
    assert abs(post.mean("noise") - float(share @ np.exp(log_factor))) < 2e-2 * post.sd("noise")
    for constant in ("e_n", "beta0", "mu", "kappa"):
        mean = float(share @ [p.mean(constant) for p in each])
        assert abs(post.mean(constant) - mean) < 2e-2 * post.sd(constant)
        for level in (0.025, 0.975):
            at = post.quantile(constant, level)
            assert abs(float(share @ [p.cdf(constant, at) for p in each]) - level) < 2e-3


NOISY = Question(
    (
        *(replace(r, sigma=None) for r in measured("beta", FAN, seed=4, closure="fr", c=0.4)),
        *(Row("e_n", 7.0 + i, value, None) for i, value in enumerate((0.91, 0.88, 0.93, 0.9))),
    ),
    "fr",
    noise="unknown",
)
# Bytes: the density 8, polynomials at the nodes with mass 6 to 8, what has a value a node of (e_n,
# transition) 3 to 4; with curved rows an eighth of the grid is worked on at once, at some 80 bytes a value
LIMITS = {
    "curved rows": (lambda: ifrfit.fit("wang-2020", closure="fr", method="lsq").problem, 26),
    "unknown noises": (NOISY.problem, 24),
}


@pytest.mark.parametrize("name", rest_long(LIMITS))
def test_a_value_of_the_grid_takes_few_bytes(name: str) -> None:
    """73 and 107 bytes when closure constant, mu and temporaries of all nodes were kept."""
    make, limit = LIMITS[name]
    problem = make()
    tracemalloc.start()
    post = integrate(problem, tolerance=1e-3)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    size = post.density.size()
    assert size > 1_500_000
    assert peak < limit * size


@pytest.mark.parametrize(
    ("closure", "observable", "prior"),
    # one on each side of the largest of these
    each_once(["fr", "f", "ifr", "maw"], ["delta_deg", "beta_cm"], [{}, {"mu": (0.5, 0.1)}]),
)
def test_slabs_of_e_n_are_the_whole(monkeypatch: pytest.MonkeyPatch, closure, observable, prior) -> None:
    gamma = [20.0, 35.0, 50.0, 65.0, 80.0]
    rows = measured(observable, gamma, seed=2, sigma=0.05, c=-0.66, mu=0.5, e_n=0.6)
    problem = Question(rows, closure, prior=prior).problem()
    module = importlib.import_module("ifrfit.inference.posterior.slabs")
    whole = integrate(problem, tolerance=1e-2)
    monkeypatch.setattr(module, "_AT_ONCE", 1000)
    parts = integrate(problem, tolerance=1e-2)
    assert parts.log_evidence == pytest.approx(whole.log_evidence, abs=1e-10)
    for name in whole.names:
        sd = whole.sd(name)
        assert parts.mean(name) == pytest.approx(whole.mean(name), abs=1e-9 * sd)
        np.testing.assert_allclose(parts.quantile(name, LEVELS), whole.quantile(name, LEVELS), atol=1e-8 * sd)


def test_errors_of_panels_take_a_part_of_the_grid_at_once() -> None:
    problem = ifrfit.fit("buck-2017", closure="fr", method="lsq").problem
    density = integrate(problem, tolerance=1e-4).density
    (grid,) = (grid for grid in density.grids if grid.nodes.coordinate is not None)
    assert grid.f.size > 1_000_000
    tracemalloc.start()
    found = grid.panel_errors(density.share)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < grid.f.size  # a byte a value
    sides = grid.f.reshape(*grid.f.shape[:-1], 2, -1) @ rule(grid.series.c_order).differences.T
    part = grid.factor * (grid.outer(density.share)[0] * grid.e_weight[0][:, None] * grid.x_weight[0])
    error = (np.abs(sides).sum(axis=-2) * part[..., None]).sum(axis=(0, 1, 2)).max()
    assert found[-1][2] == pytest.approx(error, rel=1e-12)
