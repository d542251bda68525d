"""Facts are worked out when they are first read, once, and travel as they are."""

from __future__ import annotations

import pickle

import pytest

import ifrfit
from ifrfit.inference.result.deferred import Deferred


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
