"""Items got ahead of their turn are the same items, and what goes wrong goes wrong in its turn."""

import multiprocessing
import threading

import pytest

from ifrfit.data.stream.read_ahead import read_ahead


def test_items_come_in_their_order():
    assert list(read_ahead(iter(range(50)))) == list(range(50))
    assert list(read_ahead(iter([None, 0, None]))) == [None, 0, None]
    assert list(read_ahead(iter([]))) == []


def test_an_error_is_raised_where_its_turn_comes():
    def two_of_three():
        yield 1
        yield 2
        raise ValueError("the third is damaged")

    found = read_ahead(two_of_three())
    assert [next(found), next(found)] == [1, 2]
    with pytest.raises(ValueError, match="the third is damaged"):
        next(found)


def test_one_item_is_got_while_another_is_looked_at():
    second = threading.Event()

    def items():
        yield 1
        second.set()
        yield 2

    found = read_ahead(items())
    assert next(found) == 1
    assert second.wait(10.0)
    assert list(found) == [2]


def test_whoever_stops_early_may_close_what_is_read():
    began, goes_on = threading.Event(), threading.Event()

    def items():
        yield 1
        began.set()
        goes_on.wait(10.0)
        yield 2

    source = items()
    found = read_ahead(source)
    assert next(found) == 1
    assert began.wait(10.0)
    threading.Timer(0.05, goes_on.set).start()
    found.close()
    source.close()  # raises while a generator is running


def _of_a_fork(found):
    found.put(list(read_ahead(iter(range(3)))))


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="needs fork")
def test_a_process_that_was_forked_off_reads_as_well():
    assert list(read_ahead(iter(range(3)))) == [0, 1, 2]
    fork = multiprocessing.get_context("fork")
    found = fork.SimpleQueue()
    child = fork.Process(target=_of_a_fork, args=(found,))
    child.start()
    child.join(20.0)
    alive = child.is_alive()
    child.kill()
    assert not alive
    assert found.get() == [0, 1, 2]
