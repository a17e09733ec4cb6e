"""The frame of every node: parameter table, lifecycle with autostart, diagnostics, clean end."""

import os
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import rclpy
from builtin_interfaces.msg import Time as Stamp
from diagnostic_msgs.msg import DiagnosticStatus
from rcl_interfaces.msg import SetParametersResult
from rclpy._rclpy_pybind11 import RCLError
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode, State, TransitionCallbackReturn
from rclpy.parameter import Parameter as RosParameter

from fastswing_planner.cdr.stamps import age_sec, from_ns, to_ns
from fastswing_planner.lifecycle.common_parameters import AUTOSTART, EVERY_NODE
from fastswing_planner.lifecycle.declaration import declare, judged
from fastswing_planner.lifecycle.diagnostics import DiagnosticsPublisher, Health
from fastswing_planner.lifecycle.parameters import Parameter, check_all
from fastswing_planner.lifecycle.real_time import (
    ask_for_real_time,
    keep_what_there_is,
)
from fastswing_planner.lifecycle.transitions import attempt

# Nodes draw nothing, and MuJoCo's window library costs a quarter of their start.
os.environ.setdefault("MUJOCO_GL", "disable")
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
        self._health = Health()
        declare(self, self._table)
        self.add_on_set_parameters_callback(self._judge_parameters)
        self.add_post_set_parameters_callback(self.guarded(self._apply_parameters))
        self._steady_clock = Clock(clock_type=ClockType.STEADY_TIME)
        self._now = self.get_clock().handle.get_now
        self._diagnostics = DiagnosticsPublisher(self)
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

    def _judge_parameters(self, changes: list[RosParameter]) -> SetParametersResult:
        return judged(self._table, changes, self.judge_parameter if self._configured else None)

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
        self._health.forget_refusals()
        for text in ask_for_real_time(values["realtime_priority"], values["cpu_affinity"]):
            self.tell_refusal(text)
        self.configure(values)

    def tell_refusal(self, text: str, asked: bool = True) -> None:
        """Warn of what the kernel does not grant; diagnostics repeat it until configured again.

        asked  somebody relies on it; else diagnostics name it and stay at their level
        """
        if self._health.refused(text, asked):
            self.get_logger().warning(text)

    def _transition(self, verb: str, action: Callable[[], None]) -> TransitionCallbackReturn:
        return attempt(verb, action, self.get_logger())

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
                self._health.callback_errors += 1
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
        report = self._health.within(self.diagnose(), self.is_active)
        self._diagnostics.publish(report, self.stamp())

    def greet_listeners(self) -> None:
        """Publish diagnostics for who began to listen since the last call."""
        if self._diagnostics.has_new_listener():
            self.publish_diagnostics()
