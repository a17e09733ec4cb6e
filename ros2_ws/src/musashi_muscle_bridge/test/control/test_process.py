"""The control process lives and dies as it must, with boards on a real bus."""

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from fastswing_planner.robot.description import Robot
from musashi_muscle_bridge.buses.bus import open_board_port
from musashi_muscle_bridge.buses.protocol import WatchdogAction
from musashi_muscle_bridge.control.command_limits import command_limits
from musashi_muscle_bridge.control.loop import Measurement
from musashi_muscle_bridge.control.orders import EmergencyStop, Heartbeat, Hold, Override
from musashi_muscle_bridge.control.period import ControlPeriod
from musashi_muscle_bridge.control.process import ControlProcess, LoopTask
from musashi_muscle_bridge.emulation.board_link import BoardLink
from musashi_muscle_bridge.emulation.boards import Boards
from musashi_muscle_bridge.errors import BusError

SOON = 20.0
SILENCE = 0.3
"""[s] without a frame after which a process that sends 200 in a second has stopped."""


def until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + SOON
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)


class FarEnd:
    """Boards without time that answer on a UDP port.

    heard  when the last frame came [s], monotonic
    """

    def __init__(self, robot: Robot) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind(("127.0.0.1", 0))
            self.url = f"udp://127.0.0.1:{free.getsockname()[1]}"
        self.heard = -1.0
        self._port = open_board_port(self.url)
        self._link = BoardLink(Boards(robot))
        self._ended = False
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _serve(self) -> None:
        while not self._ended:
            received = self._port.receive(0.05)
            if received is None:
                continue
            self.heard = time.monotonic()
            answer = self._link.answer(received.frame)
            if answer:
                self._port.send(answer, received.sender)

    @property
    def silent(self) -> bool:
        return time.monotonic() - self.heard > SILENCE

    def close(self) -> None:
        self._ended = True
        self._thread.join()
        self._port.close()


class Node:
    """What the bridge's node does with a control process."""

    def __init__(self, robot: Robot, url: str, wanted: Callable[[], bool] = lambda: True) -> None:
        limits = command_limits(robot, stream_timeout=0.1, max_lease=0.2, payout_allowance=0.2)
        control = ControlPeriod(robot, limits, WatchdogAction.ZERO_CURRENT, 0.1, 77)
        self.measured: list[Measurement] = []
        self.complaints: list[str] = []
        self.publish: Callable[[Measurement], None] = self.measured.append
        self.process = ControlProcess(
            LoopTask(control, [url], 200.0, supervision_timeout=SOON),
            lambda measured: self.publish(measured),
            self.complaints.append,
            wanted,
        )

    def until(self, condition: Callable[[], bool]) -> None:
        def beat_until() -> bool:
            self.process.order(Heartbeat())
            return condition()

        until(beat_until)


@pytest.fixture
def boards(hoist: Robot) -> Iterator[FarEnd]:
    far_end = FarEnd(hoist)
    yield far_end
    far_end.close()


@pytest.fixture
def node(hoist: Robot, boards: FarEnd) -> Iterator[Node]:
    one = Node(hoist, boards.url)
    yield one
    one.process.stop()


def test_what_the_boards_answer_is_published(node: Node) -> None:
    node.until(lambda: len(node.measured) >= 5)
    sequences = [measured.state.sequence for measured in node.measured]
    assert sequences == sorted(set(sequences))


def test_the_process_runs_on_the_cores_of_the_node(hoist: Robot, boards: FarEnd) -> None:
    before = os.sched_getaffinity(0)
    chosen = {min(before)}
    os.sched_setaffinity(0, chosen)
    try:
        node = Node(hoist, boards.url)
    finally:
        os.sched_setaffinity(0, before)
    assert os.sched_getaffinity(node.process.pid) == chosen
    node.process.stop()


def test_an_order_arrives(node: Node) -> None:
    assert node.process.order(EmergencyStop())
    node.until(lambda: node.process.status.report.emergency)


def test_a_bus_that_cannot_be_opened_is_an_error_with_its_reason(hoist: Robot) -> None:
    with pytest.raises(BusError, match=r"^bus_url 'pigeon://x': unknown scheme 'pigeon', choose"):
        Node(hoist, "pigeon://x")


def test_a_start_that_is_not_wanted_any_more_is_given_up(hoist: Robot) -> None:
    with pytest.raises(BusError, match=r"^the control process does not start$"):
        Node(hoist, "udp://127.0.0.1:9", wanted=lambda: False)


def test_a_process_that_stands_still_does_not_answer(node: Node) -> None:
    node.until(lambda: node.process.answers)
    os.kill(node.process.pid, signal.SIGSTOP)
    try:
        node.until(lambda: not node.process.answers)
        assert node.process.alive
    finally:
        os.kill(node.process.pid, signal.SIGCONT)
    node.until(lambda: node.process.answers)


def test_frames_stop_when_the_process_is_stopped(node: Node, boards: FarEnd) -> None:
    node.until(lambda: len(node.measured) >= 1)
    node.process.stop()
    node.until(lambda: boards.silent)
    assert not node.process.alive
    assert node.complaints == []


def test_the_death_of_the_process_is_told(node: Node) -> None:
    node.until(lambda: len(node.measured) >= 1)
    os.kill(node.process.pid, signal.SIGKILL)
    node.until(lambda: not node.process.alive)
    node.until(lambda: node.complaints == ["the control process ended"])


def test_an_order_to_a_dead_process_is_known_to_be_lost(node: Node) -> None:
    os.kill(node.process.pid, signal.SIGKILL)
    node.until(lambda: not node.process.alive)
    assert not node.process.order(Hold(0.0))


def test_an_order_that_fails_ends_the_process_with_its_traceback(node: Node) -> None:
    node.until(lambda: len(node.measured) >= 1)
    node.process.order(Override([99], 0.1, time.monotonic()))
    node.until(lambda: not node.process.alive)
    node.until(lambda: len(node.complaints) == 2)
    assert node.complaints[0].startswith("the control process died:\nTraceback (most recent call")
    assert "IndexError: index 99 is out of bounds" in node.complaints[0]


def test_a_ctrl_c_in_the_nodes_terminal_does_not_reach_the_process(node: Node) -> None:
    assert os.getsid(node.process.pid) != os.getsid(0)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_that_ends_is_left_to_the_node(node: Node, number: signal.Signals) -> None:
    node.until(lambda: len(node.measured) >= 1)
    os.kill(node.process.pid, number)
    node.measured.clear()
    node.until(lambda: len(node.measured) >= 50)


def test_a_state_that_cannot_be_published_is_told_once_and_the_next_one_is_tried(
    node: Node,
) -> None:
    tried: list[int] = []

    def fail(measured: Measurement) -> None:
        tried.append(measured.state.sequence)
        raise ValueError("no publisher")

    node.publish = fail
    node.until(lambda: len(tried) >= 5)
    (complaint,) = node.complaints
    assert complaint.endswith("ValueError: no publisher\n")


def test_what_cannot_be_published_in_time_is_dropped_for_newer_states(node: Node) -> None:
    delivered: list[float] = []

    def slowly(measured: Measurement) -> None:
        time.sleep(0.05)
        delivered.append(time.monotonic() - measured.received)

    node.publish = slowly
    node.until(lambda: len(delivered) >= 60)
    assert node.process.unpublished > 0
    # Of 200 in a second: at most 4 that wait, and those that came while they were delivered.
    assert sorted(delivered)[30] < 0.5


NODE = """
import sys, time
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from fastswing_planner.robot.description import load_robot
from test_process import Node
node = Node(load_robot(Path(sys.argv[2])), sys.argv[3])
node.until(lambda: len(node.measured) >= 5)
print(node.process.pid, flush=True)
time.sleep(60.0)
"""


@pytest.fixture
def boards_of_musashi(musashi: Robot) -> Iterator[FarEnd]:
    far_end = FarEnd(musashi)
    yield far_end
    far_end.close()


def test_when_the_node_is_killed_its_control_process_ends(boards_of_musashi: FarEnd) -> None:
    here = Path(__file__).parent
    robot = here.parents[1] / "description/musashi_left_arm.yaml"
    command = [sys.executable, "-c", NODE, str(here), str(robot), boards_of_musashi.url]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None
        pid = int(other.stdout.readline())
        other.kill()
    until(lambda: not Path(f"/proc/{pid}").exists())
    assert boards_of_musashi.heard > 0.0
