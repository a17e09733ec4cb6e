"""Tension and current commands: streams, each valid until its time-out; without clock or I/O."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fastswing_planner.arrays import BoolVector, Vector
from musashi_muscle_bridge.buses.protocol import Mode

Chosen = Sequence[int] | NDArray[np.intp] | slice
"""Some of the muscles."""


class CommandStreams:
    """The newest tension [N] and current [A] of each of m muscles. Times are monotonic [s].

    running  something was commanded, and its end has not been noticed yet
    """

    def __init__(self, count: int, timeout: float) -> None:
        """Start without commands; each is valid for `timeout` [s]."""
        self.running = False
        self._timeout = timeout
        # Values, and when they were made.
        self._streams = {
            Mode.TENSION: (np.zeros(count), np.full(count, -np.inf)),
            Mode.CURRENT: (np.zeros(count), np.full(count, -np.inf)),
        }

    def take(self, mode: Mode, chosen: Chosen, values: Vector, now: float) -> None:
        """Take tensions or currents that were made at `now`, one for each chosen muscle."""
        stream, received = self._streams[mode]
        self.running = True
        stream[chosen] = values
        received[chosen] = now

    def forget(self, chosen: Chosen) -> None:
        """Forget all streams of some muscles."""
        for _, received in self._streams.values():
            received[chosen] = -np.inf

    def forget_ended(self, chosen: Chosen, now: float) -> None:
        """Forget those streams of some muscles that have ended by `now`."""
        for _, received in self._streams.values():
            ended = now - received[chosen] > self._timeout
            received[chosen] = np.where(ended, -np.inf, received[chosen])

    def write(self, now: float, mode: NDArray[np.uint8], value: Vector) -> BoolVector:
        """Write what is valid at `now` into `mode` and `value`, shape (m,); a current wins.

        Returns which muscles had a stream, even one that ends now, shape (m,).
        """
        streamed = np.zeros(mode.size, dtype=bool)
        for stream_mode, (stream, received) in self._streams.items():
            fresh = now - received <= self._timeout
            mode[fresh] = stream_mode
            value[fresh] = stream[fresh]
            streamed |= np.isfinite(received)
            received[~fresh] = -np.inf
        self.running = any(np.isfinite(end).any() for _, end in self._streams.values())
        return streamed
