"""A robot whose boards are on two buses: who answers for what, and what the loss of one does."""

import dataclasses

import numpy as np
import pytest

from fastswing_planner.robot.board_groups import BoardGroup
from fastswing_planner.robot.description import Robot
from musashi_muscle_bridge.buses.protocol import (
    CommandFrame,
    Fault,
    Mode,
    StateFrame,
    WatchdogAction,
)
from musashi_muscle_bridge.control.command_limits import command_limits
from musashi_muscle_bridge.control.period import ControlPeriod
from musashi_muscle_bridge.emulation.board_link import BoardLink
from musashi_muscle_bridge.emulation.boards import Boards

PERIOD = 0.002
TIMEOUT = 0.1
LOST = 3.1 * TIMEOUT


@pytest.fixture(scope="module")
def split(hoist: Robot) -> Robot:
    """Put `down` on the first bus, `up` and the joint on the second."""
    groups = (BoardGroup((1,), ()), BoardGroup((0,), (0,)))
    return dataclasses.replace(hoist, board_groups=groups)


class Arm:
    """The split hoist, its boards and its control, advanced together."""

    def __init__(self, robot: Robot, action: WatchdogAction = WatchdogAction.ZERO_CURRENT) -> None:
        limits = command_limits(robot, stream_timeout=0.1, max_lease=0.2, payout_allowance=0.2)
        self.boards = Boards(robot)
        self.control = ControlPeriod(robot, limits, action, TIMEOUT)
        self.now = 10.0
        self.states: list[StateFrame | None] = [None, None]
        self.commands: list[CommandFrame] = []

    def run(self, duration: float, deaf: tuple[int, ...] = (), mute: tuple[int, ...] = ()) -> None:
        """Let time pass; `deaf` groups get no commands, `mute` ones are not heard."""
        for _ in range(round(duration / PERIOD)):
            self.now += PERIOD
            self.boards.advance(PERIOD)
            self.commands = self.control.next_commands(self.states, self.now)
            for group, command in enumerate(self.commands):
                if group in deaf:
                    continue
                state = self.boards.handle(command, group)
                if group not in mute:
                    self.states[group] = state

    @property
    def whole(self) -> StateFrame:
        return self.control.merged([state for state in self.states if state is not None])


@pytest.fixture
def arm(split: Robot) -> Arm:
    arm = Arm(split)
    arm.run(0.1)
    return arm


def test_nothing_is_energised_before_every_group_has_answered(split: Robot) -> None:
    arm = Arm(split)
    arm.run(0.1, deaf=(1,))
    assert [command.rows["mode"].tolist() for command in arm.commands] == [[0], [0]]


def test_all_muscles_hold_when_every_group_has_answered(arm: Arm) -> None:
    assert arm.whole.rows["mode"].tolist() == [Mode.LENGTH] * 2


def test_each_group_numbers_its_boards_from_0(arm: Arm) -> None:
    assert [state.rows["id"].tolist() for state in arm.states if state] == [[0], [0]]


def test_the_merged_state_is_in_the_robots_order(arm: Arm) -> None:
    whole = arm.boards.state(0)
    np.testing.assert_array_equal(arm.whole.rows["id"], [0, 1])
    np.testing.assert_allclose(arm.whole.rows["tension"], whole.rows["tension"], atol=1.0)
    assert abs(arm.whole.rows["tension"][0] - arm.whole.rows["tension"][1]) > 5.0


def test_only_the_second_group_measures_the_joint(arm: Arm) -> None:
    assert [len(state.joints) for state in arm.states if state] == [0, 1]


def test_a_command_reaches_the_board_of_its_muscle(arm: Arm) -> None:
    arm.control.arbiter.command(Mode.TENSION, [1], np.array([30.0]), arm.now)
    arm.run(PERIOD)
    assert [command.rows["mode"].tolist() for command in arm.commands] == [
        [Mode.TENSION],
        [Mode.LENGTH],
    ]


@pytest.mark.parametrize("cut", ["deaf", "mute"])
def test_a_lost_group_is_latched_and_the_other_one_goes_on(arm: Arm, cut: str) -> None:
    cuts: dict[str, tuple[int, ...]] = {cut: (0,)}
    arm.run(LOST, deaf=cuts.get("deaf", ()), mute=cuts.get("mute", ()))
    assert arm.control.lost.tolist() == [False, True]
    assert arm.boards.state(0).rows["mode"].tolist() == [Mode.LENGTH, Mode.ZERO_CURRENT]


def test_a_deaf_groups_boards_trip_their_own_watchdog_alone(arm: Arm) -> None:
    arm.run(TIMEOUT + 5 * PERIOD, deaf=(0,))
    assert arm.boards.fault.tolist() == [Fault.NONE, Fault.WATCHDOG]


@pytest.mark.parametrize("cut", ["deaf", "mute"])
def test_with_hold_length_a_lost_group_holds_whichever_direction_was_cut(
    split: Robot, cut: str
) -> None:
    arm = Arm(split, WatchdogAction.HOLD_LENGTH)
    arm.run(0.1)
    cuts: dict[str, tuple[int, ...]] = {cut: (0,)}
    arm.run(LOST, deaf=cuts.get("deaf", ()), mute=cuts.get("mute", ()))
    arm.control.arbiter.command(Mode.TENSION, [1], np.array([0.0]), arm.now)
    arm.run(0.05)
    assert arm.boards.state(0).rows["mode"].tolist() == [Mode.LENGTH] * 2


@pytest.mark.parametrize("cut", ["deaf", "mute"])
def test_a_lost_group_that_moved_is_held_where_it_is_and_not_where_it_was_last_heard(
    split: Robot, cut: str
) -> None:
    arm = Arm(split, WatchdogAction.HOLD_LENGTH)
    arm.run(0.1)
    cuts: dict[str, tuple[int, ...]] = {cut: (0, 1)}
    deaf, mute = cuts.get("deaf", ()), cuts.get("mute", ())
    arm.control.arbiter.command(Mode.LENGTH, [0, 1], np.array([1.4, 0.6]), arm.now)
    arm.run(0.2)
    arm.run(LOST, deaf=deaf, mute=mute)
    arm.run(TIMEOUT + 5 * PERIOD, deaf=deaf, mute=mute)
    held = arm.boards.state(0).rows["length"].copy()
    arm.run(1.0, deaf=deaf, mute=mute)
    assert arm.boards.state(0).rows["mode"].tolist() == [Mode.LENGTH] * 2
    np.testing.assert_allclose(arm.boards.state(0).rows["length"], held, atol=0.002)
    assert arm.boards.fault.tolist() == [Fault.WATCHDOG] * 2


def test_a_lost_group_that_is_held_is_no_other_bridges(split: Robot) -> None:
    arm = Arm(split, WatchdogAction.HOLD_LENGTH)
    arm.run(0.1)
    arm.run(LOST + TIMEOUT, mute=(0,))
    question, command = arm.commands
    assert (len(question.rows), len(command.rows)) == (0, 1)
    assert question.watchdog_timeout == TIMEOUT


@pytest.mark.parametrize("cut", ["deaf", "mute"])
def test_a_muscle_that_an_override_let_go_stays_without_current_when_its_bus_is_lost(
    split: Robot, cut: str
) -> None:
    arm = Arm(split, WatchdogAction.HOLD_LENGTH)
    arm.run(0.1)
    arm.control.arbiter.override([0], 0.05, arm.now)
    arm.run(0.02)
    cuts: dict[str, tuple[int, ...]] = {cut: (0, 1)}
    for _ in range(25):
        arm.control.arbiter.override([0], 0.05, arm.now)
        arm.run(0.02, deaf=cuts.get("deaf", ()), mute=cuts.get("mute", ()))
    assert arm.boards.state(0).rows["mode"].tolist() == [Mode.ZERO_CURRENT, Mode.LENGTH]


@pytest.mark.parametrize("cut", ["deaf", "mute"])
def test_an_emergency_stop_takes_the_current_from_a_lost_group_that_hears_it(
    split: Robot, cut: str
) -> None:
    arm = Arm(split, WatchdogAction.HOLD_LENGTH)
    arm.run(0.1)
    cuts: dict[str, tuple[int, ...]] = {cut: (0,)}
    arm.run(2 * LOST, deaf=cuts.get("deaf", ()), mute=cuts.get("mute", ()))
    arm.control.arbiter.emergency_stop()
    arm.run(0.05, mute=cuts.get("mute", ()))
    assert arm.boards.state(0).rows["mode"].tolist() == [Mode.ZERO_CURRENT] * 2


def test_an_emergency_stop_before_every_group_answered_takes_the_current_too(split: Robot) -> None:
    earlier = Arm(split, WatchdogAction.HOLD_LENGTH)
    earlier.run(0.1)
    earlier.boards.advance(TIMEOUT + 5 * PERIOD)
    arm = Arm(split)
    arm.boards = earlier.boards
    arm.control.arbiter.emergency_stop()
    arm.run(TIMEOUT, mute=(0,))
    assert arm.boards.state(0).rows["mode"].tolist() == [Mode.ZERO_CURRENT] * 2


def test_a_group_that_is_back_stays_latched_until_faults_are_cleared(arm: Arm) -> None:
    arm.run(LOST, deaf=(0,))
    arm.run(0.2)
    assert arm.boards.state(0).rows["mode"].tolist() == [Mode.LENGTH, Mode.ZERO_CURRENT]
    arm.control.clear_faults()
    arm.run(0.05)
    assert arm.boards.state(0).rows["mode"].tolist() == [Mode.LENGTH] * 2
    assert not arm.control.lost.any()


# Read only.


def test_a_read_only_bridge_reads_every_group(split: Robot) -> None:
    arm = Arm(split)
    arm.control.read_only = True
    arm.run(0.02)
    assert arm.whole.rows["length"].tolist() == pytest.approx([1.0, 1.0], abs=0.01)


def test_a_read_only_bridge_energises_no_board(split: Robot) -> None:
    arm = Arm(split)
    arm.control.read_only = True
    arm.run(0.3)
    assert arm.boards.state(0).rows["mode"].tolist() == [Mode.ZERO_CURRENT] * 2


def test_a_read_only_bridge_arms_and_feeds_no_watchdog(arm: Arm) -> None:
    arm.control.read_only = True
    arm.run(TIMEOUT + 5 * PERIOD)
    assert (arm.boards.fault == Fault.WATCHDOG).all()


def test_a_bridge_that_commands_takes_the_boards_from_one_that_reads(split: Robot) -> None:
    boards = Boards(split)
    link = BoardLink(boards)
    limits = command_limits(split, stream_timeout=0.1, max_lease=0.2, payout_allowance=0.2)

    def bridge(session: int, read_only: bool) -> ControlPeriod:
        action = WatchdogAction.ZERO_CURRENT
        return ControlPeriod(split, limits, action, TIMEOUT, session, read_only)

    def answered(control: ControlPeriod) -> bool:
        link.advance(PERIOD)
        command = control.next_commands([None, None], 0.0)[0]
        return link.answer(command.encode()) is not None

    reader, commander = bridge(1, True), bridge(2, False)
    assert answered(reader)
    assert answered(commander)
    assert not answered(reader)
