"""The boards' end of one bus, with the faults of its line; time comes in as an argument."""

from collections.abc import Callable, Hashable

from musashi_muscle_bridge.board_link import BoardLink
from musashi_muscle_bridge.bus import BoardPort
from musashi_muscle_bridge.faulty_line import FaultyLine, LineFaults
from musashi_muscle_bridge.protocol import CommandFrame


class EmulatedBus:
    """Lets frames of one port reach one group of boards, and their answers return.

    port        None while the bus is closed
    on_command  called with the time [s] and each command that the boards took; None: nobody
    """

    def __init__(self, link: BoardLink, seed: int) -> None:
        """`seed` of jitter, loss and corruption."""
        self.link = link
        self.commands: FaultyLine[Hashable] = FaultyLine(seed)
        self.answers: FaultyLine[Hashable] = FaultyLine(seed + 1)
        self.port: BoardPort | None = None
        self.on_command: Callable[[float, CommandFrame], None] | None = None

    def set_faults(self, latency: float, jitter: float, loss: float, corruption: float) -> None:
        """Set the line's faults: latency, jitter [s]; loss, corruption as shares."""
        self.commands.faults = LineFaults(0.0, 0.0, loss, corruption)
        self.answers.faults = LineFaults(latency, jitter, loss, corruption)

    def receive(self, patience: float, now: float) -> bool:
        """Take a frame that arrives within `patience` [s]; whether there was one."""
        received = None if self.port is None else self.port.receive(patience)
        if received is None:
            return False
        self.commands.put(received.frame, received.sender, now)
        return True

    def exchange(self, now: float) -> None:
        """Let the boards carry out what arrived by `now` [s], and send what is due."""
        for frame, sender in self.commands.take(now):
            answer = self.link.answer(frame, sender)
            if answer is not None:
                if self.on_command is not None and self.link.command is not None:
                    self.on_command(now, self.link.command)
                self.answers.put(answer, sender, now)
        for answer, sender in self.answers.take(now):
            if self.port is not None:
                self.port.send(answer, sender)

    @property
    def lost(self) -> int:
        """Frames lost on purpose."""
        return self.commands.lost + self.answers.lost

    @property
    def corrupted(self) -> int:
        """Frames corrupted on purpose."""
        return self.commands.corrupted + self.answers.corrupted
