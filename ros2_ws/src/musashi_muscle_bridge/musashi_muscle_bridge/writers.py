"""One writer for each muscle of a command topic; without clock or I/O.

rclpy 7.1 does not tell who sent a message, only its number, which each writer counts by itself.
Numbers that go on a little from those before are of the same writer; others are of another one.
"""

from collections.abc import Sequence

import numpy as np

from musashi_muscle_bridge.errors import CommandRejected

PATIENCE_SEC = 1.0
"""[s] of silence after which another writer may take over a muscle."""
_MAX_GAP = 64  # messages that a writer may lose in a row and still be known again
_MAX_WRITERS = 16
_UNSUPPORTED = 2**64 - 1  # where the middleware does not number messages
_NOBODY = -1


class SingleWriter:
    """Lets one writer command each muscle through one topic, for as long as it goes on."""

    def __init__(self, muscles: int) -> None:
        """Nobody commands any of `muscles` muscles."""
        self._last: dict[int, int] = {}  # number of the last message, by writer
        self._next_writer = 0
        self._owner = np.full(muscles, _NOBODY)
        self._until = np.full(muscles, -np.inf)  # [s]

    def admit(self, number: int, index: Sequence[int], writers: int, now: float) -> None:
        """Take note of a command; raises CommandRejected if another writer has its muscles.

        number   of the message, as its writer counts
        index    the muscles that it commands
        writers  how many there are on the topic now; a single one is always admitted
        now      monotonic [s]
        """
        if number == _UNSUPPORTED:
            return
        if writers <= 1:
            self._last = {}
            self._owner[:] = _NOBODY
        writer = self._recognise(number)
        chosen = np.asarray(index, dtype=int)
        taken = (self._owner[chosen] != writer) & (now < self._until[chosen])
        if np.count_nonzero(taken & (self._owner[chosen] != _NOBODY)):
            raise CommandRejected(
                "second_writer",
                f"another node commands the same muscle, {writers} publish this topic: end one",
            )
        self._owner[chosen] = writer
        self._until[chosen] = now + PATIENCE_SEC

    def _recognise(self, number: int) -> int:
        gaps = {
            number - last: writer
            for writer, last in self._last.items()
            if 0 < number - last <= _MAX_GAP
        }
        if gaps:
            writer = gaps[min(gaps)]
        else:
            writer = self._next_writer
            self._next_writer += 1
            if len(self._last) >= _MAX_WRITERS:
                del self._last[next(iter(self._last))]
        self._last[writer] = number
        return writer
