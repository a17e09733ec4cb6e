"""Writes recordings, arrays in memory, as the messages of a bag."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from builtin_interfaces.msg import Duration, Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Header, String

from fastswing_msgs.msg import (
    CurrentCommand,
    CurrentOverride,
    InhibitionStatus,
    LengthCommand,
    MuscleState,
    SwingPlan,
    SwingTrajectory,
    TensionCommand,
)
from fastswing_planner.analysis.recording import Recording
from fastswing_planner.bags.metadata import BagTopic
from fastswing_planner.bags.writer import BagWriter
from fastswing_planner.conversion.definitions import definition_text

METHOD_VALUES = {"basic": 0, "inhibit": 1, "elongate": 2, "hybrid": 3}
EPOCH_NS = 1_700_000_000 * 10**9
TYPES: dict[type, str] = {
    JointState: "sensor_msgs/msg/JointState",
    MuscleState: "fastswing_msgs/msg/MuscleState",
    LengthCommand: "fastswing_msgs/msg/LengthCommand",
    CurrentOverride: "fastswing_msgs/msg/CurrentOverride",
    InhibitionStatus: "fastswing_msgs/msg/InhibitionStatus",
    TensionCommand: "fastswing_msgs/msg/TensionCommand",
    CurrentCommand: "fastswing_msgs/msg/CurrentCommand",
    SwingPlan: "fastswing_msgs/msg/SwingPlan",
    DiagnosticArray: "diagnostic_msgs/msg/DiagnosticArray",
    String: "std_msgs/msg/String",
}


def stamp(seconds: float) -> Time:
    nanoseconds = EPOCH_NS + round(seconds * 1e9)
    return Time(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)


class BagOfSwings:
    """Writes recordings as messages into a bag, in the order of their times."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._rows: list[tuple[int, str, Any]] = []

    def add(self, topic: str, seconds: float, message: Any) -> None:
        self._rows.append((EPOCH_NS + round(seconds * 1e9), topic, message))

    def add_recording(self, recording: Recording, namespace: str = "") -> None:
        joints, muscles = recording.joints, recording.muscles
        for time, position, velocity in zip(
            joints.time.tolist(), joints.position, joints.velocity, strict=True
        ):
            message = JointState(header=Header(stamp=stamp(time)), name=list(joints.names))
            message.position, message.velocity = position.tolist(), velocity.tolist()
            self.add(f"{namespace}/joint_states", time + 0.001, message)
        if muscles is not None:
            for row, time in enumerate(muscles.time.tolist()):
                message = MuscleState(header=Header(stamp=stamp(time)), name=list(muscles.names))
                message.velocity = muscles.velocity[row].tolist()
                message.tension = muscles.tension[row].tolist()
                message.current = muscles.current[row].tolist()
                message.mode = muscles.mode[row].tolist()
                message.fault = muscles.fault[row].tolist()
                self.add(f"{namespace}/muscle_state", time + 0.001, message)
        self._add_commands(recording, namespace)
        self._add_decisions(recording, namespace)
        for plan in recording.plans:
            message = SwingPlan(method=METHOD_VALUES[plan.method], time_cost=plan.time_cost)
            message.joint_name, message.muscle_name = (
                list(plan.joint_names),
                list(plan.muscle_names),
            )
            message.start_position, message.end_position = plan.start.tolist(), plan.end.tolist()
            message.mask = plan.kept.astype(np.uint8).tolist()
            message.inhibited = plan.inhibited.astype(np.uint8).tolist()
            message.elongation = plan.elongation.tolist()
            message.speed_index = plan.speed_index.tolist()
            message.trajectory = SwingTrajectory(
                time_from_start=plan.time.tolist(),
                joint_velocity=plan.joint_velocity.ravel().tolist(),
                muscle_velocity=plan.muscle_velocity.ravel().tolist(),
            )
            self.add(f"{namespace}/swing_plan", plan.received, message)

    def _add_commands(self, recording: Recording, namespace: str) -> None:
        if recording.commands is None:
            return
        length = 0.3
        for time, step in zip(
            [0.5, *recording.commands.time.tolist()],
            [0.0, *recording.commands.step.tolist()],
            strict=True,
        ):
            length += step
            message = LengthCommand(header=Header(stamp=stamp(time)), name=["#1", "#9"])
            message.length = [0.2, length]
            self.add(f"{namespace}/length_command", time + 0.001, message)

    def _add_decisions(self, recording: Recording, namespace: str) -> None:
        overrides, status = recording.overrides, recording.status
        if overrides is not None:
            for row, names in enumerate(overrides.muscles):
                lease = Duration(nanosec=round(overrides.lease[row] * 1e9))
                header = Header(stamp=stamp(overrides.stamp[row]))
                message = CurrentOverride(header=header, name=list(names), lease=lease)
                self.add(f"{namespace}/current_override", float(overrides.received[row]), message)
        if status is not None:
            for row, time in enumerate(status.time.tolist()):
                message = InhibitionStatus(armed=bool(status.armed[row]))
                message.rejected = int(status.rejected[row])
                message.reason_text = status.reason[row]
                self.add(f"{namespace}/inhibition_status", time, message)

    def delay_recording(self, seconds: float) -> None:
        """Let the recorder's clock be ahead of the clock of the stamps."""
        delay_ns = round(seconds * 1e9)
        self._rows = [(time + delay_ns, topic, message) for time, topic, message in self._rows]

    def add_rejections(self, seconds: float, count: int) -> None:
        status = DiagnosticStatus(name="bridge")
        status.values = [KeyValue(key="rejected_not_finite", value=str(count))]
        self.add("/diagnostics", seconds, DiagnosticArray(status=[status]))

    def messages(self, kinds: tuple[type, ...]) -> Iterator[Any]:
        """Yield the messages of some types, to be changed before they are written."""
        return (message for _, _, message in self._rows if isinstance(message, kinds))

    def write(self) -> Path:
        bag = BagWriter(self.path)
        for time_ns, topic, message in sorted(self._rows, key=lambda row: row[0]):
            if topic not in bag.topics:
                kind = TYPES[type(message)]
                bag.add_topic(BagTopic(topic, kind, definition_text(kind)))
            bag.write(topic, bytes(serialize_message(message)), time_ns, time_ns)
        bag.close()
        return self.path
