"""Executes swings: the `execute_swing` action."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from builtin_interfaces.msg import Duration
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from fastswing_msgs.action import ExecuteSwing
from fastswing_msgs.msg import (
    ErrorCode,
    InhibitionStatus,
    LengthCommand,
    MuscleState,
    SwingFigures,
)
from fastswing_msgs.msg import SwingPlan as SwingPlanMessage
from fastswing_msgs.srv import ArmInhibitor, PlanSwing
from fastswing_planner.arrays import frozen
from fastswing_planner.error_code import error_code, error_name
from fastswing_planner.errors import InvalidRequest, PlannerError, SwingAborted
from fastswing_planner.figures_conversion import figures_to_message, predicted_figures
from fastswing_planner.managed_node import ROBOT_DESCRIPTION, ManagedNode, run
from fastswing_planner.parameters import Parameter
from fastswing_planner.plan import SwingPlanner
from fastswing_planner.qp_solvers import ProxSuiteSolver
from fastswing_planner.request import Method
from fastswing_planner.robot import load_robot
from fastswing_planner.robot_path import resolve_path
from fastswing_planner.state_conversion import (
    JointStateReader,
    MuscleStateReader,
    RejectionCounter,
)
from fastswing_planner.swing_execution import (
    ExecutionSettings,
    JointMeasurement,
    MuscleMeasurement,
    Orders,
    Phase,
    PreparedSwing,
    SwingExecution,
)

_DEFAULTS = ExecutionSettings()


def _setting(name: str, unit: str, low: float, high: float, description: str) -> Parameter:
    return Parameter(name, getattr(_DEFAULTS, name), description, unit, low, high)


TABLE = (
    ROBOT_DESCRIPTION,
    Parameter("rate", 100.0, "How often orders are given.", "Hz", 10.0, 1000.0),
    Parameter(
        "service_timeout", 2.0, "Longest wait for the planner and the inhibitor.", "s", 0.1, 60.0
    ),
    _setting("raise_speed", "rad/s", 0.05, 3.0, "Largest joint speed on the way to the start."),
    _setting("elongate_speed", "m/s", 0.005, 0.3, "Speed of paying muscles out before the swing."),
    _setting(
        "start_tolerance",
        "rad",
        0.005,
        0.5,
        "The swing begins only this near to the start posture.",
    ),
    _setting("rest_speed", "rad/s", 0.01, 1.0, "Joints slower than this rest."),
    _setting("rest_time", "s", 0.02, 5.0, "How long the arm must rest before the swing."),
    _setting(
        "arrival_tolerance",
        "rad",
        0.005,
        0.5,
        "The swing has arrived this near to the end posture.",
    ),
    _setting("phase_limit", "s", 0.5, 60.0, "Longest wait of a phase beyond its planned duration."),
    _setting("swing_limit", "s", 0.2, 10.0, "Longest swing."),
    _setting("recover_time", "s", 0.1, 10.0, "How long the end is held before the swing is done."),
    _setting("state_timeout", "s", 0.02, 2.0, "Older measurements stop the swing."),
)


class _Run:
    """One goal on its way."""

    def __init__(self, handle: ServerGoalHandle, started: float) -> None:
        self.handle = handle
        self.deadline = started
        self.plan: SwingPlanMessage | None = None
        self.execution: SwingExecution | None = None
        self.pending: Future | None = None
        self.finished = Future()


class ExecutorNode(ManagedNode):
    """One swing at a time; every end leaves the arm held."""

    def __init__(self) -> None:
        """Declare parameters."""
        super().__init__("swing_executor", TABLE)
        self._rejected = RejectionCounter()
        self._run: _Run | None = None
        self._outcomes: dict[str, int] = {}

    def configure(self, parameters: Mapping[str, Any]) -> None:
        """Load the robot."""
        self._robot = load_robot(resolve_path(parameters["robot_description"]))
        self._settings = ExecutionSettings(**{name: parameters[name] for name in vars(_DEFAULTS)})
        self._service_timeout: float = parameters["service_timeout"]
        self._period = 1.0 / parameters["rate"]
        robot = self._robot
        self._planner = SwingPlanner(robot.model, robot.limits, ProxSuiteSolver())
        self._joint_reader = JointStateReader(robot.model.joint_names)
        self._muscle_reader = MuscleStateReader(robot.model.muscle_names)
        self._joints: JointMeasurement | None = None
        self._muscles: MuscleMeasurement | None = None

    def activate(self) -> None:
        """Connect to bridge, planner and inhibitor, and offer the action."""
        group = ReentrantCallbackGroup()
        self._command = self.create_publisher(LengthCommand, "length_command", 10)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._plan_publisher = self.create_publisher(SwingPlanMessage, "swing_plan", latched)
        self._subscriptions_made = [
            self.create_subscription(
                JointState, "joint_states", self.guarded(self._on_joints), qos_profile_sensor_data
            ),
            self.create_subscription(
                MuscleState, "muscle_state", self.guarded(self._on_muscles), qos_profile_sensor_data
            ),
            self.create_subscription(
                InhibitionStatus, "inhibition_status", self.guarded(self._on_inhibition), 10
            ),
        ]
        self._plan_client = self.create_client(PlanSwing, "plan_swing", callback_group=group)
        self._arm_client = self.create_client(ArmInhibitor, "arm_inhibitor", callback_group=group)
        self._hold_client = self.create_client(Trigger, "hold_posture", callback_group=group)
        self._disarm_client = self.create_client(Trigger, "disarm_inhibitor", callback_group=group)
        self._clients_made = (
            self._plan_client,
            self._arm_client,
            self._hold_client,
            self._disarm_client,
        )
        self._timer = self.create_steady_timer(self._period, self._on_timer)
        self._server = ActionServer(
            self,
            ExecuteSwing,
            "execute_swing",
            self._execute,
            callback_group=group,
            goal_callback=lambda _goal: GoalResponse.ACCEPT,
            cancel_callback=lambda _handle: CancelResponse.ACCEPT,
        )

    def deactivate(self) -> None:
        """Stop a running swing where it is, and withdraw the action."""
        if self._run is not None:
            self._end(self._run, SwingAborted("CANCELED", "the node was deactivated"))
        self._server.destroy()
        self.destroy_timer(self._timer)
        for subscription in self._subscriptions_made:
            self.destroy_subscription(subscription)
        for client in self._clients_made:
            self.destroy_client(client)
        self.destroy_publisher(self._command)
        self.destroy_publisher(self._plan_publisher)

    # Measurements.

    def _on_joints(self, message: JointState) -> None:
        try:
            self._joints = self._joint_reader.read(message, self.monotonic())
        except InvalidRequest as error:
            self._rejected.count(error)
            return
        if self._run is not None and self._run.execution is not None:
            self._run.execution.add_joints(self._joints)

    def _on_muscles(self, message: MuscleState) -> None:
        try:
            self._muscles = self._muscle_reader.read(message, self.monotonic())
        except InvalidRequest as error:
            self._rejected.count(error)
            return
        if self._run is not None and self._run.execution is not None:
            self._run.execution.add_muscles(self._muscles)

    def _on_inhibition(self, message: InhibitionStatus) -> None:
        execution = None if self._run is None else self._run.execution
        if execution is None or message.armed:
            return
        if message.reason != InhibitionStatus.REASON_GOAL_REACHED:
            execution.inhibitor_lost(message.reason_text)

    # The action.

    async def _execute(self, handle: ServerGoalHandle) -> ExecuteSwing.Result:
        if self._run is not None:
            handle.abort()
            text = "another swing runs: wait for its result or cancel it"
            return ExecuteSwing.Result(error_code=ErrorCode.BUSY, error_string=text)
        search = float(
            np.clip(np.nan_to_num(handle.request.options.search_time_limit), 0.0, 3600.0)
        )
        self._run = _Run(handle, self.monotonic() + self._service_timeout + search)
        result: ExecuteSwing.Result = await self._run.finished
        return result

    def _on_timer(self) -> None:
        current = self._run
        if current is None:
            return
        try:
            if current.handle.is_cancel_requested:
                raise SwingAborted("CANCELED", "canceled by the client; the arm holds where it is")
            if current.execution is None:
                self._prepare(current)
            else:
                self._advance(current, current.execution)
        except PlannerError as error:
            self._end(current, error)
        except Exception:
            self._end(current, SwingAborted("INTERNAL", "defect in the executor, see its log"))
            raise

    def _prepare(self, current: _Run) -> None:
        """Ask the planner, then build the execution."""
        if current.pending is None:
            if self._plan_client.service_is_ready():
                goal = current.handle.request
                request = PlanSwing.Request(
                    joint_name=goal.joint_name,
                    start_position=goal.start_position,
                    end_position=goal.end_position,
                    options=goal.options,
                )
                current.pending = self._plan_client.call_async(request)
        elif current.pending.done():
            response = current.pending.result()
            current.pending = None
            if response.error_code != ErrorCode.SUCCESS:
                raise SwingAborted(error_name(response.error_code), response.error_string)
            current.plan = response.plan
            self._plan_publisher.publish(response.plan)
            current.execution = self._execution(response.plan)
            return
        if self.monotonic() > current.deadline:
            raise SwingAborted("NOT_READY", "plan_swing does not answer: is the planner running?")

    def _execution(self, plan: SwingPlanMessage) -> SwingExecution:
        now = self.monotonic()
        joints, muscles = self._joints, self._muscles
        if joints is None or muscles is None:
            raise SwingAborted("NOT_READY", "no joint and muscle states yet: is the bridge active?")
        age = now - min(joints.time, muscles.time)
        if age > self._settings.state_timeout:
            raise SwingAborted("STALE_STATE", f"the last measurements are {age:.2f} s old")
        if Method(plan.method).inhibits and not self._arm_client.service_is_ready():
            raise SwingAborted("NOT_READY", "arm_inhibitor is missing: is the inhibitor active?")
        swing = PreparedSwing(
            method=Method(plan.method),
            start=frozen(plan.start_position),
            end=frozen(plan.end_position),
            elongation=frozen(plan.elongation),
            holding_tension=frozen(plan.holding_tension),
            final_tension=frozen(plan.final_tension),
        )
        return SwingExecution(
            self._robot.model,
            self._planner.hold,
            self._robot.wire_stiffness,
            swing,
            self._settings,
            joints,
            muscles,
        )

    def _advance(self, current: _Run, execution: SwingExecution) -> None:
        if current.pending is not None and current.pending.done():
            response = current.pending.result()
            current.pending = None
            if response.error_code != ErrorCode.SUCCESS:
                raise SwingAborted(error_name(response.error_code), response.error_string)
            execution.inhibitor_armed()
        self._carry_out(execution.step(self.monotonic()), current)
        if execution.done:
            self._end(current, None)
            return
        if self._joints is not None:
            current.handle.publish_feedback(
                ExecuteSwing.Feedback(
                    phase=int(execution.phase),
                    joint_position=self._joints.position.tolist(),
                    distance_to_end=execution.distance_to_end,
                )
            )

    def _carry_out(self, orders: Orders, current: _Run) -> None:
        if orders.lengths is not None:
            self._command.publish(
                LengthCommand(
                    header=Header(stamp=self.get_clock().now().to_msg()),
                    name=self._robot.model.muscle_names,
                    length=orders.lengths.tolist(),
                )
            )
        if orders.arm:
            current.pending = self._arm_client.call_async(self._arm_request(current))
        if orders.disarm and self._disarm_client.service_is_ready():
            self._disarm_client.call_async(Trigger.Request())

    def _arm_request(self, current: _Run) -> ArmInhibitor.Request:
        options = current.handle.request.options
        plan = current.plan
        assert plan is not None
        limit = self._settings.swing_limit
        return ArmInhibitor.Request(
            joint_name=plan.joint_name,
            goal_position=plan.end_position,
            threshold=options.threshold,
            kept_muscle=options.kept_muscle,
            time_limit=Duration(sec=int(limit), nanosec=int(limit % 1.0 * 1e9)),
        )

    def _end(self, current: _Run, error: PlannerError | None) -> None:
        """Finish a goal; with an error the arm is told to hold where it is."""
        self._run = None
        execution = current.execution
        result = ExecuteSwing.Result(error_code=ErrorCode.SUCCESS)
        if current.plan is not None:
            result.plan = current.plan
            result.predicted = predicted_figures(current.plan)
        if execution is not None and execution.figures is not None:
            result.measured = figures_to_message(execution.figures)
        else:
            result.measured = SwingFigures(time_cost=np.nan)
        if error is None:
            current.handle.succeed()
        else:
            result.error_code = error_code(error)
            result.error_string = str(error)
            if execution is not None:
                self._stop_arm(execution, current)
            if current.handle.is_cancel_requested:
                current.handle.canceled()
            else:
                current.handle.abort()
            self.get_logger().warning(f"swing ended: {error}")
        outcome = "success" if error is None else error.code_name.lower()
        self._outcomes[outcome] = self._outcomes.get(outcome, 0) + 1
        current.finished.set_result(result)

    def _stop_arm(self, execution: SwingExecution, current: _Run) -> None:
        """Hold the arm where it is; the bridge knows that best, our states may be old."""
        if self._hold_client.service_is_ready():
            self._hold_client.call_async(Trigger.Request())
            self._carry_out(Orders(disarm=True), current)
        else:
            self._carry_out(execution.holding_orders(), current)
        if current.pending is not None:
            # An arming that is still on its way must not outlive the swing.
            current.pending.add_done_callback(
                lambda _: self._disarm_client.call_async(Trigger.Request())
            )

    def diagnose(self) -> tuple[bytes, str, dict[str, object]]:
        """Report the phase, outcomes and rejections."""
        execution = None if self._run is None else self._run.execution
        phase = "idle" if self._run is None else (execution.phase if execution else Phase.PLAN).name
        values: dict[str, object] = {"phase": phase.lower()}
        values |= {f"ended_{name}": count for name, count in self._outcomes.items()}
        values |= self._rejected.counts
        if self._rejected.last:
            return DiagnosticStatus.WARN, f"rejected: {self._rejected.last}", values
        return DiagnosticStatus.OK, "ok", values


def main() -> int:
    """Run the node."""
    return run(ExecutorNode)
