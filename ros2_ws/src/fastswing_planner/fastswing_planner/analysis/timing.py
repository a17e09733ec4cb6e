"""How regularly a topic's messages came: rate, gaps, losses, clocks that jump."""

from dataclasses import dataclass

import numpy as np

from fastswing_planner.analysis.finding import STAMP_JITTER_SEC
from fastswing_planner.analysis.recording import TopicTimes
from fastswing_planner.arrays import Vector

GAP_PERIODS = 3.0
"""A longer pause of a steady topic, in periods, is a gap."""
_LEAST_COUNT = 10
"""Of fewer messages nobody can tell the period."""
_RESTARTED = 2**20
"""A publisher's count that leaps by so much began anew."""
_MOST_RESTARTS = 3
"""Numbers that fall more often come from several publishers at once."""


@dataclass(frozen=True)
class Gap:
    """A pause: it began at `start` [s] and lasted `length` [s]."""

    start: float
    length: float


@dataclass(frozen=True)
class TopicTiming:
    """What the times of one topic tell.

    rate         [Hz] mean from the first to the last message; NaN for fewer than two
    period       [s] median; NaN for fewer than two messages
    steady       its messages come in a fixed period, and there are enough to tell it: pauses mean
                 something
    longest      [s] longest pause; NaN for fewer than two messages
    gaps         pauses of a steady topic that were longer than GAP_PERIODS periods, longest first
    missing      messages that a steady topic lacks in its gaps, by its stamps if it has any
    dropped      messages missing in the publisher's own count; None: it was not recorded, or
                 several publishers counted
    jumps        how often its clock jumped back, by more than STAMP_JITTER_SEC
    """

    name: str
    type_name: str
    count: int
    rate: float
    period: float
    steady: bool
    longest: float
    gaps: tuple[Gap, ...]
    missing: int
    dropped: int | None
    jumps: int


def topic_timing(topic: TopicTimes) -> TopicTiming:
    """Judge the times of a topic."""
    time = topic.received if topic.stamp is None else topic.stamp
    step = np.diff(time)
    forward = step[step >= 0.0]
    known = time.size >= 2 and forward.size > 0
    period = float(np.median(forward)) if known else np.nan
    covered = float(forward.sum()) if known else 0.0
    steady = topic.steady and time.size >= _LEAST_COUNT and period > 0.0
    gaps = _gaps(time, step, period) if steady else ()
    return TopicTiming(
        name=topic.name,
        type_name=topic.type_name,
        count=int(time.size),
        rate=forward.size / covered if covered > 0.0 else np.nan,
        period=period,
        steady=steady,
        longest=float(forward.max()) if known else np.nan,
        gaps=gaps,
        missing=sum(max(round(gap.length / period) - 1, 0) for gap in gaps),
        dropped=_dropped(topic),
        jumps=int(np.count_nonzero(step < -STAMP_JITTER_SEC)),
    )


def _gaps(
    time: Vector,
    step: Vector,
    period: float,
) -> tuple[Gap, ...]:
    rows = np.flatnonzero(step > GAP_PERIODS * period)
    found = [Gap(float(time[row]), float(step[row])) for row in rows]
    return tuple(sorted(found, key=lambda gap: -gap.length))


def _dropped(topic: TopicTimes) -> int | None:
    """Count what is missing in the publisher's numbers; None if several publishers mix theirs."""
    if topic.sequence is None or topic.sequence.size == 0 or not topic.sequence.any():
        return None
    leaps = np.diff(topic.sequence.astype(np.int64)) - 1
    # Numbers that fall are a publisher that began anew; that does not happen often.
    if np.count_nonzero(leaps < 0) > _MOST_RESTARTS:
        return None
    return int(leaps[(leaps > 0) & (leaps < _RESTARTED)].sum())
