"""Finds the swings of a recording: when the inhibitor was armed, and when joints were fast."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np

from fastswing_planner.analysis.recording import Burst, CommandSeries, StatusSeries
from fastswing_planner.arrays import Matrix, Vector
from fastswing_planner.errors import InvalidLimit

_COMMAND_BEFORE_SEC = 0.5
"""An arm follows its swing's command within this time."""
_LEAST_STEP = 1e-3
"""[m] smaller steps of a length command start no swing."""

STAMP_JITTER_SEC = 0.01
"""Stamps taken on a busy machine may run backwards by so much; farther, a clock jumped."""
_HOLE_SHARE = 0.5
"""Share of the rest time; in a longer pause of joint states nobody knows whether the arm rested."""


@dataclass(frozen=True)
class FindingSettings:
    """What counts as a swing; all positive.

    swing_speed  [rad/s] some joint is faster at least once; above the executor's raise_speed
    rest_speed   [rad/s] the arm rests while no joint is faster; as the executor's
    rest_time    [s] for which it must rest between two swings; as the executor's
    longest_gap  [s] after a longer one between joint states nothing is known of the arm
    """

    swing_speed: float = 1.0
    rest_speed: float = 0.15
    rest_time: float = 0.2
    longest_gap: float = 0.5

    def __post_init__(self) -> None:
        """Raise InvalidLimit for values that make no sense together."""
        for name, value in asdict(self).items():
            if not 0.0 < value < np.inf:
                raise InvalidLimit(f"{name} is {value:g}, expected a positive number")
        if self.swing_speed <= self.rest_speed:
            raise InvalidLimit(
                f"swing_speed is {self.swing_speed:g} rad/s, must be above rest_speed, "
                f"{self.rest_speed:g} rad/s"
            )


@dataclass(frozen=True)
class Interval:
    """From `start` to `end`, both [s]."""

    start: float
    end: float


def segments(time: Vector, longest_gap: float) -> list[tuple[int, int]]:
    """Split times [s], shape (k,), where they jump back or stop for longer than `longest_gap`.

    Returns (first, last) of each piece, both included; together they are all of `time`.
    """
    if time.size == 0:
        return []
    step = np.diff(time)
    edges = np.flatnonzero(~((step >= -STAMP_JITTER_SEC) & (step <= longest_gap)))
    firsts = [0, *(edges + 1).tolist()]
    lasts = [*edges.tolist(), time.size - 1]
    return list(zip(firsts, lasts, strict=True))


def armed_intervals(status: StatusSeries | None) -> list[Interval]:
    """Return when the inhibitor was armed; it was until the message that says it is not."""
    if status is None or status.time.size == 0:
        return []
    found: list[Interval] = []
    begin: float | None = None
    for time, armed in zip(status.time.tolist(), status.armed.tolist(), strict=True):
        if armed and begin is None:
            begin = time
        elif not armed and begin is not None:
            found.append(Interval(begin, time))
            begin = None
    if begin is not None:
        found.append(Interval(begin, float(status.time[-1])))
    return found


def find_bursts(
    time: Vector, speed: Vector, armed: Sequence[Interval], settings: FindingSettings
) -> list[Burst]:
    """Return the fast motions, in the order of the recording.

    time   [s] of the joint states, shape (k,)
    speed  [rad/s] of the fastest joint, shape (k,); NaN: as if that joint state were missing
    armed  when the inhibitor was armed: any motion then is a swing, however slow
    """
    known = np.flatnonzero(~np.isnan(speed))
    time, speed = time[known], speed[known]
    found: list[Burst] = []
    for first, last in segments(time, settings.longest_gap):
        for burst in _motions(time, speed, first, last, settings):
            meanwhile = any(
                interval.start <= time[burst.last] and time[burst.first] <= interval.end
                for interval in armed
            )
            if meanwhile or speed[burst.fastest] > settings.swing_speed:
                found.append(replace(burst, armed=meanwhile))
    return [
        replace(
            burst,
            first=int(known[burst.first]),
            last=int(known[burst.last]),
            fastest=int(known[burst.fastest]),
        )
        for burst in found
    ]


def _motions(
    time: Vector, speed: Vector, first: int, last: int, settings: FindingSettings
) -> list[Burst]:
    """Return every motion in one piece of the recording.

    A rest is seen: pauses of joint states do not count, and one beside a motion belongs to it.
    """
    moving = np.flatnonzero(speed[first : last + 1] > settings.rest_speed)
    if moving.size == 0:
        return []
    step = np.diff(time[first : last + 1])
    holes = np.where(step > _HOLE_SHARE * settings.rest_time, step, 0.0)
    # A clock [s] that stands still in holes.
    seen = np.concatenate([[0.0], np.cumsum(step - holes)])
    rests = np.flatnonzero(np.diff(seen[moving]) >= settings.rest_time)
    begins = moving[np.concatenate([[0], rests + 1])].tolist()
    ends = moving[np.concatenate([rests, [moving.size - 1]])].tolist()
    found = []
    for begin, end in zip(begins, ends, strict=True):
        burst_first = begin - 1 if begin > 0 and holes[begin - 1] else begin
        burst_last = end + 1 if end < step.size and holes[end] else end
        fastest = begin + int(np.argmax(speed[first + begin : first + end + 1]))
        found.append(
            Burst(
                first + burst_first,
                first + burst_last,
                first + fastest,
                begins_cut=begin == 0,
                ends_cut=bool(seen[-1] - seen[end] < settings.rest_time),
                hole=float(holes[burst_first:burst_last].max(initial=0.0)),
            )
        )
    return found


def swing_command(
    commands: CommandSeries | None, begin: float, fastest: float, after: float = -np.inf
) -> float | None:
    """Return when the swing's length command was made [s]; None if there was none.

    begin, fastest  [s] when the motion began and when it was fastest
    after           [s] when the swing before was commanded: a command begins one swing

    On the way to the start posture lengths change a little with each of many commands; the swing is
    one command that asks for the end posture at once (section IV-B of the paper). So it is the
    largest step of any muscle.
    """
    if commands is None:
        return None
    in_time = (commands.time >= begin - _COMMAND_BEFORE_SEC) & (commands.time <= fastest)
    rows = np.flatnonzero(in_time & (commands.time > after) & (commands.step > _LEAST_STEP))
    return float(commands.time[rows[np.argmax(commands.step[rows])]]) if rows.size else None


def moved_towards(start: Vector, end: Vector, begin: Vector, finish: Vector) -> float:
    """Return how far a motion went along a plan: 0 not at all, 1 all of it, negative backwards.

    start, end     [rad] of the plan, shape (n,)
    begin, finish  [rad] of the motion, shape (n,)
    """
    way = end - start
    length = float(way @ way)
    return float((finish - begin) @ way) / length if length > 0.0 else 0.0


def fastest_joint_speed(velocity: Matrix) -> Vector:
    """Return the largest magnitude of each row [rad/s], shape (k,); NaN where all are NaN.

    velocity  [rad/s] shape (k, n)
    """
    if velocity.shape[1] == 0:
        return np.full(velocity.shape[0], np.nan)
    known = ~np.isnan(velocity)
    largest = np.max(np.abs(velocity), axis=1, where=known, initial=0.0)
    return np.where(known.any(axis=1), largest, np.nan)
