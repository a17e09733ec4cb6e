"""A replay in words."""

from collections.abc import Iterator

import numpy as np

from fastswing_inhibitor.inhibition import Reason
from fastswing_inhibitor.replay.result import Replay, ReplayedSwing

_MOST_LINES = 3


def replay_text(found: Replay, bag_start_ns: int, what_if: str = "") -> str:
    """Return what was replayed, times [s] from the bag's start.

    what_if  what was changed; empty: nothing, so that a difference is an error
    """
    lines = [f"what if: {what_if}"] if what_if else []
    if not found.swings:
        lines.append("the inhibitor was never armed in this bag")
    for number, swing in enumerate(found.swings, 1):
        lines += _swing_lines(number, swing, found.muscle_names, bag_start_ns, bool(what_if))
    lines += found.override_differences[:_MOST_LINES]
    if len(found.override_differences) > _MOST_LINES:
        lines.append(f"and {len(found.override_differences) - _MOST_LINES} more overrides")
    return "\n".join(lines)


def _swing_lines(
    number: int,
    swing: ReplayedSwing,
    muscle_names: tuple[str, ...],
    bag_start_ns: int,
    what_if: bool,
) -> Iterator[str]:
    start = (swing.start_ns - bag_start_ns) * 1e-9
    title = f"swing {number} at {start:.3f} s, C {swing.threshold:g} s/rad"
    if swing.complaint:
        yield f"{title}: not replayed, {swing.complaint}"
        return
    same = "as published" if what_if else "as published, q bit for bit"
    yield f"{title}: {len(swing.decisions)} decisions, {swing.agreed} {same}"
    end = "the bag ends before it" if swing.end is None else swing.end.name
    protected = f", never inhibited: {', '.join(swing.protected)}" if swing.protected else ""
    yield f"  end {end}, {swing.rejected} joint states rejected{protected}"
    yield from (f"  {line}" for line in swing.missing[:_MOST_LINES])
    if len(swing.missing) > _MOST_LINES:
        yield f"  and {len(swing.missing) - _MOST_LINES} more gaps"
    first = swing.first_difference
    if first is not None:
        time = (first.stamp_ns - bag_start_ns) * 1e-9
        yield f"  first difference at {time:.3f} s: {first.difference}"
    yield from _muscle_lines(swing, muscle_names)


def _muscle_lines(swing: ReplayedSwing, muscle_names: tuple[str, ...]) -> Iterator[str]:
    both = [
        (one.published.inhibited, one.replayed.inhibited)
        for one in swing.decisions
        if one.replayed is not None and one.published.reason is Reason.NONE
    ]
    if not both:
        return
    published, replayed = np.array(both).sum(axis=0)
    for name, was, would in zip(muscle_names, published, replayed, strict=True):
        if was or would:
            yield f"  {name}: inhibited in {was} decisions as published, {would} replayed"
