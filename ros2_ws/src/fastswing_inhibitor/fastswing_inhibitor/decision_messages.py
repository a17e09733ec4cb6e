"""Decisions of the inhibitor to messages.

At rate they are serialised templates: one override and one status for each set of inhibited
muscles.
"""

from collections.abc import Sequence
from itertools import compress
from typing import Any, NamedTuple

from builtin_interfaces.msg import Duration, Time
from std_msgs.msg import Header

from fastswing_inhibitor.inhibition import Decision, Inhibition
from fastswing_inhibitor.latency_histogram import LatencyHistogram
from fastswing_msgs.msg import CurrentOverride, InhibitionStatus
from fastswing_planner.conversion.message_template import MessageTemplate
from fastswing_planner.conversion.number_places import STAMP

KEPT_TEMPLATES = 64
"""Sets of inhibited muscles; a swing has a few."""
_STATUS_NUMBERS = (
    *STAMP,
    "threshold",
    "speed_index",
    "direction_from_goal",
    "decisions",
    "rejected",
    "latency_count",
    "latency_max",
)


class DecisionMessages:
    """Makes ordinary messages."""

    def __init__(
        self,
        muscle_names: Sequence[str],
        lease: Duration,
        inhibition: Inhibition,
        latency: LatencyHistogram,
    ) -> None:
        """Report on `inhibition` and `latency` as they are when a message is made."""
        self._muscle_names = list(muscle_names)
        self._lease = lease
        self._inhibition = inhibition
        self._latency = latency
        self._latency_bound = list(latency.bounds)

    def override(self, header: Any, decision: Decision) -> CurrentOverride:
        """Return the override of a decision.

        header  of the joint state that was decided on, or what has its attributes
        """
        return CurrentOverride(
            header=_ordinary(header), name=self._inhibited(decision), lease=self._lease
        )

    def status(self, header: Any, decision: Decision, reason_text: str = "") -> InhibitionStatus:
        """Return the status that tells of a decision; see `override`."""
        inhibition, latency = self._inhibition, self._latency
        return InhibitionStatus(
            header=_ordinary(header),
            armed=inhibition.armed,
            reason=int(decision.reason),
            reason_text=reason_text,
            threshold=inhibition.threshold,
            name=self._muscle_names,
            speed_index=list(inhibition.speed_index(decision)),
            inhibited=self._inhibited(decision),
            direction_from_goal=decision.direction_from_goal,
            decisions=inhibition.decisions,
            rejected=inhibition.rejected,
            latency_bound=self._latency_bound,
            latency_count=latency.counts,
            latency_max=latency.longest,
        )

    def _inhibited(self, decision: Decision) -> list[str]:
        return list(compress(self._muscle_names, decision.inhibited))


_Key = tuple[str, tuple[bool, ...]]  # frame and inhibited muscles


class _Templates(NamedTuple):
    override: MessageTemplate
    status: MessageTemplate


class RawDecisionMessages:
    """Makes the same messages serialised, of decisions while the inhibitor is armed.

    Except for the first override of a set of muscles, which is an ordinary message.
    """

    def __init__(
        self, ordinary: DecisionMessages, inhibition: Inhibition, latency: LatencyHistogram
    ) -> None:
        """Serialise what `ordinary` makes."""
        self._ordinary = ordinary
        self._inhibition = inhibition
        self._latency = latency
        self._kept: dict[_Key, _Templates] = {}
        self._last_key: _Key = "", ()
        self._last: _Templates | None = None

    def override(self, header: Any, decision: Decision) -> CurrentOverride | bytes:
        """Return the override of a decision; see `DecisionMessages`."""
        kept = self._found((header.frame_id, decision.inhibited))
        if kept is None:
            # Templates take longer to make than the message: `status` makes them, which can wait.
            return self._ordinary.override(header, decision)
        return kept.override.filled(header.stamp.sec, header.stamp.nanosec)

    def status(self, header: Any, decision: Decision) -> bytes:
        """Return the status that tells of a decision; see `DecisionMessages`."""
        inhibition, latency = self._inhibition, self._latency
        return self._templates(header, decision).status.filled(
            header.stamp.sec,
            header.stamp.nanosec,
            inhibition.threshold,
            inhibition.speed_index(decision),
            decision.direction_from_goal,
            inhibition.decisions,
            inhibition.rejected,
            latency.counts,
            latency.longest,
        )

    def _found(self, key: _Key) -> _Templates | None:
        # Most decisions are the last one again; to compare keys costs half of looking one up.
        if key != self._last_key or self._last is None:
            self._last_key, self._last = key, self._kept.get(key)
        return self._last

    def _templates(self, header: Any, decision: Decision) -> _Templates:
        key = header.frame_id, decision.inhibited
        kept = self._found(key)
        if kept is None:
            if len(self._kept) == KEPT_TEMPLATES:
                del self._kept[next(iter(self._kept))]
            kept = self._kept[key] = _Templates(
                MessageTemplate(self._ordinary.override(header, decision), STAMP),
                MessageTemplate(self._ordinary.status(header, decision), _STATUS_NUMBERS),
            )
        return kept


def _ordinary(header: Any) -> Header:
    if isinstance(header, Header):
        return header
    stamp = Time(sec=header.stamp.sec, nanosec=header.stamp.nanosec)
    return Header(stamp=stamp, frame_id=header.frame_id)
