"""The far end of the bus: emulated boards on the plant, against the wall clock."""

import secrets
import threading
import time
import traceback
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus

from fastswing_planner.errors import RobotDescriptionError
from fastswing_planner.lifecycle.common_parameters import ROBOT_DESCRIPTION
from fastswing_planner.lifecycle.managed_node import ManagedNode
from fastswing_planner.lifecycle.parameters import Parameter
from fastswing_planner.lifecycle.running import run
from fastswing_planner.robot.description import load_robot
from musashi_muscle_bridge.buses.bus import group_urls, open_all, open_board_port
from musashi_muscle_bridge.emulation.board_link import BoardLink
from musashi_muscle_bridge.emulation.board_log import BoardLog
from musashi_muscle_bridge.emulation.bus import EmulatedBus, Served
from musashi_muscle_bridge.emulation.injected_faults import (
    ARM_FAULTS,
    ArmFaults,
    FaultyBoards,
    chosen_muscles,
)
from musashi_muscle_bridge.nodes.bus_parameters import BUS_URL

_IDLE_SEC = 0.002
# After a stall of this machine the plant catches up in slices, taking the frames that waited
# meanwhile: the boards' watchdog must not bite for it. What lies further back is skipped.
_SLICE_SEC = 0.01
_MAX_BACKLOG_SEC = 0.2
_MAX_FRAMES_AT_ONCE = 64
_LINE_FAULTS = ("latency", "jitter", "loss", "corruption")


def _line_fault(name: str, description: str, unit: str = "") -> Parameter:
    return Parameter(name, 0.0, description, unit, 0.0, 1.0, read_only=False)


def _arm_fault(name: str, description: str) -> Parameter:
    return Parameter(name, [], f"Muscles, by name: {description}", read_only=False)


TABLE = (
    ROBOT_DESCRIPTION,
    BUS_URL,
    _line_fault("latency", "Delay of each answer: the bridge decides on older measurements.", "s"),
    _line_fault("jitter", "At most this much more delay, at random; frames do not overtake.", "s"),
    _line_fault(
        "loss",
        "Share of frames that are lost, there and back; boards that miss all feel their watchdog.",
    ),
    _line_fault(
        "corruption",
        "Share of frames with a flipped bit, there and back; boards and bridge drop them.",
    ),
    _arm_fault(
        "stuck_encoder",
        "the encoder shows what it showed last; when the motor turns, the board latches ENCODER.",
    ),
    _arm_fault(
        "dead_board",
        "the board has no power and its muscle no force; afterwards it has started again.",
    ),
    _arm_fault(
        "hot_motor", "the motor is too hot; the board latches OVER_TEMPERATURE and stops pulling."
    ),
    _arm_fault("broken_wire", "the wire pulls nothing, and the board does not notice."),
    Parameter(
        "seed",
        0,
        "Seed of jitter, loss and corruption: the same seed breaks the same frames.",
        "",
        0,
        2**31 - 1,
    ),
    Parameter(
        "board_log",
        "",
        "New file with every command frame, answer and change of the boards, with monotonic times; "
        "empty: none.",
    ),
)


class MockDriverNode(ManagedNode):
    """Boards and arm in a thread of their own; ROS only sees parameters and diagnostics."""

    def __init__(self) -> None:
        """Declare parameters."""
        super().__init__("mock_driver", TABLE)
        self._skipped = 0.0
        self._next_faults: ArmFaults | None = None
        self._left: list[tuple[float, int, Served]] = []  # answers: when [s], whose, to what

    def configure(self, parameters: Mapping[str, Any]) -> None:
        """Build the arm."""
        robot = load_robot(parameters["robot_description"])
        self._names = robot.model.muscle_names
        self._log_path: str = parameters["board_log"]
        self._urls = group_urls(parameters["bus_url"], len(robot.board_groups))
        try:
            self._boards = FaultyBoards(robot)
        except RobotDescriptionError as error:
            raise RobotDescriptionError(f"{robot.path}: {error}") from error
        # Boards without memory draw a number at each start.
        self._buses = [
            EmulatedBus(
                BoardLink(self._boards, secrets.randbits(16), group), parameters["seed"] + 2 * group
            )
            for group in range(len(self._urls))
        ]
        self.parameters_changed(parameters)

    def judge_parameter(self, name: str, value: Any) -> None:
        """Refuse muscles that the robot does not have."""
        if name in ARM_FAULTS:
            chosen_muscles(name, value, self._names)

    def parameters_changed(self, parameters: Mapping[str, Any]) -> None:
        """Take over the faults, for the arm in its own thread."""
        self._next_faults = ArmFaults(
            **{name: chosen_muscles(name, parameters[name], self._names) for name in ARM_FAULTS}
        )
        for bus in self._buses:
            bus.set_faults(*(parameters[name] for name in _LINE_FAULTS))

    def activate(self) -> None:
        """Open the ports and let time pass."""
        ports = open_all(open_board_port, self._urls)
        try:
            self._log = BoardLog(self._log_path) if self._log_path else None
        except BaseException:
            for port in ports:
                port.close()
            raise
        for bus, port in zip(self._buses, ports, strict=True):
            bus.port = port
            self._watch(bus, self._buses.index(bus))
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="boards", daemon=True)
        self._thread.start()

    def deactivate(self) -> None:
        """Stop time and close the ports."""
        self._stop.set()
        self._thread.join()
        for bus in self._buses:
            if bus.port is not None:
                bus.port.close()
        if self._log is not None:
            self._log.close()

    def _watch(self, bus: EmulatedBus, group: int) -> None:
        """Note what happens on a group's bus, if there is a log."""
        log, boards = self._log, self._boards
        bus.on_command = bus.on_answer = None
        if log is not None:
            left = self._left
            bus.on_command = lambda now, command: log.command(now, group, command, boards)
            bus.on_answer = lambda served: left.append((time.monotonic(), group, served))

    def _run(self) -> None:
        try:
            self._live()
        except Exception:
            self.get_logger().error(f"the boards stopped:\n{traceback.format_exc()}")

    def _live(self) -> None:
        last = time.monotonic()
        while not self._stop.is_set():
            backlog = time.monotonic() - last
            if backlog > _MAX_BACKLOG_SEC:
                self._skipped += backlog - _MAX_BACKLOG_SEC
                last += backlog - _MAX_BACKLOG_SEC
            behind = backlog > _SLICE_SEC
            self._listen(1 if behind else _MAX_FRAMES_AT_ONCE, 0.0 if behind else _IDLE_SEC)
            elapsed = min(time.monotonic() - last, _SLICE_SEC)
            self._pass(elapsed)
            last += elapsed
            self._exchange(time.monotonic())

    def _listen(self, count: int, timeout: float) -> None:
        """Take the frames that wait, so that none grows old behind the plant."""
        due = min(bus.answers.due() for bus in self._buses)
        timeout = min(timeout, max(due - time.monotonic(), 0.0)) / len(self._buses)
        for bus in self._buses:
            for attempt in range(count):
                if not bus.receive(0.0 if attempt else timeout, time.monotonic()):
                    break

    def _pass(self, elapsed: float) -> None:
        faults, self._next_faults = self._next_faults, None
        if faults is not None:
            self._boards.inject(faults)
        for bus in self._buses:
            bus.link.wait(elapsed)
        self._boards.advance(elapsed)
        if self._log is not None:
            self._log.changes(time.monotonic(), self._boards)

    def _exchange(self, now: float) -> None:
        for bus in self._buses:
            bus.exchange(now)
        if self._log is not None:
            for sent, group, served in self._left:
                self._log.answer(sent, group, served)
            self._left.clear()

    def diagnose(self) -> tuple[bytes, str, dict[str, object]]:
        """Report frames, faults and lost time."""
        if not self.is_active:
            return DiagnosticStatus.OK, "inactive", {}
        values: dict[str, object] = {
            "frames": sum(bus.link.frames for bus in self._buses),
            **_total("refused", [bus.link.refused for bus in self._buses]),
            **_total("bus", [bus.port.dropped for bus in self._buses if bus.port is not None]),
            "lost_on_purpose": sum(bus.lost for bus in self._buses),
            "corrupted_on_purpose": sum(bus.corrupted for bus in self._buses),
            "skipped_seconds": round(self._skipped, 3),
            "faulty_boards": int(np.count_nonzero(self._boards.fault)),
        }
        if not self._thread.is_alive():
            return DiagnosticStatus.ERROR, "the boards stopped, see the log", values
        return DiagnosticStatus.OK, "ok", values


def _total(prefix: str, counts: Iterable[Mapping[str, int]]) -> Counter[str]:
    """Add up the counts of all buses, by reason."""
    total: Counter[str] = Counter()
    for one in counts:
        # `update` keeps zeros, where `+` drops them.
        total.update({f"{prefix}_{reason}": count for reason, count in one.items()})
    return total


def main() -> int:
    """Run the node."""
    return run(MockDriverNode)
