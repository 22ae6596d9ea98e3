"""Processes that share a list: order, an early end, and one that is killed."""

import multiprocessing
import os
import signal
import time

import pytest

from mission.errors import FlightError
from mission.side_by_side import side_by_side

kept: list[int] = []  # of each process


def slow_if_even(number: int) -> int:
    time.sleep(0.0 if number % 2 else 0.2)
    return number


def begin(number: int) -> None:
    kept.append(number)


def added(number: int) -> int:
    return kept[0] + number


def killed_by_two(number: int) -> int:
    if number == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def test_results_come_in_the_order_of_the_tasks_or_all_the_same() -> None:
    assert list(side_by_side(slow_if_even, range(4), 2)) == [0, 1, 2, 3]
    assert sorted(side_by_side(slow_if_even, range(4), 2, in_order=False)) == [0, 1, 2, 3]


def test_every_process_is_set_up_once() -> None:
    assert list(side_by_side(added, range(3), 2, begin, (10,))) == [10, 11, 12]


def test_a_killed_process_is_told_and_not_awaited() -> None:
    with pytest.raises(FlightError, match="died"):
        list(side_by_side(killed_by_two, range(5), 1))


def test_no_process_outlives_an_iterator_that_is_closed_early() -> None:
    before = set(multiprocessing.active_children())
    results = side_by_side(slow_if_even, range(0, 100, 2), 2)
    assert next(results) == 0
    results.close()
    deadline_s = time.monotonic() + 20.0
    while set(multiprocessing.active_children()) - before and time.monotonic() < deadline_s:
        time.sleep(0.05)
    assert not set(multiprocessing.active_children()) - before
