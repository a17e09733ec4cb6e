"""Reads a `fastswing_msgs/SwingPlan`: a message, or what a bag of any age holds of one."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastswing_planner.arrays import Vector, frozen
from fastswing_planner.errors import WrongLength

_LATER = ("inhibited", "speed_index")
"""Fields that older plans lack or have empty: zero."""
_OF_JOINTS = ("start_position", "end_position", "joint_position", "joint_velocity")
"""Fields with a value for each joint; all others have one for each muscle."""


class PlanFields:
    """A plan's fields as arrays of the length that its names tell; n joints, m muscles.

    time  [s] of the predicted steps, shape (k,)
    """

    def __init__(self, message: Any) -> None:
        """Take an object with the attributes of the message; raises AttributeError without them."""
        self._message = message
        self.joint_names: tuple[str, ...] = tuple(message.joint_name)
        self.muscle_names: tuple[str, ...] = tuple(message.muscle_name)
        self._tables = message.trajectory
        if isinstance(self._tables, Sequence):  # before SwingTrajectory: a message for each step
            self.time = frozen([point.time_from_start for point in self._tables])
        else:
            self.time = frozen(self._tables.time_from_start)

    def _width(self, name: str) -> int:
        return len(self.joint_names if name in _OF_JOINTS else self.muscle_names)

    def vector(self, name: str) -> Vector:
        """Return a field's values, shape (n,) or (m,); raises WrongLength.

        Values that the plan does not have, because it was made before its field, are zero.
        """
        width = self._width(name)
        if name in _LATER and not len(getattr(self._message, name, ())):
            return frozen(np.zeros(width))
        values = getattr(self._message, name)
        if len(values) != width:
            raise WrongLength(f"{name} has {len(values)} values for {width} names")
        return frozen(values)

    def flags(self, name: str) -> NDArray[np.bool_]:
        """Return a field's values as truth values, shape (m,); see `vector`."""
        flags = self.vector(name) != 0.0
        flags.setflags(write=False)
        return flags

    def table(self, name: str) -> NDArray[Any]:
        """Return a table of the prediction, shape (k, n) or (k, m); raises WrongLength."""
        steps, width = self.time.size, self._width(name)
        if isinstance(self._tables, Sequence):
            rows = [getattr(point, name) for point in self._tables]
            unknown = [np.nan] * width
            numbers = [x for row in rows for x in (row if len(row) == width else unknown)]
        else:
            numbers = getattr(self._tables, name)
        if len(numbers) != steps * width:
            raise WrongLength(
                f"a table of the plan's trajectory has {len(numbers)} values, expected {width} for "
                f"each of {steps} steps"
            )
        return np.reshape(numbers, (steps, width))
