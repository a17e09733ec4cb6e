"""A bus that delays, loses and damages frames; with explicit time and a seed."""

import random
from collections import deque
from dataclasses import dataclass
from typing import Generic, TypeVar

_MAX_UNDERWAY = 4096  # frames: 2 kHz for the longest latency and jitter; more are lost

Address = TypeVar("Address")


@dataclass(frozen=True)
class LineFaults:
    """What a frame suffers on its way.

    latency     [s] of every frame
    jitter      [s] at most this much more; a frame waits for the one before it
    loss        share of frames that are lost, 0 to 1
    corruption  share of frames with one flipped bit, 0 to 1
    """

    latency: float = 0.0
    jitter: float = 0.0
    loss: float = 0.0
    corruption: float = 0.0


class FaultyLine(Generic[Address]):
    """One direction of a bus. `faults` may change at any time, for the frames from then on."""

    def __init__(self, seed: int) -> None:
        """Start without faults."""
        self.faults = LineFaults()
        self._random = random.Random(seed)  # not for security
        self._underway: deque[tuple[float, bytes, Address]] = deque()
        self._latest = -float("inf")
        self.lost = 0
        self.corrupted = 0

    def put(self, frame: bytes, to: Address, now: float) -> None:
        """Send a frame at the time `now` [s]."""
        faults = self.faults
        if self._random.random() < faults.loss or len(self._underway) >= _MAX_UNDERWAY:
            self.lost += 1
            return
        if self._random.random() < faults.corruption:
            self.corrupted += 1
            frame = self._flip(frame)
        due = now + faults.latency + faults.jitter * self._random.random()
        self._latest = max(self._latest, due)
        self._underway.append((self._latest, frame, to))

    def _flip(self, frame: bytes) -> bytes:
        if not frame:
            return frame
        damaged = bytearray(frame)
        bit = self._random.randrange(8 * len(damaged))
        damaged[bit // 8] ^= 1 << bit % 8
        return bytes(damaged)

    def take(self, now: float) -> list[tuple[bytes, Address]]:
        """Return the frames that have arrived by `now` [s], with where they go."""
        arrived = []
        while self._underway and self._underway[0][0] <= now:
            _, frame, to = self._underway.popleft()
            arrived.append((frame, to))
        return arrived

    def due(self) -> float:
        """Return when the next frame arrives [s]; infinite if none is underway."""
        return self._underway[0][0] if self._underway else float("inf")
