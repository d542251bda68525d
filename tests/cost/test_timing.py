"""Timing: what is run, how often, and what is made of the seconds."""

from __future__ import annotations

import pytest

from ifrfit.cost.timing import Timing, in_turns, timed


def test_median_least_and_most():
    assert Timing.of([3.0, 1.0, 2.0]) == Timing(2.0, 1.0, 3.0, 3)
    assert Timing.of([3.0, 1.0]).per(2) == Timing(1.0, 0.5, 1.5, 2)


def test_calls_take_turns_after_two_runs_each():
    seen = []
    calls = {name: lambda name=name: seen.append(name) or name for name in "ab"}
    found = in_turns(calls, repeats=3, enough=0.0)
    assert "".join(seen) == "aabb" + "ab" * 3
    assert {name: given for name, (given, _) in found.items()} == {"a": "a", "b": "b"}
    assert all(time.repeats == 3 for _, time in found.values())


def test_what_takes_too_long_is_run_once_and_counts():
    seen = []
    found = in_turns({"slow": lambda: seen.append(1)}, repeats=3, most=-1.0)
    assert seen == [1]
    assert found["slow"][1].repeats == 1


def test_a_short_call_is_repeated_until_it_can_be_timed():
    seen = []
    time = timed(lambda: seen.append(1), repeats=2, enough=1e-3)
    assert time.repeats == 2
    assert len(seen) > 20
    assert 0.0 < time.low <= time.median <= time.high


def test_seconds_are_those_of_one_call(monkeypatch):
    now = [0.0]
    monkeypatch.setattr("ifrfit.cost.timing.time.perf_counter", lambda: now[0])

    def call():
        now[0] += 0.25

    assert timed(call, repeats=3, enough=1.0) == Timing(
        pytest.approx(0.25), pytest.approx(0.25), pytest.approx(0.25), 3
    )
