"""The hard cases that end in a fit, through the exact posterior: finite, silent, and the answer expected."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest import mock

import numpy as np
import pytest
from hard_cases.cases import CASES
from hard_cases.synthetic import TRUTH

from ifrfit.inference.model.problem import Problem
from ifrfit.inference.posterior import QuadraturePosterior, integrate
from ifrfit.inference.result.fit_result import FitResult

pytestmark = pytest.mark.long

FITTED = {case.name: case for case in CASES if case.methods and not case.answer.startswith("Refused")}
KINK = {"e_t": -0.9, "mu": 0.25}


def fits(outcome: Any) -> Iterator[FitResult]:
    """Every fit in what a case comes to."""
    if isinstance(outcome, FitResult):
        yield outcome
    elif isinstance(outcome, tuple | list):
        for part in outcome:
            yield from fits(part)
    elif hasattr(outcome, "result"):
        yield from fits(outcome.result)


@cache
def problems(name: str) -> tuple[Problem, ...]:
    """What the case fits, without its brute-force check."""
    with (
        TemporaryDirectory() as folder,
        mock.patch("hard_cases.numerics.best_chi2", return_value=(0.0, 0.0, 0.0)),
    ):
        found = tuple(fit.problem for fit in fits(FITTED[name].run(Path(folder), "lsq")))
    assert found, name
    assert all(isinstance(problem, Problem) for problem in found)
    return found  # type: ignore[return-value]


@cache
def integrated(name: str) -> tuple[QuadraturePosterior, ...]:
    with warnings.catch_warnings(), np.errstate(all="raise", under="ignore"):
        warnings.simplefilter("error")
        return tuple(integrate(problem) for problem in problems(name))


@pytest.mark.parametrize("name", FITTED)
def test_finite_silent_and_converged(name: str) -> None:
    for problem, post in zip(problems(name), integrated(name), strict=True):
        assert math.isfinite(post.log_evidence)
        # FR's transition has no end: a few of its smallest problems stop short of 1e-4, and say so
        assert post.converged or problem.closure.name == "fr", (post.error, post.error_evidence)
        bounds = dict(
            zip(problem.parameters.names, zip(*problem.parameters.bounds(), strict=True), strict=True)
        )
        for quantity in post.names:
            low, high = bounds.get(quantity, (0.0, math.inf))
            mean, sd = post.mean(quantity), post.sd(quantity)
            levels = np.asarray(
                post.quantile(quantity, np.array([0.0, 0.001, 0.025, 0.5, 0.975, 0.999, 1.0]))
            )
            assert math.isfinite(mean)
            assert sd > 0.0, quantity
            assert np.isfinite(levels).all()
            assert (np.diff(levels) >= 0.0).all(), (quantity, levels)
            assert low - 1e-12 <= levels[0]
            assert levels[-1] <= high + 1e-12
            # FR's tail can carry the mean beyond the quantiles; then the quadrature has not converged
            assert levels[1] <= mean <= levels[-2] or not post.converged
        draws = post.draws(50, np.random.default_rng(1))
        assert all(np.isfinite(x).all() for x in draws.values())


def near(post: QuadraturePosterior, sds: float = 5.0, **truth: float) -> None:
    """The posterior holds the truth."""
    for name, value in truth.items():
        assert abs(post.mean(name) - value) <= sds * post.sd(name), (name, post.mean(name), post.sd(name))


def is_uniform(post: QuadraturePosterior, name: str, low: float, high: float) -> None:
    """Nothing was learnt."""
    p = np.array([0.025, 0.3, 0.5, 0.9, 0.975])
    assert np.abs(np.asarray(post.quantile(name, p)) - (low + p * (high - low))).max() < 1e-4 * (high - low)
    assert abs(post.sd(name) * math.sqrt(12.0) / (high - low) - 1.0) < 1e-4


def _sliding(post: QuadraturePosterior) -> None:
    near(post, e_t=TRUTH["e_t"], mu=TRUTH["mu"])
    assert post.sd("mu") < 0.01


def _sliding_wholly_free(post: QuadraturePosterior) -> None:
    near(post, e_t=TRUTH["e_t"], kappa=TRUTH["mu"] * (1.0 + TRUTH["e_n"]))
    p = np.array([0.025, 0.5, 0.975])
    # e_n has what the uniform prior of mu leaves it
    assert np.abs(np.asarray(post.quantile("e_n", p)) - (2.0**p - 1.0)).max() < 1e-4


def _sticking(post: QuadraturePosterior) -> None:
    near(post, e_t=TRUTH["e_t"])
    least = post.quantile("mu", 0.001)
    assert 0.08 < least < TRUTH["mu"] + 0.03
    # above what sticking asks for mu is as it was before
    rest = (np.asarray(post.quantile("mu", 0.9)) - post.quantile("mu", 0.5)) / 0.4
    assert abs(rest - (2.0 - post.quantile("mu", 0.5)) / 0.5) < 1e-3


def _silent(post: QuadraturePosterior) -> None:
    is_uniform(post, "e_t", -1.0, -0.4)
    is_uniform(post, "mu", 0.0, 2.0)
    assert abs(post.log_evidence + 3.0 * math.log(0.01 * math.sqrt(2.0 * math.pi))) < 1e-4


def _open(post: QuadraturePosterior) -> None:
    for name in ("e_t", "mu"):
        assert post.quantile(name, 0.005) <= TRUTH[name] <= post.quantile(name, 0.995)


def _single(post: QuadraturePosterior) -> None:
    near(post, **{"e_t[run]": TRUTH["e_t"], "mu[run]": TRUTH["mu"]})
    assert post.sd("mu[single]") > 3.0 * post.sd("mu[run]")
    assert post.sd("e_t[single]") > 3.0 * post.sd("e_t[run]")


def _exactly(**truth: float) -> Callable[[QuadraturePosterior], None]:
    def test(post: QuadraturePosterior) -> None:
        near(post, 0.5, **truth)

    return test


def _on_bound(name: str, bound: float, sign: int) -> Callable[[QuadraturePosterior], None]:
    def test(post: QuadraturePosterior) -> None:
        sd = post.sd(name)
        assert 0.0 <= sign * (post.mean(name) - bound) < 4.0 * sd
        assert abs(post.quantile(name, 0.0 if sign > 0 else 1.0) - bound) < 0.2 * sd
        near(post, **{x: {**TRUTH, name: bound}[x] for x in ("e_n", "e_t", "mu")})

    return test


EXPECTED: dict[str, Callable[[QuadraturePosterior], None]] = {
    "only sliding impacts": _sliding,
    "only sliding impacts, e_n free": _sliding_wholly_free,
    "only sticking impacts": _sticking,
    "all points at one angle": _open,
    "one sliding point": _open,
    "as many points as constants": _open,
    "fewer points than constants": _open,
    "rows that say nothing": _silent,
    "one point in its own series": _single,
    "no noise at all": _exactly(e_t=-0.9, mu=TRUTH["mu"]),
    "no noise, a point on the kink": _exactly(**KINK),
    "points on the kink": lambda post: near(post, **KINK),
}
for _constant, _bound, _sign in (("e_t", -1.0, 1), ("mu", 0.0, 1), ("e_n", 1.0, -1)):
    for _noise in ("without noise", "with noise", "with other noise"):
        EXPECTED[f"truth on a bound: {_constant} = {_bound:g}, {_noise}"] = _on_bound(
            _constant, _bound, _sign
        )


@pytest.mark.parametrize("name", EXPECTED)
def test_the_answer_expected(name: str) -> None:
    for post in integrated(name):
        EXPECTED[name](post)


def test_every_row_thrice_is_a_third_of_the_variance() -> None:
    (thrice, once) = problems("duplicated rows")
    sharp = integrate(once.with_noise(replace(once.noise, sigma=once.noise.sigma / math.sqrt(3.0))))
    post = integrate(thrice)
    for name in post.names:
        assert abs(post.mean(name) - sharp.mean(name)) < 2e-4 * post.sd(name)
        assert abs(post.sd(name) / sharp.sd(name) - 1.0) < 2e-4


def test_an_outlier_moves_the_noise_and_not_much_else() -> None:
    bad, good = integrated("outlier at 50 sigma, sigma unknown")
    assert bad.mean("noise[run/beta]") > 4.0 * good.mean("noise[run/beta]")
    near(good, e_t=TRUTH["e_t"], mu=TRUTH["mu"])
    assert abs(good.quantile("noise[run/beta]", 0.5) / 0.01 - 1.0) < 0.4
