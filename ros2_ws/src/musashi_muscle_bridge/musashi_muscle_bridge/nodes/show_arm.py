"""Publishes the arm as markers for RViz and Foxglove: `ros2 run musashi_muscle_bridge show_arm`."""

from collections.abc import Callable, Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from visualization_msgs.msg import MarkerArray

from fastswing_msgs.msg import MuscleState
from fastswing_planner.conversion.states import (
    JointStateReader,
    MuscleStateReader,
    RejectionCounter,
)
from fastswing_planner.errors import InvalidParameter, InvalidRequest
from fastswing_planner.lifecycle.common_parameters import ROBOT_DESCRIPTION
from fastswing_planner.lifecycle.parameters import Parameter
from fastswing_planner.lifecycle.running import run
from fastswing_planner.robot.description import load_robot
from musashi_muscle_bridge.nodes.arm_markers import ArmMarkers
from musashi_muscle_bridge.nodes.polling import PollingNode, Sample

TABLE = (
    ROBOT_DESCRIPTION,
    Parameter("frame_id", "world", "Frame of the markers: where the MJCF's world is."),
    Parameter("rate", 15.0, "Pictures of the arm, while its state arrives.", "Hz", 0.5, 60.0),
    Parameter(
        "lifetime",
        0.5,
        "Viewers forget what was drawn longer ago, and older states are not drawn; at least two "
        "periods of rate.",
        "s",
        0.05,
        10.0,
    ),
    Parameter("slack_tension", 1.0, "A muscle that pulls less is drawn slack.", "N", 0.0, 50.0),
)


class ShowArmNode(PollingNode):
    """Active means: the newest state is drawn again and again, if there is one."""

    def __init__(self) -> None:
        """Declare parameters."""
        super().__init__("show_arm", TABLE)

    def configure(self, parameters: Mapping[str, Any]) -> None:
        """Load the robot and its shapes."""
        if parameters["lifetime"] * parameters["rate"] < 2.0:
            raise InvalidParameter(
                f"lifetime is {parameters['lifetime']:g} s, expected at least two periods of rate: "
                f"{2.0 / parameters['rate']:g} s"
            )
        robot = load_robot(parameters["robot_description"])
        self._values = parameters
        self._markers = ArmMarkers(robot, parameters["lifetime"], parameters["slack_tension"])
        self._read_joints = JointStateReader(robot.model.joint_names).read
        self._read_muscles = MuscleStateReader(robot.model.muscle_names).read

    def activate(self) -> None:
        """Watch the states, draw."""
        self._drawn = 0
        self._rejected = RejectionCounter()
        self._newest_muscles: Sample | None = None
        self._joints = self.poll(JointState, "joint_states")
        self._muscles = self.poll(MuscleState, "muscle_state")
        self._pictures = self.create_publisher(MarkerArray, "arm_markers", QoSProfile(depth=1))
        self._clock_of_pictures = self.create_steady_timer(1.0 / self._values["rate"], self._draw)

    def deactivate(self) -> None:
        """Draw no more; viewers forget the arm."""
        self.destroy_timer(self._clock_of_pictures)
        self.end_polling()
        self.destroy_publisher(self._pictures)

    def _draw(self) -> None:
        now = self.monotonic()
        joints = self._fresh(self._joints.take(now), now)
        self._newest_muscles = self._fresh(self._muscles.take(now) or self._newest_muscles, now)
        position = self._understood(self._read_joints, joints)
        if joints is None or position is None:
            return
        muscles = self._understood(self._read_muscles, self._newest_muscles)
        header = Header(stamp=joints.message.header.stamp, frame_id=self._values["frame_id"])
        self._pictures.publish(self._markers.draw(header, position.position, muscles))
        self._drawn += 1

    def _fresh(self, sample: Sample | None, now: float) -> Sample | None:
        if sample is None or now - sample.received > self._values["lifetime"]:
            return None
        return sample

    def _understood(self, read: Callable[[Any, float], Any], sample: Sample | None) -> Any:
        if sample is None:
            return None
        try:
            return read(sample.message, sample.received)
        except InvalidRequest as error:
            self._rejected.count(error)
            return None

    def diagnose(self) -> tuple[bytes, str, dict[str, object]]:
        """Report how much was drawn, and states that could not be."""
        if not self.is_active:
            return DiagnosticStatus.OK, "inactive", {}
        values: dict[str, object] = {"drawn": self._drawn, **self._rejected.counts}
        if self._rejected.last:
            return DiagnosticStatus.WARN, f"rejected: {self._rejected.last}", values
        return DiagnosticStatus.OK, "ok", values


def main() -> int:
    """Run the node."""
    return run(ShowArmNode)


if __name__ == "__main__":
    raise SystemExit(main())
