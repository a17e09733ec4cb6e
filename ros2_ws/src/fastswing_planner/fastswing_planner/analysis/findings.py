"""All that was found in a bag."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from fastswing_planner.analysis.finding import (
    FindingSettings,
    armed_intervals,
    segments,
)
from fastswing_planner.analysis.measured_swing import MeasuredSwing
from fastswing_planner.analysis.measuring import measure_swings
from fastswing_planner.analysis.recording import Recording
from fastswing_planner.analysis.timing import TopicTiming, topic_timing

_MOST_JUMPS = 5
"""Of more places where a clock jumped only the number is told."""


@dataclass(frozen=True)
class BagFindings:
    """What one bag shows.

    source    its name
    began_ns  when it began, since 1970; 0: unknown
    swings    in the order of their arms and of time
    topics    the timing of its topics
    counters  increase of counted rejections and losses: node -> name -> count
    lines     what a reader has to know, such as that there is no swing, a line each
    joints    the names of its joints
    muscles   the names of its muscles
    """

    source: str
    began_ns: int
    swings: tuple[MeasuredSwing, ...]
    topics: tuple[TopicTiming, ...]
    counters: Mapping[str, Mapping[str, int]]
    lines: tuple[str, ...]
    joints: tuple[str, ...] = ()
    muscles: tuple[str, ...] = ()


def examine(
    source: str,
    recordings: Sequence[Recording],
    settings: FindingSettings,
    tolerance: float = 0.1,
    lines: Sequence[str] = (),
) -> BagFindings:
    """Find and measure the swings of each arm in a bag.

    tolerance  [rad] norm of the distance to the end posture that counts as arrived
    lines      what is known of the bag already
    """
    swings: list[MeasuredSwing] = []
    told = list(lines)
    for recording in recordings:
        found = measure_swings(recording, tolerance)
        swings += found
        told += [*recording.warnings, *_remarks(recording, found, settings)]
    topics = tuple(topic_timing(one) for recording in recordings for one in recording.topics)
    counters: dict[str, Mapping[str, int]] = {}
    for recording in recordings:
        counters |= recording.counters or {}
    began = min((one.began_ns for one in recordings), default=0)
    muscles = [one.muscles for one in recordings if one.muscles is not None]
    return BagFindings(
        source=source,
        began_ns=began,
        swings=tuple(swings),
        topics=topics,
        counters=counters,
        lines=tuple(dict.fromkeys(told)),
        joints=tuple(dict.fromkeys(name for one in recordings for name in one.joints.names)),
        muscles=tuple(dict.fromkeys(name for one in muscles for name in one.names)),
    )


def _remarks(
    recording: Recording, swings: Sequence[MeasuredSwing], settings: FindingSettings
) -> list[str]:
    """Return why there is no swing, and where the clock jumped."""
    time, speed = recording.speed.time, recording.speed.speed
    space = f"{recording.namespace}: " if recording.namespace else ""
    lines = []
    pieces = segments(time, settings.longest_gap)
    for (_, last), (first, _) in pairwise(pieces):
        step = float(time[first] - time[last])
        what = "the clock jumped back" if step < 0.0 else "no joint state came"
        lines.append(
            f"{space}{what} for {abs(step):.2f} s at {time[last]:.2f} s; no swing is read across it"
        )
    if len(lines) > _MOST_JUMPS:
        more = len(lines) - _MOST_JUMPS
        lines = [*lines[:_MOST_JUMPS], f"{space}and {more} more such places"]
    if swings:
        return lines
    if not np.isfinite(speed).any():
        lines.append(f"{space}no swing: the joint states hold no velocity")
        return lines
    armed = len(armed_intervals(recording.status))
    told = f"; the inhibitor was armed {armed} times" if armed else ""
    lines.append(
        f"{space}no swing: the fastest joint, {recording.speed.fastest}, reached "
        f"{np.nanmax(speed):.2f} rad/s, a swing "
        f"exceeds {settings.swing_speed:g} rad/s (--swing-speed){told}"
    )
    return lines
