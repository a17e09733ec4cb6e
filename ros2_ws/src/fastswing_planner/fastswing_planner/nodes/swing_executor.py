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
from fastswing_planner.conversion.raw_messages import RawReader
from fastswing_planner.conversion.states import (
    JointStateReader,
    MuscleStateReader,
    RejectionCounter,
)
from fastswing_planner.errors import (
    Busy,
    Canceled,
    InvalidRequest,
    PlannerError,
    Preempted,
    SwingAborted,
    SwingNotReady,
)
from fastswing_planner.execution.measurements import (
    InhibitionReport,
    JointMeasurement,
    MuscleMeasurement,
)
from fastswing_planner.execution.rest import RestWatch
from fastswing_planner.execution.settings import ExecutionSettings
from fastswing_planner.lifecycle.common_parameters import ROBOT_DESCRIPTION
from fastswing_planner.lifecycle.managed_node import ManagedNode
from fastswing_planner.lifecycle.parameters import Parameter
from fastswing_planner.lifecycle.request_age import REQUEST_MAX_AGE, check_request_stamp
from fastswing_planner.lifecycle.running import run
from fastswing_planner.nodes.executor_links import ExecutorLinks
from fastswing_planner.nodes.swing_goal import SwingContext, SwingGoal
from fastswing_planner.planning.planner import SwingPlanner
from fastswing_planner.qp.solvers import solver_from
from fastswing_planner.robot.description import load_robot

_DEFAULTS = ExecutionSettings()
_RESULT_KEPT_SEC = 60
"""For clients that ask late; each result holds a plan of 40 kB."""


def _setting(name: str, unit: str, low: float, high: float, description: str) -> Parameter:
    return Parameter(name, getattr(_DEFAULTS, name), description, unit, low, high)


TABLE = (
    ROBOT_DESCRIPTION,
    REQUEST_MAX_AGE,
    Parameter(
        "rate",
        100.0,
        "How often the way of the arm is judged and length commands are sent: on the way to the "
        "start each one is a small step.",
        "Hz",
        10.0,
        1000.0,
    ),
    Parameter(
        "service_timeout",
        2.0,
        "Longest wait for the planner and the inhibitor; then the swing is refused or the arm "
        "held.",
        "s",
        0.1,
        60.0,
    ),
    _setting(
        "raise_speed",
        "rad/s",
        0.05,
        3.0,
        "Largest joint speed on the way to the start; slower is gentler to whatever is in the way.",
    ),
    _setting(
        "elongate_speed",
        "m/s",
        0.005,
        0.3,
        "Speed of paying Method 2's muscles out before the swing.",
    ),
    _setting(
        "start_tolerance",
        "rad",
        0.005,
        0.5,
        "The swing begins only this near to the start posture, by the norm over all joints.",
    ),
    _setting(
        "rest_speed",
        "rad/s",
        0.01,
        1.0,
        "Joints slower than this rest. The arm is raised, and swings, only from rest.",
    ),
    _setting(
        "rest_time",
        "s",
        0.02,
        5.0,
        "How long the arm must rest before the swing; longer lets ringing of the raise die away.",
    ),
    _setting(
        "arrival_tolerance",
        "rad",
        0.005,
        0.5,
        "The swing has arrived this near to the end posture, by the norm over all joints; then it "
        "only has to rest.",
    ),
    _setting(
        "raise_limit",
        "s",
        0.5,
        300.0,
        "Longest way to the start posture; a longer one is refused before anything moves.",
    ),
    _setting(
        "elongate_limit",
        "s",
        0.2,
        60.0,
        "Longest time of paying out; a longer one is refused before anything moves.",
    ),
    _setting(
        "settle_limit",
        "s",
        0.5,
        60.0,
        "Longest wait for the arm to rest before the raise, and for rest at the start posture and "
        "the inhibitor before the swing.",
    ),
    _setting(
        "swing_limit",
        "s",
        0.2,
        10.0,
        "Longest swing; then the arm is held where it is. The inhibitor is armed for 0.5 s more, "
        "so keep this 0.5 s below its max_time_limit.",
    ),
    _setting(
        "recover_time",
        "s",
        0.1,
        10.0,
        "How long the arm is held at the end before the swing is done.",
    ),
    _setting(
        "recover_limit",
        "s",
        0.2,
        60.0,
        "Longest wait for rest at the end posture, recover_time included; then the swing has "
        "failed and the arm is held.",
    ),
    _setting(
        "state_timeout",
        "s",
        0.02,
        2.0,
        "Older measurements, a longer stall of this node or a longer silence of the inhibitor stop "
        "the swing and hold the arm. Longer forgives stalls, and moves an unseen arm for as long.",
    ),
)


class ExecutorNode(ManagedNode):
    """One swing at a time; every end leaves the arm held."""

    def __init__(self) -> None:
        """Declare parameters."""
        super().__init__("swing_executor", TABLE)
        self._rejected = RejectionCounter()
        self._goal: SwingGoal | None = None
        self._next: SwingGoal | None = None
        self._outcomes: dict[str, int] = {}

    def configure(self, parameters: Mapping[str, Any]) -> None:
        """Load the robot, and create the action; it refuses goals until the node is active."""
        self._robot = load_robot(parameters["robot_description"])
        self._execution_settings = ExecutionSettings(
            **{name: parameters[name] for name in vars(_DEFAULTS)}
        )
        self._service_timeout: float = parameters["service_timeout"]
        self._request_max_age: float = parameters["request_max_age"]
        self._period = 1.0 / parameters["rate"]
        self._joint_reader = JointStateReader(self._robot.model.joint_names)
        self._muscle_reader = MuscleStateReader(self._robot.model.muscle_names)
        self._raw_joints = RawReader(JointState, JointStateReader.NUMBERS)
        self._raw_muscles = RawReader(MuscleState, MuscleStateReader.NUMBERS)
        self._joints: JointMeasurement | None = None
        self._muscles: MuscleMeasurement | None = None
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
        self._context = SwingContext(
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

    def _on_joints(self, received: JointState | bytes) -> None:
        try:
            message = self._raw_joints.read(received)
            self._joints = self._joint_reader.read(message, self._made(message))
        except InvalidRequest as error:
            self._rejected.count(error)
            return
        self._rest.add(self._joints.time, self._joints.velocity)
        if self._goal is not None:
            self._goal.add_joints(self._joints)

    def _on_muscles(self, received: MuscleState | bytes) -> None:
        try:
            message = self._raw_muscles.read(received)
            self._muscles = self._muscle_reader.read(message, self._made(message))
        except InvalidRequest as error:
            self._rejected.count(error)
            return
        if self._goal is not None:
            self._goal.add_muscles(self._muscles)

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
        goal, now = SwingGoal(handle, self._context), self.monotonic()
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
            if goal.step(now, self._joints, self._muscles):
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
        for what, state in (("joint", self._joints), ("muscle", self._muscles)):
            if state is not None:
                values[f"{what}_state_age_ms"] = f"{1e3 * (self.monotonic() - state.time):.1f}"
        values |= {f"ended_{name}": count for name, count in self._outcomes.items()}
        values |= self._rejected.counts
        if self._rejected.last:
            return DiagnosticStatus.WARN, f"rejected: {self._rejected.last}", values
        return DiagnosticStatus.OK, "ok", values


def main() -> int:
    """Run the node."""
    return run(ExecutorNode)
