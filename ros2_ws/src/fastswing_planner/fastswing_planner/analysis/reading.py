"""Reads a bag's arms into recordings; what is kept of a long bag is little more than its swings."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastswing_planner.analysis.finding import (
    FindingSettings,
    armed_intervals,
    fastest_joint_speed,
    find_bursts,
)
from fastswing_planner.analysis.losses import DIAGNOSTICS, counted_losses, recorder_losses
from fastswing_planner.analysis.recorded_plan import recorded_plan
from fastswing_planner.analysis.recording import (
    Burst,
    CommandSeries,
    JointSeries,
    JointSpeed,
    MuscleSeries,
    OverrideSeries,
    RecordedPlan,
    Recording,
    StatusSeries,
    TopicTimes,
)
from fastswing_planner.analysis.state_tables import inside, matrix_of, names_of
from fastswing_planner.analysis.timed_topics import (
    JOINT_STATE,
    MUSCLE_STATE,
    TimedTopics,
    topic_times,
)
from fastswing_planner.bags import Bag, BagError
from fastswing_planner.bags.robot_topics import namespace_of, robot_topics
from fastswing_planner.cdr.stamps import to_seconds

OVERRIDE = "fastswing_msgs/msg/CurrentOverride"
STATUS = "fastswing_msgs/msg/InhibitionStatus"
COMMAND = "fastswing_msgs/msg/LengthCommand"
PLAN = "fastswing_msgs/msg/SwingPlan"

_TIMED = ("fastswing_msgs/msg/TensionCommand", "fastswing_msgs/msg/CurrentCommand")
"""Of these only the times are used."""
_AROUND_SEC = 0.6
"""Kept of the states before and after each fast motion; more than is shown of a swing."""
_CLOCKS_APART_SEC = 0.5
"""No message is this long on its way: its stamp and the recorder's time are of two clocks."""
_UNKNOWN_MODE = 255
"""A mode that is not recorded is not zero current."""


class NoJointStates(BagError):
    """A bag in which no arm can be found."""


def read_recordings(source: str, bag: Bag, settings: FindingSettings) -> list[Recording]:
    """Return a recording for each namespace with joint states.

    source  the bag's name, for people

    Raises NoJointStates, or another BagError if the joint states cannot be read.
    """
    if bag.message_count == 0:
        raise NoJointStates(f"{source} is empty: it holds no message")
    arms: dict[str, str] = {}
    for topic in bag.topics_of_type(JOINT_STATE):
        namespace = namespace_of(topic)
        if namespace not in arms or topic.endswith("/joint_states"):
            arms[namespace] = topic
    if not arms:
        held = ", ".join(f"{one.name} ({one.type})" for one in bag.topics.values())
        raise NoJointStates(f"{source} holds no joint states ({JOINT_STATE}); it holds: {held}")
    began = bag.start_ns
    counters, warnings = counted_losses(bag)
    warnings += recorder_losses(bag.metadata_records)
    recordings = [
        _Arm(source, bag, namespace, TimedTopics(bag, began), settings).read(topic)
        for namespace, topic in sorted(arms.items())
    ]
    first = recordings[0]
    recordings[0] = replace(
        first,
        counters=counters,
        warnings=(*warnings, *first.warnings),
        topics=(*first.topics, *topic_times(bag, bag.topics_of_type(DIAGNOSTICS), began)),
    )
    return recordings


@dataclass
class _Arm:
    """Reads the topics of one namespace."""

    source: str
    bag: Bag
    namespace: str
    clocked: TimedTopics
    settings: FindingSettings
    warnings: list[str] = field(default_factory=list)
    clock_lead: float = 0.0
    """[s] by which the recorder's clock is ahead of the joint states'; 0 if they agree."""

    def read(self, joint_topic: str) -> Recording:
        speed = self._speed(joint_topic)
        self._compare_clocks(self.clocked.topics[-1])
        status = self._status()
        bursts = find_bursts(speed.time, speed.speed, armed_intervals(status), self.settings)
        kept = _windows(speed, bursts)
        joints = self._joints(joint_topic, kept)
        muscles = self._muscles(kept)
        overrides, commands = self._overrides(), self._commands()
        plans = self._plans()
        for type_name in _TIMED:
            self.clocked.add_times(self._topic(type_name))
        return Recording(
            source=self.source,
            namespace=self.namespace,
            speed=speed,
            joints=joints,
            bursts=tuple(bursts),
            began_ns=self.clocked.began_ns,
            muscles=muscles,
            overrides=overrides,
            status=status,
            commands=commands,
            plans=plans,
            topics=tuple(self.clocked.topics),
            warnings=tuple(self.warnings),
        )

    def _topic(self, type_name: str) -> str | None:
        """Return this namespace's topic of a type; None if it has none with messages."""
        for topic in robot_topics(self.bag, type_name, self.namespace):
            if namespace_of(topic) == self.namespace:
                return topic
        return None

    def _compare_clocks(self, joints: TopicTimes) -> None:
        lead = clock_lead(joints)
        if abs(lead) <= _CLOCKS_APART_SEC:
            return
        self.clock_lead = lead
        self.warnings.append(
            f"{joints.name}: the recorder's clock is {abs(lead):.2f} s "
            f"{'ahead of' if lead > 0.0 else 'behind'} the stamps; "
            "latencies of overrides mean nothing"
        )

    def _speed(self, topic: str) -> JointSpeed:
        times, speeds = [], []
        best = (-1.0, "")
        names: tuple[str, ...] = ()
        for part in self.clocked.parts(topic, "name", "velocity"):
            names = names or names_of(part)
            velocity = matrix_of(part, "velocity", names)
            speed = fastest_joint_speed(velocity)
            times.append(self.clocked.stamps(part))
            speeds.append(speed)
            if np.isfinite(speed).any():
                row = int(np.nanargmax(speed))
                joint = int(np.nanargmax(np.abs(velocity[row])))
                best = max(best, (float(speed[row]), names[joint]))
        return JointSpeed(np.concatenate(times), np.concatenate(speeds), best[1])

    def _joints(self, topic: str, kept: list[tuple[float, float]]) -> JointSeries:
        rows, times, positions, velocities = [], [], [], []
        names: tuple[str, ...] = ()
        at = 0
        for part in self.clocked.parts(topic, "name", "position", "velocity"):
            names = names or names_of(part)
            time = self.clocked.stamps(part)
            chosen = np.flatnonzero(inside(time, kept))
            rows.append(at + chosen)
            at += time.size
            times.append(time[chosen])
            positions.append(matrix_of(part, "position", names)[chosen])
            velocities.append(matrix_of(part, "velocity", names)[chosen])
        return JointSeries(
            names,
            np.concatenate(rows),
            np.concatenate(times),
            np.concatenate(positions),
            np.concatenate(velocities),
        )

    def _muscles(self, kept: list[tuple[float, float]]) -> MuscleSeries | None:
        topic = self._topic(MUSCLE_STATE)
        if topic is None:
            return None
        fields = ("velocity", "tension", "current", "mode", "fault")
        tables: dict[str, list[NDArray[Any]]] = {name: [] for name in fields}
        times = []
        names: tuple[str, ...] = ()
        try:
            for part in self.clocked.parts(topic, "name", *fields):
                names = names or names_of(part)
                time = self.clocked.stamps(part)
                chosen = inside(time, kept)
                times.append(time[chosen])
                for name in fields[:3]:
                    tables[name].append(matrix_of(part, name, names)[chosen])
                for name, unknown in (("mode", _UNKNOWN_MODE), ("fault", 0)):
                    values = np.nan_to_num(matrix_of(part, name, names)[chosen], nan=unknown)
                    tables[name].append(values.astype(np.uint8))
        except BagError as error:
            self.warnings.append(str(error))
            return None
        whole = {name: np.concatenate(parts) for name, parts in tables.items()}
        return MuscleSeries(names, np.concatenate(times), **whole)

    def _overrides(self) -> OverrideSeries | None:
        topic = self._topic(OVERRIDE)
        if topic is None:
            return None
        stamps, received, leases = [], [], []
        muscles: list[tuple[str, ...]] = []
        for part in self.clocked.parts(topic, "name", "lease.sec", "lease.nanosec"):
            stamps.append(self.clocked.stamps(part))
            received.append(self.clocked.seconds(part.log_time_ns))
            leases.append(to_seconds(part["lease.sec"], part["lease.nanosec"]))
            muscles += [tuple(row) for row in part["name"]]
        return OverrideSeries(
            np.concatenate(stamps), np.concatenate(received), np.concatenate(leases), tuple(muscles)
        )

    def _status(self) -> StatusSeries | None:
        topic = self._topic(STATUS)
        if topic is None:
            return None
        times, armed, rejected = [], [], []
        reasons: list[str] = []
        for part in self.clocked.parts(topic, "armed", "rejected", "reason_text"):
            received = self.clocked.seconds(part.log_time_ns) - self.clock_lead
            times.append(np.where(part.time_ns == 0, received, self.clocked.seconds(part.time_ns)))
            armed.append(part["armed"].astype(bool))
            unknown = np.full(part.count, np.nan)
            rejected.append(np.asarray(part.get("rejected", unknown), dtype=float))
            reasons += list(part.get("reason_text", [""] * part.count))
        return StatusSeries(
            np.concatenate(times), np.concatenate(armed), np.concatenate(rejected), tuple(reasons)
        )

    def _commands(self) -> CommandSeries | None:
        topic = self._topic(COMMAND)
        if topic is None:
            return None
        times, steps = [], []
        known: dict[str, float] = {}
        for part in self.clocked.parts(topic, "name", "length"):
            times.append(self.clocked.stamps(part))
            for names, lengths in zip(part["name"], part["length"], strict=True):
                new = dict(zip(names, np.asarray(lengths, dtype=float).tolist(), strict=False))
                moved = [abs(new[name] - known[name]) for name in new if name in known]
                steps.append(max(moved, default=0.0))
                known |= new
        return CommandSeries(np.concatenate(times), np.array(steps))

    def _plans(self) -> tuple[RecordedPlan, ...]:
        topic = self._topic(PLAN)
        if topic is None:
            return ()
        plans: list[RecordedPlan] = []
        try:
            for log_time_ns, message in self.bag.messages(topic):
                # Its stamp says when it was planned, which may be long before its swing.
                received = (log_time_ns - self.clocked.began_ns) * 1e-9 - self.clock_lead
                plans += self._usable(topic, received, message)
        except BagError as error:
            self.warnings.append(str(error))
        self.clocked.add_times(topic)
        return tuple(plans)

    def _usable(self, topic: str, received: float, message: Any) -> list[RecordedPlan]:
        try:
            return [recorded_plan(received, message)]
        except (AttributeError, ValueError) as error:
            self.warnings.append(f"{topic}: a plan cannot be used: {error}")
            return []


def clock_lead(topic: TopicTimes) -> float:
    """Return by how much a topic's messages typically were recorded after their stamps [s]."""
    if topic.stamp is None or topic.stamp.size == 0:
        return 0.0
    return float(np.median(topic.received - topic.stamp))


def _windows(speed: JointSpeed, bursts: Sequence[Burst]) -> list[tuple[float, float]]:
    """Return from when to when [s] states are kept."""
    return [
        (float(speed.time[one.first]) - _AROUND_SEC, float(speed.time[one.last]) + _AROUND_SEC)
        for one in bursts
    ]
