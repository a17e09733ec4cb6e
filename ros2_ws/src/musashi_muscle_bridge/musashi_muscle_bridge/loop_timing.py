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
