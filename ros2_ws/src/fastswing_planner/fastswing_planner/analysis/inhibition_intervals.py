"""When which muscles were forced to zero current: leased overrides as intervals."""

from collections.abc import Sequence
from dataclasses import dataclass

from fastswing_planner.analysis.recording import OverrideSeries


@dataclass(frozen=True)
class InhibitionInterval:
    """From `start` to `end` [s] the same muscles were forced to zero current."""

    start: float
    end: float
    muscles: tuple[str, ...]


def inhibitions(overrides: OverrideSeries | None) -> list[InhibitionInterval]:
    """Return what was inhibited; an override ends with its lease or with the next one.

    Renewed leases of the same muscles are one interval.
    """
    if overrides is None:
        return []
    found: list[InhibitionInterval] = []
    pending: InhibitionInterval | None = None
    rows = zip(
        overrides.received.tolist(), overrides.lease.tolist(), overrides.muscles, strict=True
    )
    for begin, lease, muscles in rows:
        if pending is not None and pending.muscles == muscles and begin <= pending.end:
            pending = InhibitionInterval(pending.start, begin + lease, muscles)
            continue
        if pending is not None and pending.muscles:
            found.append(
                InhibitionInterval(pending.start, min(pending.end, begin), pending.muscles)
            )
        pending = InhibitionInterval(begin, begin + lease, muscles)
    if pending is not None and pending.muscles:
        found.append(pending)
    return found


def within(
    intervals: Sequence[InhibitionInterval], start: float, end: float
) -> tuple[InhibitionInterval, ...]:
    """Return the parts of `intervals` between two times [s]."""
    cut = (
        InhibitionInterval(max(one.start, start), min(one.end, end), one.muscles)
        for one in intervals
    )
    return tuple(one for one in cut if one.end > one.start)
