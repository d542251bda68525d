"""mcmc against the exact posterior, within the Monte Carlo error that the chains state."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from posterior_questions import Question, Row

import ifrfit
from ifrfit.data.catalogue import listing
from ifrfit.inference.distributions.protocol import LEVELS
from ifrfit.inference.mcmc import Sample, sample
from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.inference.posterior import QuadraturePosterior, integrate
from ifrfit.inference.result.fit_result import FitResult

FAR = 5.5  # standard errors: some 40 comparisons a dataset, each wrong once in ten million
QUICK = ("kharaz-2001",)
PAIR = ((20.0, 0.42), (60.0, -0.5))


@cache
def fitted(name: str, method: str) -> FitResult:
    return ifrfit.fit(name, method=method)


def check(drawn: Sample, exact: QuadraturePosterior) -> None:
    """Means, sd and probabilities below the exact quantiles; effective draws say how near they must be."""
    law = drawn.distribution
    assert sorted(law.names) == sorted(exact.names)  # a noise that stands alone comes last in the exact one
    for name in law.names:
        bulk, tail = drawn.evidence.bulk[name], drawn.evidence.tail[name]
        sd = exact.sd(name)
        values = (law.values[name] - exact.mean(name)) / sd
        assert abs(values.mean()) < FAR / math.sqrt(bulk) + 1e-3, name
        # the error of a variance, whatever the law
        error = float((values**2).std()) / math.sqrt(min(bulk, tail))
        assert abs((values**2).mean() - 1.0) < FAR * error + 1e-3, name
        for p, edge in zip(LEVELS, np.asarray(exact.quantile(name, LEVELS)), strict=True):
            error = math.sqrt(p * (1.0 - p) / min(bulk, tail))
            assert abs((law.values[name] <= edge).mean() - p) < FAR * error + 1e-3, (name, p)


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=() if name in QUICK else pytest.mark.long)
        for name in (entry.name for entry in listing())
    ],
)
def test_on_every_bundled_dataset(name: str) -> None:
    mcmc, exact = fitted(name, "mcmc"), fitted(name, "exact")
    assert mcmc.facts["converged"].ok, mcmc.facts["converged"].says
    chains = mcmc.files["chains.npz"]
    assert isinstance(chains, Sample)
    check(chains, exact.distribution)
    ours, theirs = mcmc.flat_constants(), exact.flat_constants()
    for key, one in ours.items():
        assert (one.value is None) == (theirs[key].value is None)
    assert mcmc.fit.log_evidence is None
    assert mcmc.fit.chi2 == exact.fit.chi2


@pytest.mark.long
@pytest.mark.parametrize("sigma", [0.05, 0.01, 1e-3])
def test_two_optima_have_their_weights(sigma: float) -> None:
    problem = Question(tuple(Row("beta", g, v, sigma) for g, v in PAIR), fix={"e_n": 0.9}).problem()
    start = least_squares(problem)
    assert len(start.optimum.minima) == 2
    drawn = sample(problem, start, 0, max_steps=20_000)
    assert drawn.verdict.ok, drawn.verdict.says
    check(drawn, integrate(problem))


def test_two_optima_are_both_found_in_a_short_walk() -> None:
    problem = Question(tuple(Row("beta", g, v, 0.02) for g, v in PAIR), fix={"e_n": 0.9}).problem()
    exact = integrate(problem)
    drawn = sample(problem, least_squares(problem), 0, max_steps=400)
    edge = float(np.mean([theta[2] for _, theta in least_squares(problem).optimum.minima]))
    share, expected = float((drawn.distribution.values["mu"] < edge).mean()), float(exact.cdf("mu", edge))
    assert 0.05 < expected < 0.95
    error = math.sqrt(expected * (1.0 - expected) / drawn.evidence.bulk["mu"])
    assert abs(share - expected) < FAR * error
