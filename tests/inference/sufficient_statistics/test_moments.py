"""Sums that know no order, rows that stand for them, and bounds that are bounds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import optimize

from ifrfit.inference.sufficient_statistics.condensed_rows import condensed_rows
from ifrfit.inference.sufficient_statistics.moments import (
    SUMS,
    ExactSum,
    Moments,
)
from ifrfit.inference.sufficient_statistics.tau_intervals import Intervals
from ifrfit.inference.sufficient_statistics.transition_bounds import least_misfit
from ifrfit.physics import OBSERVABLES, get_closure
from ifrfit.physics.angles import Incidence

pytest.importorskip("numba")
BINS = 16


def bin_of(slip, cosine, bins):
    """Equal steps of tau/(1 + tau)."""
    return np.minimum((slip / (slip + cosine) * bins).astype(np.int32), np.int32(bins - 1))


def rows_of(seed, n):
    rng = np.random.default_rng(seed)
    slip, cosine = rng.uniform(0.01, 3.0, n), rng.uniform(0.01, 1.0, n)
    w = np.exp(rng.normal(0.0, 3.0, n))
    s, r = rng.normal(0.0, 1.0, n), rng.normal(0.0, 10.0, n)
    return rng.integers(2, size=n).astype(np.intp), bin_of(slip, cosine, BINS), w, s, r, cosine / slip


def sums_of(rows, at=slice(None)):
    made = Moments.nothing(2, BINS)
    group, *terms = (part[at] for part in rows)
    for own in (0, 1):
        made.add(own, *(part[group == own] for part in terms))
    return made.merge(Moments.nothing(2, BINS))


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 400), st.integers(1, 7))
def test_parts_and_their_order_change_no_bit(seed, n, parts):
    rows = rows_of(seed, n)
    whole = sums_of(rows)
    rng = np.random.default_rng(seed + 1)
    pieces = [sums_of(rows, at) for at in np.array_split(rng.permutation(n), parts)]
    for order in (rng.permutation(parts), rng.permutation(parts)):
        merged = Moments.nothing(2, BINS)
        for number in order:
            merged = merged.merge(pieces[number])
        np.testing.assert_array_equal(merged.high, whole.high)
    left = pieces[0].merge(pieces[-1])
    right = pieces[-1].merge(pieces[0])
    np.testing.assert_array_equal(left.high, right.high)


def test_the_sums_are_those_of_exact_arithmetic():
    from fractions import Fraction

    rows = rows_of(3, 500)
    whole = sums_of(rows)
    total = ExactSum().add(rows[4])
    assert total.high == float(sum(map(Fraction, rows[4].tolist()), Fraction(0)))
    assert ExactSum.of_equal(0.1, 12_345).high == float(Fraction(0.1) * 12_345)
    assert ExactSum.of_equal(0.1, 12_345) == ExactSum().add(np.full(12_345, 0.1))
    sigma, none = rows[2], np.zeros(500)
    first = np.zeros(500, dtype=np.int32)
    direct, one, measured = (Moments.nothing(1, BINS) for _ in range(3))
    direct.add_direct(0, sigma, *rows[3:5])
    one.add(0, first, 1.0 / (sigma * sigma), *rows[3:5], none)
    np.testing.assert_array_equal(direct.merge(direct).high, one.merge(one).high)
    measured.add_values(0, first, sigma, rows[3], rows[4] + 1.0, none + 1.0, none)
    one = Moments.nothing(1, BINS)
    one.add(0, first, 1.0 / (sigma * sigma), rows[3], (rows[4] + 1.0) - 1.0, none)
    np.testing.assert_array_equal(measured.high, one.high)
    np.testing.assert_array_equal(measured.low, one.low)
    group, place, w, s, r, _ = rows
    for g, b in ((0, 3), (1, 5), (0, 9)):
        here = np.flatnonzero((group == g) & (place == b))
        terms = np.array([w[here] * r[here] * r[here], w[here] * s[here] * s[here]])
        for term, column in zip(terms, (6, 1), strict=True):
            exact = float(sum((Fraction(t) for t in term.tolist()), Fraction(0)))
            assert whole.high[g, b, column] == exact
        assert whole.high[g, b, 0] == here.size
    assert whole.high.shape[2] == SUMS


@settings(max_examples=40, deadline=None)
@given(
    st.integers(0, 10_000), st.integers(1, 60), st.sampled_from(["beta", "beta_cm", "v_x", "spin_y_after"])
)
def test_condensed_rows_have_the_quadratics_of_all(seed, n, name):
    rng = np.random.default_rng(seed)
    gamma, spin = rng.uniform(0.5, 90.0, n), rng.normal(0.0, 1.0, n)
    incidence = Incidence.of(gamma, 0.0, spin, degrees=True)
    offset, slope = OBSERVABLES[name].linear(incidence, 0.4)
    value, w = offset + slope * rng.normal(0.5, 1.0, n), np.exp(rng.normal(size=n))
    slip = np.abs(incidence.slip_x)
    x = incidence.cosine / slip
    made = Moments.nothing(1, BINS)
    place = bin_of(slip, incidence.cosine, BINS)
    made.add(0, place, w, slope, value - offset, x - Intervals(BINS).middles[place])
    few = condensed_rows(made.high[0], Intervals(BINS), name, 0.4)
    assert few.count.sum() == pytest.approx(n)
    assert (np.diff(Intervals(BINS).edges) > 0.0).all()
    other = Incidence.of(few.gamma_deg, degrees=True)
    base, along = OBSERVABLES[name].linear(other, 0.4)
    for k, kappa in rng.normal(0.3, 0.5, (5, 2)):
        for all_k, few_k in (
            (np.full(n, k), np.full(few.value.size, k)),
            (k + kappa * x, k + kappa / other.tau),
        ):
            theirs = float((w * (value - offset - slope * all_k) ** 2).sum())
            ours = float((((few.value - base - along * few_k) / few.sigma) ** 2).sum())
            assert ours == pytest.approx(theirs, rel=1e-7)


@pytest.mark.parametrize("closure", ["ifr", "fr", "f", "ifr-contact"])
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("shift", [0.0, 0.4])
def test_a_bound_lies_below_every_fit_with_its_transition_there(closure, seed, shift):
    rng = np.random.default_rng(seed)
    n, bins = 300, 24
    gamma = rng.uniform(1.0, 85.0, n)
    incidence = Incidence.of(gamma, degrees=True)
    law = get_closure(closure).law(0.4)
    domain = get_closure(closure).domain(0.4)
    offset, slope = OBSERVABLES["beta"].linear(incidence, 0.4)
    c, kappa = rng.uniform(*domain), rng.uniform(0.05, 0.6)
    k, _ = law.impulse(incidence, c, kappa)
    # what no constants describe, too: sticking and sliding each would have their own transition
    value = offset + slope * k + 0.05 * rng.standard_normal(n) + shift * (gamma > 45.0)
    made = Moments.nothing(1, bins)
    slip = np.abs(incidence.slip_x)
    place = bin_of(slip, incidence.cosine, bins)
    x = incidence.cosine / slip
    made.add(0, place, np.full(n, 400.0), slope, value - offset, x - Intervals(bins).middles[place])
    bound = least_misfit(made.high[0], Intervals(bins), law, domain)
    tau = Intervals(bins).edges
    for _ in range(400):
        c, t = rng.uniform(*domain), np.exp(rng.uniform(-3.0, 2.0))
        b = law.b0 + law.b1 * c
        k, _ = law.impulse(incidence, c, b * t)
        misfit = float((400.0 * (value - offset - slope * k) ** 2).sum())
        where = int(np.searchsorted(tau, t, side="right")) - 1
        assert bound[where] <= misfit * (1.0 + 1e-9)


@pytest.mark.parametrize(("closure", "start"), [("fr", (0.69, 0.4)), ("ifr-contact", (-0.41, 0.19))])
def test_a_closure_that_the_data_refute_leaves_few_intervals_open(closure, start):
    # impacts of an interval stick with the c of all others: with a c of their own they would cost next to
    # nothing, and the bound would fall short by their misfit, in as many intervals as that outweighs
    rng = np.random.default_rng(4)
    n, bins = 100_000, 2048
    gamma = rng.uniform(1.0, 85.0, n)
    incidence = Incidence.of(gamma, degrees=True)
    offset, slope = OBSERVABLES["beta"].linear(incidence, 0.4)
    k, _ = get_closure("ifr").law(0.4).impulse(incidence, -0.7, 0.285)
    value = offset + slope * k + 0.03 * rng.standard_normal(n)
    made = Moments.nothing(1, bins)
    slip = np.abs(incidence.slip_x)
    place = bin_of(slip, incidence.cosine, bins)
    x = incidence.cosine / slip - Intervals(bins).middles[place]
    made.add(0, place, np.full(n, 0.03**-2), slope, value - offset, x)
    law, domain = get_closure(closure).law(0.4), get_closure(closure).domain(0.4)

    def misfit(constants):
        own, _ = law.impulse(incidence, *constants)
        return float((((value - offset - slope * own) / 0.03) ** 2).sum())

    best = optimize.minimize(misfit, start, method="Nelder-Mead", options={"xatol": 1e-7, "fatol": 1e-4}).fun
    assert best > 5.0 * n
    assert np.count_nonzero(least_misfit(made.high[0], Intervals(bins), law, domain) < best + 80.0) <= 6
