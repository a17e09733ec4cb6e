"""The robot as a node: commands in, muscle and joint states out."""

import secrets
import sys
import threading
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from fastswing_msgs.msg import (
    CurrentCommand,
    CurrentOverride,
    LengthCommand,
    MuscleState,
    TensionCommand,
)
from fastswing_planner.managed_node import ROBOT_DESCRIPTION, ManagedNode, run
from fastswing_planner.parameters import Parameter
from fastswing_planner.robot import load_robot
from fastswing_planner.robot_path import resolve_path
from musashi_muscle_bridge.bus import open_bus
from musashi_muscle_bridge.bus_parameters import BUS_URL
from musashi_muscle_bridge.commands import check_stamp, checked_index, checked_values
from musashi_muscle_bridge.control import ControlPeriod, command_limits
from musashi_muscle_bridge.control_loop import ControlLoop
from musashi_muscle_bridge.errors import CommandRejected
from musashi_muscle_bridge.protocol import Fault, Mode, StateFrame, WatchdogAction

_SWITCH_INTERVAL_SEC = 5e-5
_COMMANDS = {
    Mode.LENGTH: (LengthCommand, "length_command", "length"),
    Mode.TENSION: (TensionCommand, "tension_command", "tension"),
    Mode.CURRENT: (CurrentCommand, "current_command", "current"),
}
_OVERRIDE = "current_override"
_FAULT_NAMES = {fault.value: fault.name.lower() for fault in Fault}

TABLE = (
    ROBOT_DESCRIPTION,
    BUS_URL,
    Parameter("control_rate", 500.0, "Frames to the boards.", "Hz", 10.0, 2000.0),
    Parameter(
        "watchdog_action",
        "zero_current",
        "What the boards do when frames stop. zero_current: the arm falls, nothing pulls; "
        "hold_length: a raised arm stays up, and so does the force on whatever it presses.",
        choices=("zero_current", "hold_length"),
    ),
    Parameter("watchdog_timeout", 0.1, "Time without frames until they do.", "s", 0.01, 10.0),
    Parameter(
        "command_timeout",
        0.1,
        "Time without a tension or current command until the muscle holds its measured length.",
        "s",
        0.005,
        10.0,
    ),
    Parameter("command_max_age", 0.5, "Older commands are rejected.", "s", 0.01, 10.0),
    Parameter("max_lease", 0.2, "Longest lease of a current override.", "s", 0.005, 1.0),
    Parameter(
        "payout_allowance",
        0.2,
        "Length commands may exceed the longest path by this.",
        "m",
        0.0,
        1.0,
    ),
)


class BridgeNode(ManagedNode):
    """Publishes state once per reply of the boards; commands them once per period."""

    def __init__(self) -> None:
        """Declare parameters."""
        super().__init__("bridge", TABLE)
        self._rejected: dict[str, int] = {}
        self._last_rejection = ""
        self._faults: tuple[str, ...] = ()
        self._refused = 0
        self._holds = 0  # so that a running swing notices that somebody holds the arm
        self._emergency_latched = False  # over a deactivation

    def configure(self, parameters: Mapping[str, Any]) -> None:
        """Load the robot; nothing is energised."""
        self._robot = load_robot(resolve_path(parameters["robot_description"]))
        self._values = parameters
        self._names = self._robot.model.muscle_names

    def activate(self) -> None:
        """Open the bus, hold the measured lengths, listen to commands."""
        # The control thread must not wait 5 ms for the GIL while a callback computes.
        sys.setswitchinterval(_SWITCH_INTERVAL_SEC)
        parameters = self._values
        limits = command_limits(
            self._robot,
            parameters["command_timeout"],
            parameters["max_lease"],
            parameters["payout_allowance"],
        )
        self._control = ControlPeriod(
            self._robot,
            limits,
            WatchdogAction[parameters["watchdog_action"].upper()],
            parameters["watchdog_timeout"],
            session=secrets.randbits(32),
        )
        if self._emergency_latched:
            self._control.arbiter.emergency_stop()
        bus = open_bus(parameters["bus_url"])
        newest = QoSProfile(depth=1)
        self._muscle_state = self.create_publisher(MuscleState, "muscle_state", newest)
        self._joint_state = self.create_publisher(JointState, "joint_states", newest)
        self._lock = threading.Lock()
        self._connect()
        self._loop = ControlLoop(
            bus, self._control, self._lock, parameters["control_rate"], self._publish
        )
        self._loop.start()

    def _connect(self) -> None:
        self._inputs = [
            self.create_subscription(
                kind, topic, self.guarded(self._taker(topic, self._command(mode, field))), 10
            )
            for mode, (kind, topic, field) in _COMMANDS.items()
        ]
        self._inputs.append(
            self.create_subscription(
                CurrentOverride,
                _OVERRIDE,
                self.guarded(self._taker(_OVERRIDE, self._override)),
                QoSProfile(depth=1),
            )
        )
        self._triggers = [
            self.create_service(Trigger, name, self.guarded(self._answer(action, text)))
            for name, action, text in (
                ("emergency_stop", self._emergency_stop, "all muscles at zero current"),
                ("clear_faults", self._clear_faults, "faults cleared, holding measured lengths"),
                ("hold_posture", self._hold, "holding measured lengths"),
            )
        ]

    def deactivate(self) -> None:
        """Stop sending frames: the boards' watchdog acts."""
        self._loop.stop()
        self._emergency_latched = self._control.arbiter.emergency
        for subscription in self._inputs:
            self.destroy_subscription(subscription)
        for service in self._triggers:
            self.destroy_service(service)
        self.destroy_publisher(self._muscle_state)
        self.destroy_publisher(self._joint_state)

    # Commands.

    def _taker(self, topic: str, take: Callable[[Any], None]) -> Callable[[Any], None]:
        def on_message(message: Any) -> None:
            stamp = message.header.stamp
            try:
                check_stamp(
                    stamp.sec * 1_000_000_000 + stamp.nanosec,
                    self.get_clock().now().nanoseconds,
                    self._values["command_max_age"],
                )
                take(message)
            except CommandRejected as error:
                key = f"rejected_{topic}_{error.reason}"
                self._rejected[key] = self._rejected.get(key, 0) + 1
                self._last_rejection = f"{topic}: {error}"
                self.get_logger().warning(f"rejected {topic}: {error}", throttle_duration_sec=1.0)

        return on_message

    def _command(self, mode: Mode, field: str) -> Callable[[Any], None]:
        def take(message: Any) -> None:
            index = checked_index(message.name, self._names)
            values = checked_values(message.name, getattr(message, field))
            with self._lock:
                self._control.arbiter.command(mode, index, values, self.monotonic())

        return take

    def _override(self, message: CurrentOverride) -> None:
        index = checked_index(message.name, self._names)
        lease = message.lease.sec + message.lease.nanosec * 1e-9
        with self._lock:
            self._control.arbiter.override(index, lease, self.monotonic())

    def _answer(
        self, action: Callable[[], None], text: str
    ) -> Callable[[Trigger.Request, Trigger.Response], Trigger.Response]:
        def serve(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            with self._lock:
                action()
            self.get_logger().warning(text)
            response.success = True
            response.message = text
            return response

        return serve

    def _emergency_stop(self) -> None:
        self._control.arbiter.emergency_stop()

    def _clear_faults(self) -> None:
        self._control.clear_faults()
        self._holds += 1

    def _hold(self) -> None:
        self._control.arbiter.hold()
        self._holds += 1

    # States.

    def _publish(self, state: StateFrame) -> None:
        header = Header(stamp=self.get_clock().now().to_msg())
        rows, joints = state.rows, state.joints
        self._faults = tuple(
            f"{name} {_FAULT_NAMES.get(int(fault), f'fault {fault}')}"
            for name, fault in zip(self._names, rows["fault"], strict=True)
            if fault
        )
        self._refused = int(rows["refused"].max(initial=0))
        self._muscle_state.publish(
            MuscleState(
                header=header,
                name=self._names,
                length=rows["length"].tolist(),
                velocity=rows["velocity"].tolist(),
                tension=rows["tension"].tolist(),
                current=rows["current"].tolist(),
                temperature=rows["temperature"].tolist(),
                mode=rows["mode"].tolist(),
                fault=rows["fault"].tolist(),
                holds=self._holds,
            )
        )
        self._joint_state.publish(
            JointState(
                header=header,
                name=self._robot.model.joint_names,
                position=joints["position"].tolist(),
                velocity=joints["velocity"].tolist(),
            )
        )

    # Diagnostics.

    def diagnose(self) -> tuple[bytes, str, dict[str, object]]:
        """Report bus, timing, overrides, rejections, faults and foreign writers."""
        if not self.is_active:
            return DiagnosticStatus.OK, "inactive", {}
        with self._lock:
            arbiter = self._control.arbiter
            overridden = np.flatnonzero(arbiter.overridden(self.monotonic()))
            latched = ", ".join(self._names[index] for index in np.flatnonzero(arbiter.latched))
            rebooted = ", ".join(
                self._names[index] for index in np.flatnonzero(self._control.rebooted)
            )
            values: dict[str, object] = {
                "emergency_stop": arbiter.emergency,
                "overridden": ", ".join(self._names[index] for index in overridden),
                "clamped": arbiter.clamped,
                "faults": ", ".join(self._faults),
                "rebooted": rebooted,
                "refused_by_boards": self._refused,
            }
        values |= self._loop.statistics() | self._rejected
        topics = [topic for _, topic, _ in _COMMANDS.values()] + [_OVERRIDE]
        doubled = [topic for topic in topics if self.count_publishers(topic) > 1]
        problems = [
            (not self._loop.alive, DiagnosticStatus.ERROR, "the control thread died, see the log"),
            (
                rebooted,
                DiagnosticStatus.ERROR,
                f"boards started again, at zero current until clear_faults: {rebooted}",
            ),
            (latched, DiagnosticStatus.ERROR, f"latched until clear_faults: {latched}"),
            (self._faults, DiagnosticStatus.ERROR, f"faults: {', '.join(self._faults)}"),
            (arbiter.emergency, DiagnosticStatus.ERROR, "emergency stop, see clear_faults"),
            (self._loop.misses_in_a_row, DiagnosticStatus.ERROR, "the boards do not answer"),
            (doubled, DiagnosticStatus.ERROR, f"two publishers on {', '.join(doubled)}"),
            (self._last_rejection, DiagnosticStatus.WARN, f"rejected {self._last_rejection}"),
        ]
        for problem, level, text in problems:
            if problem:
                return level, text, values
        return DiagnosticStatus.OK, "ok", values


def main() -> int:
    """Run the node."""
    return run(BridgeNode)
