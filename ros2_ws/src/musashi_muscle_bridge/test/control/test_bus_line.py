"""An answer belongs to the frame that it answers, however late it comes."""

import time
from collections import deque
from collections.abc import Mapping

import pytest

from fastswing_planner.robot.description import Robot
from musashi_muscle_bridge.buses.protocol import CommandFrame, WatchdogAction
from musashi_muscle_bridge.control.bus_line import BusLine
from musashi_muscle_bridge.control.command_limits import command_limits
from musashi_muscle_bridge.control.period import ControlPeriod
from musashi_muscle_bridge.emulation.board_link import BoardLink
from musashi_muscle_bridge.emulation.boards import Boards
from musashi_muscle_bridge.errors import BusTimeout


class SlowBus:
    """Gives the answers to frames a number of frames later."""

    dropped: Mapping[str, int] = {}

    def __init__(self, robot: Robot, behind: int) -> None:
        self._link = BoardLink(Boards(robot))
        self._behind = behind
        self._answers: deque[bytes] = deque()

    def send(self, frame: bytes) -> None:
        answer = self._link.answer(frame)
        assert answer is not None
        self._answers.append(answer)

    def receive(self, timeout: float) -> bytes:
        if len(self._answers) <= self._behind:
            raise BusTimeout("no answer")
        return self._answers.popleft()

    def close(self) -> None:
        pass


class Line:
    """A bus line whose answers come `behind` frames late."""

    def __init__(self, robot: Robot, behind: int) -> None:
        limits = command_limits(robot, stream_timeout=0.1, max_lease=0.2, payout_allowance=0.2)
        control = ControlPeriod(robot, limits, WatchdogAction.ZERO_CURRENT, 0.1)
        (self._group,) = control.groups
        self.line = BusLine(SlowBus(robot, behind), self._group)
        self.sent: list[float] = []

    def exchange(self) -> bool:
        """Send a frame, and look for an answer."""
        command: CommandFrame = self._group.first_command()
        self.line.send(command)
        self.sent.append(time.monotonic())
        time.sleep(0.001)
        return self.line.answered(time.monotonic())


@pytest.mark.parametrize("behind", [1, 3, 10])
def test_a_late_answer_is_as_old_as_the_frame_that_it_answers(hoist: Robot, behind: int) -> None:
    line = Line(hoist, behind)
    fresh = [line.exchange() for _ in range(behind + 1)]
    assert fresh == [False] * behind + [True]
    assert line.line.measured <= line.sent[0]
    assert line.line.round_trip >= line.sent[-1] - line.sent[0]
    assert line.line.late == 1


def test_an_answer_in_its_period_is_as_old_as_its_receipt(hoist: Robot) -> None:
    line = Line(hoist, 0)
    assert line.exchange()
    assert line.line.measured > line.sent[0]
    assert line.line.late == 0


def test_an_answer_to_a_frame_long_ago_is_none(hoist: Robot) -> None:
    line = Line(hoist, 300)
    assert not any(line.exchange() for _ in range(320))
