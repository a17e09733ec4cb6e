"""How long it took from a joint state to its override, and from there to zero current."""

from dataclasses import dataclass

import numpy as np

from fastswing_planner.analysis.recording import ZERO_CURRENT, MuscleSeries, OverrideSeries
from fastswing_planner.arrays import Vector, frozen

_EARLIER_SEC = 0.05
"""The recorder may hear of an override this much later than the bridge."""
_OLDEST_STATE_SEC = 1.0
"""An override is not decided on an older joint state, unless a clock jumped."""


@dataclass(frozen=True)
class Latency:
    """Durations of one kind; how long the longest took is unknown if any was not measured.

    values   [s] shape (k,)
    unusable measured on a clock that jumped: negative
    missing  never happened
    """

    values: Vector
    unusable: int = 0
    missing: int = 0

    @property
    def complete(self) -> bool:
        """Whether there are values, and none is missing or unusable."""
        return bool(self.values.size) and not self.missing and not self.unusable

    @property
    def median(self) -> float:
        """[s] of those measured; NaN without values."""
        return float(np.median(self.values)) if self.values.size else np.nan

    @property
    def p99(self) -> float:
        """[s] 99% are not longer; NaN unless complete."""
        return float(np.quantile(self.values, 0.99)) if self.complete else np.nan

    @property
    def longest(self) -> float:
        """[s] NaN unless complete."""
        return float(self.values.max()) if self.complete else np.nan


@dataclass(frozen=True)
class InhibitionLatency:
    """The three latencies of Method 1.

    state_to_override  from the stamp of a joint state to its override's arrival at the recorder
    override_to_zero   from there to the first muscle state that shows zero current; 0 if the boards
                       were faster than the recorder
    state_to_zero      from the stamp of the joint state to that of this muscle state; the recorder
                       has no part in it

    The last two are known to one period of the muscle states.
    """

    state_to_override: Latency
    override_to_zero: Latency
    state_to_zero: Latency


def inhibition_latency(
    overrides: OverrideSeries | None, muscles: MuscleSeries | None, start: float, end: float
) -> InhibitionLatency:
    """Measure the overrides that were received from `start` to `end` [s]."""
    if overrides is None:
        nothing = Latency(frozen([]))
        return InhibitionLatency(nothing, nothing, nothing)
    chosen = np.flatnonzero((overrides.received >= start) & (overrides.received <= end))
    named = [int(index) for index in chosen if overrides.muscles[index]]
    delay = overrides.received[named] - overrides.stamp[named]
    to_override = Latency(frozen(delay[delay >= 0.0]), int(np.count_nonzero(~(delay >= 0.0))))
    if muscles is None:
        nothing = Latency(frozen([]))
        return InhibitionLatency(to_override, nothing, nothing)
    from_override: list[float] = []
    from_state: list[float] = []
    missing = 0
    for row, muscle in _engagements(overrides, chosen.tolist()):
        received, stamp = float(overrides.received[row]), float(overrides.stamp[row])
        until = received + max(float(overrides.lease[row]), _EARLIER_SEC)
        zero = _zero_time(muscles, muscle, stamp, received, until)
        if zero is None:
            missing += 1
            continue
        from_override.append(max(zero - received, 0.0))
        from_state.append(zero - stamp)
    total = np.array(from_state)
    return InhibitionLatency(
        to_override,
        Latency(frozen(from_override), missing=missing),
        Latency(frozen(total[total >= 0.0]), int(np.count_nonzero(total < 0.0)), missing),
    )


def _engagements(overrides: OverrideSeries, chosen: list[int]) -> list[tuple[int, str]]:
    """Return (row, muscle) where a muscle is named that was not under a lease before."""
    found: list[tuple[int, str]] = []
    until: dict[str, float] = {}
    for row in chosen:
        received = float(overrides.received[row])
        named = overrides.muscles[row]
        found += [(row, name) for name in named if until.get(name, -np.inf) < received]
        # An override replaces the one before: muscles it does not name are free again.
        until = dict.fromkeys(named, received + float(overrides.lease[row]))
    return found


def _zero_time(
    muscles: MuscleSeries, muscle: str, stamp: float, received: float, until: float
) -> float | None:
    """Return when the muscle first was at zero current [s]; None if it never was, or is unknown."""
    if muscle not in muscles.names:
        return None
    plausible = 0.0 <= received - stamp <= _OLDEST_STATE_SEC
    begin = stamp if plausible else received - _EARLIER_SEC
    in_time = (muscles.time >= begin) & (muscles.time <= until)
    rows = np.flatnonzero(in_time & (muscles.mode[:, muscles.names.index(muscle)] == ZERO_CURRENT))
    return float(muscles.time[rows[0]]) if rows.size else None
