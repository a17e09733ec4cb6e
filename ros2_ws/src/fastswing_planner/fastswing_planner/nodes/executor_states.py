"""The newest states of the arm, as the swing executor takes them."""

from collections.abc import Callable
from typing import Any

from sensor_msgs.msg import JointState

from fastswing_msgs.msg import MuscleState
from fastswing_planner.conversion.raw_reader import RawReader
from fastswing_planner.conversion.states import (
    JointStateReader,
    MuscleStateReader,
    RejectionCounter,
)
from fastswing_planner.errors import InvalidRequest
from fastswing_planner.execution.measurements import JointMeasurement, MuscleMeasurement
from fastswing_planner.robot.muscle_model import MuscleModel


class ExecutorStates:
    """Reads serialised states; call `expect` first.

    joints    the newest joint state; None before the first
    muscles   the newest muscle state; None before the first
    rejected  counts what was not understood
    """

    def __init__(self, made: Callable[[Any], float]) -> None:
        """`made` returns when a message was made [s], monotonic."""
        self._made = made
        self.joints: JointMeasurement | None = None
        self.muscles: MuscleMeasurement | None = None
        self.rejected = RejectionCounter()

    def expect(self, model: MuscleModel) -> None:
        """Forget the states, and expect those of this robot."""
        self._joint_reader = JointStateReader(model.joint_names)
        self._muscle_reader = MuscleStateReader(model.muscle_names)
        self._raw_joints = RawReader(JointState, JointStateReader.NUMBERS)
        self._raw_muscles = RawReader(MuscleState, MuscleStateReader.NUMBERS)
        self.joints = None
        self.muscles = None

    def read_joints(self, data: bytes) -> JointMeasurement | None:
        """Return a joint state; None, and counted, if it is rejected."""
        try:
            message = self._raw_joints.read(data)
            self.joints = self._joint_reader.read(message, self._made(message))
        except InvalidRequest as error:
            self.rejected.count(error)
            return None
        return self.joints

    def read_muscles(self, data: bytes) -> MuscleMeasurement | None:
        """Return a muscle state; None, and counted, if it is rejected."""
        try:
            message = self._raw_muscles.read(data)
            self.muscles = self._muscle_reader.read(message, self._made(message))
        except InvalidRequest as error:
            self.rejected.count(error)
            return None
        return self.muscles

    def ages(self, now: float) -> dict[str, str]:
        """Return how old the states are at time `now` [s], for diagnostics [ms]."""
        states = (("joint", self.joints), ("muscle", self.muscles))
        return {
            f"{what}_state_age_ms": f"{1e3 * (now - state.time):.1f}"
            for what, state in states
            if state is not None
        }
