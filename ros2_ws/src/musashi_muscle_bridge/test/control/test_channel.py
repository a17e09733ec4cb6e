"""Objects cross whole and in order, and a slow or missing other end holds up nobody."""

import threading
from collections.abc import Iterator

import numpy as np
import pytest

from musashi_muscle_bridge.buses.protocol import JOINT_ROW, STATE_ROW, StateFrame
from musashi_muscle_bridge.control.channel import Channel, channel_pair
from musashi_muscle_bridge.control.loop import Measurement


@pytest.fixture
def ends() -> Iterator[tuple[Channel, Channel]]:
    here, socket = channel_pair()
    there = Channel(socket)
    yield here, there
    here.close()
    there.close()


def test_what_is_put_is_taken_in_order(ends: tuple[Channel, Channel]) -> None:
    for item in (1, "two", [3.0]):
        assert ends[0].put(item)
    assert ends[1].take() == [1, "two", [3.0]]


def test_an_array_crosses_unchanged(ends: tuple[Channel, Channel]) -> None:
    ends[0].put(np.array([1.5, np.nan]))
    assert ends[1].wait().tobytes() == np.array([1.5, np.nan]).tobytes()


def test_a_measurement_crosses_unchanged(ends: tuple[Channel, Channel]) -> None:
    state = StateFrame(7, np.ones(3, STATE_ROW), np.ones(2, JOINT_ROW), session=5)
    ends[0].put(Measurement(state, np.array([True, False, True]), True, 4.25))
    back = ends[1].wait()
    assert (type(back), back.state.encode()) == (Measurement, state.encode())
    assert (back.lost.tolist(), back.joints_fresh, back.received) == (
        [True, False, True],
        True,
        4.25,
    )


def test_nothing_is_taken_where_nothing_was_put(ends: tuple[Channel, Channel]) -> None:
    assert ends[1].take() == []
    assert not ends[1].closed


def test_an_end_that_reads_nothing_holds_up_nobody(ends: tuple[Channel, Channel]) -> None:
    went = [ends[0].put(number) for number in range(100_000)]
    assert not all(went)
    assert ends[1].take() == [number for number, sent in enumerate(went) if sent]


def test_what_was_put_before_the_end_is_still_taken(ends: tuple[Channel, Channel]) -> None:
    ends[0].put("last")
    ends[0].close()
    assert ends[1].take() == ["last"]
    assert ends[1].closed


def test_nothing_goes_to_an_end_that_is_gone(ends: tuple[Channel, Channel]) -> None:
    ends[1].close()
    assert not ends[0].put(1)


def test_shutting_ends_the_waiting_of_both(ends: tuple[Channel, Channel]) -> None:
    waiting = [threading.Thread(target=end.wait) for end in ends]
    for thread in waiting:
        thread.start()
    ends[0].shut()
    for thread in waiting:
        thread.join(10.0)
    assert not any(thread.is_alive() for thread in waiting)


def test_shutting_twice_does_no_harm(ends: tuple[Channel, Channel]) -> None:
    ends[0].shut()
    ends[1].shut()
    assert ends[0].wait() is None
