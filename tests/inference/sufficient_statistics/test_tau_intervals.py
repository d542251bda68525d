"""Intervals of tau that are parted where a transition may lie, so that few impacts are held of many."""

from __future__ import annotations

import numpy as np
import pytest
from streams import folder_of, impacts

import ifrfit
from ifrfit.data.conventions import Conventions
from ifrfit.data.selection import Selection
from ifrfit.data.stream import portions
from ifrfit.data.stream.impact_stream import ImpactStream
from ifrfit.inference.sufficient_statistics import passes, transition_window
from ifrfit.inference.sufficient_statistics.accumulated import Accumulated
from ifrfit.inference.sufficient_statistics.passes import Reader
from ifrfit.inference.sufficient_statistics.tau_intervals import Intervals
from ifrfit.inference.sufficient_statistics.window_rows import WindowRows
from ifrfit.physics.angles import Incidence
from ifrfit.physics.compiled_incidence import PARTS, incidence_of

pytest.importorskip("numba")


def parted_twice():
    once, former = Intervals(64).part(np.isin(np.arange(64), (0, 20, 21, 63)))
    assert once.count == 64 + 4 * (PARTS - 1)
    np.testing.assert_array_equal(np.flatnonzero(np.bincount(former) == PARTS), (0, 20, 21, 63))
    twice, _ = once.part(np.arange(once.count) == 40)
    return twice


def test_an_impact_lies_between_the_edges_of_its_interval():
    intervals = parted_twice()
    edges = intervals.edges
    assert edges.size == intervals.count + 1
    assert (np.diff(edges[:-1]) > 0.0).all()
    assert edges[0] == 0.0
    assert edges[-1] == np.inf
    rng = np.random.default_rng(0)
    gamma = np.concatenate((rng.uniform(0.0, 90.0, 4000), np.degrees(np.arctan(edges)), [0.0, 45.0, 90.0]))
    state, exact = incidence_of(gamma), Incidence.of(gamma, degrees=True)
    place, x = intervals.places(state)
    assert (place >= 0).all()
    assert (place < intervals.count).all()
    low, high = edges[place], edges[place + 1]
    assert (exact.tau >= low * (1.0 - 1e-14)).all()
    assert (exact.tau <= high * (1.0 + 1e-14)).all()
    moves = exact.slip > 0.0
    np.testing.assert_allclose(
        (x + intervals.middles[place])[moves], 1.0 / exact.tau[moves], rtol=1e-14, atol=1e-16
    )


def test_a_step_that_is_too_narrow_is_not_parted():
    intervals, before = Intervals(4), None
    while intervals != before:
        before = intervals
        intervals, former = intervals.part(np.arange(intervals.count) == intervals.count // 2)
        assert intervals.count < 1000
    np.testing.assert_array_equal(former, np.arange(intervals.count))
    narrowest = np.diff(intervals.edges[:-1] / (1.0 + intervals.edges[:-1])).min()
    assert 2.0**-40 < narrowest < 2.0**-30


@pytest.mark.parametrize("columns", [("beta", "e_n"), ("v_x", "v_n")])
def test_parting_gives_the_sums_that_a_pass_with_these_intervals_gives(tmp_path, columns):
    folder = folder_of(tmp_path / "all", impacts(3000, columns=columns, series=2), 2, "parquet")
    stream = ImpactStream.of(folder, Conventions(), Selection(), 0.4)

    def added(intervals, inside):
        found = Accumulated.nothing(stream, True, intervals, inside)
        for portion in stream.portions:
            for batch in stream.batches(portion, found.tally):
                found.add(batch)
        return found

    some = np.abs(np.arange(64) - 20) < 3
    whole = added(Intervals(64), some)
    finer = whole.parted(np.arange(64) < 20)  # as far as rows are kept: 18 and 19
    finer = finer.parted(np.arange(finer.intervals.count) == 30)
    own = added(finer.intervals, finer.window.inside)
    np.testing.assert_array_equal(finer.sums, own.sums)
    assert finer.intervals.count == 64 + 3 * (PARTS - 1)
    for name, rows in own.window.arrays().items():
        np.testing.assert_array_equal(finer.window.arrays()[name], rows)


@pytest.fixture
def many_in_small(monkeypatch):
    """As if tens of thousands of rows were thousands of millions."""
    monkeypatch.setattr(portions, "FIRST_ROWS", 2000)
    monkeypatch.setattr(portions, "ROWS", 4000)
    monkeypatch.setattr(passes, "_STAGE", 2)


def held_of(monkeypatch, call):
    """What a call gives, and the most rows that were kept at once and that any problem has one by one."""
    kept, single = [0], [0]
    add, rows = WindowRows.merge, WindowRows.rows

    def counted(window, following, series):
        add(window, following, series)
        kept.append(sum(len(part[0]) for parts in window.parts.values() for part in parts))

    def told(*given, **named):
        found = rows(*given, **named)
        single.append(sum(of.shape[1] for of in found.values()))
        return found

    with monkeypatch.context() as patched:
        patched.setattr(WindowRows, "merge", counted)
        patched.setattr(WindowRows, "rows", told)
        result = call()
    return result, max(kept), max(single)


def test_few_rows_are_held_of_many(tmp_path, monkeypatch, many_in_small):
    folder = folder_of(tmp_path / "all", impacts(32_000, sigma=0.001, spin=0.0), 8, "parquet")
    compared = lambda: ifrfit.compare(folder, loo=False)  # noqa: E731
    monkeypatch.setattr("ifrfit.inference.sufficient_statistics.stream_fit.BINS", 64)
    coarse, many, most = held_of(monkeypatch, compared)
    monkeypatch.setattr(transition_window, "_FEW_ROWS", 100)
    parted, few, least = held_of(monkeypatch, compared)
    assert few < many / 5
    assert least < most / 5
    assert parted.ranked == coarse.ranked
    for name, entry in parted.entries.items():
        other = coarse.entries[name]
        assert entry.log_evidence == pytest.approx(other.log_evidence, rel=1e-10, abs=1e-4)
        assert entry.fit.fit.chi2 == pytest.approx(other.fit.fit.chi2, rel=1e-9)
        for constant, found in entry.fit.constants.items():
            theirs = other.fit.constants[constant]
            assert found.value == pytest.approx(theirs.value, abs=1e-3 * theirs.stderr)


def test_whoever_reads_and_whatever_is_resumed_parting_changes_no_bit(tmp_path, monkeypatch, many_in_small):
    monkeypatch.setattr(transition_window, "_FEW_ROWS", 100)
    monkeypatch.setattr("ifrfit.inference.sufficient_statistics.stream_fit.BINS", 64)
    asked = []
    parted = Accumulated.parted
    monkeypatch.setattr(Accumulated, "parted", lambda *given: asked.append(1) or parted(*given))
    folder = folder_of(tmp_path / "all", impacts(20_000, sigma=0.003), 5, "parquet")
    alone = ifrfit.fit(folder, method="lsq")
    assert asked
    from ifrfit.inference.estimators import LeastSquares

    shared = ifrfit.fit(folder, method=LeastSquares(workers=2))
    for name in ("e_n", "e_t", "mu"):
        assert shared.constants[name].value == alone.constants[name].value
    assert shared.fit == alone.fit


def test_a_long_first_portion_is_parted_for(tmp_path, monkeypatch, many_in_small):
    folder = folder_of(tmp_path / "all", impacts(20_000, sigma=0.003), 2, "parquet")
    monkeypatch.setattr("ifrfit.inference.sufficient_statistics.stream_fit.BINS", 64)
    alone = ifrfit.fit(folder, method="lsq")
    monkeypatch.setattr(passes, "_MOST_KEPT", 10)
    monkeypatch.setattr(transition_window, "_FEW_ROWS", 100)
    fetched = []
    monkeypatch.setattr(Reader, "fetch", lambda *given: fetched.append(1))
    found = ifrfit.fit(folder, method="lsq")
    assert not fetched
    for name in ("e_n", "e_t", "mu"):
        assert found.constants[name].value == pytest.approx(alone.constants[name].value, rel=1e-9)
