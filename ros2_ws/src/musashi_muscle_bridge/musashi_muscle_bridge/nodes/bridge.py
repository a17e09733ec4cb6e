"""The robot as a node: commands in, muscle and joint states out."""

import secrets
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from numpy.typing import NDArray
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
from fastswing_planner.lifecycle.managed_node import ManagedNode
from fastswing_planner.lifecycle.real_time import CoreSleep
from fastswing_planner.lifecycle.running import run
from fastswing_planner.robot.description import load_robot
from musashi_muscle_bridge.buses.bus import group_urls
from musashi_muscle_bridge.buses.protocol import Fault, Mode, WatchdogAction
from musashi_muscle_bridge.control.command_checks import (
    check_lease,
    check_stream,
    checked_age,
    checked_index,
    checked_values,
)
from musashi_muscle_bridge.control.command_limits import command_limits
from musashi_muscle_bridge.control.loop import Measurement
from musashi_muscle_bridge.control.orders import (
    ClearFaults,
    Command,
    EmergencyStop,
    Heartbeat,
    Hold,
    Order,
    Override,
)
from musashi_muscle_bridge.control.period import ControlPeriod, slack
from musashi_muscle_bridge.control.process import ControlProcess, LoopTask
from musashi_muscle_bridge.errors import CommandRejected
from musashi_muscle_bridge.nodes.bridge_parameters import TABLE, refuse_short_watchdog
from musashi_muscle_bridge.nodes.state_messages import (
    OrdinaryStates,
    RawStates,
    Stamp,
    reported_faults,
)

_COMMANDS = {
    Mode.LENGTH: (LengthCommand, "length_command", "length"),
    Mode.TENSION: (TensionCommand, "tension_command", "tension"),
    Mode.CURRENT: (CurrentCommand, "current_command", "current"),
}
_OVERRIDE = "current_override"
# The next one comes before a lost one could be repeated, and sooner without the middleware's
# answers; the inhibitor says more than once that it lets no muscle go any more.
_NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
_DEAD = "the control process died, see the log: nothing is sent, the boards' watchdog acts"
_SWITCH_INTERVAL_SEC = 1e-4
# Longer than the control process takes to start on a busy machine.
_LASTING_SILENCE_SEC = 3.0
_CLOCK_READINGS, _CLOCK_READING_NS = 5, 50_000
_FAULTS = "faults, latched until clear_faults: {}"
_HEARTBEATS = 10
"""In the time after which the control process stops without one."""
_FAULT_NAMES = {fault.value: fault.name.lower() for fault in Fault}


class BridgeNode(ManagedNode):
    """Publishes state once per reply of the boards; commands them once per period."""

    def __init__(self) -> None:
        """Declare parameters."""
        super().__init__("bridge", TABLE)
        self._counts: dict[str, int] = {}  # of commands, by what was wrong with them
        self._last_rejection = ""
        self._measured: Measurement | None = None  # the newest
        self._logged_faults = ""
        self._silent_since: dict[int, float] = {}
        self._logged_silent: tuple[int, ...] = ()
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
        self._core_sleep = CoreSleep(parameters["prevent_core_sleep"])
        if not parameters["read_only"]:
            refuse_short_watchdog(parameters["watchdog_timeout"], parameters["control_rate"])

    def activate(self) -> None:
        """Open the bus, hold the measured lengths, listen to commands."""
        parameters = self._values
        limits = command_limits(
            self._robot,
            parameters["command_timeout"],
            parameters["max_lease"],
            parameters["payout_allowance"],
        )
        control = ControlPeriod(
            self._robot,
            limits,
            WatchdogAction[parameters["watchdog_action"].upper()],
            parameters["watchdog_timeout"],
            session=secrets.randbits(32),
            read_only=parameters["read_only"],
        )
        if self._emergency_latched:
            control.arbiter.emergency_stop()
        messages = RawStates if parameters["raw_messages"] else OrdinaryStates
        self._messages = messages(self._names, self._robot.model.joint_names)
        newest = QoSProfile(depth=1)
        self._muscle_state = self.create_publisher(MuscleState, "muscle_state", newest)
        self._joint_state = self.create_publisher(JointState, "joint_states", newest)
        # Commands must not wait 5 ms for the interpreter while a state is published.
        sys.setswitchinterval(_SWITCH_INTERVAL_SEC)
        patience = parameters["supervision_timeout"]
        task = LoopTask(control, self._urls, parameters["control_rate"], patience)
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
        self._heart = self.create_steady_timer(patience / _HEARTBEATS, self._beat)
        if refusal := self._core_sleep.prevent():
            self.tell_refusal(refusal)
        if not parameters["read_only"]:
            self._connect()

    def _connect(self) -> None:
        self._inputs = [
            self._listen(kind, topic, self._command(mode, field), QoSProfile(depth=10))
            for mode, (kind, topic, field) in _COMMANDS.items()
        ]
        self._inputs.append(self._listen(CurrentOverride, _OVERRIDE, self._override, _NEWEST))
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
        if self._measured is not None:
            self._log_new_faults(self._measured)
        if self._emergency_latched and not self._loop.status.report.emergency:
            self._loop.order(EmergencyStop())  # until it is known to be obeyed
        elif self._loop.answers:
            self._loop.order(Heartbeat())

    # Commands.

    def _listen(
        self, kind: Any, topic: str, take: Callable[[Any, float], None], qos: QoSProfile
    ) -> Any:
        return self.create_subscription(kind, topic, self.guarded(self._taker(topic, take)), qos)

    def _taker(self, topic: str, take: Callable[[Any, float], None]) -> Callable[[Any], None]:
        """Return a callback of messages that `take` sends to the control process.

        `take` gets each with the monotonic time [s] when it was made: one that waited while this
        node stood still gets no longer lease, and no longer stream, by that.
        """

        def on_message(message: Any) -> None:
            stamp = message.header.stamp
            try:
                age = checked_age(
                    stamp.sec * 1_000_000_000 + stamp.nanosec,
                    self.get_clock().now().nanoseconds,
                    self._values["command_max_age"],
                )
                take(message, self.monotonic() - age)
            except CommandRejected as error:
                self._count(f"rejected_{topic}_{error.reason}")
                self._last_rejection = f"{topic}: {error}"
                self.get_logger().warning(f"rejected {topic}: {error}", throttle_duration_sec=1.0)
                return
            if self.count_publishers(topic) > 1:
                # Whose it is, rclpy's executor does not tell.
                self._count(f"contested_{topic}")

        return on_message

    def _count(self, key: str) -> None:
        self._counts[key] = self._counts.get(key, 0) + 1

    def _command(self, mode: Mode, field: str) -> Callable[[Any, float], None]:
        def take(message: Any, made: float) -> None:
            index = checked_index(message.name, self._names)
            values = checked_values(message.name, getattr(message, field))
            if mode is not Mode.LENGTH:
                check_stream(self.monotonic() - made, self._values["command_timeout"])
            self._order(Command(mode, index, values, made))

        return take

    def _override(self, message: CurrentOverride, made: float) -> None:
        index = checked_index(message.name, self._names)
        lease = message.lease.sec + message.lease.nanosec * 1e-9
        if index:
            check_lease(lease, self._values["max_lease"], self.monotonic() - made)
        self._order(Override(index, lease, made))

    def _order(self, order: Order) -> None:
        if not self._loop.order(order):
            raise CommandRejected("lost", "the control process takes no orders")

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
        stamp = self._stamp(measured.received)
        # What is not measured now is not told: whoever needs it notices its age. Joints first: the
        # inhibitor waits for them.
        if measured.joints_fresh:
            self._joint_state.publish(self._messages.joint_state(stamp, measured))
        self._muscle_state.publish(self._messages.muscle_state(stamp, measured, self._holds))

    def _stamp(self, received: float) -> Stamp:
        """Return the node's time at the monotonic time `received` [s]."""
        clock = self.get_clock()
        for _ in range(_CLOCK_READINGS):
            now, monotonic = clock.now().nanoseconds, time.monotonic()
            # Somebody else may have computed between the two: read them again.
            if abs(now - clock.now().nanoseconds) < _CLOCK_READING_NS:
                break
        # A simulated clock may not have begun yet.
        made = max(now - round((monotonic - received) * 1e9), 0)
        return Stamp(*divmod(made, 1_000_000_000))

    # Diagnostics.

    def diagnose(self) -> tuple[bytes, str, dict[str, object]]:
        """Report bus, timing, overrides, rejections, faults and foreign writers."""
        if not self.is_active:
            if self._emergency_latched:
                return DiagnosticStatus.WARN, "inactive; emergency stop until clear_faults", {}
            return DiagnosticStatus.OK, "inactive", {}
        status = self._loop.status
        self._log_silence(status.silent)
        report = status.report
        values: dict[str, object] = {
            "read_only": self._values["read_only"],
            "emergency_stop": report.emergency,
            "overridden": self._named(report.overridden),
            "clamped": report.clamped,
            "outdated": report.outdated,
            "latched": self._named(report.latched),
            "rebooted": self._named(report.rebooted),
            "lost": self._named(report.lost),
            **self._told_by_boards(),
        }
        values |= status.statistics
        values["unpublished_states"] = self._loop.unpublished
        values |= self._counts
        for problem, level, text in self._problems(values):
            if problem:
                return level, text, values
        return DiagnosticStatus.OK, "read only" if self._values["read_only"] else "ok", values

    def _told_by_boards(self) -> dict[str, object]:
        measured = self._measured
        if measured is None:
            return {"faults": "", "slack": "", "refused_by_boards": 0}
        return {
            "faults": self._fault_text(measured),
            "slack": self._named(slack(measured.state)),
            "refused_by_boards": int(measured.state.rows["refused"].max(initial=0)),
        }

    def _fault_text(self, measured: Measurement) -> str:
        return ", ".join(
            f"{name} {_FAULT_NAMES.get(number, f'fault {number}')}"
            for name, number in zip(self._names, reported_faults(measured).tolist(), strict=True)
            if number
        )

    def _log_new_faults(self, measured: Measurement) -> None:
        text = self._fault_text(measured)
        if text and text != self._logged_faults:
            self.get_logger().error(_FAULTS.format(text))
        self._logged_faults = text

    def _log_silence(self, silent: tuple[int, ...]) -> None:
        """Log buses that stay silent, and when all answer again; short pauses are no news."""
        now = time.monotonic()
        self._silent_since = {bus: self._silent_since.get(bus, now) for bus in silent}
        lasting = tuple(
            bus for bus, since in self._silent_since.items() if now - since > _LASTING_SILENCE_SEC
        )
        if set(lasting) - set(self._logged_silent):
            urls = ", ".join(self._urls[bus] for bus in lasting)
            self.get_logger().error(f"the boards do not answer on {urls}")
            self._logged_silent = lasting
        elif self._logged_silent and not silent:
            self.get_logger().info("the boards answer again")
            self._logged_silent = ()

    def _problems(self, values: Mapping[str, object]) -> Iterator[tuple[object, bytes, str]]:
        """Yield what can be wrong, the worst first: whether it is, its level and its text."""
        topics = [topic for _, topic, _ in _COMMANDS.values()] + [_OVERRIDE]
        doubled = [topic for topic in topics if self.count_publishers(topic) > 1]
        silent = self._loop.status.silent
        where = f" on {', '.join(self._urls[n] for n in silent)}" if len(self._urls) > 1 else ""
        error = DiagnosticStatus.ERROR
        yield not self._loop.answers, error, self._failure()
        # What they latch meanwhile follows from it.
        yield silent, error, f"the boards do not answer{where}"
        for key, text in (
            ("rebooted", "boards started again, at zero current until clear_faults: {}"),
            ("faults", _FAULTS),
            ("latched", "latched until clear_faults: {}"),
            ("emergency_stop", "emergency stop, see clear_faults"),
        ):
            yield values[key], error, text.format(values[key])
        yield self._loop.failures, error, "states cannot be published, see the log"
        yield doubled, error, f"two publishers on {', '.join(doubled)}"
        slack_muscles = values["slack"]
        yield slack_muscles, DiagnosticStatus.WARN, f"slack in tension mode: {slack_muscles}"
        yield self._last_rejection, DiagnosticStatus.WARN, f"rejected {self._last_rejection}"

    def _named(self, chosen: NDArray[np.bool_]) -> str:
        return ", ".join(self._names[index] for index in np.flatnonzero(chosen))


def main() -> int:
    """Run the node."""
    return run(BridgeNode)
