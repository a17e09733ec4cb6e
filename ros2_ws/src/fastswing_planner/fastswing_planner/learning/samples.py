"""What a bag tells of muscle lengths over joint angles."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fastswing_planner.arrays import BoolMatrix, Matrix, Vector
from fastswing_planner.bags import Bag
from fastswing_planner.bags.robot_topics import robot_topic
from fastswing_planner.cdr.columns import Columns
from fastswing_planner.errors import BagError, UnknownTopic
from fastswing_planner.robot.muscle_model import MuscleModel

_JOINTS = "sensor_msgs/msg/JointState"
_MUSCLES = "fastswing_msgs/msg/MuscleState"
_LONGEST_GAP_SEC = 0.05
_TAUT_TENSION = 2.0
"""[N] below it a wire may hang and its length says nothing of the path."""


class UnusableForLearning(BagError):
    """A bag without what learning needs."""


@dataclass(frozen=True)
class MuscleSamples:
    """Muscle path lengths at postures.

    joint_position  [rad] shape (k, n)
    length          [m] of the path: the encoder's length and the wire's stretch, shape (k, m)
    usable          finite, and taut, shape (k, m)
    """

    joint_position: Matrix
    length: Matrix
    usable: BoolMatrix


def muscle_samples(
    bag: Bag, model: MuscleModel, wire_stiffness: Vector, most: int = 20_000, prefix: str = ""
) -> MuscleSamples:
    """Return at most `most` samples, evenly over the bag.

    Joint angles are interpolated to the muscles' stamps, where joint states are near enough.

    wire_stiffness  [N/m] shape (m,)
    prefix          namespace of the robot's topics if the bag holds more than one

    Raises BagError if the bag lacks the robot's joints or muscles.
    """
    joints = _columns(bag, _JOINTS, ["name", "position"], prefix)
    muscles = _columns(bag, _MUSCLES, ["name", "length", "tension"], prefix)
    order = np.argsort(joints.time_ns, kind="stable")
    joint_time = joints.time_ns[order]
    position = _picked("joints", joints, "position", model.joint_names)[order]
    step = -(-muscles.count // most)
    time = muscles.time_ns[::step]
    length = _picked("muscles", muscles, "length", model.muscle_names)[::step]
    tension = _picked("muscles", muscles, "tension", model.muscle_names)[::step]
    after = np.clip(np.searchsorted(joint_time, time), 1, len(joint_time) - 1)
    gap = (joint_time[after] - joint_time[after - 1]) * 1e-9
    inside = (time >= joint_time[0]) & (time <= joint_time[-1]) & (gap < _LONGEST_GAP_SEC)
    base = int(joint_time[0])  # float64 keeps the nanoseconds of differences, not of dates
    angles = np.stack(
        [np.interp(time - base, joint_time - base, angle) for angle in position.T], axis=1
    )
    path = length + tension / wire_stiffness
    usable = np.isfinite(path) & (tension > _TAUT_TENSION)
    whole = inside & np.isfinite(angles).all(axis=1)
    return MuscleSamples(angles[whole], np.where(usable[whole], path[whole], 0.0), usable[whole])


def _columns(bag: Bag, type_name: str, fields: list[str], prefix: str) -> Columns:
    try:
        topic = robot_topic(bag, type_name, prefix)
    except UnknownTopic as error:
        raise UnusableForLearning(f"nothing to learn from: {error}") from error
    columns = bag.columns(topic, "header", fields)
    if columns.count < 2:
        raise UnusableForLearning(f"{topic} has {columns.count} messages, too few to learn from")
    return columns


def _picked(what: str, columns: Columns, field: str, wanted: Sequence[str]) -> Matrix:
    names = columns.names()
    missing = [name for name in wanted if name not in names]
    if missing:
        raise UnusableForLearning(
            f"{what} of the robot are not in {columns.topic}: {', '.join(missing)}; it has: "
            f"{', '.join(names)}"
        )
    values = columns[field]
    if values.ndim != 2 or values.shape[1] != len(names):
        raise UnusableForLearning(f"{field} of {columns.topic} has not one value for each name")
    return np.asarray(values[:, [names.index(name) for name in wanted]], dtype=float)
