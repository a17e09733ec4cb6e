"""Executes swings: the `execute_swing` action."""

from collections.abc import Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState

from fastswing_msgs.action import ExecuteSwing
from fastswing_msgs.msg import InhibitionStatus, LengthCommand, MuscleState
from fastswing_planner.cdr.stamps import to_ns
from fastswing_planner.conversion.error_codes import error_code
from fastswing_planner.errors import (
    Busy,
    Canceled,
    PlannerError,
    Preempted,
    SwingAborted,
    SwingNotReady,
)
from fastswing_planner.execution.measurements import InhibitionReport
from fastswing_planner.execution.rest import RestWatch
from fastswing_planner.lifecycle.managed_node import ManagedNode
from fastswing_planner.lifecycle.request_age import check_request_stamp
from fastswing_planner.lifecycle.running import run
from fastswing_planner.nodes.executor_links import ExecutorLinks
from fastswing_planner.nodes.executor_parameters import TABLE, settings_from
from fastswing_planner.nodes.executor_states import ExecutorStates
from fastswing_planner.nodes.swing_goal import SwingContext, SwingGoal
from fastswing_planner.planning.planner import SwingPlanner
from fastswing_planner.qp.solvers import solver_from
from fastswing_planner.robot.description import load_robot

_RESULT_KEPT_SEC = 60
"""For clients that ask late; each result holds a plan of 40 kB."""


class ExecutorNode(ManagedNode):
    """One swing at a time; every end leaves the arm held."""

    def __init__(self) -> None:
        """Declare parameters."""
        super().__init__("swing_executor", TABLE)
        self._states = ExecutorStates(self._made)
        self._goal: SwingGoal | None = None
        self._next: SwingGoal | None = None
        self._outcomes: dict[str, int] = {}

    def configure(self, parameters: Mapping[str, Any]) -> None:
        """Load the robot, and create the action; it refuses goals until the node is active."""
        self._robot = load_robot(parameters["robot_description"])
        self._execution_settings = settings_from(parameters)
        self._service_timeout: float = parameters["service_timeout"]
        self._request_max_age: float = parameters["request_max_age"]
        self._period = 1.0 / parameters["rate"]
        self._states.expect(self._robot.model)
        self._links = ExecutorLinks(self)
        # Not in `activate`: a goal that ends with a deactivation still has to get its result.
        self._server = ActionServer(
            self,
            ExecuteSwing,
            "execute_swing",
            self._execute,
            callback_group=ReentrantCallbackGroup(),
            goal_callback=self._admit,
            cancel_callback=lambda _handle: CancelResponse.ACCEPT,
            result_timeout=_RESULT_KEPT_SEC,
        )

    def cleanup(self) -> None:
        """Withdraw the action, and disconnect."""
        self._server.destroy()
        self._links.destroy()

    def activate(self) -> None:
        """Connect to bridge, planner and inhibitor."""
        self._links.open()
        robot, settings = self._robot, self._execution_settings
        self._rest = RestWatch(settings.rest_speed, settings.rest_time)
        planner = SwingPlanner(robot.model, robot.limits, solver_from())
        self._swing_context = SwingContext(
            robot, planner.hold, self._rest, settings, self._service_timeout, self._links
        )
        self._subscriptions_made = [
            self.create_subscription(
                JointState,
                "joint_states",
                self.guarded(self._on_joints),
                qos_profile_sensor_data,
                raw=True,
            ),
            self.create_subscription(
                MuscleState,
                "muscle_state",
                self.guarded(self._on_muscles),
                qos_profile_sensor_data,
                raw=True,
            ),
            self.create_subscription(
                InhibitionStatus, "inhibition_status", self.guarded(self._on_inhibition), 10
            ),
            self.create_subscription(
                LengthCommand, "length_command", self.guarded(self._on_length_command), 10
            ),
        ]
        self._timer = self.create_steady_timer(self._period, self._on_timer)

    def deactivate(self) -> None:
        """Stop a running swing where it is; the requests that do so are still answered."""
        self.destroy_timer(self._timer)
        for subscription in self._subscriptions_made:
            self.destroy_subscription(subscription)
        ended, self._goal, self._next = (self._goal, self._next), None, None
        for goal in filter(None, ended):
            goal.stop(Canceled("the node was deactivated"), self.monotonic())
            self._write_result(goal)
        self._links.close()

    # Measurements.

    def _on_joints(self, received: bytes) -> None:
        joints = self._states.read_joints(received)
        if joints is None:
            return
        self._rest.add(joints.time, joints.velocity)
        if self._goal is not None:
            self._goal.add_joints(joints)

    def _on_muscles(self, received: bytes) -> None:
        muscles = self._states.read_muscles(received)
        if muscles is not None and self._goal is not None:
            self._goal.add_muscles(muscles)

    def _on_inhibition(self, message: InhibitionStatus) -> None:
        if self._goal is not None:
            reached = message.reason == InhibitionStatus.REASON_GOAL_REACHED
            self._goal.add_inhibition(
                InhibitionReport(self._made(message), message.armed, reached, message.reason_text)
            )

    def _made(self, message: Any) -> float:
        """Return when a message was made [s], monotonic.

        Not its receipt: what waited in a network, or while this node stood still, comes in a row.
        """
        return self.monotonic() - max(self.age(message.header.stamp), 0.0)

    def _on_length_command(self, message: LengthCommand) -> None:
        if self._goal is not None and not self._links.is_own(message):
            self._goal.interrupted("somebody else publishes length_command")

    # The action.

    def _admit(self, _goal: ExecuteSwing.Goal) -> GoalResponse:
        return GoalResponse.ACCEPT if self.is_active else GoalResponse.REJECT

    async def _execute(self, handle: ServerGoalHandle) -> ExecuteSwing.Result:
        try:
            goal = self._take(handle)
        except PlannerError as error:
            self.get_logger().warning(f"swing refused: {error}")
            self._count(error)
            handle.abort()
            return ExecuteSwing.Result(error_code=error_code(error), error_string=str(error))
        result: ExecuteSwing.Result = await goal.finished
        return result

    def _take(self, handle: ServerGoalHandle) -> SwingGoal:
        """Begin a goal, or let it wait for the end of the one that it preempts."""
        stamp = handle.request.stamp
        check_request_stamp(
            "goal",
            to_ns(stamp.sec, stamp.nanosec),
            self.get_clock().now().nanoseconds,
            self._request_max_age,
        )
        if not self.is_active:
            raise SwingNotReady("the swing executor is not active")
        if self._goal is not None and not handle.request.preempt:
            raise Busy("another swing runs: wait for its result, cancel it, or set preempt")
        goal, now = SwingGoal(handle, self._swing_context), self.monotonic()
        if self._goal is None:
            self._goal = goal
            goal.begin(now)
            return goal
        preempted = Preempted("another goal took its place; the arm was held")
        if not self._goal.stopping:
            self._goal.stop(preempted, now)
        if self._next is not None:
            self._next.stop(preempted, now)
            self._write_result(self._next)
        self._next = goal
        return goal

    def _on_timer(self) -> None:
        self._drop_canceled()
        goal, now = self._goal, self.monotonic()
        if goal is None:
            return
        if goal.stopping:
            if goal.stopped(now):
                self._finish(goal)
            return
        try:
            if goal.step(now, self._states.joints, self._states.muscles):
                self._finish(goal)
        except PlannerError as error:
            goal.stop(error, now)
        except Exception:
            goal.stop(SwingAborted("defect in the executor, see its log"), now)
            raise

    def _drop_canceled(self) -> None:
        waiting = self._next
        if waiting is not None and waiting.canceled:
            self._next = None
            waiting.stop(Canceled("canceled before it began"), self.monotonic())
            self._write_result(waiting)

    def _finish(self, goal: SwingGoal) -> None:
        self._goal, self._next = self._next, None
        if self._goal is not None:
            self._goal.begin(self.monotonic())
        self._write_result(goal)

    def _write_result(self, goal: SwingGoal) -> None:
        self._count(goal.error)
        if goal.error is not None:
            self.get_logger().warning(f"swing ended: {goal.error}")
        goal.finish()

    def _count(self, error: PlannerError | None) -> None:
        outcome = "success" if error is None else error.code_name.lower()
        self._outcomes[outcome] = self._outcomes.get(outcome, 0) + 1

    def diagnose(self) -> tuple[bytes, str, dict[str, object]]:
        """Report the phase, outcomes and rejections."""
        phase = "idle" if self._goal is None else self._goal.phase.name.lower()
        if self._goal is not None and self._goal.stopping:
            phase = "stopping"
        values: dict[str, object] = {"phase": phase}
        values |= self._states.ages(self.monotonic())
        values |= {f"ended_{name}": count for name, count in self._outcomes.items()}
        values |= self._states.rejected.counts
        if self._states.rejected.last:
            return DiagnosticStatus.WARN, f"rejected: {self._states.rejected.last}", values
        return DiagnosticStatus.OK, "ok", values


def main() -> int:
    """Run the node."""
    return run(ExecutorNode)
