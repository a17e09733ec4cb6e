"""Reads the bag of one swing into columns; time 0 is the swing's length command."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Schema
from rclpy.serialization import deserialize_message

Array = npt.NDArray[np.float64]

_LOOK_BACK_SEC = 5.0
_TOPICS = ("joint_states", "muscle_state", "length_command", "current_override", "swing_plan")


class UnusableBag(ValueError):
    """A bag that holds no swing; the text names the file and what is missing."""


@dataclass(frozen=True)
class Inhibition:
    """An interval [s] in which the same muscles were forced to zero current."""

    start: float
    end: float
    muscles: tuple[str, ...]


@dataclass(frozen=True)
class PlannedSpeed:
    """Joint speeds of the plan.

    time      [s] ends of the steps, shape (k,)
    velocity  [rad/s] means over the steps, shape (k, n)
    masked    muscles inhibited or elongated
    """

    joint_names: tuple[str, ...]
    time: Array
    velocity: Array
    masked: tuple[str, ...]


@dataclass(frozen=True)
class RecordedSwing:
    """One swing, times [s] from its length command on.

    joint_velocity   [rad/s] shape (j, n), at joint_time
    muscle_velocity  [m/s] shape (k, m), at muscle_time
    muscle_tension   [N] shape (k, m), at muscle_time
    plan             None if the bag holds none
    """

    joint_names: tuple[str, ...]
    joint_time: Array
    joint_velocity: Array
    muscle_names: tuple[str, ...]
    muscle_time: Array
    muscle_velocity: Array
    muscle_tension: Array
    inhibitions: tuple[Inhibition, ...]
    plan: PlannedSpeed | None


@dataclass(frozen=True)
class _Row:
    time: float  # [s] header's stamp; of the receipt if that is zero
    received: float  # [s]
    message: Any


def read_swing(bag: Path) -> RecordedSwing:
    """Read the swing of a finished bag; raises UnusableBag."""
    rows = _rows_by_topic(bag)
    for needed in ("joint_states", "muscle_state", "length_command"):
        if not rows[needed]:
            raise UnusableBag(f"{bag} holds no message of {needed}")
    joints, muscles = rows["joint_states"], rows["muscle_state"]
    joint_names = tuple(joints[0].message.name)
    muscle_names = tuple(muscles[0].message.name)
    joint_time = _times(joints)
    joint_velocity = _columns(joints, "velocity", joint_names)
    start = _swing_command(rows["length_command"], joint_time, joint_velocity)
    return RecordedSwing(
        joint_names=joint_names,
        joint_time=joint_time - start,
        joint_velocity=joint_velocity,
        muscle_names=muscle_names,
        muscle_time=_times(muscles) - start,
        muscle_velocity=_columns(muscles, "velocity", muscle_names),
        muscle_tension=_columns(muscles, "tension", muscle_names),
        inhibitions=tuple(_inhibitions(rows["current_override"], start)),
        plan=_plan(rows["swing_plan"], start),
    )


def _rows_by_topic(bag: Path) -> dict[str, list[_Row]]:
    rows: dict[str, list[_Row]] = {topic: [] for topic in _TOPICS}
    classes: dict[int, type] = {}
    try:
        with open(bag, "rb") as stream:
            for schema, channel, record in make_reader(stream).iter_messages():
                topic = channel.topic.rpartition("/")[2]
                if topic in rows and schema is not None:
                    if schema.id not in classes:
                        classes[schema.id] = _message_class(schema)
                    message = deserialize_message(record.data, classes[schema.id])
                    rows[topic].append(_row(message, record.log_time))
    except (OSError, McapError) as error:
        raise UnusableBag(f"{bag} cannot be read: {error}") from error
    return rows


def _message_class(schema: Schema) -> type:
    package, _, name = schema.name.split("/")
    found: type = getattr(import_module(f"{package}.msg"), name)
    return found


def _row(message: Any, log_time_ns: int) -> _Row:
    stamp = message.header.stamp
    received = log_time_ns * 1e-9
    return _Row(stamp.sec + stamp.nanosec * 1e-9 or received, received, message)


def _times(rows: Sequence[_Row]) -> Array:
    return np.array([row.time for row in rows])


def _columns(rows: Iterable[_Row], field: str, names: Sequence[str]) -> Array:
    """Return a field of all messages in the order of `names`, shape (k, len(names))."""
    table = []
    for row in rows:
        values = dict(zip(row.message.name, getattr(row.message, field), strict=False))
        table.append([values.get(name, np.nan) for name in names])
    return np.array(table, dtype=float)


def _swing_command(rows: Sequence[_Row], joint_time: Array, joint_velocity: Array) -> float:
    """Return the time [s] of the swing's length command.

    On the way to the start posture lengths change a little with each of many messages; the swing
    is one message that asks for the end posture at once. So it is the largest step among the
    commands before the arm was fastest.
    """
    fastest = joint_time[np.nanargmax(np.nanmax(np.abs(joint_velocity), axis=1))]
    best_time, best_step = rows[0].time, -1.0
    commanded: dict[str, float] = {}
    for row in rows:
        lengths = dict(zip(row.message.name, row.message.length, strict=False))
        steps = [abs(lengths[name] - commanded[name]) for name in lengths if name in commanded]
        commanded.update(lengths)
        recent = fastest - _LOOK_BACK_SEC <= row.time <= fastest
        if recent and max(steps, default=0.0) > best_step:
            best_time, best_step = row.time, max(steps, default=0.0)
    return best_time


def _inhibitions(rows: Sequence[_Row], start: float) -> Iterable[Inhibition]:
    """Yield what was inhibited: an override ends with its lease or with the next one."""
    pending: Inhibition | None = None
    for row in rows:
        begin = row.received - start
        lease = row.message.lease.sec + row.message.lease.nanosec * 1e-9
        now = Inhibition(begin, begin + lease, tuple(row.message.name))
        if pending is not None and pending.muscles == now.muscles and begin <= pending.end:
            pending = Inhibition(pending.start, now.end, now.muscles)
            continue
        if pending is not None and pending.muscles:
            yield Inhibition(pending.start, min(pending.end, begin), pending.muscles)
        pending = now
    if pending is not None and pending.muscles:
        yield pending


def _plan(rows: Sequence[_Row], start: float) -> PlannedSpeed | None:
    """Return the last plan before the swing; an earlier swing's may be latched."""
    plans = [row.message for row in rows if row.time <= start]
    if not plans:
        return None
    plan = plans[-1]
    return PlannedSpeed(
        joint_names=tuple(plan.joint_name),
        time=np.array([point.time_from_start for point in plan.trajectory]),
        velocity=np.array([list(point.joint_velocity) for point in plan.trajectory]),
        masked=tuple(
            name for name, kept in zip(plan.muscle_name, plan.mask, strict=True) if not kept
        ),
    )


def read_swings(bags: Mapping[str, Path]) -> dict[str, RecordedSwing]:
    """Read the bags of several methods."""
    return {method: read_swing(bag) for method, bag in bags.items()}
