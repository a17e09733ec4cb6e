"""Frames over an open serial port or pseudo-terminal, COBS-framed, without waiting queues."""

import os
import select
import termios
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress

from musashi_muscle_bridge.buses import cobs
from musashi_muscle_bridge.buses.bus import MAX_FRAME

_MAX_WAITING = 64  # frames; older ones give way
_READ_SIZE = 65536
_WRITE_SEC = 0.01  # a port that takes no more bytes loses the frame after this


class SerialLine:
    """One open port; every method raises OSError when it is unplugged.

    dropped  by reason: garbled, overlong (no frames), unread (nobody took them in time), unsent
    """

    def __init__(self, descriptor: int, close: Callable[[], None]) -> None:
        """Use a non-blocking descriptor; `close` releases it."""
        self._descriptor = descriptor
        self._close = close
        self._reader = cobs.FrameReader(MAX_FRAME)
        self._waiting: deque[bytes] = deque(maxlen=_MAX_WAITING)
        self.dropped = self._reader.dropped
        self.dropped |= {"unread": 0, "unsent": 0}

    def receive(self, timeout: float) -> bytes | None:
        """Return the next frame, or None after `timeout` [s]."""
        deadline = time.monotonic() + timeout
        while not self._waiting:
            left = max(deadline - time.monotonic(), 0.0)
            if not select.select([self._descriptor], [], [], left)[0]:
                return None
            self._read()
            if not self._waiting and time.monotonic() > deadline:
                return None
        return self._waiting.popleft()

    def _read(self) -> None:
        try:
            received = os.read(self._descriptor, _READ_SIZE)
        except BlockingIOError:
            return
        if not received:
            raise OSError("the port was unplugged")
        frames = self._reader.feed(received)
        room = _MAX_WAITING - len(self._waiting)
        self.dropped["unread"] += max(len(frames) - room, 0)
        self._waiting.extend(frames)

    def send(self, frame: bytes) -> None:
        """Send a frame, or lose it if the port takes no more bytes."""
        # The first delimiter ends whatever an interrupted frame left.
        waiting = cobs.DELIMITER + cobs.encode(frame) + cobs.DELIMITER
        deadline = time.monotonic() + _WRITE_SEC
        while waiting:
            left = max(deadline - time.monotonic(), 0.0)
            if not select.select([], [self._descriptor], [], left)[1]:
                self._give_up()
                return
            with suppress(BlockingIOError):
                waiting = waiting[os.write(self._descriptor, waiting) :]

    def _give_up(self) -> None:
        self.dropped["unsent"] += 1
        with suppress(termios.error):
            # The next frame must not wait behind this one.
            termios.tcflush(self._descriptor, termios.TCOFLUSH)

    def close(self) -> None:
        """Release the port."""
        self._close()
