"""Reads a bag's arms into recordings; what is kept of a long bag is little more than its swings."""

from collections.abc import Iterator, Sequence
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
    CommandSeries,
    JointSeries,
    JointSpeed,
    MuscleSeries,
    OverrideSeries,
    RecordedPlan,
    Recording,
    StatusSeries,
    TopicTimes,
    plausible,
)
from fastswing_planner.arrays import Matrix, Vector
from fastswing_planner.bags.reader import Bag, BagError, Columns
from fastswing_planner.cdr.stamps import to_seconds

JOINT_STATE = "sensor_msgs/msg/JointState"
MUSCLE_STATE = "fastswing_msgs/msg/MuscleState"
OVERRIDE = "fastswing_msgs/msg/CurrentOverride"
STATUS = "fastswing_msgs/msg/InhibitionStatus"
COMMAND = "fastswing_msgs/msg/LengthCommand"
PLAN = "fastswing_msgs/msg/SwingPlan"

_STEADY = (JOINT_STATE, MUSCLE_STATE)
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
        namespace, _, name = topic.rpartition("/")
        if namespace not in arms or name == "joint_states":
            arms[namespace] = topic
    if not arms:
        held = ", ".join(f"{one.name} ({one.type})" for one in bag.topics.values())
        raise NoJointStates(f"{source} holds no joint states ({JOINT_STATE}); it holds: {held}")
    began = bag.start_ns
    counters, warnings = counted_losses(bag)
    warnings += recorder_losses(bag.metadata_records)
    recordings = [
        _Arm(source, bag, namespace, began, settings).read(topic)
        for namespace, topic in sorted(arms.items())
    ]
    first = recordings[0]
    recordings[0] = replace(
        first,
        counters=counters,
        warnings=(*warnings, *first.warnings),
        topics=(*first.topics, *_times(bag, bag.topics_of_type(DIAGNOSTICS), began)),
    )
    return recordings


@dataclass
class _Arm:
    """Reads the topics of one namespace."""

    source: str
    bag: Bag
    namespace: str
    began_ns: int
    settings: FindingSettings
    warnings: list[str] = field(default_factory=list)
    topics: list[TopicTimes] = field(default_factory=list)
    clock_lead: float = 0.0
    """[s] by which the recorder's clock is ahead of the joint states'; 0 if they agree."""

    def read(self, joint_topic: str) -> Recording:
        speed = self._speed(joint_topic)
        self._compare_clocks(self.topics[-1])
        status = self._status()
        kept = _windows(speed, status, self.settings)
        joints = self._joints(joint_topic, kept)
        muscles = self._muscles(kept)
        overrides, commands = self._overrides(), self._commands()
        plans = self._plans()
        for type_name in _TIMED:
            self._add_times(self._topic(type_name))
        return Recording(
            source=self.source,
            namespace=self.namespace,
            speed=speed,
            joints=joints,
            began_ns=self.began_ns,
            muscles=muscles,
            overrides=overrides,
            status=status,
            commands=commands,
            plans=plans,
            topics=tuple(self.topics),
            warnings=tuple(self.warnings),
        )

    def _topic(self, type_name: str) -> str | None:
        """Return this namespace's topic of a type; None if it has none with messages."""
        for topic in self.bag.topics_of_type(type_name):
            if topic.rpartition("/")[0] == self.namespace:
                return topic
        return None

    def _seconds(self, time_ns: NDArray[np.int64]) -> Vector:
        return np.asarray((time_ns - self.began_ns) * 1e-9)

    def _stamps(self, part: Columns) -> Vector:
        """Return the headers' stamps [s]; a header without one counts as just recorded."""
        return self._seconds(np.where(part.time_ns == 0, part.log_time_ns, part.time_ns))

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

    def _parts(self, topic: str, *fields: str) -> Iterator[Columns]:
        """Read a topic by its stamps, once noting when its messages came."""
        known = {"header.stamp.sec", *self.bag.fields(topic)}
        wanted = [name for name in fields if name in known]
        log_times, stamps, sequences = [], [], []
        for part in self.bag.stream(topic, time="header", fields=wanted):
            log_times.append(self._seconds(part.log_time_ns))
            stamps.append(self._stamps(part))
            sequences.append(part.sequence)
            yield part
        if topic in {one.name for one in self.topics}:
            return
        type_name = self.bag.topics[topic].type
        steady = type_name in _STEADY
        self.topics.append(
            TopicTimes(
                topic,
                type_name,
                np.concatenate(log_times),
                np.concatenate(stamps) if steady else None,
                np.concatenate(sequences).astype(np.int64),
                steady,
            )
        )

    def _speed(self, topic: str) -> JointSpeed:
        times, speeds = [], []
        best = (-1.0, "")
        names: tuple[str, ...] = ()
        for part in self._parts(topic, "name", "velocity"):
            names = names or _names(part)
            velocity = _matrix(part, "velocity", names)
            speed = fastest_joint_speed(velocity)
            times.append(self._stamps(part))
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
        for part in self._parts(topic, "name", "position", "velocity"):
            names = names or _names(part)
            time = self._stamps(part)
            chosen = np.flatnonzero(_inside(time, kept))
            rows.append(at + chosen)
            at += time.size
            times.append(time[chosen])
            positions.append(_matrix(part, "position", names)[chosen])
            velocities.append(_matrix(part, "velocity", names)[chosen])
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
            for part in self._parts(topic, "name", *fields):
                names = names or _names(part)
                time = self._stamps(part)
                chosen = _inside(time, kept)
                times.append(time[chosen])
                for name in fields[:3]:
                    tables[name].append(_matrix(part, name, names)[chosen])
                for name, unknown in (("mode", _UNKNOWN_MODE), ("fault", 0)):
                    values = np.nan_to_num(_matrix(part, name, names)[chosen], nan=unknown)
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
        for part in self._parts(topic, "name", "lease.sec", "lease.nanosec"):
            stamps.append(self._stamps(part))
            received.append(self._seconds(part.log_time_ns))
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
        for part in self._parts(topic, "armed", "rejected", "reason_text"):
            received = self._seconds(part.log_time_ns) - self.clock_lead
            times.append(np.where(part.time_ns == 0, received, self._seconds(part.time_ns)))
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
        for part in self._parts(topic, "name", "length"):
            times.append(self._stamps(part))
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
                received = (log_time_ns - self.began_ns) * 1e-9 - self.clock_lead
                plans += self._usable(topic, received, message)
        except BagError as error:
            self.warnings.append(str(error))
        self._add_times(topic)
        return tuple(plans)

    def _add_times(self, topic: str | None) -> None:
        if topic is not None:
            self.topics += _times(self.bag, [topic], self.began_ns)

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


def _windows(
    speed: JointSpeed, status: StatusSeries | None, settings: FindingSettings
) -> list[tuple[float, float]]:
    """Return from when to when [s] states are kept."""
    bursts = find_bursts(speed.time, speed.speed, armed_intervals(status), settings)
    return [
        (float(speed.time[one.first]) - _AROUND_SEC, float(speed.time[one.last]) + _AROUND_SEC)
        for one in bursts
    ]


def _inside(time: Vector, windows: Sequence[tuple[float, float]]) -> NDArray[np.bool_]:
    inside = np.zeros(time.shape, dtype=bool)
    if time.size == 0:
        return inside
    low, high = float(time.min()), float(time.max())
    for begin, end in windows:
        if begin <= high and end >= low:
            inside |= (time >= begin) & (time <= end)
    return inside


def _names(part: Columns) -> tuple[str, ...]:
    """Return the names in the first message; empty without messages."""
    return tuple(part["name"][0]) if part.count else ()


def _matrix(part: Columns, name: str, names: tuple[str, ...]) -> Matrix:
    """Return a field in the order of `names`, shape (k, len(names)); NaN where it is missing."""
    if name not in part:
        return np.full((part.count, len(names)), np.nan)
    values, titles = part[name], part["name"]
    if (
        values.ndim == 2
        and titles.ndim == 2
        and values.shape == titles.shape
        and tuple(titles[0]) == names
        and bool((titles == titles[0]).all())
    ):
        return plausible(values)
    table = np.full((part.count, len(names)), np.nan)
    place = {title: column for column, title in enumerate(names)}
    for row, (keys, numbers) in enumerate(zip(titles, values, strict=True)):
        if len(keys) == len(numbers):
            for key, number in zip(keys, numbers, strict=True):
                if key in place:
                    table[row, place[key]] = number
    return plausible(table)


def _times(bag: Bag, topics: Sequence[str], began_ns: int) -> list[TopicTimes]:
    """Return when the messages of topics came that are read otherwise."""
    found = []
    for topic in topics:
        parts = list(bag.stream(topic, fields=[]))
        found.append(
            TopicTimes(
                topic,
                bag.topics[topic].type,
                np.concatenate([(part.log_time_ns - began_ns) * 1e-9 for part in parts]),
                sequence=np.concatenate([part.sequence for part in parts]).astype(np.int64),
            )
        )
    return found
