"""The boards' end of a bus tells who wants to know when frames came and went."""

import math
from collections.abc import Hashable, Mapping

import numpy as np

from fastswing_planner.robot.description import Robot
from musashi_muscle_bridge.buses.bus import Received
from musashi_muscle_bridge.buses.protocol import COMMAND_ROW, CommandFrame, WatchdogAction
from musashi_muscle_bridge.emulation.board_link import BoardLink
from musashi_muscle_bridge.emulation.boards import Boards
from musashi_muscle_bridge.emulation.bus import EmulatedBus, Served

SEQUENCE, ARRIVED, READ, TAKEN = 7, 1.0, 2.0, 3.0


def frame() -> bytes:
    rows = np.zeros(2, COMMAND_ROW)
    rows["id"] = 0, 1
    return CommandFrame(SEQUENCE, rows, WatchdogAction.ZERO_CURRENT, 0.1).encode()


class Port:
    """One frame that waits, and what happens."""

    def __init__(self, arrived: float) -> None:
        self.dropped: Mapping[str, int] = {}
        self.events: list[object] = []
        self._waiting = [Received(frame(), "bridge", arrived)]

    def receive(self, timeout: float) -> Received | None:
        return self._waiting.pop() if self._waiting else None

    def send(self, frame: bytes, to: Hashable) -> None:
        self.events.append("answer")

    def close(self) -> None:
        pass


def exchange(robot: Robot, port: Port) -> list[object]:
    """Return what happened, in order, while the boards took a frame and answered it."""
    bus = EmulatedBus(BoardLink(Boards(robot)), seed=0)
    bus.port = port
    bus.on_command = lambda now, command: port.events.append((now, command.sequence))
    bus.on_answer = port.events.append
    bus.receive(0.0, READ)
    bus.exchange(TAKEN)
    return port.events


def test_a_command_is_told_after_its_answer_has_left(hoist: Robot) -> None:
    events = exchange(hoist, Port(ARRIVED))
    assert events[1:] == ["answer", (TAKEN, SEQUENCE)]


def test_an_answer_is_told_before_it_leaves_with_the_arrival_of_its_command(hoist: Robot) -> None:
    assert exchange(hoist, Port(ARRIVED))[0] == Served(SEQUENCE, ARRIVED, TAKEN)


def test_where_the_bus_cannot_tell_a_frame_arrived_when_it_was_read(hoist: Robot) -> None:
    assert exchange(hoist, Port(math.nan))[0] == Served(SEQUENCE, READ, TAKEN)


def test_an_answer_that_is_lost_never_left(hoist: Robot) -> None:
    port = Port(ARRIVED)
    bus = EmulatedBus(BoardLink(Boards(hoist)), seed=0)
    bus.port = port
    bus.on_answer = port.events.append
    bus.receive(0.0, READ)
    bus.set_faults(0.0, 0.0, 1.0, 0.0)
    bus.exchange(TAKEN)
    assert port.events == []
