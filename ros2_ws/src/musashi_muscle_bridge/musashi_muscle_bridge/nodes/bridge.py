"""The robot as a node: commands in, muscle and joint states out."""

import secrets
import sys
import time
from collections.abc import Callable, Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.clock import Clock
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from fastswing_msgs.msg import (
    CurrentCommand,
    CurrentOverride,
    LengthCommand,
    MuscleState,
    TensionCommand,
)
from fastswing_planner.cdr.stamps import Stamp, from_ns
from fastswing_planner.lifecycle.managed_node import ManagedNode
from fastswing_planner.lifecycle.real_time import CoreSleep
from fastswing_planner.lifecycle.running import run
from fastswing_planner.robot.description import load_robot
from musashi_muscle_bridge.buses.bus import group_urls
from musashi_muscle_bridge.buses.protocol import WatchdogAction
from musashi_muscle_bridge.control.command_intake import (
    COMMAND_TOPICS,
    OVERRIDE,
    CommandIntake,
    CommandTally,
)
from musashi_muscle_bridge.control.command_limits import command_limits
from musashi_muscle_bridge.control.loop import Measurement
from musashi_muscle_bridge.control.orders import (
    ClearFaults,
    EmergencyStop,
    Heartbeat,
    Hold,
    Order,
)
from musashi_muscle_bridge.control.period import ControlPeriod
from musashi_muscle_bridge.control.process import ControlProcess, LoopTask
from musashi_muscle_bridge.errors import CommandRejected
from musashi_muscle_bridge.nodes.bridge_diagnosis import BridgeCondition, BridgeDiagnosis
from musashi_muscle_bridge.nodes.bridge_parameters import TABLE, refuse_short_watchdog
from musashi_muscle_bridge.nodes.state_messages import StateMessages

_TYPES = {
    "length_command": LengthCommand,
    "tension_command": TensionCommand,
    "current_command": CurrentCommand,
    OVERRIDE: CurrentOverride,
}
# The next one comes before a lost one could be repeated, and sooner without the middleware's
# answers; the inhibitor says more than once that it lets no muscle go any more.
_NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
_DEAD = "the control process died, see the log: nothing is sent, the boards' watchdog acts"
_SWITCH_INTERVAL_SEC = 1e-4
_CLOCK_READINGS, _CLOCK_READING_NS = 5, 50_000
_HEARTBEATS = 10
"""In the time after which the control process stops without one."""


class BridgeNode(ManagedNode):
    """Publishes state once per reply of the boards; commands them once per period."""

    def __init__(self) -> None:
        """Declare parameters."""
        super().__init__("bridge", TABLE)
        self._tally = CommandTally()
        self._measured: Measurement | None = None  # the newest
        self._holds = 0  # so that a running swing notices that somebody holds the arm
        self._emergency_latched = False  # over a deactivation
        self._inputs: list[Any] = []
        self._triggers: list[Any] = []

    def configure(self, parameters: Mapping[str, Any]) -> None:
        """Load the robot; nothing is energised."""
        self._robot = load_robot(parameters["robot_description"])
        self._values = parameters
        self._names = self._robot.model.muscle_names
        self._urls = group_urls(parameters["bus_url"], len(self._robot.board_groups))
        self._intake = CommandIntake(
            self._names,
            parameters["command_max_age"],
            parameters["command_timeout"],
            parameters["max_lease"],
        )
        self._diagnosis = BridgeDiagnosis(self._names, self._urls, parameters["read_only"])
        self._core_sleep = CoreSleep(parameters["prevent_core_sleep"])
        if not parameters["read_only"]:
            refuse_short_watchdog(parameters["watchdog_timeout"], parameters["control_rate"])

    def activate(self) -> None:
        """Open the bus, hold the measured lengths, listen to commands."""
        parameters = self._values
        control = self._control()
        self._messages = StateMessages(self._names, self._robot.model.joint_names)
        newest = QoSProfile(depth=1)
        self._muscle_state = self.create_publisher(MuscleState, "muscle_state", newest)
        self._joint_state = self.create_publisher(JointState, "joint_states", newest)
        # Commands must not wait 5 ms for the interpreter while a state is published.
        sys.setswitchinterval(_SWITCH_INTERVAL_SEC)
        timeout = parameters["supervision_timeout"]
        task = LoopTask(control, self._urls, parameters["control_rate"], timeout)
        self._inputs, self._triggers = [], []
        try:
            self._loop = ControlProcess(
                task,
                self._publish,
                self.get_logger().error,
                lambda: not self.asked_to_end(),
            )
        except BaseException:
            self._disconnect()
            raise
        self._heart = self.create_steady_timer(timeout / _HEARTBEATS, self._beat)
        if refusal := self._core_sleep.prevent():
            self.tell_refusal(refusal)
        if not parameters["read_only"]:
            self._connect()

    def _control(self) -> ControlPeriod:
        parameters = self._values
        control = ControlPeriod(
            self._robot,
            command_limits(
                self._robot,
                parameters["command_timeout"],
                parameters["max_lease"],
                parameters["payout_allowance"],
            ),
            WatchdogAction[parameters["watchdog_action"].upper()],
            parameters["watchdog_timeout"],
            session=secrets.randbits(32),
            read_only=parameters["read_only"],
        )
        if self._emergency_latched:
            control.arbiter.emergency_stop()
        return control

    def _connect(self) -> None:
        self._inputs = [self._listen(topic, kind) for topic, kind in _TYPES.items()]
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
        self._core_sleep.allow()
        self.destroy_timer(self._heart)
        self._loop.stop()
        self._disconnect()

    def _disconnect(self) -> None:
        for subscription in self._inputs:
            self.destroy_subscription(subscription)
        for service in self._triggers:
            self.destroy_service(service)
        self.destroy_publisher(self._muscle_state)
        self.destroy_publisher(self._joint_state)

    def _beat(self) -> None:
        if self._measured is not None and (news := self._diagnosis.fault_news(self._measured)):
            self.get_logger().error(news)
        if self._emergency_latched and not self._loop.status.report.emergency:
            self._loop.order(EmergencyStop())  # until it is known to be obeyed
        elif self._loop.answers:
            self._loop.order(Heartbeat())

    # Commands.

    def _listen(self, topic: str, kind: Any) -> Any:
        qos = _NEWEST if topic == OVERRIDE else QoSProfile(depth=10)
        take = self.guarded(lambda message: self._take(topic, message))
        return self.create_subscription(kind, topic, take, qos)

    def _take(self, topic: str, message: Any) -> None:
        """Send what a message asks for to the control process."""
        now, clock_ns = self.monotonic(), self.get_clock().now().nanoseconds
        try:
            if not self._loop.order(self._intake.order(topic, message, now, clock_ns)):
                raise CommandRejected("lost", "the control process takes no orders")
        except CommandRejected as error:
            self._tally.reject(topic, error)
            self.get_logger().warning(f"rejected {topic}: {error}", throttle_duration_sec=1.0)
            return
        if self._contested(topic):
            # Whose it is, rclpy's executor does not tell.
            self._tally.contest(topic)

    def _contested(self, topic: str) -> bool:
        return int(self.count_publishers(topic)) > 1

    def _answer(
        self, action: Callable[[], str], text: str
    ) -> Callable[[Trigger.Request, Trigger.Response], Trigger.Response]:
        def serve(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            failure = action()
            response.success, response.message = not failure, failure or text
            self.get_logger().warning(response.message)
            return response

        return serve

    # What the services do; each returns why it did not, or nothing.

    def _emergency_stop(self) -> str:
        self._emergency_latched = True
        stops = self._loop.order(EmergencyStop()) and self._loop.answers
        return "" if stops else self._failure()

    def _clear_faults(self) -> str:
        failure = self._give(ClearFaults(self.monotonic()))
        self._emergency_latched &= bool(failure)
        return failure

    def _hold(self) -> str:
        failure = self._give(Hold(self.monotonic()))
        if not failure and self._emergency_latched:
            return "emergency stop: no muscle holds anything until clear_faults"
        return failure

    def _give(self, order: Order) -> str:
        """Send an order that must not come late, if the control process goes on."""
        if not self._loop.answers or not self._loop.order(order):
            return self._failure()
        self._holds += 1
        return ""

    def _failure(self) -> str:
        if self._loop.alive:
            return f"the control process stands still for {self._loop.silence:.1f} s"
        return _DEAD

    # States.

    def _publish(self, measured: Measurement) -> None:
        self._measured = measured
        stamp = stamp_at(self.get_clock(), measured.received)
        # What is not measured now is not told: whoever needs it notices its age. Joints first: the
        # inhibitor waits for them.
        if measured.joints_fresh:
            self._joint_state.publish(self._messages.joint_state(stamp, measured))
        self._muscle_state.publish(self._messages.muscle_state(stamp, measured, self._holds))

    # Diagnostics.

    def diagnose(self) -> tuple[bytes, str, dict[str, object]]:
        """Report bus, timing, overrides, rejections, faults and foreign writers."""
        if not self.is_active:
            if self._emergency_latched:
                return DiagnosticStatus.WARN, "inactive; emergency stop until clear_faults", {}
            return DiagnosticStatus.OK, "inactive", {}
        status = self._loop.status
        news, good = self._diagnosis.silence_news(status.silent, self.monotonic())
        # On two lines: rclpy refuses another severity from the same one.
        if news and good:
            self.get_logger().info(news)
        elif news:
            self.get_logger().error(news)
        return self._diagnosis.report(
            BridgeCondition(
                status,
                "" if self._loop.answers else self._failure(),
                self._loop.unpublished,
                self._loop.failures,
                self._measured,
                [topic for topic in COMMAND_TOPICS if self._contested(topic)],
                self._tally,
            )
        )


def stamp_at(clock: Clock, received: float) -> Stamp:
    """Return a clock's time at the monotonic time `received` [s]."""
    for _ in range(_CLOCK_READINGS):
        now, monotonic = clock.now().nanoseconds, time.monotonic()
        # Somebody else may have computed between the two: read them again.
        if abs(now - clock.now().nanoseconds) < _CLOCK_READING_NS:
            break
    # A simulated clock may not have begun yet.
    return from_ns(max(now - round((monotonic - received) * 1e9), 0))


def main() -> int:
    """Run the node."""
    return run(BridgeNode)
