"""Reads a bag's arms into recordings; what is kept of a long bag is little more than its swings."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

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
)
from fastswing_planner.analysis.swing_finding import (
    FindingSettings,
    armed_intervals,
    fastest_joint_speed,
    find_bursts,
)
from fastswing_planner.arrays import Matrix, Vector
from fastswing_planner.bag import Bag, BagError, Columns
from fastswing_planner.bag_writer import NOTES

JOINT_STATE = "sensor_msgs/msg/JointState"
MUSCLE_STATE = "fastswing_msgs/msg/MuscleState"
OVERRIDE = "fastswing_msgs/msg/CurrentOverride"
STATUS = "fastswing_msgs/msg/InhibitionStatus"
COMMAND = "fastswing_msgs/msg/LengthCommand"
PLAN = "fastswing_msgs/msg/SwingPlan"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"

_STEADY = (JOINT_STATE, MUSCLE_STATE)
_TIMED = ("fastswing_msgs/msg/TensionCommand", "fastswing_msgs/msg/CurrentCommand")
"""Of these only the times are used."""
_METHODS = {0: "basic", 1: "inhibit", 2: "elongate", 3: "hybrid"}
_AROUND_SEC = 0.6
"""Kept of the states before and after each fast motion; more than is shown of a swing."""
_LARGEST = 1e6
"""In SI units, beyond anything that an arm can do."""
_CLOCKS_APART_SEC = 0.5
"""No message is this long on its way: its stamp and the recorder's time are of two clocks."""
_MOST_DIGITS = 20
"""Of a 64-bit count."""
_UNKNOWN_MODE = 255
"""A mode that is not recorded is not zero current."""
_COUNTED = ("rejected", "refused", "lost", "late_", "missed", "overruns", "dropped")
"""What the names of counted losses in the diagnostics begin with."""


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
    counters, warnings = _counters(bag)
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
            leases.append(part["lease.sec"] + part["lease.nanosec"] * 1e-9)
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


def recorded_plan(received: float, message: Any) -> RecordedPlan:
    """Return a `fastswing_msgs/SwingPlan` as arrays; raises AttributeError or ValueError.

    received  [s]

    Plans recorded before a field existed lack it or have it empty: zero.
    """
    joints, muscles = tuple(message.joint_name), tuple(message.muscle_name)
    time, joint_velocity, muscle_velocity = _predicted(
        message.trajectory, len(joints), len(muscles)
    )
    kept = np.array(message.mask, dtype=bool)
    plan = RecordedPlan(
        received=received,
        method=_METHODS.get(message.method, f"method {message.method}"),
        joint_names=joints,
        start=_plausible(message.start_position),
        end=_plausible(message.end_position),
        muscle_names=muscles,
        kept=kept,
        inhibited=np.array(_or_zeros(message, "inhibited", muscles), dtype=bool),
        elongation=_plausible(message.elongation),
        speed_index=_plausible(_or_zeros(message, "speed_index", muscles)),
        time_cost=float(_plausible(message.time_cost)),
        time=_plausible(time),
        joint_velocity=_table(joint_velocity, len(time), len(joints)),
        muscle_velocity=_table(muscle_velocity, len(time), len(muscles)),
    )
    for what, values, names in (
        ("start_position", plan.start, joints),
        ("end_position", plan.end, joints),
        ("mask", plan.kept, muscles),
        ("inhibited", plan.inhibited, muscles),
        ("elongation", plan.elongation, muscles),
        ("speed_index", plan.speed_index, muscles),
    ):
        if values.shape != (len(names),):
            raise ValueError(f"{what} has {values.size} values for {len(names)} names")
    if not joints:
        raise ValueError("it names no joint")
    if np.array_equal(plan.start, plan.end):
        raise ValueError("it ends where it starts")
    return plan


def _or_zeros(message: Any, name: str, muscles: Sequence[str]) -> Sequence[float]:
    values: Sequence[float] = getattr(message, name, ())
    return values if len(values) else [0.0] * len(muscles)


def _predicted(
    trajectory: Any, joints: int, muscles: int
) -> tuple[Sequence[float], Sequence[float], Sequence[float]]:
    """Return time [s] and the speeds of joints and muscles, row by row.

    Plans recorded before SwingTrajectory have a message for each step.
    """
    if hasattr(trajectory, "time_from_start"):
        return trajectory.time_from_start, trajectory.joint_velocity, trajectory.muscle_velocity
    return (
        [point.time_from_start for point in trajectory],
        _in_a_row([point.joint_velocity for point in trajectory], joints),
        _in_a_row([point.muscle_velocity for point in trajectory], muscles),
    )


def _in_a_row(rows: Sequence[Sequence[float]], width: int) -> list[float]:
    """Return rows one behind the other; those of another length are unknown."""
    unknown = [np.nan] * width
    return [value for row in rows for value in (row if len(row) == width else unknown)]


def _table(numbers: Sequence[float], steps: int, width: int) -> Matrix:
    """Return a table (steps, width); unknown if there are fewer or more numbers."""
    if len(numbers) != steps * width:
        return np.full((steps, width), np.nan)
    return _plausible(np.reshape(numbers, (steps, width)))


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
        return _plausible(values)
    table = np.full((part.count, len(names)), np.nan)
    place = {title: column for column, title in enumerate(names)}
    for row, (keys, numbers) in enumerate(zip(titles, values, strict=True)):
        if len(keys) == len(numbers):
            for key, number in zip(keys, numbers, strict=True):
                if key in place:
                    table[row, place[key]] = number
    return _plausible(table)


def _plausible(values: ArrayLike) -> Matrix:
    """Return numbers as floats; what no arm can measure, infinity included, is unknown."""
    numbers = np.asarray(values, dtype=float)
    beyond = ~(np.abs(numbers) <= _LARGEST)
    return np.where(beyond, np.nan, numbers) if beyond.any() else numbers


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


def recorder_losses(records: Sequence[tuple[Path, str, Mapping[str, str]]]) -> list[str]:
    """Return what the recorder itself says it lost, a line for each topic and file.

    records  file, name and content of a bag's metadata
    """
    lines = []
    for path, name, content in records:
        if name != NOTES:
            continue
        try:
            told = json.loads(content.get("lost", "{}"))
            counts = [(str(topic), int(count)) for topic, count in told.items()]
        except (ValueError, TypeError, AttributeError):
            lines.append(f"{path.name}: what the recorder says of its losses cannot be read")
            continue
        lines += [
            f"the recorder lost {count} messages of {topic}" for topic, count in counts if count
        ]
    return lines


def _counters(bag: Bag) -> tuple[dict[str, dict[str, int]], list[str]]:
    """Return by how much the nodes' counts of rejections and losses rose, and what went wrong.

    A count that falls belongs to a node that began anew.
    """
    risen: dict[str, dict[str, int]] = {}
    last: dict[tuple[str, str], int] = {}
    warnings: list[str] = []
    for topic in bag.topics_of_type(DIAGNOSTICS):
        try:
            for _, message in bag.messages(topic):
                for status in message.status:
                    counts = {
                        pair.key: int(pair.value)
                        for pair in status.values
                        if pair.key.startswith(_COUNTED) and _is_count(pair.value)
                    }
                    _count(risen, last, status.name, counts)
        except BagError as error:
            warnings.append(str(error))
    return {node: counts for node, counts in risen.items() if counts}, warnings


def _is_count(text: str) -> bool:
    """Return whether a text is a number of 64 bits as nodes write it; '²' is a digit, too."""
    return text.isascii() and text.isdecimal() and len(text) <= _MOST_DIGITS


def _count(
    risen: dict[str, dict[str, int]],
    last: dict[tuple[str, str], int],
    node: str,
    counts: Mapping[str, int],
) -> None:
    """Add what rose since the node's last report; its first one is where counting begins."""
    first = node not in risen
    total = risen.setdefault(node, {})
    for name, value in counts.items():
        # A count that appears later was zero before.
        known = last.get((node, name), value if first else 0)
        rise = value - known if value >= known else value
        last[node, name] = value
        if rise:
            total[name] = total.get(name, 0) + rise
