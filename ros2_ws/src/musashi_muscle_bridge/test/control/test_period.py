"""One control period: what the bridge makes of a state, and which states it refuses."""

import dataclasses

import numpy as np
import pytest

from fastswing_planner.robot.description import Robot
from musashi_muscle_bridge.buses.protocol import (
    CommandFrame,
    Fault,
    Mode,
    StateFrame,
    WatchdogAction,
)
from musashi_muscle_bridge.control.command_limits import command_limits, length_range
from musashi_muscle_bridge.control.period import ControlPeriod, slack
from musashi_muscle_bridge.emulation.boards import Boards
from musashi_muscle_bridge.errors import FrameError

PERIOD = 0.002


@pytest.fixture
def control(hoist: Robot) -> ControlPeriod:
    limits = command_limits(hoist, stream_timeout=0.1, max_lease=0.2, payout_allowance=0.2)
    return ControlPeriod(hoist, limits, WatchdogAction.HOLD_LENGTH, 0.1)


@pytest.fixture
def state(hoist: Robot) -> StateFrame:
    return Boards(hoist).state(1)


def with_fault(state: StateFrame, fault: Fault) -> StateFrame:
    rows = state.rows.copy()
    rows["fault"] = fault
    return dataclasses.replace(state, rows=rows)


def run(control: ControlPeriod, boards: Boards, periods: int) -> StateFrame:
    """Let bridge and boards exchange frames; return the last answer."""
    state = boards.handle(control.first_command())
    for period in range(periods):
        boards.advance(PERIOD)
        state = boards.handle(control.next_command(state, 10.0 + PERIOD * period))
    return state


def held_by_their_watchdog(control: ControlPeriod, robot: Robot) -> Boards:
    """Return boards whose bridge stood still, and then went on."""
    boards = Boards(robot)
    run(control, boards, 20)
    boards.advance(0.2)
    run(control, boards, 20)
    rows = boards.state(0).rows
    assert (rows["fault"] == Fault.WATCHDOG).all()
    assert (rows["mode"] == Mode.LENGTH).all()
    return boards


def modes(command: CommandFrame) -> list[int]:
    return [int(mode) for mode in command.rows["mode"]]


# Limits.


def test_the_length_range_is_that_of_the_travel(hoist: Robot) -> None:
    shortest, longest = length_range(hoist.model)
    np.testing.assert_allclose(shortest, [0.5, 0.1])
    np.testing.assert_allclose(longest, [1.9, 1.5])


def test_every_sampled_posture_lies_in_the_length_range(musashi: Robot) -> None:
    shortest, longest = length_range(musashi.model)
    for posture in musashi.postures.values():
        lengths = musashi.model.lengths(posture)
        assert (shortest <= lengths).all()
        assert (lengths <= longest).all()


def test_the_length_range_is_the_same_each_time(musashi: Robot) -> None:
    assert np.array_equal(length_range(musashi.model), length_range(musashi.model))


def test_the_length_range_of_many_joints_is_sampled_within_the_travel() -> None:
    class ManyJoints:
        joint_lower = np.full(38, -1.0)
        joint_upper = np.full(38, 1.0)

        def lengths(self, joint_position: np.ndarray) -> np.ndarray:
            return 5.0 + 0.1 * joint_position[:2]

    shortest, longest = length_range(ManyJoints())  # type: ignore[arg-type]  # all it asks for
    np.testing.assert_allclose(shortest, [4.9, 4.9])
    np.testing.assert_allclose(longest, [5.1, 5.1])


def test_length_limits_leave_room_for_stretch_and_for_elongation(hoist: Robot) -> None:
    limits = command_limits(hoist, stream_timeout=0.1, max_lease=0.2, payout_allowance=0.2)
    np.testing.assert_allclose(limits.length_min, [0.5 - 60 / 7000, 0.1 - 60 / 7000])
    np.testing.assert_allclose(limits.length_max, [2.1, 1.7])


def test_the_other_limits_are_the_robots(hoist: Robot) -> None:
    limits = command_limits(hoist, stream_timeout=0.1, max_lease=0.2, payout_allowance=0.2)
    assert limits.tension_max.tolist() == [50.0, 50.0]
    assert limits.current_max.tolist() == [8.0, 8.0]
    assert limits.velocity.tolist() == [0.3, 0.3]
    assert (limits.stream_timeout, limits.max_lease) == (0.1, 0.2)


# Commands.


def test_the_first_command_moves_nothing(control: ControlPeriod) -> None:
    command = control.first_command()
    assert modes(command) == [Mode.ZERO_CURRENT] * 2
    assert command.rows["setpoint"].tolist() == [0.0, 0.0]


def test_the_second_command_holds_what_was_measured(
    control: ControlPeriod, state: StateFrame
) -> None:
    control.first_command()
    command = control.next_command(state, PERIOD)
    assert modes(command) == [Mode.LENGTH] * 2
    assert command.rows["setpoint"].tolist() == [1.0, 1.0]


def test_each_command_has_the_next_sequence_number(
    control: ControlPeriod, state: StateFrame
) -> None:
    first = control.first_command().sequence
    following = [control.next_command(state, k * PERIOD).sequence for k in range(1, 4)]
    assert following == [first + 1, first + 2, first + 3]


def test_a_command_carries_ids_limits_and_watchdog(control: ControlPeriod) -> None:
    command = control.first_command()
    assert command.rows["id"].tolist() == [0, 1]
    assert command.rows["tension_limit"].tolist() == [60.0, 60.0]
    assert command.rows["current_limit"].tolist() == [8.0, 8.0]
    assert command.watchdog_action is WatchdogAction.HOLD_LENGTH
    assert command.watchdog_timeout == 0.1


def test_a_command_is_not_changed_by_the_next_one(
    control: ControlPeriod, state: StateFrame
) -> None:
    first = control.first_command()
    before = first.encode()
    control.next_command(state, PERIOD)
    assert first.encode() == before


def test_a_faulty_muscle_is_told_zero_current(control: ControlPeriod, state: StateFrame) -> None:
    faulty = with_fault(state, Fault.NONE)
    faulty.rows["fault"][1] = Fault.ENCODER
    assert modes(control.next_command(faulty, PERIOD)) == [Mode.LENGTH, Mode.ZERO_CURRENT]


# Clearing.


def test_a_command_does_not_clear_faults_unasked(control: ControlPeriod, state: StateFrame) -> None:
    faulty = with_fault(state, Fault.WATCHDOG)
    assert not control.first_command().clear_faults
    assert not control.next_command(faulty, PERIOD).clear_faults


def test_clearing_is_asked_for_in_three_frames(control: ControlPeriod, state: StateFrame) -> None:
    control.clear_faults()
    flags = [control.next_command(state, k * PERIOD).clear_faults for k in range(1, 6)]
    assert flags == [True, True, True, False, False]


def flags_without_answers(control: ControlPeriod, state: StateFrame, seconds: float) -> list[bool]:
    """Return which of the following commands ask to clear while only an old state is there."""
    return [
        control.next_command(state, k * PERIOD).clear_faults
        for k in range(1, round(seconds / PERIOD) + 1)
    ]


def test_clearing_is_asked_for_until_it_is_answered(
    control: ControlPeriod, state: StateFrame
) -> None:
    flags_without_answers(control, state, 0.1)
    control.clear_faults()
    assert all(flags_without_answers(control, state, 0.1))
    answer = dataclasses.replace(state, sequence=100)
    assert not control.next_command(answer, 0.11).clear_faults


def test_clearing_that_nobody_answers_is_given_up(hoist: Robot, state: StateFrame) -> None:
    limits = command_limits(hoist, stream_timeout=0.1, max_lease=0.2, payout_allowance=0.2)
    control = ControlPeriod(hoist, limits, WatchdogAction.ZERO_CURRENT, 0.1)
    flags_without_answers(control, state, 0.1)
    control.clear_faults()
    asked = flags_without_answers(control, state, 1.0)
    assert sum(asked) == pytest.approx(0.5 / PERIOD, abs=2)
    assert not any(asked[-200:])


def test_clearing_that_was_given_up_is_not_made_up_for_when_the_boards_are_back(
    control: ControlPeriod, state: StateFrame
) -> None:
    flags_without_answers(control, state, 0.1)
    control.clear_faults()
    flags_without_answers(control, state, 1.0)
    back = dataclasses.replace(state, sequence=1000)
    assert not control.next_command(back, 1.1).clear_faults


def test_clearing_ends_a_fault_that_the_boards_still_report(
    control: ControlPeriod, state: StateFrame
) -> None:
    faulty = with_fault(state, Fault.WATCHDOG)
    control.next_command(faulty, PERIOD)
    control.clear_faults()
    control.next_command(faulty, 2 * PERIOD)
    for k in range(3, 10):
        command = control.next_command(state, k * PERIOD)
    assert modes(command) == [Mode.LENGTH] * 2


def test_a_fault_that_clearing_did_not_end_is_back(
    control: ControlPeriod, state: StateFrame
) -> None:
    faulty = with_fault(state, Fault.ENCODER)
    control.clear_faults()
    for k in range(1, 6):
        command = control.next_command(faulty, k * PERIOD)
    assert modes(command) == [Mode.ZERO_CURRENT] * 2


def test_clearing_ends_an_emergency_stop_and_holds_what_is_measured(
    control: ControlPeriod, state: StateFrame
) -> None:
    control.arbiter.command(Mode.LENGTH, [0], np.array([1.2]), 0.0)
    control.arbiter.emergency_stop()
    assert modes(control.next_command(state, PERIOD)) == [Mode.ZERO_CURRENT] * 2
    control.clear_faults()
    command = control.next_command(state, 2 * PERIOD)
    assert modes(command) == [Mode.LENGTH] * 2
    assert command.rows["setpoint"].tolist() == [1.0, 1.0]


def test_an_emergency_stop_takes_the_current_from_boards_that_their_watchdog_holds(
    control: ControlPeriod, hoist: Robot
) -> None:
    boards = held_by_their_watchdog(control, hoist)
    control.arbiter.emergency_stop()
    run(control, boards, 3)
    assert boards.state(0).rows["mode"].tolist() == [Mode.ZERO_CURRENT] * 2


def test_after_such_a_stop_the_fault_stays_latched_until_faults_are_cleared(
    control: ControlPeriod, hoist: Robot
) -> None:
    boards = held_by_their_watchdog(control, hoist)
    control.arbiter.emergency_stop()
    run(control, boards, 10)
    assert control.arbiter.latched.tolist() == [True, True]


def test_the_last_frame_of_an_ending_bridge_stops_boards_that_their_watchdog_holds(
    control: ControlPeriod, hoist: Robot
) -> None:
    boards = Boards(hoist)
    state = run(control, boards, 20)
    boards.advance(0.2)
    control.arbiter.emergency_stop()
    boards.handle(control.next_command(state, 10.3))
    assert boards.state(0).rows["mode"].tolist() == [Mode.ZERO_CURRENT] * 2


def test_an_emergency_stop_clears_no_other_fault(control: ControlPeriod, state: StateFrame) -> None:
    control.next_command(state, 10.0)
    control.arbiter.emergency_stop()
    limp = with_fault(state, Fault.OVER_TEMPERATURE)
    assert not control.next_command(limp, 10.0 + PERIOD).clear_faults


def test_boards_that_lost_the_bridge_come_back_by_clearing(
    hoist: Robot, control: ControlPeriod
) -> None:
    boards = Boards(hoist)
    state = boards.handle(control.first_command())
    boards.advance(0.5)
    state = boards.handle(control.next_command(state, 0.5))
    assert (state.rows["fault"] == Fault.WATCHDOG).all()
    control.clear_faults()
    for k in range(5):
        boards.advance(PERIOD)
        state = boards.handle(control.next_command(state, 0.5 + k * PERIOD))
    assert (state.rows["fault"] == Fault.NONE).all()
    assert (state.rows["mode"] == Mode.LENGTH).all()


# States.


def test_the_answer_of_this_robots_boards_is_accepted(control: ControlPeriod, hoist: Robot) -> None:
    command = control.first_command()
    control.check(Boards(hoist).handle(command))


@pytest.mark.parametrize(("ids", "shown"), [([0], "[0]"), ([1, 0], "[1, 0]"), ([0, 5], "[0, 5]")])
def test_the_answer_of_other_boards_is_refused_naming_them(
    control: ControlPeriod, state: StateFrame, ids: list[int], shown: str
) -> None:
    rows = state.rows[: len(ids)].copy()
    rows["id"] = ids
    with pytest.raises(FrameError) as caught:
        control.check(dataclasses.replace(state, rows=rows))
    assert str(caught.value) == (
        f"the boards answer for muscles {shown}, expected 0 to 1: "
        "do robot_description and boards belong together?"
    )


def test_an_answer_with_other_joints_is_refused(control: ControlPeriod, state: StateFrame) -> None:
    joints = np.concatenate([state.joints, state.joints])
    with pytest.raises(FrameError, match=r"^the boards measure 2 joints, expected 1$"):
        control.check(dataclasses.replace(state, joints=joints))


# Boards that start again.


def booted(state: StateFrame, boots: tuple[int, int], sequence: int = 2) -> StateFrame:
    rows = state.rows.copy()
    rows["boots"] = boots
    return dataclasses.replace(state, rows=rows, sequence=sequence)


def test_the_first_boot_number_seen_is_no_fault(control: ControlPeriod, state: StateFrame) -> None:
    command = control.next_command(booted(state, (7, 9)), PERIOD)
    assert modes(command) == [Mode.LENGTH] * 2
    assert not control.rebooted.any()


def test_a_board_that_started_again_is_told_zero_current(
    control: ControlPeriod, state: StateFrame
) -> None:
    control.next_command(booted(state, (7, 9), 1), PERIOD)
    command = control.next_command(booted(state, (8, 9), 2), 2 * PERIOD)
    assert modes(command) == [Mode.ZERO_CURRENT, Mode.LENGTH]


def test_a_start_stays_latched_although_the_board_reports_no_fault(
    control: ControlPeriod, state: StateFrame
) -> None:
    control.next_command(booted(state, (7, 9), 1), PERIOD)
    for k in range(2, 200):
        command = control.next_command(booted(state, (8, 9), k), k * PERIOD)
    assert modes(command) == [Mode.ZERO_CURRENT, Mode.LENGTH]
    assert control.rebooted.tolist() == [True, False]


def test_after_clearing_a_board_that_started_again_holds_its_measured_length(
    control: ControlPeriod, state: StateFrame
) -> None:
    control.next_command(booted(state, (7, 9), 1), PERIOD)
    control.next_command(booted(state, (8, 9), 2), 2 * PERIOD)
    control.clear_faults()
    for k in range(3, 10):
        command = control.next_command(booted(state, (8, 9), k), k * PERIOD)
    assert modes(command) == [Mode.LENGTH] * 2
    assert command.rows["setpoint"].tolist() == [1.0, 1.0]
    assert not control.rebooted.any()


def test_a_start_during_clearing_is_noticed(control: ControlPeriod, state: StateFrame) -> None:
    control.next_command(booted(state, (7, 9), 1), PERIOD)
    control.clear_faults()
    control.next_command(booted(state, (8, 9), 2), 2 * PERIOD)
    assert control.rebooted.tolist() == [True, False]


def test_commands_carry_the_session(hoist: Robot) -> None:
    limits = command_limits(hoist, stream_timeout=0.1, max_lease=0.2, payout_allowance=0.2)
    control = ControlPeriod(hoist, limits, WatchdogAction.HOLD_LENGTH, 0.1, session=77)
    assert control.first_command().session == 77


# Outages.


def moved(state: StateFrame, sequence: int, change: float) -> StateFrame:
    rows = state.rows.copy()
    rows["length"] += change
    return dataclasses.replace(state, sequence=sequence, rows=rows)


def test_boards_that_come_back_are_held_where_they_are(
    control: ControlPeriod, state: StateFrame
) -> None:
    control.next_command(state, 10.0)
    control.next_command(state, 10.2)
    back = moved(state, 3, 0.1)
    found = control.next_command(back, 10.3).rows["setpoint"]
    np.testing.assert_allclose(found, back.rows["length"])


def test_boards_that_were_silent_stay_where_they_are_until_faults_are_cleared(
    control: ControlPeriod, state: StateFrame
) -> None:
    control.next_command(state, 10.0)
    control.next_command(state, 10.31)
    back = moved(state, 3, 0.1)
    control.next_command(back, 10.4)
    control.arbiter.command(Mode.LENGTH, [0, 1], np.array([0.9, 0.9]), 10.4)
    found = control.next_command(moved(state, 4, 0.1), 10.41).rows["setpoint"]
    np.testing.assert_allclose(found, back.rows["length"])


def test_boards_that_were_silent_follow_again_after_clearing(
    control: ControlPeriod, state: StateFrame
) -> None:
    control.next_command(state, 10.0)
    control.next_command(state, 10.31)
    control.next_command(moved(state, 3, 0.1), 10.4)
    control.clear_faults()
    control.arbiter.command(Mode.LENGTH, [0, 1], np.array([1.1, 1.1]), 10.4)
    for period in range(4, 400):
        command = control.next_command(moved(state, period, 0.1), 10.4 + PERIOD * period)
    np.testing.assert_allclose(command.rows["setpoint"], [1.1, 1.1])
    assert not control.lost.any()


def test_silent_boards_get_no_current_where_that_is_the_watchdog_action(hoist: Robot) -> None:
    limits = command_limits(hoist, stream_timeout=0.1, max_lease=0.2, payout_allowance=0.2)
    control = ControlPeriod(hoist, limits, WatchdogAction.ZERO_CURRENT, 0.1)
    state = Boards(hoist).state(1)
    control.next_command(state, 10.0)
    assert modes(control.next_command(state, 10.29)) == [Mode.LENGTH] * 2
    assert modes(control.next_command(state, 10.31)) == [Mode.ZERO_CURRENT] * 2


def test_a_silence_that_goes_on_is_latched_again_after_clearing(
    control: ControlPeriod, state: StateFrame
) -> None:
    control.next_command(state, 10.0)
    control.next_command(state, 10.31)
    control.clear_faults()
    control.next_command(state, 10.32)
    assert control.lost.tolist() == [True, True]


def test_a_missed_answer_is_no_outage(control: ControlPeriod, state: StateFrame) -> None:
    control.next_command(state, 10.0)
    control.next_command(state, 10.05)
    found = control.next_command(moved(state, 3, 0.1), 10.06).rows["setpoint"]
    np.testing.assert_allclose(found, state.rows["length"])


def test_late_answers_from_before_a_clearing_do_not_latch_again(
    control: ControlPeriod, state: StateFrame
) -> None:
    late = with_fault(state, Fault.OVER_TENSION)
    for period in range(20):
        control.next_command(dataclasses.replace(late, sequence=period), 10.0 + PERIOD * period)
    control.clear_faults()
    for period in range(20, 30):
        command = control.next_command(
            dataclasses.replace(late, sequence=period - 10), 10.0 + PERIOD * period
        )
    assert modes(command) == [Mode.LENGTH, Mode.LENGTH]


# Slack.


@pytest.mark.parametrize(
    ("mode", "tension", "found"),
    [(Mode.TENSION, 0.0, True), (Mode.TENSION, 5.0, False), (Mode.LENGTH, 0.0, False)],
)
def test_a_slack_wire_in_tension_mode_is_found(
    state: StateFrame, mode: Mode, tension: float, found: bool
) -> None:
    rows = state.rows.copy()
    rows["mode"], rows["tension"] = [mode, Mode.LENGTH], [tension, 20.0]
    assert slack(dataclasses.replace(state, rows=rows)).tolist() == [found, False]
