"""What must not change the posterior, and what any law must obey."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, reject, settings
from hypothesis import strategies as st
from posterior_questions import LEVELS, Question, Row, measured
from scipy import special

from ifrfit.inference.posterior import QuadraturePosterior, integrate
from ifrfit.inference.posterior.adaptive_quadrature import GridTooLargeError

pytestmark = pytest.mark.long

CLOSE = 2e-4  # sd: either side is within 1e-4
FEW = settings(max_examples=6)
CLOSURES = {"ifr": (-1.0, -0.4), "ifr-contact": (-1.0, 0.0), "fr": (-0.5, 1.0), "f": (0.0, 0.0)}
OTHER = {"beta": "v_x", "e_n": "v_n"}


@st.composite
def questions(draw: st.DrawFn) -> Question:
    """Small data of any closure, some with e_n, some with a prior, some with an unknown factor."""
    closure = draw(st.sampled_from(sorted(CLOSURES)))
    low, high = CLOSURES[closure]
    c = low + (high - low) * draw(st.floats(0.0, 1.0))
    mu, e_n = draw(st.floats(0.0, 0.5)), draw(st.floats(0.3, 1.0))
    gamma = draw(st.lists(st.integers(3, 85), min_size=3, max_size=8))
    sigma = draw(st.sampled_from([0.01, 0.05, 0.3]))
    rows = measured(
        "beta", [float(g) for g in gamma], seed=draw(st.integers(0, 99)), sigma=sigma, closure=closure,
        c=c, mu=mu, e_n=e_n,
    )  # fmt: skip
    prior = {"mu": (round(mu, 3), 0.05)} if draw(st.booleans()) else {}
    scaled = draw(st.booleans())
    if draw(st.booleans()):
        rows += (Row("e_n", 7.0, round(e_n, 3), 0.03),)
        fix = {}
    else:
        fix = {"e_n": round(e_n, 3)}
    return Question(
        rows, closure, fix=fix, prior=prior, noise="scaled" if scaled else "known",
        noise_bounds={"": (0.05, 20.0)} if scaled else {},
    )  # fmt: skip


def integrated(question: Question) -> QuadraturePosterior:
    """Its posterior; a question whose grid is refused for its size is no example.

    A few impacts near the normal do not bound mu: e_n stays beside it on the grid then, and so does a common
    factor of the noise.
    """
    try:
        return integrate(question.problem())
    except GridTooLargeError:
        reject()


def tolerance(one: QuadraturePosterior, other: QuadraturePosterior) -> float:
    """How far one may be from the other, more where one says that it stops short of its tolerance."""
    reached = [max(each.error, each.error_evidence) for each in (one, other) if not each.converged]
    return CLOSE + 2.0 * sum(reached)


def same(one: QuadraturePosterior, other: QuadraturePosterior, evidence: float = 0.0) -> None:
    """Both within their tolerance of the same law."""
    assert one.names == other.names
    if one.problem.closure.name != "fr":  # its transition has no end: some grids would grow too large
        assert one.converged
        assert other.converged
    close = tolerance(one, other)
    assert abs(one.log_evidence - other.log_evidence - evidence) < close
    for name in one.names:
        sd = one.sd(name)
        assert abs(one.mean(name) - other.mean(name)) < close * sd, name
        assert abs(other.sd(name) / sd - 1.0) < close, name
        off = np.asarray(one.quantile(name, np.array(LEVELS))) - other.quantile(name, np.array(LEVELS))
        assert np.abs(off).max() < close * sd, name


@FEW
@given(question=questions(), seed=st.integers(0, 2**32 - 1))
def test_the_order_of_rows_does_not_matter(question: Question, seed: int) -> None:
    order = np.random.default_rng(seed).permutation(len(question.rows))
    shuffled = replace(question, rows=tuple(question.rows[i] for i in order))
    same(integrated(question), integrated(shuffled))


@FEW
@given(question=questions().filter(lambda q: q.noise == "known"), at=st.integers(0, 7))
def test_a_row_is_two_rows_of_half_the_weight(question: Question, at: int) -> None:
    row = question.rows[at % len(question.rows)]
    assert row.sigma is not None
    half = replace(row, sigma=row.sigma * math.sqrt(2.0))
    twice = replace(question, rows=(*(r for r in question.rows if r is not row), half, half))
    # N(x; m, s)^(1/2 + 1/2): only the normalisation differs
    evidence = math.log(row.sigma * math.sqrt(2.0 * math.pi)) - 2.0 * math.log(
        half.sigma * math.sqrt(2.0 * math.pi)  # type: ignore[operator]
    )
    same(integrated(twice), integrated(question), evidence)


@FEW
@given(question=questions().filter(lambda q: q.noise == "scaled"), factor=st.floats(0.1, 10.0))
def test_a_common_factor_absorbs_the_scale_of_sigma(question: Question, factor: float) -> None:
    rows = tuple(replace(r, sigma=r.sigma * factor) for r in question.rows if r.sigma is not None)
    low, high = question.noise_bounds[""]
    other = replace(question, rows=rows, noise_bounds={"": (low / factor, high / factor)})
    one, two = integrated(question), integrated(other)
    close = tolerance(one, two)
    assert abs(one.log_evidence - two.log_evidence) < close
    for name in one.names:
        by = factor if name == "noise" else 1.0
        assert abs(one.mean(name) - by * two.mean(name)) < close * one.sd(name)
        assert abs(by * two.sd(name) / one.sd(name) - 1.0) < close
        assert abs(one.quantile(name, 0.84) - by * two.quantile(name, 0.84)) < close * one.sd(name)


@FEW
@given(question=questions())
def test_beta_said_as_v_x_is_the_same(question: Question) -> None:
    rows = []
    jacobian = 0.0
    for row in question.rows:
        assert row.sigma is not None
        if row.observable == "e_n":
            factor, value = math.cos(math.radians(row.gamma)), row.value * math.cos(math.radians(row.gamma))
        else:
            # v_x = sin gamma - k U_x with k = (2/7)(1 + beta)
            sine = math.sin(math.radians(row.gamma))
            factor, value = sine * 2.0 / 7.0, sine - sine * 2.0 / 7.0 * (1.0 + row.value)
        rows.append(replace(row, observable=OTHER[row.observable], value=value, sigma=row.sigma * factor))
        jacobian += math.log(factor)
    other = replace(question, rows=tuple(rows))
    same(integrated(question), integrated(other), jacobian)


@FEW
@given(question=questions().filter(lambda q: q.noise == "known" and "e_n" not in q.fix))
def test_a_prior_is_a_further_row(question: Question) -> None:
    row = next(r for r in question.rows if r.observable == "e_n")
    assert row.sigma is not None
    rest = tuple(r for r in question.rows if r is not row)
    as_prior = replace(question, rows=rest, prior={**question.prior, "e_n": (row.value, row.sigma)})
    cut = special.ndtr((1.0 - row.value) / row.sigma) - special.ndtr(-row.value / row.sigma)
    # the prior is normalised over [0, 1], the row is not; the uniform prior there is 1
    same(integrated(question), integrated(as_prior), float(np.log(cut)))


@FEW
@given(question=questions())
def test_every_marginal_is_a_law(question: Question) -> None:
    post = integrated(question)
    p = np.array([1e-4, 1e-3, 0.01, 0.025, 0.1, 0.16, 0.3, 0.5, 0.7, 0.84, 0.9, 0.975, 0.99, 0.999, 0.9999])
    for name in post.names:
        q = np.asarray(post.quantile(name, p))
        assert (np.diff(q) > 0.0).all(), name
        assert np.abs(np.asarray(post.cdf(name, q)) - p).max() < 1e-6, name
        assert q[0] < post.mean(name) < q[-1]
        assert post.sd(name) > 0.0
        # Cantelli and the distance of median and mean: true of every law
        assert abs(post.mean(name) - post.quantile(name, 0.5)) <= post.sd(name)
        assert post.quantile(name, 0.0) <= q[0]
        assert post.quantile(name, 1.0) >= q[-1]
        assert post.cdf(name, -1e9) == 0.0
        assert post.cdf(name, 1e9) == pytest.approx(1.0, abs=1e-12)
        assert isinstance(post.quantile(name, 0.5), float)
        x = np.linspace(q[0], q[-1], 200)
        assert (np.diff(np.asarray(post.cdf(name, x))) >= 0.0).all()
        # mean and sd are those of the law that cdf tells
        middle = np.asarray(post.quantile(name, (np.arange(200) + 0.5) / 200))
        # a factor of few rows has tails that so many quantiles do not reach
        assert abs(middle.mean() - post.mean(name)) < (1e-2 if question.noise == "known" else 0.1) * post.sd(
            name
        )
        if question.noise == "known":
            assert abs(middle.std() / post.sd(name) - 1.0) < 4e-2


def test_a_far_outlier_of_e_n_keeps_its_digits() -> None:
    # forty sd beyond the bound: the law is exponential at 1, and no number underflows
    question = Question((Row("e_n", 5.0, 1.8, 0.02),), fix={"e_t": -0.9, "mu": 0.2})
    post = integrated(question)
    rate = 0.8 / 0.02**2
    assert post.mean("e_n") == pytest.approx(1.0 - 1.0 / rate, abs=2e-3 / rate)
    log_z = float(special.log_ndtr(-40.0))
    assert post.log_evidence == pytest.approx(log_z, abs=1e-4)
