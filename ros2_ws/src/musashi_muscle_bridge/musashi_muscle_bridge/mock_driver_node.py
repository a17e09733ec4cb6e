"""The far end of the bus: emulated boards on the plant, against the wall clock."""

import random
import threading
import time
from collections.abc import Mapping
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus

from fastswing_planner.managed_node import ROBOT_DESCRIPTION, ManagedNode, run
from fastswing_planner.parameters import Parameter
from fastswing_planner.robot import load_robot
from fastswing_planner.robot_path import resolve_path
from musashi_muscle_bridge.board import Boards
from musashi_muscle_bridge.bus_parameters import BUS_URL
from musashi_muscle_bridge.errors import FrameError
from musashi_muscle_bridge.protocol import CommandFrame
from musashi_muscle_bridge.udp_bus import UdpBoardPort

_IDLE_SEC = 0.002
# After a stall of this machine the plant catches up in slices, taking the frames that waited
# meanwhile: the boards' watchdog must not bite for it. What lies further back is skipped.
_SLICE_SEC = 0.01
_MAX_BACKLOG_SEC = 0.2

TABLE = (
    ROBOT_DESCRIPTION,
    BUS_URL,
    Parameter("latency", 0.0, "Delay of each answer.", "s", 0.0, 1.0, read_only=False),
    Parameter("loss", 0.0, "Share of answers that are lost.", "", 0.0, 1.0, read_only=False),
    Parameter(
        "corruption", 0.0, "Share of answers with a flipped bit.", "", 0.0, 1.0, read_only=False
    ),
    Parameter("seed", 0, "Seed of loss and corruption.", "", 0, 2**31 - 1),
)


class MockDriverNode(ManagedNode):
    """Boards and arm in a thread of their own; ROS only sees parameters and diagnostics."""

    def __init__(self) -> None:
        """Declare parameters."""
        super().__init__("mock_driver", TABLE)
        self._frames = 0
        self._bad_frames = 0
        self._skipped = 0.0

    def configure(self, parameters: Mapping[str, Any]) -> None:
        """Build the arm."""
        self._boards = Boards(load_robot(resolve_path(parameters["robot_description"])))
        self._url: str = parameters["bus_url"]
        self._random = random.Random(parameters["seed"])  # not for security

    def activate(self) -> None:
        """Open the port and let time pass."""
        self._port = UdpBoardPort(self._url)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._live, name="boards", daemon=True)
        self._thread.start()

    def deactivate(self) -> None:
        """Stop time and close the port."""
        self._stop.set()
        self._thread.join()
        self._port.close()

    def _live(self) -> None:
        last = time.monotonic()
        while not self._stop.is_set():
            backlog = time.monotonic() - last
            if backlog > _MAX_BACKLOG_SEC:
                self._skipped += backlog - _MAX_BACKLOG_SEC
                last += backlog - _MAX_BACKLOG_SEC
            frame = self._port.receive(0.0 if backlog > _SLICE_SEC else _IDLE_SEC)
            elapsed = min(time.monotonic() - last, _SLICE_SEC)
            self._boards.advance(elapsed)
            last += elapsed
            if frame is not None:
                self._answer(frame)

    def _answer(self, frame: bytes) -> None:
        try:
            command = CommandFrame.decode(frame)
        except FrameError:
            self._bad_frames += 1
            return
        self._frames += 1
        answer = self._boards.handle(command).encode()
        faults = {
            name: self.get_parameter(name).value for name in ("latency", "loss", "corruption")
        }
        if self._random.random() < faults["loss"]:
            return
        if self._random.random() < faults["corruption"]:
            place = self._random.randrange(len(answer))
            answer = answer[:place] + bytes([answer[place] ^ 1]) + answer[place + 1 :]
        if faults["latency"]:
            self._stop.wait(faults["latency"])
        self._port.send(answer)

    def diagnose(self) -> tuple[bytes, str, dict[str, object]]:
        """Report frames, faults and lost time."""
        values: dict[str, object] = {
            "frames": self._frames,
            "bad_frames": self._bad_frames,
            "skipped_seconds": round(self._skipped, 3),
        }
        if self.is_active:
            values["faulty_boards"] = int(np.count_nonzero(self._boards.fault))
        return DiagnosticStatus.OK, "ok", values


def main() -> int:
    """Run the node."""
    return run(MockDriverNode)
