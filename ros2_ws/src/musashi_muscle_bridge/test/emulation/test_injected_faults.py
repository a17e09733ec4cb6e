"""What breaks on the emulated arm is felt, found and told, and ends when it is mended."""

import numpy as np
import pytest

from fastswing_planner.errors import InvalidParameter
from fastswing_planner.robot.description import Robot
from musashi_muscle_bridge.buses.protocol import (
    COMMAND_ROW,
    CommandFrame,
    Fault,
    Mode,
    Rows,
    WatchdogAction,
)
from musashi_muscle_bridge.emulation.boards import Boards
from musashi_muscle_bridge.emulation.injected_faults import (
    ARM_FAULTS,
    ArmFaults,
    FaultyBoards,
    chosen_muscles,
)

UP, DOWN = 0, 1
WEIGHT = 20.0
NAMES = ("up", "down")


def faults(**chosen: str) -> ArmFaults:
    """One muscle for each fault named; none for the others."""
    return ArmFaults(
        **{
            name: chosen_muscles(name, [chosen[name]] if name in chosen else [], NAMES)
            for name in ARM_FAULTS
        }
    )


NOTHING = faults()


def command(
    lengths: tuple[float, float],
    *,
    clear: bool = False,
    action: WatchdogAction = WatchdogAction.ZERO_CURRENT,
) -> CommandFrame:
    rows = np.zeros(2, COMMAND_ROW)
    rows["id"] = 0, 1
    rows["mode"], rows["setpoint"] = Mode.LENGTH, lengths
    rows["tension_limit"], rows["current_limit"] = 60.0, 8.0
    return CommandFrame(1, rows, action, 0.1, clear)


def run(boards: Boards, seconds: float, lengths: tuple[float, float] = (1.0, 1.2)) -> Rows:
    """Let time pass, with a command every 10 ms; return what the boards say in the end."""
    for _ in range(round(seconds / 0.01)):
        boards.handle(command(lengths))
        boards.advance(0.01)
    return boards.state(1).rows


def cleared(boards: Boards, lengths: tuple[float, float] = (1.0, 1.2)) -> Rows:
    boards.handle(command(lengths, clear=True))
    return run(boards, 0.05, lengths)


@pytest.fixture
def boards(hoist: Robot) -> FaultyBoards:
    """Hang the load from 1 m of wire, the tether slack."""
    boards = FaultyBoards(hoist)
    run(boards, 1.0)
    return boards


def test_without_faults_the_boards_do_what_all_boards_do(hoist: Robot) -> None:
    sound, plain = FaultyBoards(hoist), Boards(hoist)
    assert run(sound, 0.5, (0.9, 1.2)).tobytes() == run(plain, 0.5, (0.9, 1.2)).tobytes()


@pytest.mark.parametrize("fault", ARM_FAULTS)
def test_an_unknown_muscle_is_refused_with_the_choices(fault: str) -> None:
    with pytest.raises(InvalidParameter) as caught:
        chosen_muscles(fault, ["#11"], NAMES)
    assert str(caught.value) == f"{fault}: unknown muscle '#11', choose from: up, down"


def test_a_muscle_named_twice_is_refused() -> None:
    with pytest.raises(InvalidParameter) as caught:
        chosen_muscles("hot_motor", ["up", "up"], NAMES)
    assert str(caught.value) == "hot_motor: muscle 'up' is named more than once"


@pytest.mark.parametrize("fault", ARM_FAULTS)
def test_a_fault_of_one_muscle_is_none_of_the_other(boards: FaultyBoards, fault: str) -> None:
    boards.inject(faults(**{fault: "up"}))
    rows = run(boards, 0.2, (0.95, 1.2))
    assert rows["fault"][DOWN] == Fault.NONE
    assert rows["mode"][DOWN] == Mode.LENGTH


# A broken wire.


def test_a_broken_wire_pulls_nothing(boards: FaultyBoards) -> None:
    boards.inject(faults(broken_wire="up"))
    assert run(boards, 0.02)["tension"][UP] == 0.0


def test_a_load_on_a_broken_wire_falls(boards: FaultyBoards) -> None:
    before = boards.plant.joint_position[0]
    boards.inject(faults(broken_wire="up"))
    run(boards, 0.2)
    assert boards.plant.joint_position[0] > before + 0.1


def test_a_broken_wire_is_no_fault_of_its_board(boards: FaultyBoards) -> None:
    boards.inject(faults(broken_wire="up"))
    assert run(boards, 0.2)["fault"].tolist() == [Fault.NONE] * 2


def test_a_mended_wire_pulls_again(boards: FaultyBoards) -> None:
    boards.inject(faults(broken_wire="up"))
    run(boards, 0.02)
    boards.inject(NOTHING)
    assert run(boards, 1.0)["tension"][UP] == pytest.approx(WEIGHT, abs=1.0)


# A stuck encoder.


def test_a_stuck_encoder_shows_what_it_showed(boards: FaultyBoards) -> None:
    shown = boards.state(1).rows["length"][UP]
    boards.inject(faults(stuck_encoder="up"))
    rows = run(boards, 0.04, (1.3, 1.3))
    assert rows["length"][UP] == shown
    assert rows["velocity"][UP] == 0.0


def test_a_stuck_encoder_of_a_motor_that_turns_is_found(boards: FaultyBoards) -> None:
    boards.inject(faults(stuck_encoder="up"))
    rows = run(boards, 0.4, (1.3, 1.3))
    assert rows["fault"][UP] == Fault.ENCODER
    assert rows["mode"][UP] == Mode.ZERO_CURRENT


def test_a_stuck_encoder_of_a_motor_that_rests_is_not_found(boards: FaultyBoards) -> None:
    boards.inject(faults(stuck_encoder="up"))
    assert run(boards, 0.4)["fault"][UP] == Fault.NONE


def test_an_encoder_that_moves_again_can_be_cleared(boards: FaultyBoards) -> None:
    boards.inject(faults(stuck_encoder="up"))
    run(boards, 0.4, (1.3, 1.3))
    boards.inject(NOTHING)
    assert cleared(boards)["fault"].tolist() == [Fault.NONE] * 2


# A dead board.


def test_a_dead_board_is_told_by_its_group(boards: FaultyBoards) -> None:
    boards.inject(faults(dead_board="up"))
    rows = run(boards, 0.02)
    assert rows["fault"][UP] == Fault.BUS
    assert rows["mode"][UP] == Mode.ZERO_CURRENT
    assert rows["current"][UP] == 0.0


def test_a_dead_board_repeats_what_it_measured_last(boards: FaultyBoards) -> None:
    last = boards.state(1).rows[UP].copy()
    boards.inject(faults(dead_board="up"))
    rows = run(boards, 0.3)
    for field in ("length", "velocity", "tension"):
        assert rows[field][UP] == last[field]
    assert boards.plant.length[UP] > last["length"] + 0.01


def test_a_dead_board_cannot_be_cleared(boards: FaultyBoards) -> None:
    boards.inject(faults(dead_board="up"))
    assert cleared(boards)["fault"][UP] == Fault.BUS


def test_a_dead_board_holds_nothing_for_its_watchdog(boards: FaultyBoards) -> None:
    boards.handle(command((1.0, 1.2), action=WatchdogAction.HOLD_LENGTH))
    boards.advance(0.2)
    assert boards.state(1).rows["mode"].tolist() == [Mode.LENGTH] * 2
    boards.inject(faults(dead_board="up"))
    assert boards.state(1).rows["mode"].tolist() == [Mode.ZERO_CURRENT, Mode.LENGTH]


def test_a_board_that_lives_again_has_started_again(boards: FaultyBoards) -> None:
    before = boards.state(1).rows["boots"].tolist()
    boards.inject(faults(dead_board="up"))
    boards.inject(NOTHING)
    assert boards.state(1).rows["boots"].tolist() == [before[UP] + 1, before[DOWN]]


def test_a_board_that_lives_again_can_be_cleared(boards: FaultyBoards) -> None:
    boards.inject(faults(dead_board="up"))
    run(boards, 0.02)
    boards.inject(NOTHING)
    assert run(boards, 0.02)["fault"][UP] == Fault.BUS
    assert cleared(boards)["fault"][UP] == Fault.NONE


# A hot motor.


def test_a_hot_motor_is_found_and_told(boards: FaultyBoards) -> None:
    boards.inject(faults(hot_motor="up"))
    rows = boards.state(1).rows
    assert rows["fault"].tolist() == [Fault.OVER_TEMPERATURE, Fault.NONE]
    assert rows["temperature"][UP] == 120.0


def test_a_hot_motor_gets_no_current(boards: FaultyBoards) -> None:
    boards.inject(faults(hot_motor="up"))
    rows = run(boards, 0.02)
    assert rows["mode"][UP] == Mode.ZERO_CURRENT
    assert rows["current"][UP] == 0.0


def test_a_motor_that_is_still_hot_cannot_be_cleared(boards: FaultyBoards) -> None:
    boards.inject(faults(hot_motor="up"))
    assert cleared(boards)["fault"][UP] == Fault.OVER_TEMPERATURE


def test_a_motor_that_cooled_down_can_be_cleared(boards: FaultyBoards) -> None:
    boards.inject(faults(hot_motor="up"))
    boards.inject(NOTHING)
    assert cleared(boards)["fault"][UP] == Fault.NONE
