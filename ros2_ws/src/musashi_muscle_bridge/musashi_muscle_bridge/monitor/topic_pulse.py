"""How often a topic is published, and how old its newest message is."""

import math
from collections import deque

_WINDOW_SEC = 2.0


class TopicPulse:
    """Is told of some of a topic's messages, and knows the rate of all.

    received  monotonic time [s] of the last one's arrival; -inf: none yet
    """

    def __init__(self) -> None:
        self.received = -math.inf
        self._marks: deque[tuple[float, int]] = deque()

    def heard(self, sequence: int, received: float) -> None:
        """Take note of a message.

        sequence  the publisher's count of its messages; 0: unknown
        received  monotonic time [s]
        """
        self.received = received
        if self._marks and sequence == self._marks[-1][1]:
            return  # the same message, looked at again
        if self._marks and sequence < self._marks[-1][1]:
            self._marks.clear()  # another publisher, or the same one started again
        if sequence:
            self._marks.append((received, sequence))
        while self._marks and received - self._marks[0][0] > _WINDOW_SEC:
            self._marks.popleft()

    def age(self, now: float) -> float:
        """Return how long ago the last message arrived [s]; infinity: there was none."""
        return now - self.received

    def rate(self, now: float) -> float:
        """Return messages per second over the last 2 s; 0 when silent, NaN if it is not known."""
        if self.age(now) > _WINDOW_SEC:
            return 0.0
        if len(self._marks) < 2 or self._marks[-1][0] <= self._marks[0][0]:
            return math.nan
        (begin, first), (end, last) = self._marks[0], self._marks[-1]
        return (last - first) / (end - begin)
