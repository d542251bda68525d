"""Shared against separate constants: which questions are put, and what the evidence is said to mean."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from ifrfit.data.observations import Observations, make_table
from ifrfit.errors import DataError
from ifrfit.inference.diagnostics.nested_models import sharing
from ifrfit.inference.diagnostics.thresholds import FACTS
from ifrfit.inference.model.prior_specification import make_parameters
from ifrfit.inference.model.problem import make_problem
from ifrfit.inference.posterior import log_evidence
from ifrfit.physics import get_closure

SIGMA = 0.02


def build(mu=(0.1, 0.1), *, rows=12, separate=(), fix=None, prior=None, closure="ifr", seed=0):
    """Series of beta and e_n, each with its own mu."""
    rng = np.random.default_rng(seed)
    gamma = np.tile(np.linspace(10.0, 80.0, rows // 2), 2 * len(mu))
    n = gamma.size
    index = np.repeat(np.arange(len(mu)), rows)
    table = make_table(
        {
            "series": [f"run {1 + i}" for i in index],
            "observable": ["beta" if i % rows < rows // 2 else "e_n" for i in range(n)],
            "gamma_deg": gamma,
            "value": np.zeros(n),
            "sigma": np.full(n, SIGMA),
        }
    )
    chosen = get_closure(closure)

    def problem_of(table, constants):
        return make_problem(Observations(table), chosen, 0.4, constants, "known")

    apart = problem_of(table, make_parameters(chosen, 0.4, separate=("mu",)))
    value = apart.predict(np.array([0.9, -0.8, *mu])) + SIGMA * rng.standard_normal(n)
    constants = make_parameters(chosen, 0.4, separate=separate, fix=fix, prior=prior)
    return problem_of(table.assign(value=value), constants)


class Fake:
    """Evidence by the set of separate constants; keeps what it was asked."""

    def __init__(self, evidence):
        self.evidence = {frozenset(key): value for key, value in evidence.items()}
        self.asked = []

    def __call__(self, problem):
        separate = frozenset(c.name for c in problem.parameters if c.separate)
        self.asked.append((separate, problem))
        value = self.evidence[separate]
        if value is None:
            raise DataError("too few")
        return value


def test_a_separate_constant_is_tried_shared():
    problem = build(separate=("mu",))
    fake = Fake({(): 10.0 + math.log(14.0)})
    fact = sharing(problem, 10.0, fake)
    assert fact.ok
    assert fact.says == "the data favour one mu for all series over separate mu by a factor 14"
    assert fact.threshold == FACTS["sharing"]
    assert fact.figures["tested"] == ["mu"]
    assert fact.figures["direction"] == "shared"
    assert fact.figures["preferred"] == []
    now, other = fact.figures["models"]
    assert now == {"separate": ["mu"], "log_evidence": 10.0, "log_bayes_factor": 0.0}
    assert other["separate"] == []
    assert other["log_bayes_factor"] == pytest.approx(math.log(14.0))
    # everything else of the question stays as it was
    [(_, asked)] = fake.asked
    assert asked.parameters.names == ("e_n", "e_t", "mu")
    assert (asked.rows, asked.noise, asked.series) == (problem.rows, problem.noise, problem.series)


@pytest.mark.parametrize(
    ("gain", "factor"),
    [(math.log(4.2), "a factor 4.2"), (math.log(500.0), "a factor 500"), (23.2, "a factor e^23")],
)
def test_how_much_in_words(gain, factor):
    fact = sharing(build(separate=("mu",)), 0.0, Fake({(): -gain}))
    assert fact.ok
    assert fact.says == f"the data favour separate mu over one mu for all series by {factor}"
    assert fact.figures["preferred"] == ["mu"]


@pytest.mark.parametrize("gain", [0.0, math.log(2.9), -math.log(2.9)])
def test_within_a_factor_three_there_is_no_preference(gain):
    fact = sharing(build(separate=("mu",)), 5.0, Fake({(): 5.0 + gain}))
    assert fact.ok
    said = f"{math.exp(abs(gain)):.2g}"
    assert fact.says == (
        f"the data have no preference between separate mu and one mu for all series (a factor {said})"
    )
    assert fact.figures["preferred"] is None


def test_several_separate_constants_are_tried_together_and_one_by_one():
    fake = Fake({(): -9.0, ("mu",): 4.0, ("e_t",): -7.0})
    fact = sharing(build(separate=("e_t", "mu")), 0.0, fake)
    assert [separate for separate, _ in fake.asked] == [frozenset(), {"mu"}, {"e_t"}]
    assert fact.says == (
        "the data favour one e_t for all series with separate mu over separate e_t and mu by a factor 55"
    )
    assert fact.figures["preferred"] == ["mu"]
    assert [m["log_bayes_factor"] for m in fact.figures["models"]] == [0.0, -9.0, 4.0, -7.0]


def test_the_question_as_asked_is_compared_with_its_best_rival():
    fake = Fake({(): -9.0, ("mu",): -4.0, ("e_t",): -7.0})
    fact = sharing(build(separate=("e_t", "mu")), 0.0, fake)
    assert fact.says == (
        "the data favour separate e_t and mu over one e_t for all series with separate mu by a factor 55"
    )


def test_all_three_separate_cost_four_explorations():
    every = {(): -9.0, ("mu", "e_t"): -1.0, ("e_t", "e_n"): -2.0, ("mu", "e_n"): -3.0}
    fake = Fake(every)
    assert sharing(build(separate=("e_n", "e_t", "mu")), 0.0, fake).ok
    assert {separate for separate, _ in fake.asked} == set(fake.evidence)


def test_shared_constants_by_name_are_tried_separate():
    fake = Fake({("mu",): 23.0})
    fact = sharing(build(), 0.0, fake, names=("mu",))
    [(_, asked)] = fake.asked
    assert asked.parameters.names == ("e_n", "e_t", "mu[run 1]", "mu[run 2]")
    assert fact.figures["direction"] == "separate"
    assert not fact.ok
    assert fact.says == (
        "the data favour separate mu over one mu for all series by a factor e^23: --separate mu"
    )


@pytest.mark.parametrize(("gain", "ok"), [(math.log(19.9), True), (math.log(20.1), False), (-30.0, True)])
def test_shared_constants_are_refuted_beyond_a_factor_twenty(gain, ok):
    fact = sharing(build(), 0.0, Fake({("mu",): gain}), names=("mu",))
    assert fact.ok == ok
    assert ("--separate" in fact.says) != ok


def test_the_remedy_names_what_is_to_be_separate_only():
    fake = Fake({("e_t", "mu"): 20.0, ("e_t",): -3.0, ("mu",): 22.0})
    fact = sharing(build(), 0.0, fake, names=("e_t", "mu"))
    assert fact.says == (
        "the data favour one e_t for all series with separate mu over one e_t and one mu for all series "
        "by a factor e^22: --separate mu"
    )


def test_names_of_separate_and_fixed_constants_are_passed_over():
    problem = build(separate=("e_t",), fix={"e_n": 0.9})
    fake = Fake({("e_t", "mu"): -5.0})
    fact = sharing(problem, 0.0, fake, names=("e_n", "e_t", "mu"))
    assert fact.figures["tested"] == ["mu"]
    assert fact.figures["models"][0]["separate"] == ["e_t"]
    assert sharing(problem, 0.0, fake, names=("e_n", "e_t")) is None


def test_a_prior_stays_with_its_constant():
    fake = Fake({("mu",): 0.0})
    sharing(build(prior={"mu": (0.1, 0.02)}), 0.0, fake, names=("mu",))
    [(_, asked)] = fake.asked
    assert [c.prior for c in asked.parameters if c.name == "mu"] == [(0.1, 0.02)]


def test_where_there_is_nothing_to_ask_nothing_is_explored():
    fake = Fake({})
    assert sharing(build((0.1,), separate=("mu",)), 0.0, fake) is None  # one series
    assert sharing(build(), 0.0, fake) is None  # nothing separate
    assert sharing(build(separate=("mu",)), math.nan, fake) is None
    problem = build()
    lone = problem.with_rows(np.arange(13))  # one row of run 2
    assert sharing(lone, 0.0, fake, names=("mu",)) is None
    assert fake.asked == []


def test_a_question_that_is_refused_is_left_out():
    problem = build()
    assert sharing(problem, 0.0, Fake({("mu",): None}), names=("mu",)) is None
    fake = Fake({("e_t", "mu"): None, ("e_t",): -1.5, ("mu",): math.nan})
    fact = sharing(problem, 0.0, fake, names=("e_t", "mu"))
    assert [m["separate"] for m in fact.figures["models"]] == [[], ["e_t"]]
    assert fact.says == (
        "the data favour one e_t and one mu for all series over one mu for all series with separate e_t "
        "by a factor 4.5"
    )


def grid(problem):
    """Evidence of beta and e_n with e_n and e_t known, over mu alone, each series on its own grid."""
    mu = np.linspace(0.0, 2.0, 2001)
    log_l = np.empty((len(problem.series), mu.size))
    shared = make_parameters(problem.closure, 0.4)
    plain = make_problem(problem.observations, problem.closure, 0.4, shared, "known")
    z = np.empty((mu.size, plain.rows.value.size))
    for i, value in enumerate(mu):
        z[i] = (plain.rows.value - plain.predict(np.array([0.9, -0.8, value]))) / plain.noise.sigma
    for series in range(len(problem.series)):
        log_l[series] = -0.5 * (z[:, plain.rows.series == series] ** 2).sum(axis=1)

    def log_mean(x):
        return float(x.max() + np.log(np.trapezoid(np.exp(x - x.max()), mu) / 2.0))

    separate = any(c.separate for c in problem.parameters)
    found = sum(log_mean(x) for x in log_l) if separate else log_mean(log_l.sum(axis=0))
    return SimpleNamespace(log_evidence=found)


@pytest.mark.parametrize(("mu", "preferred"), [((0.1, 0.1), []), ((0.1, 0.2), ["mu"])])
def test_the_exact_posterior_tells_the_two_apart(mu, preferred):
    fix = {"e_n": 0.9, "e_t": -0.8}
    problem = build(mu, separate=("mu",), fix=fix)
    fact = sharing(problem, log_evidence(problem), log_evidence)
    assert fact.figures["preferred"] == preferred
    expected = grid(build(mu, fix=fix)).log_evidence - grid(problem).log_evidence
    assert fact.figures["models"][1]["log_bayes_factor"] == pytest.approx(expected, abs=1e-3)
