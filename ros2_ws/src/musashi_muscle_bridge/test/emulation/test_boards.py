"""Emulated boards obey, guard their limits, and act alone when nobody commands them."""

import numpy as np
import pytest

from fastswing_planner.robot.description import Robot
from musashi_muscle_bridge.buses.protocol import (
    COMMAND_ROW,
    CommandFrame,
    Fault,
    Mode,
    WatchdogAction,
)
from musashi_muscle_bridge.emulation.boards import Boards

UP, DOWN = 0, 1
WEIGHT = 20.0
TIMEOUT = 0.1


def frame(
    modes: tuple[Mode, Mode],
    setpoints: tuple[float, float],
    *,
    action: WatchdogAction = WatchdogAction.ZERO_CURRENT,
    clear: bool = False,
    tension_limit: float = 60.0,
    current_limit: float = 8.0,
    ids: tuple[int, ...] = (0, 1),
    sequence: int = 1,
) -> CommandFrame:
    rows = np.zeros(len(ids), COMMAND_ROW)
    rows["id"] = ids
    rows["mode"], rows["setpoint"] = modes[: len(ids)], setpoints[: len(ids)]
    rows["tension_limit"], rows["current_limit"] = tension_limit, current_limit
    return CommandFrame(sequence, rows, action, TIMEOUT, clear)


LENGTHS = (Mode.LENGTH, Mode.LENGTH)
HOLD = frame(LENGTHS, (1.0, 1.2))
HOLD_OR_STAY = frame(LENGTHS, (1.0, 1.2), action=WatchdogAction.HOLD_LENGTH)


def run(boards: Boards, command: CommandFrame, seconds: float) -> None:
    """Let time pass, with a command frame every 10 ms."""
    for _ in range(round(seconds / 0.01)):
        boards.handle(command)
        boards.advance(0.01)


@pytest.fixture
def boards(hoist: Robot) -> Boards:
    """Hang the load from 1 m of wire, the tether slack."""
    boards = Boards(hoist)
    run(boards, HOLD, 1.0)
    return boards


def fault_of(boards: Boards) -> list[int]:
    return [int(fault) for fault in boards.state(0).rows["fault"]]


def mode_of(boards: Boards) -> list[int]:
    return [int(mode) for mode in boards.state(0).rows["mode"]]


# Modes.


def test_boards_start_at_zero_current_without_faults(hoist: Robot) -> None:
    boards = Boards(hoist)
    assert mode_of(boards) == [Mode.ZERO_CURRENT] * 2
    assert fault_of(boards) == [Fault.NONE] * 2


def test_a_board_in_length_mode_goes_to_its_length(boards: Boards) -> None:
    run(boards, frame(LENGTHS, (0.9, 1.2)), 1.5)
    assert boards.plant.length[UP] == pytest.approx(0.9, abs=1e-4)


def test_a_board_in_tension_mode_reaches_its_tension(boards: Boards) -> None:
    run(boards, frame((Mode.LENGTH, Mode.TENSION), (1.0, 15.0)), 3.0)
    assert boards.plant.tension[DOWN] == pytest.approx(15.0, abs=0.5)
    assert boards.plant.tension[UP] == pytest.approx(WEIGHT + 15.0, abs=0.5)


def test_a_board_in_current_mode_draws_its_current(boards: Boards) -> None:
    run(boards, frame((Mode.CURRENT, Mode.LENGTH), (0.4, 1.2)), 0.05)
    assert boards.plant.current[UP] == pytest.approx(0.4)


def test_a_board_clips_its_current_to_the_limit(boards: Boards) -> None:
    run(boards, frame((Mode.CURRENT, Mode.LENGTH), (5.0, 1.2), current_limit=0.5), 0.01)
    assert boards.plant.current[UP] == 0.5


def test_a_board_at_zero_current_lets_the_load_sink(boards: Boards) -> None:
    before = boards.plant.joint_position[0]
    run(boards, frame((Mode.ZERO_CURRENT, Mode.LENGTH), (0.0, 1.2)), 0.5)
    assert boards.plant.current[UP] == 0.0
    assert boards.plant.joint_position[0] > before + 0.01


def test_a_mode_nobody_knows_is_zero_current(boards: Boards) -> None:
    command = frame(LENGTHS, (0.9, 1.2))
    command.rows["mode"][UP] = 99
    run(boards, command, 0.05)
    assert boards.plant.current[UP] == 0.0


# Answers.


def test_a_state_answers_its_command(boards: Boards) -> None:
    assert boards.handle(frame(LENGTHS, (1.0, 1.2), sequence=77)).sequence == 77


def test_a_state_says_what_was_measured(boards: Boards) -> None:
    state, plant = boards.state(1), boards.plant
    np.testing.assert_array_equal(state.rows["length"], plant.length.astype("f4"))
    np.testing.assert_array_equal(state.rows["tension"], plant.tension.astype("f4"))
    np.testing.assert_array_equal(state.rows["current"], plant.current.astype("f4"))
    np.testing.assert_array_equal(state.joints["position"], plant.joint_position.astype("f4"))
    assert state.rows["id"].tolist() == [0, 1]


def test_the_temperature_is_that_of_the_housings(boards: Boards) -> None:
    expected = boards.plant.housing_temperature.astype("f4")
    np.testing.assert_array_equal(boards.state(1).rows["temperature"], expected)


def test_a_command_repeated_after_a_fault_elsewhere_is_not_taken_for_obeyed(
    boards: Boards,
) -> None:
    run(boards, HOLD, 0.02)
    boards.fault[DOWN] = Fault.ENCODER
    boards.handle(HOLD)
    boards.handle(frame(LENGTHS, (1.0, 1.2), clear=True))
    boards.handle(HOLD)
    assert mode_of(boards) == [Mode.LENGTH] * 2


@pytest.mark.parametrize("ids", [(0,), (1, 0), (0, 2)])
def test_a_command_for_other_boards_changes_nothing(boards: Boards, ids: tuple[int, ...]) -> None:
    boards.handle(frame((Mode.CURRENT, Mode.CURRENT), (1.0, 1.0), ids=ids))
    assert mode_of(boards) == [Mode.LENGTH] * 2


def test_a_command_for_other_boards_does_not_feed_the_watchdog(boards: Boards) -> None:
    run(boards, frame(LENGTHS, (1.0, 1.2), ids=(0, 2)), 2 * TIMEOUT)
    assert fault_of(boards) == [Fault.WATCHDOG] * 2


# Time.


def test_what_is_left_of_a_time_step_is_not_lost(hoist: Robot) -> None:
    whole, parts = Boards(hoist), Boards(hoist)
    whole.advance(0.01)
    for _ in range(64):
        parts.advance(0.01 / 64)
    assert parts.plant.joint_position[0] == pytest.approx(whole.plant.joint_position[0], rel=0.1)
    assert parts.plant.joint_position[0] > 0.0


# Watchdog.


def test_the_watchdog_is_not_armed_before_the_first_command(hoist: Robot) -> None:
    boards = Boards(hoist)
    boards.advance(1.0)
    assert fault_of(boards) == [Fault.NONE] * 2


def test_silence_shorter_than_the_watchdog_is_no_fault(boards: Boards) -> None:
    boards.handle(HOLD)
    boards.advance(TIMEOUT - 0.001)
    assert fault_of(boards) == [Fault.NONE] * 2


def test_silence_is_a_latched_fault_of_every_board(boards: Boards) -> None:
    boards.handle(HOLD)
    boards.advance(TIMEOUT + 0.002)
    assert fault_of(boards) == [Fault.WATCHDOG] * 2
    boards.handle(HOLD)
    assert fault_of(boards) == [Fault.WATCHDOG] * 2


def test_reading_the_state_does_not_feed_the_watchdog(boards: Boards) -> None:
    for _ in range(20):
        boards.advance(0.01)
        boards.state(1)
    assert fault_of(boards) == [Fault.WATCHDOG] * 2


def test_a_watchdog_of_zero_current_lets_the_load_sink(boards: Boards) -> None:
    before = boards.plant.joint_position[0]
    boards.handle(HOLD)
    boards.advance(TIMEOUT + 0.4)
    assert mode_of(boards) == [Mode.ZERO_CURRENT] * 2
    assert boards.plant.current.tolist() == [0.0, 0.0]
    assert boards.plant.joint_position[0] > before + 0.01


def test_a_watchdog_that_holds_the_length_keeps_the_load_up(boards: Boards) -> None:
    before = boards.plant.joint_position[0]
    boards.handle(HOLD_OR_STAY)
    boards.advance(2.0)
    assert fault_of(boards) == [Fault.WATCHDOG] * 2
    assert mode_of(boards) == [Mode.LENGTH] * 2
    assert boards.plant.joint_position[0] == pytest.approx(before, abs=1e-3)


def test_a_watchdog_stops_a_moving_load_where_it_is(boards: Boards) -> None:
    moving = frame(LENGTHS, (1.5, 1.5), action=WatchdogAction.HOLD_LENGTH)
    run(boards, moving, 0.3)
    boards.advance(TIMEOUT)
    at_silence = boards.plant.length[UP]
    boards.advance(1.0)
    assert boards.plant.length[UP] == pytest.approx(at_silence, abs=0.01)


def test_a_load_held_by_the_watchdog_does_not_fall_when_frames_return(boards: Boards) -> None:
    boards.handle(HOLD_OR_STAY)
    boards.advance(TIMEOUT + 0.01)
    before = boards.plant.joint_position[0]
    # The bridge answers a fault with zero current until somebody clears it.
    idle = frame((Mode.ZERO_CURRENT,) * 2, (0.0, 0.0), action=WatchdogAction.HOLD_LENGTH)
    run(boards, idle, 1.0)
    assert fault_of(boards) == [Fault.WATCHDOG] * 2
    assert boards.plant.joint_position[0] == pytest.approx(before, abs=1e-3)


# Faults.


def test_a_faulty_board_stays_at_zero_current_whatever_is_commanded(boards: Boards) -> None:
    boards.fault[UP] = Fault.ENCODER
    run(boards, HOLD, 0.02)
    assert mode_of(boards) == [Mode.ZERO_CURRENT, Mode.LENGTH]
    assert boards.plant.current[UP] == 0.0


def test_a_fault_stays_without_the_flag(boards: Boards) -> None:
    boards.fault[UP] = Fault.ENCODER
    run(boards, HOLD, 0.5)
    assert fault_of(boards) == [Fault.ENCODER, Fault.NONE]


def test_the_flag_clears_a_fault_and_the_command_counts_again(boards: Boards) -> None:
    boards.fault[UP] = Fault.ENCODER
    boards.handle(frame(LENGTHS, (1.0, 1.2), clear=True))
    assert fault_of(boards) == [Fault.NONE] * 2
    assert mode_of(boards) == [Mode.LENGTH] * 2


def test_after_clearing_the_watchdog_watches_again(boards: Boards) -> None:
    boards.advance(2 * TIMEOUT)
    boards.handle(frame(LENGTHS, (1.0, 1.2), clear=True))
    boards.advance(TIMEOUT - 0.001)
    assert fault_of(boards) == [Fault.NONE] * 2
    boards.advance(0.002)
    assert fault_of(boards) == [Fault.WATCHDOG] * 2


# Tension.


def test_tension_above_the_limit_pays_out_against_the_command(boards: Boards) -> None:
    run(boards, frame(LENGTHS, (1.0, 1.2), tension_limit=15.0), 0.2)
    assert boards.plant.length[UP] > 1.005
    assert fault_of(boards) == [Fault.NONE] * 2


def test_tension_below_the_limit_does_not_pay_out(boards: Boards) -> None:
    run(boards, frame(LENGTHS, (1.0, 1.2), tension_limit=25.0), 0.2)
    assert boards.plant.length[UP] == pytest.approx(1.0, abs=1e-4)


def test_two_wires_that_fight_stay_about_the_limit(boards: Boards) -> None:
    run(boards, frame(LENGTHS, (0.9, 0.9)), 2.0)
    assert boards.plant.tension.max() < 1.5 * 60.0
    assert boards.plant.tension.max() > 0.7 * 60.0


def test_tension_far_above_the_limit_is_a_fault(boards: Boards) -> None:
    run(boards, frame(LENGTHS, (1.0, 1.2), tension_limit=WEIGHT / 1.6), 0.01)
    assert fault_of(boards) == [Fault.OVER_TENSION, Fault.NONE]
    assert mode_of(boards) == [Mode.ZERO_CURRENT, Mode.LENGTH]


def test_over_tension_returns_at_once_while_its_cause_persists(boards: Boards) -> None:
    tight = frame(LENGTHS, (1.0, 1.2), tension_limit=5.0, clear=True)
    run(boards, tight, 0.02)
    assert fault_of(boards)[UP] == Fault.OVER_TENSION


def test_a_watchdog_that_holds_gives_no_current_to_motors_that_were_told_to_have_none(
    boards: Boards,
) -> None:
    idle = frame((Mode.ZERO_CURRENT,) * 2, (0.0, 0.0), action=WatchdogAction.HOLD_LENGTH)
    run(boards, idle, 0.05)
    boards.advance(2.0 * TIMEOUT)
    assert fault_of(boards) == [Fault.WATCHDOG] * 2
    assert mode_of(boards) == [Mode.ZERO_CURRENT] * 2


def test_tension_above_the_limit_pays_out_in_current_mode_too(boards: Boards) -> None:
    pulling = frame((Mode.CURRENT, Mode.LENGTH), (6.0, 1.2), tension_limit=WEIGHT / 2.0)
    before = float(boards.plant.length[UP])
    run(boards, pulling, 0.02)
    assert float(boards.plant.velocity[UP]) > 0.0
    assert float(boards.plant.length[UP]) > before
