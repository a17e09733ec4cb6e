"""Joint and muscle states to arrays in the robot's order; names are looked up once.

A message here is the ordinary one or the plain object that RawReader makes of it.
"""

import math
from collections.abc import Sequence
from types import SimpleNamespace

import numpy as np
from sensor_msgs.msg import JointState

from fastswing_msgs.msg import MuscleState
from fastswing_planner.arrays import BoolVector, Vector, frozen
from fastswing_planner.conversion.number_places import STAMP
from fastswing_planner.errors import NotFinite, PlannerError, UnknownName, WrongLength
from fastswing_planner.execution.measurements import JointMeasurement, MuscleMeasurement


class NamedColumns:
    """Picks the robot's elements out of messages that name theirs."""

    def __init__(self, kind: str, names: Sequence[str]) -> None:
        """`kind` is what an element is called in errors."""
        self._kind = kind
        self._names = tuple(names)
        self._seen: Sequence[str] | None = None
        self._index: list[int] | None = None

    def _look_up(self, names: Sequence[str]) -> None:
        for name in self._names:
            if names.count(name) != 1:
                found = "is missing" if name not in names else "is named more than once"
                raise UnknownName(f"{self._kind} '{name}' {found} in: {', '.join(names)}")
        in_order = tuple(names) == self._names
        self._index = None if in_order else [names.index(name) for name in self._names]
        self._seen = list(names)

    def numbers(self, what: str, names: Sequence[str], values: Sequence[float]) -> Sequence[float]:
        """Return the robot's elements of `values`, which are in the order of `names`.

        Raises UnknownName, WrongLength or NotFinite.
        """
        if names != self._seen:
            self._look_up(names)
        if len(values) != len(names):
            raise WrongLength(f"{what} has {len(values)} values for {len(names)} names")
        picked = values if self._index is None else [values[place] for place in self._index]
        # The sum is quick, and finite unless numbers are huge, which then are looked at again.
        if not math.isfinite(sum(picked)):
            for name, value in zip(self._names, picked, strict=True):
                if not math.isfinite(value):
                    raise NotFinite(f"{what} of {name} is {value}")
        return picked

    def pick(self, what: str, names: Sequence[str], values: Sequence[float]) -> Vector:
        """Return the same as an array; see `numbers`."""
        return frozen(self.numbers(what, names, values))


class JointStateReader:
    """Reads `sensor_msgs/JointState`; velocities are required."""

    NUMBERS = (*STAMP, "position", "velocity")
    """What a RawReader has to read for it."""

    def __init__(self, joint_names: Sequence[str]) -> None:
        """Read the joints with these names."""
        self._columns = NamedColumns("joint", joint_names)

    def read(self, message: JointState | SimpleNamespace, time: float) -> JointMeasurement:
        """Return the measurement received at `time` [s]; raises InvalidRequest."""
        position, velocity = self.numbers(message)
        return JointMeasurement(time, frozen(position), frozen(velocity))

    def numbers(
        self, message: JointState | SimpleNamespace
    ) -> tuple[Sequence[float], Sequence[float]]:
        """Return position [rad] and velocity [rad/s] as plain numbers; raises InvalidRequest."""
        numbers, names = self._columns.numbers, message.name
        position = numbers("position", names, message.position)
        return position, numbers("velocity", names, message.velocity)


class MuscleStateReader:
    """Reads `fastswing_msgs/MuscleState`."""

    NUMBERS = (*STAMP, "length", "velocity", "tension", "mode", "fault", "holds")
    """What a RawReader has to read for it."""

    def __init__(self, muscle_names: Sequence[str]) -> None:
        """Read the muscles with these names."""
        self._columns = NamedColumns("muscle", muscle_names)

    def read(self, message: MuscleState | SimpleNamespace, time: float) -> MuscleMeasurement:
        """Return the measurement received at `time` [s]; raises InvalidRequest."""
        names = message.name
        for what, values in (("fault", message.fault), ("mode", message.mode)):
            if len(values) != len(names):
                raise WrongLength(f"{what} has {len(values)} values for {len(names)} names")
        limp = np.equal(message.mode, MuscleState.MODE_ZERO_CURRENT)
        held = np.equal(message.mode, MuscleState.MODE_LENGTH)
        return MuscleMeasurement(
            time,
            self._columns.pick("length", names, message.length),
            self._columns.pick("velocity", names, message.velocity),
            self._columns.pick("tension", names, message.tension),
            _chosen(names, np.not_equal(message.fault, MuscleState.FAULT_NONE)),
            _chosen(names, limp),
            _chosen(names, ~(limp | held)),
            message.holds,
        )


def _chosen(names: Sequence[str], marks: BoolVector) -> tuple[str, ...]:
    return tuple(names[index] for index in marks.nonzero()[0].tolist())


class RejectionCounter:
    """Counts rejected messages by reason, for diagnostics."""

    def __init__(self) -> None:
        """Start with nothing counted."""
        self.counts: dict[str, int] = {}
        self.last = ""

    def count(self, error: PlannerError) -> None:
        """Count one rejection."""
        key = f"rejected_{error.code_name.lower()}"
        self.counts[key] = self.counts.get(key, 0) + 1
        self.last = str(error)
