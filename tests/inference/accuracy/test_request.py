"""What can be asked for, and the time that is left."""

from __future__ import annotations

import math

import pytest

from ifrfit.errors import UsageError
from ifrfit.inference.accuracy.request import make_request, seconds_of


@pytest.mark.parametrize(
    ("text", "seconds"),
    [("2s", 2.0), ("500ms", 0.5), ("3min", 180.0), ("1h", 3600.0), ("0.25", 0.25), (" 2 s ", 2.0), (7, 7.0)],
)
def test_times_are_read_as_people_write_them(text, seconds):
    assert seconds_of(text) == pytest.approx(seconds, rel=1e-15)


@pytest.mark.parametrize("text", ["2 parsec", "", "s", "-1s", "0", "nan", "inf", "1,5s", "1.2.3s", "2S"])
def test_other_times_are_refused(text):
    with pytest.raises(UsageError, match="write a time, as 2s, 500ms or 3min"):
        seconds_of(text)


@pytest.mark.parametrize("accuracy", [0.0, -1.0, 1e-10, 0.51, math.nan, math.inf])
def test_accuracies_beyond_reason_are_refused(accuracy):
    with pytest.raises(UsageError, match=r"choose from 1e-9 to 0\.5"):
        make_request(accuracy, None)


def test_time_runs_from_when_the_user_asked():
    assert make_request(None, 10.0, started=3.0, clock=lambda: 5.0).seconds == 2.0
    assert make_request(None, 10.0, clock=lambda: 5.0).seconds == 0.0


def test_a_tenth_of_the_budget_is_kept_for_what_comes_after():
    now = iter([100.0, 101.0, 101.0, 109.5])
    request = make_request(None, "10s", clock=lambda: next(now))
    assert request.seconds == 1.0
    assert request.left == pytest.approx(8.0)
    assert request.over


def test_without_a_budget_there_is_no_end():
    request = make_request(1e-3, None)
    assert request.left == math.inf
    assert not request.over
