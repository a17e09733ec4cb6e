"""Boards obey one bridge at a time, and each of its frames once and in order."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fastswing_planner.robot.description import Robot
from musashi_muscle_bridge.buses.protocol import (
    COMMAND_ROW,
    CommandFrame,
    Fault,
    Mode,
    StateFrame,
    WatchdogAction,
)
from musashi_muscle_bridge.emulation.board_link import BoardLink
from musashi_muscle_bridge.emulation.boards import Boards

TIMEOUT = 0.1
BRIDGE, OTHER = ("127.0.0.1", 50000), ("127.0.0.1", 50001)


def command(
    sequence: int, *, session: int = 1, mode: Mode = Mode.LENGTH, clear: bool = False
) -> bytes:
    rows = np.zeros(2, COMMAND_ROW)
    rows["id"] = 0, 1
    rows["mode"], rows["setpoint"] = mode, 1.0
    rows["tension_limit"], rows["current_limit"] = 60.0, 8.0
    action = WatchdogAction.ZERO_CURRENT
    return CommandFrame(sequence, rows, action, TIMEOUT, clear, session).encode()


def state(answer: bytes | None) -> StateFrame:
    assert answer is not None
    return StateFrame.decode(answer)


@pytest.fixture(scope="module")
def boards(hoist: Robot) -> Boards:
    return Boards(hoist)


@pytest.fixture
def link(hoist: Robot) -> BoardLink:
    link = BoardLink(Boards(hoist))
    link.answer(command(100), BRIDGE)
    return link


def test_an_answer_carries_session_and_sequence_of_its_command(link: BoardLink) -> None:
    answer = state(link.answer(command(101), BRIDGE))
    assert (answer.session, answer.sequence) == (1, 101)


# Order.


def test_lost_frames_leave_a_gap_that_is_no_objection(link: BoardLink) -> None:
    assert link.answer(command(150), BRIDGE) is not None


@pytest.mark.parametrize("sequence", [100, 99, 1, 100 + 2**31], ids=lambda s: f"sequence_{s}")
def test_a_frame_that_is_not_newer_gets_no_answer(link: BoardLink, sequence: int) -> None:
    assert link.answer(command(sequence), BRIDGE) is None


def test_a_frame_that_is_not_newer_is_counted(link: BoardLink) -> None:
    link.answer(command(100), BRIDGE)
    assert link.refused == {"damaged": 0, "foreign": 0, "old": 1}


def test_a_repeated_frame_is_not_carried_out(hoist: Robot) -> None:
    boards = Boards(hoist)
    link = BoardLink(boards)
    link.answer(command(1), BRIDGE)
    link.answer(command(1, mode=Mode.CURRENT), BRIDGE)
    assert boards.state(0).rows["mode"].tolist() == [Mode.LENGTH] * 2


def test_a_repeated_frame_does_not_feed_the_watchdog(link: BoardLink) -> None:
    for _ in range(30):
        link.advance(0.01)
        link.answer(command(100), BRIDGE)
    assert set(state(link.answer(command(101), BRIDGE)).rows["fault"]) == {Fault.WATCHDOG}


def test_a_repeated_old_reset_does_not_clear_a_fault(hoist: Robot) -> None:
    boards = Boards(hoist)
    link = BoardLink(boards)
    link.answer(command(1, clear=True), BRIDGE)
    boards.fail(np.array([True, False]), Fault.ENCODER)
    link.answer(command(1, clear=True), BRIDGE)
    assert boards.fault.tolist() == [Fault.ENCODER, Fault.NONE]


def test_the_sequence_may_wrap(hoist: Robot) -> None:
    link = BoardLink(Boards(hoist))
    assert link.answer(command(2**32 - 1), BRIDGE) is not None
    assert link.answer(command(0), BRIDGE) is not None


@given(order=st.lists(st.integers(0, 20), min_size=1, max_size=30))
def test_whatever_order_frames_come_in_the_answered_ones_ascend(
    boards: Boards, order: list[int]
) -> None:
    link = BoardLink(boards)
    answers = [link.answer(command(sequence), BRIDGE) for sequence in order]
    answered = [state(answer).sequence for answer in answers if answer is not None]
    assert answered == sorted(set(answered))
    assert link.refused["old"] == len(order) - len(answered)


# Sessions.


def test_a_frame_of_another_session_is_refused_while_one_lasts(link: BoardLink) -> None:
    assert link.answer(command(101, session=2), BRIDGE) is None
    assert link.refused["foreign"] == 1


def test_a_frame_from_another_address_is_refused_even_with_the_right_session(
    link: BoardLink,
) -> None:
    assert link.answer(command(101), OTHER) is None
    assert link.refused["foreign"] == 1


def test_a_foreign_frame_does_not_disturb_the_order(link: BoardLink) -> None:
    link.answer(command(500), OTHER)
    assert link.answer(command(101), BRIDGE) is not None


def test_foreign_frames_do_not_feed_the_watchdog(link: BoardLink) -> None:
    for sequence in range(101, 110):
        link.advance(TIMEOUT / 10)
        link.answer(command(sequence, session=2), OTHER)
    link.advance(TIMEOUT / 5)
    assert set(state(link.answer(command(101), BRIDGE)).rows["fault"]) == {Fault.WATCHDOG}


def test_after_the_watchdog_timeout_another_bridge_may_begin(link: BoardLink) -> None:
    link.advance(TIMEOUT * 1.01)
    answer = state(link.answer(command(3, session=2), OTHER))
    assert (answer.session, answer.sequence) == (2, 3)


def test_a_bridge_that_was_replaced_is_refused(link: BoardLink) -> None:
    link.advance(TIMEOUT * 1.01)
    link.answer(command(3, session=2), OTHER)
    assert link.answer(command(101), BRIDGE) is None


def test_a_bridge_that_only_stalled_goes_on(link: BoardLink) -> None:
    link.advance(TIMEOUT * 5)
    assert link.answer(command(101), BRIDGE) is not None


# What is counted and told.


def test_a_damaged_frame_is_counted_and_not_answered(link: BoardLink) -> None:
    assert link.answer(command(101)[:-1], BRIDGE) is None
    assert link.refused["damaged"] == 1


def test_every_single_flipped_bit_of_a_command_is_refused(link: BoardLink) -> None:
    frame = command(101)
    for bit in range(8 * len(frame)):
        damaged = bytearray(frame)
        damaged[bit // 8] ^= 1 << bit % 8
        assert link.answer(bytes(damaged), BRIDGE) is None
    assert link.refused["damaged"] == 8 * len(frame)


def test_the_boards_tell_how_many_frames_they_refused(link: BoardLink) -> None:
    link.answer(b"noise", BRIDGE)
    link.answer(command(100), BRIDGE)
    link.answer(command(101), OTHER)
    assert state(link.answer(command(101), BRIDGE)).rows["refused"].tolist() == [3, 3]


def test_the_count_of_refused_frames_wraps(link: BoardLink) -> None:
    link.refused["old"] = 2**16 + 5
    assert state(link.answer(command(101), BRIDGE)).rows["refused"].tolist() == [5, 5]


def test_the_boards_tell_which_start_this_is(hoist: Robot) -> None:
    link = BoardLink(Boards(hoist), boot=7)
    assert state(link.answer(command(1), BRIDGE)).rows["boots"].tolist() == [7, 7]


def test_frames_that_counted_are_counted(link: BoardLink) -> None:
    link.answer(command(101), BRIDGE)
    link.answer(command(101), BRIDGE)
    assert link.frames == 2


def test_the_state_is_sent_as_it_was_measured(hoist: Robot) -> None:
    boards = Boards(hoist)
    link = BoardLink(boards)
    link.answer(command(1), BRIDGE)
    link.advance(0.01)
    answer = state(link.answer(command(2), BRIDGE))
    expected = dataclasses.replace(boards.state(2), session=1)
    assert answer.encode() == expected.encode()
