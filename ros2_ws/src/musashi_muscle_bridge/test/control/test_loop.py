"""The control loop takes the answers meant for it, and nobody floods, confuses or delays it."""

import dataclasses
import itertools
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping

import numpy as np
import pytest

from fastswing_planner.robot.board_groups import BoardGroup
from fastswing_planner.robot.description import Robot
from musashi_muscle_bridge.buses.protocol import CommandFrame, Mode, StateFrame, WatchdogAction
from musashi_muscle_bridge.control.channel import Channel, channel_pair
from musashi_muscle_bridge.control.command_limits import command_limits
from musashi_muscle_bridge.control.loop import ControlLoop, LoopStatus, Measurement
from musashi_muscle_bridge.control.orders import (
    ClearFaults,
    Command,
    EmergencyStop,
    Heartbeat,
    Hold,
    Order,
    after_the_last_stop,
)
from musashi_muscle_bridge.control.period import ControlPeriod
from musashi_muscle_bridge.emulation.board_link import BoardLink
from musashi_muscle_bridge.emulation.boards import Boards
from musashi_muscle_bridge.errors import BusError, BusTimeout

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
        self.waits: list[float] = []  # [s] until when somebody waited for an answer in vain
        self.mode, self.setpoint = Mode.ZERO_CURRENT, 0.0
        self.unplugged = self.closed = self.cleared = False

    @property
    def dropped(self) -> Mapping[str, int]:
        return {"stranger": 4}

    def send(self, frame: bytes) -> None:
        if self.unplugged:
            raise BusError("the cable is out")
        self.sent += 1
        command = CommandFrame.decode(frame)
        self.mode = Mode(command.rows["mode"][0])
        self.setpoint = float(command.rows["setpoint"][0])
        self.cleared |= command.clear_faults
        answer = self._link.answer(frame)
        self._answers.extend(self._tamper(answer) if answer else [])

    def receive(self, timeout: float) -> bytes:
        if self._answers:
            return self._answers.popleft()
        self.waits.append(time.monotonic() + timeout)
        time.sleep(max(timeout, 0.0))
        raise BusTimeout("no answer")

    def close(self) -> None:
        self.closed = True


class Running:
    """A control loop in a thread, and this end of its channel.

    reads  whether somebody takes what the loop tells
    beats  whether the loop gets heartbeats
    """

    def __init__(self, robot: Robot, buses: list[LinkBus], timeout: float = SOON) -> None:
        limits = command_limits(robot, stream_timeout=0.1, max_lease=0.2, payout_allowance=0.2)
        self.control = ControlPeriod(robot, limits, WatchdogAction.ZERO_CURRENT, 0.1, SESSION)
        self.buses = buses
        self.channel, theirs = channel_pair()
        self.far_end = Channel(theirs)
        self.loop = ControlLoop(buses, self.control, 200.0, timeout, self.far_end)
        self.measured: list[Measurement] = []
        self.status = self.loop.status()
        self.reads = self.beats = True
        self.thread = threading.Thread(target=self.loop.run)

    @property
    def states(self) -> list[StateFrame]:
        return [measured.state for measured in self.measured]

    def order(self, order: Order) -> None:
        assert self.channel.put(order)

    def until(self, condition: Callable[[], bool]) -> None:
        """Run until a condition holds."""
        if not self.thread.is_alive():
            self.thread.start()
        deadline = time.monotonic() + SOON
        while not condition() and time.monotonic() < deadline:
            if self.beats:
                self.channel.put(Heartbeat())
            for item in self.channel.take() if self.reads else ():
                if isinstance(item, LoopStatus):
                    self.status = item
                else:
                    self.measured.append(item)
            time.sleep(0.01)
        assert condition(), self.status

    def stop(self) -> None:
        self.channel.shut()
        if self.thread.is_alive():
            self.thread.join(SOON)
        self.channel.close()
        self.far_end.close()

    def counted(self, key: str) -> int:
        return int(float(str(self.status.statistics[key])))


Start = Callable[..., Running]


@pytest.fixture
def start(hoist: Robot) -> Iterator[Start]:
    """Return a function that makes a loop against one tampered bus."""
    runs: list[Running] = []

    def make(tamper: Tamper = lambda answer: [answer], **arguments: float) -> Running:
        runs.append(Running(hoist, [LinkBus(hoist, tamper)], **arguments))
        return runs[-1]

    yield make
    for run in runs:
        run.stop()


@pytest.fixture
def two_buses(hoist: Robot) -> Iterator[Running]:
    """Let a loop run with `down` on the first bus, `up` and the joint on the second."""
    groups = (BoardGroup((1,), ()), BoardGroup((0,), (0,)))
    robot = dataclasses.replace(hoist, board_groups=groups)
    boards = Boards(robot)
    run = Running(
        robot, [LinkBus(robot, lambda answer: [answer], boards, group) for group in (0, 1)]
    )
    yield run
    run.stop()


def of_session(answer: bytes, session: int) -> bytes:
    return dataclasses.replace(StateFrame.decode(answer), session=session).encode()


def test_each_answer_is_published(start: Start) -> None:
    run = start()
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
    start: Start, key: str, noise: Callable[[bytes], bytes]
) -> None:
    run = start(lambda answer: [noise(answer), answer])
    run.until(lambda: run.counted(key) >= 5)
    assert run.counted("misses") == 0
    assert len(run.states) >= 5


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
    start: Start, text: str, noise: Callable[[bytes], bytes]
) -> None:
    run = start(lambda answer: [noise(answer)])
    run.until(lambda: run.counted("misses") >= 5)
    assert run.states == []
    assert run.status.statistics["last_bus_error"] == text


def test_a_doubled_answer_is_published_once(start: Start) -> None:
    run = start(lambda answer: [answer, answer])
    run.until(lambda: len(run.states) >= 5)
    sequences = [state.sequence for state in run.states]
    assert sequences == sorted(set(sequences))


def test_an_old_answer_is_never_published_after_a_newer_one(start: Start) -> None:
    kept: list[bytes] = []

    def mixed(answer: bytes) -> list[bytes]:
        kept.append(answer)
        return [kept[0], answer, kept[0]]

    run = start(mixed)
    run.until(lambda: len(run.states) >= 5)
    sequences = [state.sequence for state in run.states]
    assert sequences == sorted(set(sequences))


def test_a_flood_of_answers_does_not_stop_the_commands(start: Start) -> None:
    first: list[bytes] = []

    def flood(answer: bytes) -> list[bytes]:
        first.append(answer)
        return [first[0]] * 1000

    run = start(flood)
    run.until(lambda: run.buses[0].sent >= 20)


def test_an_unplugged_bus_is_missed_until_it_is_back(start: Start) -> None:
    run = start()
    run.until(lambda: len(run.states) > 0)
    run.buses[0].unplugged = True
    run.until(lambda: run.status.silent == (0,))
    assert run.status.statistics["last_bus_error"] == "the cable is out"
    run.buses[0].unplugged = False
    run.until(lambda: run.status.silent == ())


def test_a_few_lost_frames_are_no_silence(start: Start) -> None:
    answers = itertools.cycle([True, False, False, False])
    run = start(lambda answer: [answer] if next(answers) else [])
    silent: set[tuple[int, ...]] = set()

    def enough() -> bool:
        silent.add(run.status.silent)
        return run.counted("misses") >= 50

    run.until(enough)
    assert silent == {()}


def test_what_the_bus_dropped_is_in_the_statistics(start: Start) -> None:
    run = start()
    run.until(lambda: run.counted("replies") >= 1)
    assert run.counted("bus_stranger") == 4


def test_boards_of_another_robot_are_a_miss_that_says_so(start: Start) -> None:
    def other(answer: bytes) -> list[bytes]:
        state = StateFrame.decode(answer)
        return [dataclasses.replace(state, joints=np.tile(state.joints, 2)).encode()]

    run = start(other)
    run.until(lambda: run.counted("misses") >= 2)
    assert run.status.statistics["last_bus_error"] == "the boards measure 2 joints, expected 1"


# Nobody holds up the loop.


def test_a_node_that_takes_nothing_stops_no_command(start: Start) -> None:
    run = start()
    run.reads = False
    run.until(lambda: run.buses[0].sent >= 500)


def test_states_that_nobody_takes_are_counted(start: Start) -> None:
    run = start()
    run.reads = False
    run.until(lambda: run.loop.status().statistics["untaken_states"] != 0)


def test_orders_are_carried_out_in_turn(start: Start) -> None:
    run = start()
    for number in range(20):
        run.order(Command(Mode.LENGTH, [0], np.array([0.9 + 0.001 * number]), time.monotonic()))
    run.until(lambda: run.buses[0].setpoint == pytest.approx(0.919, abs=1e-6))


STOP, CLEAR, HOLD = EmergencyStop(), ClearFaults(0.0), Hold(0.0)


@pytest.mark.parametrize(
    ("orders", "left"),
    [
        ([CLEAR, HOLD], [CLEAR, HOLD]),
        ([CLEAR, STOP, HOLD], [STOP, HOLD]),
        ([STOP, CLEAR, STOP], [STOP]),
        ([STOP, CLEAR], [STOP, CLEAR]),
        ([], []),
    ],
)
def test_an_emergency_stop_forgets_what_was_ordered_before_it(
    orders: list[Order], left: list[Order]
) -> None:
    assert after_the_last_stop(orders) == left


def test_a_clearing_that_an_emergency_stop_overtook_reaches_no_board(start: Start) -> None:
    run = start()
    run.order(CLEAR)
    run.order(STOP)
    run.until(lambda: run.counted("replies") >= 20)
    assert run.status.report.emergency
    assert not run.buses[0].cleared


def test_a_clearing_after_an_emergency_stop_ends_it(start: Start) -> None:
    run = start()
    run.order(STOP)
    run.until(lambda: run.status.report.emergency)
    run.order(CLEAR)
    run.until(lambda: not run.status.report.emergency)


def test_an_emergency_stop_that_comes_with_the_end_still_goes_out(start: Start) -> None:
    run = start()
    run.until(lambda: len(run.states) >= 5)
    assert run.buses[0].mode == Mode.LENGTH
    run.order(STOP)
    run.stop()
    assert run.buses[0].mode == Mode.ZERO_CURRENT


def test_no_frame_is_sent_before_the_node_gave_a_sign(start: Start) -> None:
    run = start()
    run.beats = False
    told = run.status
    run.until(lambda: run.status is not told)
    assert run.buses[0].sent == 0


def test_the_end_of_the_channel_ends_the_loop_and_closes_its_buses(start: Start) -> None:
    run = start()
    run.until(lambda: len(run.states) >= 1)
    run.stop()
    assert not run.thread.is_alive()
    assert run.buses[0].closed


def test_without_a_sign_of_the_node_no_frame_is_sent(start: Start) -> None:
    run = start(timeout=0.2)
    run.until(lambda: len(run.states) >= 1)
    run.beats = False
    run.until(lambda: run.counted("unsupervised_periods") >= 2)
    sent = run.buses[0].sent
    run.until(lambda: run.counted("unsupervised_periods") >= 30)
    assert run.buses[0].sent == sent


def test_when_the_node_gives_a_sign_again_frames_are_sent_again(start: Start) -> None:
    run = start(timeout=0.2)
    run.until(lambda: len(run.states) >= 1)
    run.beats = False
    run.until(lambda: run.counted("unsupervised_periods") >= 2)
    run.beats = True
    sent = run.buses[0].sent
    run.until(lambda: run.buses[0].sent > sent)


# Several buses.


def test_a_silent_bus_does_not_hide_the_others_answers(two_buses: Running) -> None:
    two_buses.until(lambda: len(two_buses.measured) >= 5)
    two_buses.buses[1].unplugged = True
    two_buses.until(lambda: two_buses.status.silent == (1,))
    two_buses.measured.clear()
    two_buses.until(lambda: len(two_buses.measured) >= 5)


@pytest.mark.parametrize(("unplugged", "fresh"), [(0, True), (1, False)])
def test_joints_are_fresh_if_their_group_answered(
    two_buses: Running, unplugged: int, fresh: bool
) -> None:
    two_buses.until(lambda: len(two_buses.measured) >= 5)
    two_buses.buses[unplugged].unplugged = True
    two_buses.until(lambda: two_buses.status.silent == (unplugged,))
    two_buses.measured.clear()
    two_buses.until(lambda: len(two_buses.measured) >= 5)
    assert {measured.joints_fresh for measured in two_buses.measured} == {fresh}


def test_each_of_several_buses_has_its_own_counts(two_buses: Running) -> None:
    two_buses.until(lambda: two_buses.counted("replies") >= 5)
    own = [two_buses.counted(f"bus{number}_replies") for number in (0, 1)]
    assert sum(own) == two_buses.counted("replies")


def test_every_period_sends_a_frame_or_is_counted(start: Start) -> None:
    stalls = iter([0.0, 0.1, 0.0, 0.03])

    def stalling(answer: bytes) -> list[bytes]:
        time.sleep(next(stalls, 0.0))
        return [answer]

    run = start(stalling)

    def all_counted() -> bool:
        counted = run.counted("replies") + run.counted("misses") + run.counted("overruns")
        periods = float(str(run.status.statistics["running_s"])) * 200.0
        return run.counted("overruns") > 20 and abs(periods - counted) < 2.0

    run.until(all_counted)


def test_silent_boards_are_waited_for_until_the_next_frame_is_due(start: Start) -> None:
    run = start(lambda answer: [])
    run.until(lambda: run.counted("misses") >= 60)
    # On the schedule they end at one place of the period, and the mean of such turns is 1; ends
    # that drift through the period have the mean 0. A few may be late with this machine.
    turns = np.exp(2j * np.pi * 200.0 * np.array(run.buses[0].waits))
    assert np.abs(turns.mean()) > 0.7


def test_periods_and_round_trips_are_timed(start: Start) -> None:
    run = start()
    run.until(lambda: run.counted("rate_hz") > 0)
    assert run.counted("rate_hz") <= 210
    assert 0.0 <= float(str(run.status.statistics["round_trip_ms"])) < 5.0
