"""When which message of a bag is published again; without clock or I/O."""

import heapq
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from fastswing_planner.bags import Bag
from fastswing_planner.errors import InvalidLimit


@dataclass(frozen=True)
class Window:
    """The part of a bag that is published.

    start_ns  [ns] log time from which on
    end_ns    [ns] log time before which
    """

    start_ns: int
    end_ns: int


def window(bag: Bag, start: float, duration: float) -> Window:
    """Return the part from `start` [s] after the bag's start on, `duration` [s] long.

    Raises InvalidLimit if there is nothing.
    """
    length = (bag.end_ns - bag.start_ns) * 1e-9
    if not 0.0 <= start <= length:
        raise InvalidLimit(f"--start is {start:g} s, the bag is {length:.3f} s long")
    if not duration > 0.0:
        raise InvalidLimit(f"--duration is {duration:g} s, expected more than 0")
    begin = bag.start_ns + round(start * 1e9)
    end = bag.end_ns + 1
    if duration < length:
        end = min(end, begin + round(duration * 1e9))
    return Window(begin, end)


def messages_in_order(
    bag: Bag, topics: Sequence[str], part: Window
) -> Iterator[tuple[int, str, bytes]]:
    """Yield log time [ns], topic and CDR bytes of several topics in order of log time."""

    def one(topic: str) -> Iterator[tuple[int, str, bytes]]:
        for log_ns, _, data in bag.raw_messages(topic):
            if part.start_ns <= log_ns < part.end_ns:
                yield log_ns, topic, data

    return heapq.merge(*map(one, topics), key=lambda row: row[0])


class ReplayClock:
    """Bag time as a function of wall time, at a rate, with pauses."""

    def __init__(self, start_ns: int, rate: float) -> None:
        """Begin paused at `start_ns` [ns]; raises InvalidLimit."""
        if not 0.0 < rate < float("inf"):
            raise InvalidLimit(f"--rate is {rate:g}, expected more than 0")
        self._rate = rate
        self._bag_ns = start_ns
        self._since: float | None = None

    @property
    def paused(self) -> bool:
        """Whether bag time stands still."""
        return self._since is None

    def now_ns(self, wall: float) -> int:
        """Return the bag's time [ns] at a wall time [s]."""
        if self._since is None:
            return self._bag_ns
        return self._bag_ns + round((wall - self._since) * self._rate * 1e9)

    def wait(self, bag_ns: int, wall: float) -> float:
        """Return how long it takes from `wall` on until a bag time [s]; infinity if paused."""
        if self._since is None:
            return float("inf")
        return (bag_ns - self.now_ns(wall)) * 1e-9 / self._rate

    def pause(self, wall: float) -> None:
        """Stand still from a wall time [s] on."""
        self._bag_ns = self.now_ns(wall)
        self._since = None

    def resume(self, wall: float) -> None:
        """Run from a wall time [s] on."""
        if self._since is None:
            self._since = wall

    def jump(self, bag_ns: int, wall: float) -> None:
        """Continue at another bag time [ns]."""
        paused = self.paused
        self._bag_ns, self._since = bag_ns, None if paused else wall
