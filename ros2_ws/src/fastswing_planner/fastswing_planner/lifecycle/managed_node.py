"""The frame of every node: parameter table, lifecycle with autostart, diagnostics, clean end."""

import os
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from difflib import get_close_matches
from typing import Any

import rclpy
from builtin_interfaces.msg import Time as Stamp
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy._rclpy_pybind11 import RCLError
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode, State, TransitionCallbackReturn
from rclpy.parameter import Parameter as RosParameter

from fastswing_planner.cdr.stamps import age_sec, from_ns, to_ns
from fastswing_planner.errors import InvalidParameter, PlannerError
from fastswing_planner.lifecycle.common_parameters import AUTOSTART, EVERY_NODE
from fastswing_planner.lifecycle.parameters import Parameter, check_all
from fastswing_planner.lifecycle.real_time import (
    ask_for_real_time,
    keep_what_there_is,
)

# Nodes draw nothing, and MuJoCo's window library costs a quarter of their start.
os.environ.setdefault("MUJOCO_GL", "disable")
_NEARLY = 0.8  # of difflib's similarity; parameters of different nodes are below
_DIAGNOSTICS_PERIOD_SEC = 1.0


class ManagedNode(LifecycleNode):
    """A lifecycle node that declares its table, reports diagnostics and survives its errors.

    asked_to_end  tells whether SIGINT or SIGTERM came

    Subclasses fill in `configure`, `activate`, `deactivate`, `cleanup` and `diagnose`. What
    `configure` creates is destroyed in `cleanup`.
    """

    def __init__(self, name: str, table: Sequence[Parameter]) -> None:
        """Declare `table`.

        Raises InvalidParameterTypeException for an override of other type, InvalidParameter for one
        that is nearly the name of a parameter.
        """
        super().__init__(name)
        self.is_active = False
        self.asked_to_end: Callable[[], bool] = lambda: False
        self._configured = False
        self._table = (*EVERY_NODE, *table)
        self._not_granted: dict[str, bool] = {}  # whether somebody asked for it
        self._callback_errors = 0
        for row in self._table:
            self.declare_parameter(
                row.name,
                row.default,
                ParameterDescriptor(
                    description=row.description,
                    additional_constraints=row.range_text,
                    # An empty list has no element that tells its type; `Parameter.check` does.
                    dynamic_typing=isinstance(row.default, list),
                ),
            )
        self._judge_names()
        self.add_on_set_parameters_callback(self._judge_parameters)
        self.add_post_set_parameters_callback(self.guarded(self._apply_parameters))
        self._steady_clock = Clock(clock_type=ClockType.STEADY_TIME)
        self._now = self.get_clock().handle.get_now
        self._listeners = 0
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._diagnostics_timer = self.create_steady_timer(
            _DIAGNOSTICS_PERIOD_SEC, self.publish_diagnostics
        )

    # What subclasses fill in.

    def configure(self, parameters: Mapping[str, Any]) -> None:
        """Read files, create topics and services; raise PlannerError to refuse."""

    def activate(self) -> None:
        """Start working; raise PlannerError to refuse."""

    def deactivate(self) -> None:
        """Stop working; must leave the robot safe and must not raise."""

    def cleanup(self) -> None:
        """Destroy what `configure` created."""

    def diagnose(self) -> tuple[bytes, str, dict[str, object]]:
        """Return level (DiagnosticStatus), summary and values."""
        return DiagnosticStatus.OK, "ok", {}

    def judge_parameter(self, name: str, value: Any) -> None:
        """Raise PlannerError for a value that the table allows and the configured robot does not.

        Asked only about changes at run time; `configure` judges the first values.
        """

    def parameters_changed(self, parameters: Mapping[str, Any]) -> None:
        """Apply checked values of parameters that may change at run time."""

    # Parameters.

    def parameter_values(self) -> dict[str, Any]:
        """Return the checked values of the whole table; raises InvalidParameter."""
        return check_all(
            self._table, {row.name: self.get_parameter(row.name).value for row in self._table}
        )

    def _judge_names(self) -> None:
        """Refuse what is misspelt: `read_ony` must not energise the arm.

        Other unknown names are no error in ROS: one file may serve all nodes.
        """
        known = [row.name for row in self._table]
        for name in self._parameter_overrides:  # rclpy offers no public way to see them
            if self.has_parameter(name) or name.startswith("qos_overrides."):
                continue
            if close := get_close_matches(name, known, 1, _NEARLY):
                raise InvalidParameter(f"unknown parameter '{name}', did you mean '{close[0]}'?")
            self.get_logger().warning(
                f"unknown parameter '{name}' is ignored, choose from: {', '.join(known)}"
            )

    def _judge_parameters(self, changes: list[RosParameter]) -> SetParametersResult:
        rows = {row.name: row for row in self._table}
        for change in changes:
            row = rows.get(change.name)
            if row is None:
                continue
            try:
                value = row.check(change.value)
                if self._configured:
                    self.judge_parameter(row.name, value)
            except PlannerError as error:
                return SetParametersResult(successful=False, reason=str(error))
            if row.read_only and self._configured:
                reason = f"{row.name} takes effect at configuration: deactivate and clean up first"
                return SetParametersResult(successful=False, reason=reason)
        return SetParametersResult(successful=True)

    def _apply_parameters(self, _changes: list[RosParameter]) -> None:
        if self._configured:
            self.parameters_changed(self.parameter_values())

    # Lifecycle.

    def on_configure(self, state: State) -> TransitionCallbackReturn:
        """Lifecycle transition; see `configure`."""
        result = self._transition("configure", self._configure)
        self._configured = result is TransitionCallbackReturn.SUCCESS
        return result

    def on_activate(self, state: State) -> TransitionCallbackReturn:
        """Lifecycle transition; see `activate`."""
        result = self._transition("activate", self.activate)
        self.is_active = result is TransitionCallbackReturn.SUCCESS
        keep_what_there_is()
        if self.is_active:
            self.guarded(self.publish_diagnostics)()
        return result

    def on_deactivate(self, state: State) -> TransitionCallbackReturn:
        """Lifecycle transition; see `deactivate`."""
        self.is_active = False
        return self._transition("deactivate", self.deactivate)

    def on_cleanup(self, state: State) -> TransitionCallbackReturn:
        """Lifecycle transition; see `cleanup`."""
        self._configured = False
        return self._transition("clean up", self.cleanup)

    def on_shutdown(self, state: State) -> TransitionCallbackReturn:
        """Lifecycle transition; ends like SIGTERM."""
        self.stop_working()
        return TransitionCallbackReturn.SUCCESS

    def on_error(self, state: State) -> TransitionCallbackReturn:
        """Lifecycle transition; back to unconfigured."""
        self.stop_working()
        self._configured = False
        return TransitionCallbackReturn.SUCCESS

    def stop_working(self) -> None:
        """Leave the robot safe, whatever state the node is in."""
        if self.is_active:
            self.is_active = False
            self._transition("deactivate", self.deactivate)

    def _LifecycleNodeMixin__change_state(self, transition_id: int) -> TransitionCallbackReturn:  # noqa: N802  # rclpy's name
        """Refuse an illegal transition, where rclpy 7.1 lets its error end the process."""
        try:
            return super()._LifecycleNodeMixin__change_state(transition_id)
        except RCLError as error:
            self.get_logger().warning(f"transition {transition_id} refused: {error}")
            return TransitionCallbackReturn.FAILURE

    def _configure(self) -> None:
        values = self.parameter_values()
        # First, so that the threads and processes that `configure` starts inherit it.
        self._not_granted = {}
        for text in ask_for_real_time(values["realtime_priority"], values["cpu_affinity"]):
            self.tell_refusal(text)
        self.configure(values)

    def tell_refusal(self, text: str, asked: bool = True) -> None:
        """Warn of what the kernel does not grant; diagnostics repeat it until configured again.

        asked  somebody relies on it; else diagnostics name it and stay at their level
        """
        if text not in self._not_granted:
            self._not_granted[text] = asked
            self.get_logger().warning(text)

    def _transition(self, verb: str, action: Callable[[], None]) -> TransitionCallbackReturn:
        try:
            action()
        except PlannerError as error:
            self.get_logger().error(f"cannot {verb}: {error}")
            return TransitionCallbackReturn.FAILURE
        except Exception:
            self.get_logger().error(f"cannot {verb}:\n{traceback.format_exc()}")
            return TransitionCallbackReturn.ERROR
        return TransitionCallbackReturn.SUCCESS

    def autostart(self) -> bool:
        """Configure and activate if the parameter says so; False if that failed."""
        if not self.get_parameter(AUTOSTART.name).value:
            return True
        for transition in (self.trigger_configure, self.trigger_activate):
            if transition() is not TransitionCallbackReturn.SUCCESS:
                return False
        self.get_logger().info("active")
        return True

    # Callbacks, timers, time.

    def guarded(self, callback: Callable[..., Any]) -> Callable[..., Any]:
        """Return `callback` so that an exception in it is logged and counted, not fatal."""

        def call(*arguments: Any) -> Any:  # whatever the callback takes
            try:
                return callback(*arguments)
            except Exception:
                self._callback_errors += 1
                self.get_logger().error(
                    f"defect in {callback.__qualname__}:\n{traceback.format_exc()}",
                    throttle_duration_sec=1.0,
                )
                return arguments[-1] if len(arguments) == 2 else None  # a service's response

        return call

    def create_steady_timer(
        self, period_sec: float, callback: Callable[[], None]
    ) -> rclpy.timer.Timer:
        """Create a timer on the monotonic clock, which no time source can stop or jump."""
        return self.create_timer(period_sec, self.guarded(callback), clock=self._steady_clock)

    def monotonic(self) -> float:
        """Return the monotonic time [s]."""
        return time.monotonic()

    def age(self, stamp: Any) -> float:
        """Return how old a stamp is on the node's clock [s]; negative if a clock jumped.

        The receipt of a message makes one fresh that waited while this process stood still, and
        EventsExecutor of rclpy 7.1 ends the process when a callback asks for the time of receipt.
        """
        return age_sec(to_ns(stamp.sec, stamp.nanosec), self._now_ns())

    def stamp(self) -> Stamp:
        """Return the time on the node's clock as messages carry it."""
        sec, nanosec = from_ns(self._now_ns())
        return Stamp(sec=sec, nanosec=nanosec)

    def _now_ns(self) -> int:
        # Clock.now() would put the number into an object that takes longer to make than to ask for.
        now_ns: int = self._now().nanoseconds
        return now_ns

    # Diagnostics.

    def publish_diagnostics(self) -> None:
        """Publish this node's status in the standard form."""
        level, summary, values = self.diagnose()
        if self._callback_errors:
            defect = "defect in a callback, see the log"
            # What the node says of the robot is more urgent than what is wrong with the node.
            summary = defect if level == DiagnosticStatus.OK else f"{summary}; {defect}"
            level = DiagnosticStatus.ERROR
        elif any(self._not_granted.values()) and level == DiagnosticStatus.OK:
            refused = (text for text, asked in self._not_granted.items() if asked)
            level, summary = DiagnosticStatus.WARN, "; ".join(refused)
        values = {
            "active": self.is_active,
            "callback_errors": self._callback_errors,
            "not_granted": "; ".join(self._not_granted),
            **values,
        }
        status = DiagnosticStatus(
            level=level,
            name=self.get_fully_qualified_name().lstrip("/"),
            message=summary,
            hardware_id="",
            values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
        )
        message = DiagnosticArray(status=[status])
        message.header.stamp = self.stamp()
        self._diagnostics.publish(message)

    def greet_listeners(self) -> None:
        """Publish diagnostics for who began to listen since the last call."""
        listeners = self._diagnostics.get_subscription_count()
        if listeners > self._listeners:
            self.publish_diagnostics()
        self._listeners = listeners
