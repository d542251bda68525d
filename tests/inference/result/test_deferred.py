"""Facts are worked out when they are first read, once, and travel as they are."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

import ifrfit
from ifrfit.inference.result import build
from ifrfit.inference.result.deferred import Deferred, Postponed, PostponedField, replaced


def test_entries_are_computed_once_at_the_first_access():
    calls = []

    def compute():
        calls.append(1)
        return {"a": 1, "b": 2}

    deferred = Deferred(compute)
    assert not calls
    assert deferred["a"] == 1
    assert list(deferred) == ["a", "b"]
    assert len(deferred) == 2
    assert dict(deferred) == deferred == {"a": 1, "b": 2}
    assert repr(deferred) == "{'a': 1, 'b': 2}"
    assert len(calls) == 1


def test_a_copy_for_another_process_carries_the_entries():
    assert pickle.loads(pickle.dumps(Deferred(lambda: {"a": 1}))) == {"a": 1}


def test_a_fit_whose_facts_nobody_reads_tries_no_slip(monkeypatch):
    class AskedError(Exception):
        pass

    def refuse(*_):
        raise AskedError

    monkeypatch.setattr("ifrfit.inference.result.build.causes_of", refuse)
    found = ifrfit.fit("kharaz-2001", method="lsq")
    assert found.derived["kappa"].value == pytest.approx(0.18, abs=0.02)
    with pytest.raises(AskedError):
        found.summary()


def test_a_field_may_be_given_as_postponed_and_is_worked_out_once():
    calls = []

    class Holder:
        kept = PostponedField("kept")

    def compute():
        calls.append(1)
        return 3

    holder = Holder()
    holder.kept = Postponed(compute)
    assert not calls
    assert holder.kept == holder.kept == 3
    assert len(calls) == 1
    holder.kept = 4
    assert holder.kept == 4
    assert pickle.loads(pickle.dumps(Postponed(compute))) == 3


def test_draws_points_and_assumptions_wait_until_they_are_read(monkeypatch):
    made = []
    for name in ("_drawn", "_points", "assumed_of"):
        original = getattr(build, name)
        monkeypatch.setattr(
            build, name, lambda *a, _name=name, _original=original: (made.append(_name), _original(*a))[1]
        )
    found, other = (ifrfit.fit("kharaz-2001", seed=5) for _ in range(2))
    assert not made
    assert found.state.sample.shape[0] == build.DRAWS
    assert len(found.points) == found.fit.n
    assert found.assumed
    assert sorted(made) == ["_drawn", "_points", "assumed_of"]
    # whatever is read first, or never, the result is the same
    assert len(other.points) == found.fit.n
    assert np.array_equal(other.state.sample, found.state.sample)
    assert replace(other, command="").to_dict() == found.to_dict() | {"created": other.created}


def test_a_copy_with_other_fields_asks_for_nothing_that_is_postponed():
    found = ifrfit.fit("kharaz-2001", method="lsq")
    before = found.__dict__["points"]
    made = replaced(found, seed=3)
    assert made.seed == 3
    assert made.__dict__["points"] is before
    assert made.points.equals(found.points)
