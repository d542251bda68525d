"""The incoming state of many impacts by compiled loops: that of the reference, to its last digit."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

from ifrfit.physics.angles import Incidence
from ifrfit.physics.compiled_incidence import incidence_of, intervals_of

pytest.importorskip("numba")
BINS = 2048
NO_TREE = np.full(BINS, -1, dtype=np.int32), np.arange(BINS, dtype=np.int32)


def middles():
    share = (np.arange(BINS) + 0.5) / BINS
    return (1.0 - share) / share


def test_sines_and_cosines_to_fifty_digits():
    rng = np.random.default_rng(0)
    gamma = np.concatenate((rng.uniform(0.0, 90.0, 400), 90.0 - 10.0 ** rng.uniform(-12.0, 0.0, 50)))
    found = incidence_of(gamma)
    with mpmath.workdps(50):
        for own, sine, cosine in zip(gamma.tolist(), found.sine, found.cosine, strict=True):
            angle = mpmath.mpf(own) * mpmath.pi / 180
            # the angle in radians is rounded once (half a unit, times its size over its sine), the sum again
            assert sine == pytest.approx(float(mpmath.sin(angle)), rel=4.5e-16)
            assert cosine == pytest.approx(float(mpmath.cos(angle)), rel=4.5e-16)


@pytest.mark.parametrize("spin", [None, 0.5])
def test_the_state_is_that_of_the_reference(spin):
    rng = np.random.default_rng(1)
    gamma = np.concatenate(([0.0, 45.0, 90.0], rng.uniform(0.0, 90.0, 1000)))
    spins = () if spin is None else (spin * rng.standard_normal(1003), spin * rng.standard_normal(1003))
    found, known = incidence_of(gamma, *spins), Incidence.of(gamma, *spins, degrees=True)
    for name in ("sine", "cosine", "spin_x", "spin_y", "slip_x", "slip_y"):
        np.testing.assert_allclose(getattr(found, name), getattr(known, name), rtol=1e-15, atol=3e-16)
    assert found.sine[1] == found.cosine[1]
    place, x = intervals_of(found, BINS, middles(), *NO_TREE)
    tau = known.tau
    share = np.where(np.isinf(tau), 1.0, tau / (1.0 + np.where(np.isinf(tau), 0.0, tau)))
    steps = share * BINS
    inner = np.abs(steps - np.round(steps)) > 1e-9  # elsewhere the last digit decides
    np.testing.assert_array_equal(place[inner], np.minimum(steps[inner].astype(int), BINS - 1))
    moves = known.slip > 0.0
    np.testing.assert_allclose((x + middles()[place])[moves], 1.0 / tau[moves], rtol=1e-14, atol=1e-16)
    assert (x[~moves] == 0.0).all()


def test_a_row_has_the_same_bits_wherever_it_stands():
    rng = np.random.default_rng(2)
    gamma, spin = rng.uniform(0.0, 90.0, 101), rng.standard_normal(101)
    none = np.zeros(101)
    whole = incidence_of(gamma, none, spin)
    places = intervals_of(whole, BINS, middles(), *NO_TREE)
    for at in (slice(3, 4), slice(5, 22), slice(1, None, 3)):
        part = incidence_of(gamma[at], none[at], spin[at])
        np.testing.assert_array_equal(part.sine, whole.sine[at])
        np.testing.assert_array_equal(part.cosine, whole.cosine[at])
        for own, of_all in zip(intervals_of(part, BINS, middles(), *NO_TREE), places, strict=True):
            np.testing.assert_array_equal(own, of_all[at])
