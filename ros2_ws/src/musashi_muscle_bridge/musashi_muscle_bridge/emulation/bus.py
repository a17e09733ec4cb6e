"""The boards' end of one bus, with the faults of its line; time comes in as an argument."""

import math
from collections.abc import Callable, Hashable
from typing import NamedTuple

from musashi_muscle_bridge.buses.bus import BoardPort, Received
from musashi_muscle_bridge.buses.protocol import CommandFrame
from musashi_muscle_bridge.emulation.board_link import BoardLink
from musashi_muscle_bridge.emulation.faulty_line import FaultyLine, LineFaults


class Served(NamedTuple):
    """A command frame that the boards answer; monotonic times [s].

    arrived   when it reached this computer, as far as the bus tells, else when it was read
    measured  of the state in the answer
    """

    sequence: int
    arrived: float
    measured: float


class EmulatedBus:
    """Lets frames of one port reach one group of boards, and their answers return.

    port        None while the bus is closed
    on_command  called with the time [s] and each command that the boards took, before they take
                the next, and after the answers left if it can: it then delays none; None: nobody
    on_answer   called before each answer leaves; None: nobody
    """

    def __init__(self, link: BoardLink, seed: int) -> None:
        """`seed` of jitter, loss and corruption."""
        self.link = link
        self.commands: FaultyLine[Received] = FaultyLine(seed)
        self.answers: FaultyLine[tuple[Hashable, Served]] = FaultyLine(seed + 1)
        self.port: BoardPort | None = None
        self.on_command: Callable[[float, CommandFrame], None] | None = None
        self.on_answer: Callable[[Served], None] | None = None

    def set_faults(self, latency: float, jitter: float, loss: float, corruption: float) -> None:
        """Set the line's faults: latency, jitter [s]; loss, corruption as shares."""
        self.commands.faults = LineFaults(0.0, 0.0, loss, corruption)
        self.answers.faults = LineFaults(latency, jitter, loss, corruption)

    def receive(self, timeout: float, now: float) -> bool:
        """Take a frame that arrives within `timeout` [s]; whether there was one."""
        received = None if self.port is None else self.port.receive(timeout)
        if received is None:
            return False
        if math.isnan(received.arrived):
            received = received._replace(arrived=now)
        self.commands.put(received.frame, received, now)
        return True

    def exchange(self, now: float) -> None:
        """Let the boards carry out what arrived by `now` [s], and send what is due."""
        taken: CommandFrame | None = None
        for frame, received in self.commands.take(now):
            self._tell(now, taken)
            taken = None
            answer = self.link.answer(frame, received.sender)
            command = self.link.command
            if answer is not None and command is not None:
                taken = command
                served = Served(command.sequence, received.arrived, now)
                self.answers.put(answer, (received.sender, served), now)
        for answer, (sender, served) in self.answers.take(now):
            if self.port is not None:
                if self.on_answer is not None:
                    self.on_answer(served)
                self.port.send(answer, sender)
        self._tell(now, taken)

    def _tell(self, now: float, taken: CommandFrame | None) -> None:
        if taken is not None and self.on_command is not None:
            self.on_command(now, taken)

    @property
    def lost(self) -> int:
        """Frames lost on purpose."""
        return self.commands.lost + self.answers.lost

    @property
    def corrupted(self) -> int:
        """Frames corrupted on purpose."""
        return self.commands.corrupted + self.answers.corrupted
