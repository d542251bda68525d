"""The rule of statuses, case by case."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from ifrfit.inference.model.parameters import Domain, Kappa, Parameter
from ifrfit.inference.result.types import Estimate
from ifrfit.inference.summary.status import Known, Marginal, OneSided, estimate_of, linear

DOMAIN = Domain(0.0, math.inf, 2.0)
PRIOR_SD = 2.0 / math.sqrt(12.0)


def one_sided(below: bool) -> OneSided:
    return OneSided((0.0, 0.12), (0.0, 0.14), 0.02) if below else OneSided((0.1, 2.0), (0.08, 2.0), 0.02)


CLEAR = Marginal(0.1, 0.02, (0.08, 0.12), (0.06, 0.14), (False, False), one_sided, mean=0.101)


@pytest.mark.parametrize(
    ("marginal", "known", "status", "value", "reason"),
    [
        (CLEAR, Known(plain="plain"), "determined", 0.1, "plain"),
        (replace(CLEAR, pieces=2), Known(), "determined", 0.1, "several optima describe the data"),
        (CLEAR, Known(prior="your prior"), "prior", 0.1, "your prior"),
        (CLEAR, Known(seen=False), "not_determined", None, "the data do not fix a value"),
        (CLEAR, Known(unique=False), "not_determined", None, "two optima are equally good"),
        (replace(CLEAR, sd=0.51 * PRIOR_SD), Known(loose="wide"), "not_determined", None, "wide"),
        (replace(CLEAR, sd=0.49 * PRIOR_SD), Known(), "determined", 0.1, ""),
        (replace(CLEAR, reached=(True, False)), Known(), "one_sided", 0.1, "not told from its bound 0"),
        (replace(CLEAR, value=0.0, reached=(True, False)), Known(), "one_sided", 0.0, "lies on its bound 0"),
        (replace(CLEAR, reached=(True, False)), Known(optimum=0.0), "one_sided", 0.1, "lies on its bound 0"),
        (replace(CLEAR, reached=(False, True)), Known(seen=False), "one_sided", None, "only a lower limit"),
        (replace(CLEAR, reached=(True, True)), Known(loose="flat"), "not_determined", None, "flat"),
        # an upper limit near the end of the default prior says nothing, a lower one does
        (replace(CLEAR, central95=(0.0, 1.9), reached=(True, False)), Known(), "not_determined", None, None),
        (replace(CLEAR, central95=(0.1, math.inf), reached=(False, True)), Known(), "one_sided", 0.1, None),
    ],
)
def test_each_row_of_the_table(
    marginal: Marginal, known: Known, status: str, value: float | None, reason: str | None
) -> None:
    found = estimate_of(DOMAIN, marginal, known)
    assert (found.status, found.value, found.mean) == (status, value, 0.101)
    assert (found.stderr is None) == (value is None)
    assert reason is None or found.reason == reason


def test_a_value_far_from_the_bound_is_not_stated() -> None:
    far = replace(CLEAR, reached=(True, False), one_sided=lambda _: OneSided((0.0, 0.5), (0.0, 0.6), None))
    found = estimate_of(DOMAIN, far, Known())
    assert (found.value, found.interval95, found.reason) == (None, (0.0, 0.6), "only an upper limit")


def _of_kappa(e_n: Parameter, mu: Parameter) -> Domain:
    return Kappa("kappa", 0, 1, e_n, mu).domain


def test_the_domain_of_kappa_follows_from_those_of_mu_and_e_n() -> None:
    e_n, mu = Parameter("e_n", 0.5, 0.9), Parameter("mu", 0.1, 0.2)
    assert _of_kappa(e_n, mu) == Domain(0.1 * 1.5, 0.2 * 1.9, 0.2 * 1.9)
    assert _of_kappa(replace(e_n, fixed=0.8), mu) == Domain(0.1 * 1.8, 0.2 * 1.8, 0.2 * 1.8)
    assert _of_kappa(e_n, replace(mu, fixed=0.1)) == Domain(0.1 * 1.5, 0.1 * 1.9, 0.1 * 1.9)
    free = _of_kappa(Parameter("e_n", 0.0, 1.0), Parameter("mu", 0.0, math.inf))
    assert (free.lower, free.upper, free.prior_upper) == (0.0, math.inf, 4.0)


def test_a_linear_function_keeps_the_status_and_names_its_own_bound() -> None:
    mu = Estimate(0.2, 0.01, (0.19, 0.2), (0.17, 0.2), "one_sided", "lies on its bound 0.2", mean=0.19)
    kappa = linear(mu, 0.0, 1.5, Domain(0.15, 0.3, 0.3))
    assert (kappa.status, kappa.reason) == ("one_sided", "lies on its bound 0.3")
    assert kappa.interval95 == pytest.approx((0.255, 0.3))
    assert (kappa.value, kappa.stderr, kappa.mean) == pytest.approx((0.3, 0.015, 0.285))
    limit = Estimate(None, None, (0.1, math.inf), (0.08, math.inf), "one_sided", "only a lower limit")
    assert linear(limit, 0.0, 1.5, DOMAIN).interval95 == pytest.approx((0.12, math.inf))
