"""What the terminal dashboard knows: fed with messages and times, asked for what is true now.

Messages are taken as they are, by their fields; times are monotonic [s].
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from fastswing_planner.cdr.stamps import to_seconds
from fastswing_planner.execution.settings import Phase
from musashi_muscle_bridge.buses.protocol import Fault, Mode
from musashi_muscle_bridge.monitor.topic_pulse import TopicPulse

STATE, JOINTS, OVERRIDE = "muscle_state", "joint_states", "current_override"
INHIBITION, FEEDBACK = "inhibition_status", "execute_swing/_action/feedback"
TOPICS = (STATE, JOINTS, OVERRIDE, INHIBITION, FEEDBACK)

LEVELS = ("ok", "WARN", "ERROR", "STALE")
"""Of a DiagnosticStatus, by its number."""
_SILENT_SEC = 3.0  # nodes report in /diagnostics once a second
_ARRAYS = ("length", "tension", "current", "temperature", "mode", "fault")


@dataclass(frozen=True)
class MuscleRow:
    """One muscle as last measured.

    length         [m]
    tension        [N]
    tension_limit  [N] NaN if the robot's description does not know the muscle
    current        [A]
    temperature    [degC] NaN if unmeasured
    inhibited      whether an override forces it to zero current now
    fault          empty: none
    """

    name: str
    length: float
    tension: float
    tension_limit: float
    current: float
    temperature: float
    mode: str
    inhibited: bool
    fault: str


@dataclass(frozen=True)
class NodeReport:
    """What a node said of itself in /diagnostics.

    level  index in LEVELS
    """

    name: str
    level: int
    text: str
    values: Mapping[str, str]
    received: float


class Dashboard:
    """The newest of everything, and how old it is.

    namespace   without slashes at its ends
    pulses      of each topic of TOPICS
    publishers  of each topic that is published now; counted by whoever feeds this
    rejected    why the last muscle state cannot be shown; empty: it can
    """

    def __init__(
        self,
        namespace: str,
        tension_limit: Mapping[str, float],
        stale_after: float,
    ) -> None:
        """Know nothing yet.

        tension_limit  [N] by muscle
        stale_after    [s]
        """
        self.namespace = namespace
        self.pulses = {topic: TopicPulse() for topic in TOPICS}
        self.publishers: dict[str, int] = {}
        self.rejected = ""
        self._newest: dict[str, Any] = {}
        self._reports: dict[str, NodeReport] = {}
        self._tension_limit = tension_limit
        self._stale_after = stale_after

    # What comes in.

    def heard(self, topic: str, message: Any, received: float, sequence: int) -> None:
        """Take a message of one of TOPICS."""
        self.pulses[topic].heard(sequence, received)
        if topic == STATE:
            self.rejected = _wrong(message)
            if self.rejected:
                return
        self._newest[topic] = message

    def diagnosed(self, statuses: Sequence[Any], received: float) -> None:
        """Take what nodes of this namespace say in /diagnostics."""
        for status in statuses:
            namespace, _, name = status.name.rpartition("/")
            if namespace == self.namespace:
                level = min(status.level[0], len(LEVELS) - 1)
                values = {value.key: value.value for value in status.values}
                self._reports[name] = NodeReport(name, level, status.message, values, received)

    # What is true now.

    def stale(self, now: float) -> bool:
        """Whether the muscles' last state is too old to be called the present one."""
        return bool(self.rejected) or self.pulses[STATE].age(now) > self._stale_after

    def muscles(self, now: float) -> list[MuscleRow]:
        """Return the muscles as last measured; see `stale`."""
        message = self._newest.get(STATE)
        if message is None:
            return []
        overridden = self.overridden(now)
        columns = [message.name, *(getattr(message, name) for name in _ARRAYS)]
        return [
            MuscleRow(
                name,
                length,
                tension,
                self._tension_limit.get(name, math.nan),
                current,
                temperature,
                _named(Mode, mode),
                name in overridden,
                "" if fault == Fault.NONE else _named(Fault, fault),
            )
            for name, length, tension, current, temperature, mode, fault in zip(
                *columns, strict=True
            )
        ]

    def overridden(self, now: float) -> frozenset[str]:
        """Return the muscles named in an override whose lease has not ended."""
        override = self._newest.get(OVERRIDE)
        if override is None:
            return frozenset()
        lease = to_seconds(override.lease.sec, override.lease.nanosec)
        return frozenset(override.name if self.pulses[OVERRIDE].age(now) <= lease else ())

    def emergency(self, now: float) -> bool:
        """Whether the bridge says that the emergency stop is latched."""
        bridge = self.report("bridge", now)
        return bridge is not None and bridge.values.get("emergency_stop") == "True"

    def report(self, node: str, now: float) -> NodeReport | None:
        """Return a node's last report, unless it is too old."""
        report = self._reports.get(node)
        return report if report and now - report.received <= _SILENT_SEC else None

    def reports(self, now: float) -> list[NodeReport]:
        """Return all nodes' reports, the worst first; a node that fell silent is an error."""
        reports = [
            report
            if now - report.received <= _SILENT_SEC
            else NodeReport(
                report.name, 2, f"silent for {now - report.received:.0f} s", {}, report.received
            )
            for report in self._reports.values()
        ]
        return sorted(reports, key=lambda report: (-report.level, report.name))

    def executor(self, now: float) -> str:
        """Return the swing executor's phase."""
        feedback = self._newest.get(FEEDBACK)
        if feedback is not None and self.pulses[FEEDBACK].age(now) <= self._stale_after:
            way = feedback.feedback.distance_to_end
            phase = _named(Phase, feedback.feedback.phase)
            return phase if math.isnan(way) else f"{phase}, {way:.2f} rad to go"
        report = self.report("swing_executor", now)
        return "not heard" if report is None else report.values.get("phase", "inactive")

    def inhibitor(self, now: float) -> str:
        """Return whether the inhibitor is armed, and why not any more."""
        status, report = self._newest.get(INHIBITION), self.report("inhibitor", now)
        age = self.pulses[INHIBITION].age(now)
        if status is not None and status.armed and age > self._stale_after:
            return f"was armed, silent for {age:.1f} s"
        if status is not None and status.armed:
            return f"ARMED, inhibits {' '.join(status.inhibited) or 'none'}"
        if report is None:
            return "not heard"
        if status is not None:
            return f"not armed: {status.reason_text}"
        return "armed" if report.values.get("armed") == "True" else "not armed"


def _wrong(message: Any) -> str:
    count = len(message.name)
    for name in _ARRAYS:
        if len(getattr(message, name)) != count:
            return f"{STATE}: {name} has {len(getattr(message, name))} values for {count} muscles"
    return ""


def _named(kind: type[Mode] | type[Fault] | type[Phase], number: int) -> str:
    try:
        return kind(number).name.lower()
    except ValueError:
        return str(number)
