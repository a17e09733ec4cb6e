"""How regularly a loop runs; without clock or I/O."""

from typing import NamedTuple

import numpy as np

_WINDOW_SEC = 1.0


class Timing(NamedTuple):
    """One window of a loop.

    rate        [Hz] periods begun
    jitter      [s] standard deviation of the time from one begin to the next
    longest     [s] longest such time
    round_trip  [s] mean time from the command to the answer; NaN without one
    """

    rate: float
    jitter: float
    longest: float
    round_trip: float


class Schedule:
    """Absolute deadlines of a loop, one period apart. What cannot begin in time is left out.

    deadline  monotonic time [s] at which the present period was to begin
    skipped   periods so far that never began
    """

    def __init__(self, start: float, period: float) -> None:
        """Begin the first period at `start`; both [s]."""
        self.deadline = start
        self.skipped = 0
        self._period = period

    def next(self, now: float) -> float:
        """Go on to the next period; return how long to wait for it from `now`, 0 at least [s].

        It is late by less than a period: those before it are over.
        """
        self.deadline += self._period
        late = now - self.deadline
        if late > self._period:
            lost = int(late / self._period)
            self.skipped += lost
            self.deadline += lost * self._period
        return max(self.deadline - now, 0.0)


class LoopTiming:
    """Sums up windows of one second. `latest` is replaced, never changed: any thread may read it.

    late  periods so far that were longer than 1.5 times the wanted one
    """

    def __init__(self, period: float) -> None:
        """Period [s] that the loop should have."""
        self.latest = Timing(0.0, 0.0, 0.0, float("nan"))
        self.late = 0
        self._too_long = 1.5 * period
        self._began: float | None = None
        self._window_began = 0.0
        self._periods: list[float] = []
        self._round_trips: list[float] = []

    def begin(self, now: float) -> None:
        """Note that a period begins at `now` [s]."""
        if self._began is None:
            self._began = self._window_began = now
            return
        self._periods.append(now - self._began)
        self.late += now - self._began > self._too_long
        self._began = now
        if now - self._window_began >= _WINDOW_SEC:
            self._close_window()
            self._window_began = now

    def answered(self, round_trip: float) -> None:
        """Note the time [s] that an answer took."""
        self._round_trips.append(round_trip)

    def _close_window(self) -> None:
        periods = np.array(self._periods)
        trips = self._round_trips
        self.latest = Timing(
            len(periods) / float(periods.sum()),
            float(periods.std()),
            float(periods.max()),
            float(np.mean(trips)) if trips else float("nan"),
        )
        self._periods, self._round_trips = [], []
