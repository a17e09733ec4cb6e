"""Pulls one muscle at a time through a running bridge."""

import time
from typing import Any

import numpy as np
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from fastswing_msgs.msg import CurrentCommand, MuscleState
from fastswing_planner.conversion.states import JointStateReader
from fastswing_planner.errors import NotReady, StaleState, UnknownName
from fastswing_planner.robot.description import Robot
from musashi_muscle_bridge.calibration import MuscleReading, Pull, PullSettings, length_offsets

_SPIN_SEC = 0.005
_FIRST_STATES_SEC = 10.0
_STALE_SEC = 0.5
_PULL_STALE_SEC = 0.1  # the bridge's own limits of a current hold meanwhile
_SETTLE_STATES = 20  # what waited while the person read is old


class Calibrator:
    """Pulls one muscle at a time by `current_command`, and reads the states."""

    def __init__(self, robot: Robot, settings: PullSettings) -> None:
        """Connect; rclpy must be running."""
        self._robot = robot
        self._settings = settings
        self._muscles: MuscleState | None = None
        self._posture: Any = None
        self._states, self._seen = 0, time.monotonic()
        self._node = Node("calibrate", start_parameter_services=False)
        self._reader = JointStateReader(robot.model.joint_names)
        self._commands = self._node.create_publisher(CurrentCommand, "current_command", 10)
        newest = QoSProfile(depth=1)
        self._node.create_subscription(MuscleState, "muscle_state", self._on_muscles, newest)
        self._node.create_subscription(
            JointState, "joint_states", self._on_joints, qos_profile_sensor_data
        )
        self._executor = EventsExecutor()
        self._executor.add_node(self._node)

    def _on_muscles(self, message: MuscleState) -> None:
        self._muscles = message
        self._states += 1
        self._seen = time.monotonic()

    def _on_joints(self, message: JointState) -> None:
        self._posture = self._reader.read(message, time.monotonic()).position

    def close(self) -> None:
        """Disconnect; without a stream the muscle holds."""
        self._node.destroy_node()

    def fresh(self, timeout: float = _STALE_SEC) -> MuscleState:
        """Return states that were measured just now.

        Raises StaleState if none come within `timeout` [s], NotReady for a fault, for muscles that
        do not hold a length by then, or if somebody else commands currents.
        """
        self._states, self._seen = 0, time.monotonic()
        begin = self._seen
        while (
            self._states < _SETTLE_STATES
            or self._posture is None
            or (self._not_held() and time.monotonic() < begin + timeout)
        ):
            self._executor.spin_once(timeout_sec=_SPIN_SEC)
            self._refuse_silence(timeout)
        assert self._muscles is not None
        if list(self._muscles.name) != list(self._robot.model.muscle_names):
            raise UnknownName("the bridge has other muscles: set --robot to its description")
        faulty = [
            name
            for name, fault in zip(self._muscles.name, self._muscles.fault, strict=True)
            if fault
        ]
        if faulty:
            raise NotReady(
                f"faulty muscles: {', '.join(faulty)}; find the cause, then clear_faults"
            )
        if loose := self._not_held():
            raise NotReady(
                f"muscles that do not hold a length: {', '.join(loose)}; end an emergency stop "
                "with clear_faults, or what else drives them; is the bridge read only?"
            )
        if self._node.count_publishers("current_command") > 1:
            raise NotReady("somebody else publishes current_command: end it first")
        return self._muscles

    def _not_held(self) -> list[str]:
        if self._muscles is None:
            return []
        modes = zip(self._muscles.name, self._muscles.mode, strict=True)
        return [name for name, mode in modes if mode != MuscleState.MODE_LENGTH]

    def _refuse_silence(self, timeout: float) -> None:
        silence = time.monotonic() - self._seen
        if silence > timeout:
            raise StaleState(
                f"no muscle_state for {silence:.1f} s: is the bridge active, do its boards answer?"
            )

    def offsets(self) -> dict[str, float]:
        """Return what to add to each muscle's length [m]; see `length_offsets`."""
        state = self.fresh(_FIRST_STATES_SEC)
        offsets = length_offsets(
            self._robot.model.lengths(self._posture),
            np.array(state.length),
            np.array(state.tension),
            self._robot.wire_stiffness,
        )
        return dict(zip(self._robot.model.muscle_names, offsets.tolist(), strict=True))

    def pull(self, name: str) -> Pull:
        """Pull one muscle; returns the finished pull. Raises as `fresh` does."""
        index = self._robot.model.muscle_names.index(name)
        before = _reading(self.fresh(), index)
        pull = Pull(self._settings, before, float(self._robot.current_limit[index]))
        current = pull.step(before)
        while current is not None:
            stamp = self._node.get_clock().now().to_msg()
            command = CurrentCommand(header=Header(stamp=stamp), name=[name], current=[current])
            self._commands.publish(command)
            self._executor.spin_once(timeout_sec=_SPIN_SEC)
            self._refuse_silence(_PULL_STALE_SEC)
            assert self._muscles is not None
            current = pull.step(_reading(self._muscles, index))
        return pull


def _reading(state: MuscleState, index: int) -> MuscleReading:
    return MuscleReading(
        time.monotonic(),
        state.length[index],
        state.tension[index],
        state.current[index],
        state.mode[index] == MuscleState.MODE_CURRENT,
        bool(any(state.fault)),
    )
