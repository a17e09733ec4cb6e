"""The control thread takes the answers meant for it, and nobody floods or confuses it."""

import dataclasses
import time
from collections import deque
from collections.abc import Callable, Mapping

import numpy as np
import pytest

from fastswing_planner.robot import Robot
from musashi_muscle_bridge.board import Boards
from musashi_muscle_bridge.board_link import BoardLink
from musashi_muscle_bridge.control import ControlPeriod, command_limits
from musashi_muscle_bridge.control_loop import ControlLoop
from musashi_muscle_bridge.errors import BusError, BusTimeout
from musashi_muscle_bridge.protocol import StateFrame, WatchdogAction

SOON = 10.0
SESSION = 77

Tamper = Callable[[bytes], list[bytes]]


class LinkBus:
    """Boards without time behind a bus that a test tampers with."""

    def __init__(self, robot: Robot, tamper: Tamper) -> None:
        self._link = BoardLink(Boards(robot))
        self._tamper = tamper
        self._answers: deque[bytes] = deque()
        self.sent = 0
        self.unplugged = False

    @property
    def dropped(self) -> Mapping[str, int]:
        return {"stranger": 4}

    def send(self, frame: bytes) -> None:
        if self.unplugged:
            raise BusError("the cable is out")
        self.sent += 1
        answer = self._link.answer(frame)
        self._answers.extend(self._tamper(answer) if answer else [])

    def receive(self, timeout: float) -> bytes:
        if self._answers:
            return self._answers.popleft()
        time.sleep(max(timeout, 0.0))
        raise BusTimeout("no answer")

    def close(self) -> None:
        pass


class Run:
    """A control loop against a tampered bus."""

    def __init__(self, robot: Robot, tamper: Tamper) -> None:
        limits = command_limits(robot, stream_timeout=0.1, max_lease=0.2, payout_allowance=0.2)
        control = ControlPeriod(robot, limits, WatchdogAction.ZERO_CURRENT, 0.1, SESSION)
        self.bus = LinkBus(robot, tamper)
        self.states: list[StateFrame] = []
        self.complaints: list[str] = []
        self.loop = ControlLoop(
            [self.bus],
            control,
            200.0,
            lambda measured: self.states.append(measured.state),
            self.complaints.append,
        )

    def until(self, condition: Callable[[], bool]) -> None:
        self.loop.start()
        deadline = time.monotonic() + SOON
        while not condition() and time.monotonic() < deadline:
            time.sleep(0.01)
        reached = condition()
        self.loop.stop()
        assert reached, self.loop.statistics()

    def counted(self, key: str) -> int:
        return int(str(self.loop.statistics()[key]))


def of_session(answer: bytes, session: int) -> bytes:
    return dataclasses.replace(StateFrame.decode(answer), session=session).encode()


def test_each_answer_is_published(hoist: Robot) -> None:
    run = Run(hoist, lambda answer: [answer])
    run.until(lambda: len(run.states) >= 5)
    assert [state.sequence for state in run.states[:5]] == [1, 2, 3, 4, 5]


@pytest.mark.parametrize(
    ("key", "noise"),
    [
        ("dropped_damaged", lambda answer: answer[:-1]),
        ("dropped_foreign", lambda answer: of_session(answer, SESSION + 1)),
    ],
)
def test_noise_before_the_answer_is_counted_and_does_not_hide_it(
    hoist: Robot, key: str, noise: Callable[[bytes], bytes]
) -> None:
    run = Run(hoist, lambda answer: [noise(answer), answer])
    run.until(lambda: len(run.states) >= 5)
    assert run.counted("misses") == 0
    assert run.counted(key) >= 5


@pytest.mark.parametrize(
    ("text", "noise"),
    [
        ("frame is damaged: its CRC does not fit", lambda answer: answer[:-5] + answer[-4:]),
        (
            f"an answer to another bridge, of session {SESSION + 1:#x}",
            lambda answer: of_session(answer, SESSION + 1),
        ),
    ],
)
def test_noise_alone_is_a_miss_that_says_what_came(
    hoist: Robot, text: str, noise: Callable[[bytes], bytes]
) -> None:
    run = Run(hoist, lambda answer: [noise(answer)])
    run.until(lambda: run.counted("misses") >= 5)
    assert run.states == []
    assert run.loop.statistics()["last_bus_error"] == text


def test_a_doubled_answer_is_published_once(hoist: Robot) -> None:
    run = Run(hoist, lambda answer: [answer, answer])
    run.until(lambda: len(run.states) >= 5)
    sequences = [state.sequence for state in run.states]
    assert sequences == sorted(set(sequences))


def test_an_old_answer_is_never_published_after_a_newer_one(hoist: Robot) -> None:
    kept: list[bytes] = []

    def mixed(answer: bytes) -> list[bytes]:
        kept.append(answer)
        return [kept[0], answer, kept[0]]

    run = Run(hoist, mixed)
    run.until(lambda: len(run.states) >= 5)
    sequences = [state.sequence for state in run.states]
    assert sequences == sorted(set(sequences))


def test_a_flood_of_answers_does_not_stop_the_commands(hoist: Robot) -> None:
    first: list[bytes] = []

    def flood(answer: bytes) -> list[bytes]:
        first.append(answer)
        return [first[0]] * 1000

    run = Run(hoist, flood)
    run.until(lambda: run.bus.sent >= 20)


def test_an_unplugged_bus_is_missed_until_it_is_back(hoist: Robot) -> None:
    run = Run(hoist, lambda answer: [answer])

    def unplugged_and_back() -> bool:
        run.bus.unplugged = len(run.states) > 0 and run.counted("misses") < 5
        return run.counted("misses") >= 5 and run.loop.misses_in_a_row == 0

    run.until(unplugged_and_back)
    assert run.loop.statistics()["last_bus_error"] == "the cable is out"


def test_what_the_bus_dropped_is_in_the_statistics(hoist: Robot) -> None:
    run = Run(hoist, lambda answer: [answer])
    run.until(lambda: len(run.states) >= 1)
    assert run.counted("bus_stranger") == 4


def test_boards_of_another_robot_are_a_miss_that_says_so(hoist: Robot) -> None:
    def other(answer: bytes) -> list[bytes]:
        state = StateFrame.decode(answer)
        return [dataclasses.replace(state, joints=np.tile(state.joints, 2)).encode()]

    run = Run(hoist, other)
    run.until(lambda: run.counted("misses") >= 2)
    assert run.loop.statistics()["last_bus_error"] == "the boards measure 2 joints, expected 1"
