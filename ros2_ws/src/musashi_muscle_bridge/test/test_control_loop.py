"""The control thread takes the answers meant for it, and nobody floods or confuses it."""

import dataclasses
import functools
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping

import numpy as np
import pytest

from fastswing_planner.board_groups import BoardGroup
from fastswing_planner.robot import Robot
from musashi_muscle_bridge.board import Boards
from musashi_muscle_bridge.board_link import BoardLink
from musashi_muscle_bridge.control import ControlPeriod, command_limits
from musashi_muscle_bridge.control_loop import ControlLoop, Measurement
from musashi_muscle_bridge.errors import BusError, BusTimeout
from musashi_muscle_bridge.protocol import StateFrame, WatchdogAction

SOON = 10.0
SESSION = 77

Tamper = Callable[[bytes], list[bytes]]


class LinkBus:
    """Boards without time behind a bus that a test tampers with."""

    def __init__(
        self, robot: Robot, tamper: Tamper, boards: Boards | None = None, group: int = 0
    ) -> None:
        self._link = BoardLink(boards or Boards(robot), group=group)
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
        self.control = control
        self.bus = LinkBus(robot, tamper)
        self.states: list[StateFrame] = []
        self.complaints: list[str] = []
        self.deliver: Callable[[Measurement], None] = lambda measured: self.states.append(
            measured.state
        )
        self.loop = ControlLoop(
            [self.bus],
            control,
            200.0,
            lambda measured: self.deliver(measured),
            self.complaints.append,
        )

    def until(self, condition: Callable[[], bool]) -> None:
        """Run until a condition holds, then stop."""
        self.loop.start()
        deadline = time.monotonic() + SOON
        while not condition() and time.monotonic() < deadline:
            time.sleep(0.01)
        reached = condition()
        self.loop.stop()
        assert reached, self.loop.statistics()

    def counted(self, key: str) -> int:
        return int(str(self.loop.statistics()[key]))


class TwoBuses:
    """A control loop with `down` on the first bus, `up` and the joint on the second."""

    def __init__(self, hoist: Robot) -> None:
        groups = (BoardGroup((1,), ()), BoardGroup((0,), (0,)))
        robot = dataclasses.replace(hoist, board_groups=groups)
        limits = command_limits(robot, stream_timeout=0.1, max_lease=0.2, payout_allowance=0.2)
        control = ControlPeriod(robot, limits, WatchdogAction.ZERO_CURRENT, 0.1, SESSION)
        boards = Boards(robot)
        self.buses = [LinkBus(robot, lambda answer: [answer], boards, group) for group in (0, 1)]
        self.measured: list[Measurement] = []
        self.loop = ControlLoop(self.buses, control, 200.0, self.measured.append, print)
        self.loop.start()

    def until(self, condition: Callable[[], bool]) -> None:
        deadline = time.monotonic() + SOON
        while not condition() and time.monotonic() < deadline:
            time.sleep(0.01)
        assert condition(), self.loop.statistics()

    def stop(self) -> None:
        self.loop.stop()


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


# Nobody holds up the control thread.


def hang(run: Run, release: threading.Event) -> None:
    """Let whoever publishes wait until he is released."""

    def deliver(_measured: Measurement) -> None:
        release.wait(SOON)

    run.deliver = deliver


def test_whoever_publishes_for_ever_stops_no_command(hoist: Robot) -> None:
    run = Run(hoist, lambda answer: [answer])
    release = threading.Event()
    hang(run, release)
    try:
        run.until(lambda: run.bus.sent >= 50)
    finally:
        release.set()


def test_states_that_nobody_takes_are_counted(hoist: Robot) -> None:
    run = Run(hoist, lambda answer: [answer])
    release = threading.Event()
    hang(run, release)

    def enough() -> bool:
        if run.bus.sent >= 50:
            release.set()
        return run.counted("unpublished_states") > 0

    run.until(enough)


def test_a_state_that_cannot_be_published_is_told_once_and_the_next_one_is_tried(
    hoist: Robot,
) -> None:
    run = Run(hoist, lambda answer: [answer])
    tried: list[int] = []

    def fail(measured: Measurement) -> None:
        tried.append(measured.state.sequence)
        raise ValueError("no publisher")

    run.deliver = fail
    run.until(lambda: len(tried) >= 5)
    (complaint,) = run.complaints
    assert complaint.endswith("ValueError: no publisher\n")


def test_an_order_is_carried_out_by_the_control_thread(hoist: Robot) -> None:
    run = Run(hoist, lambda answer: [answer])
    threads: list[str] = []
    run.loop.order(lambda: threads.append(threading.current_thread().name))
    run.until(lambda: len(threads) > 0)
    assert threads == ["control"]


def test_orders_are_carried_out_in_turn(hoist: Robot) -> None:
    run = Run(hoist, lambda answer: [answer])
    done: list[int] = []
    for number in range(100):
        run.loop.order(functools.partial(done.append, number))
    run.until(lambda: len(done) == 100)
    assert done == list(range(100))


def test_an_emergency_stop_forgets_what_was_ordered_before_it(hoist: Robot) -> None:
    run = Run(hoist, lambda answer: [answer])
    done: list[str] = []
    run.loop.order(lambda: done.append("clear"))
    run.loop.order_first(lambda: done.append("stop"))
    run.loop.order(lambda: done.append("later"))
    run.until(lambda: "later" in done)
    assert done == ["stop", "later"]


def test_a_dead_control_thread_tells_its_traceback(hoist: Robot) -> None:
    run = Run(hoist, lambda answer: [answer])

    def defect() -> None:
        raise ZeroDivisionError("a defect")

    run.loop.order(defect)
    run.until(lambda: len(run.complaints) > 0)
    assert not run.loop.alive
    (complaint,) = run.complaints
    assert complaint.startswith("the control thread died:\nTraceback (most recent call last):\n")
    assert complaint.endswith("ZeroDivisionError: a defect\n")


def test_the_report_tells_what_is_latched(hoist: Robot) -> None:
    run = Run(hoist, lambda answer: [answer])
    run.loop.order(run.control.arbiter.emergency_stop)
    run.until(lambda: run.loop.report.emergency)


# Several buses.


def test_a_silent_bus_does_not_hide_the_others_answers(hoist: Robot) -> None:
    run = TwoBuses(hoist)
    run.until(lambda: len(run.measured) >= 5)
    run.buses[1].unplugged = True
    run.measured.clear()
    run.until(lambda: len(run.measured) >= 5)
    run.stop()
    assert run.loop.silent == [1]


@pytest.mark.parametrize(("unplugged", "fresh"), [(0, True), (1, False)])
def test_joints_are_fresh_if_their_group_answered(
    hoist: Robot, unplugged: int, fresh: bool
) -> None:
    run = TwoBuses(hoist)
    run.until(lambda: len(run.measured) >= 5)
    run.buses[unplugged].unplugged = True
    run.until(lambda: unplugged in run.loop.silent)
    run.measured.clear()
    run.until(lambda: len(run.measured) >= 5)
    run.stop()
    assert {measured.joints_fresh for measured in run.measured[1:]} == {fresh}


def test_each_of_several_buses_has_its_own_counts(hoist: Robot) -> None:
    run = TwoBuses(hoist)
    run.until(lambda: len(run.measured) >= 5)
    run.stop()
    statistics = run.loop.statistics()
    assert int(str(statistics["bus0_replies"])) + int(str(statistics["bus1_replies"])) == int(
        str(statistics["replies"])
    )


def test_periods_and_round_trips_are_timed(hoist: Robot) -> None:
    run = Run(hoist, lambda answer: [answer])
    run.until(lambda: float(str(run.loop.statistics()["rate_hz"])) > 0.0)
    assert 0.0 < float(str(run.loop.statistics()["rate_hz"])) <= 210.0
    assert 0.0 <= float(str(run.loop.statistics()["round_trip_ms"])) < 5.0
