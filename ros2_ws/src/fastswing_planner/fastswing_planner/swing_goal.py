"""One goal of the `execute_swing` action, from its plan to its result."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from builtin_interfaces.msg import Duration
from rclpy.action.server import ServerGoalHandle
from rclpy.task import Future
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from fastswing_msgs.action import ExecuteSwing
from fastswing_msgs.msg import ErrorCode, LengthCommand, SwingFigures
from fastswing_msgs.msg import SwingPlan as SwingPlanMessage
from fastswing_msgs.srv import ArmInhibitor, PlanSwing
from fastswing_planner.arrays import Vector, frozen
from fastswing_planner.error_code import error_code, error_name
from fastswing_planner.errors import PlannerError, SwingAborted
from fastswing_planner.executor_links import ExecutorLinks
from fastswing_planner.figures_conversion import figures_to_message, predicted_figures
from fastswing_planner.holding import Holding
from fastswing_planner.request import Method
from fastswing_planner.robot import Robot
from fastswing_planner.swing_execution import (
    ExecutionSettings,
    JointMeasurement,
    MuscleMeasurement,
    Orders,
    Phase,
    PreparedSwing,
    SwingExecution,
)

_LONGEST_SEARCH_SEC = 3600.0


@dataclass(frozen=True)
class SwingSurroundings:
    """What every goal of an executor shares.

    hold             how a posture [rad], shape (n,), is held
    service_timeout  [s] longest wait for the planner, beside its search's time limit
    """

    robot: Robot
    hold: Callable[[Vector], Holding]
    settings: ExecutionSettings
    service_timeout: float
    links: ExecutorLinks


class SwingGoal:
    """Asks for the plan, carries it out, and writes the result. Call `step` often."""

    def __init__(self, handle: ServerGoalHandle, around: SwingSurroundings, now: float) -> None:
        """Begin at time `now` [s]."""
        self._handle = handle
        self._around = around
        search = np.nan_to_num(handle.request.options.search_time_limit)
        patience = around.service_timeout + float(np.clip(search, 0.0, _LONGEST_SEARCH_SEC))
        self._deadline = now + patience
        self._plan: SwingPlanMessage | None = None
        self._execution: SwingExecution | None = None
        self._pending: Future | None = None
        self.finished = Future()
        """Done with the result when the goal has ended."""

    @property
    def phase(self) -> Phase:
        """The present phase."""
        return Phase.PLAN if self._execution is None else self._execution.phase

    def add_joints(self, joints: JointMeasurement) -> None:
        """Take a joint state."""
        if self._execution is not None:
            self._execution.add_joints(joints)

    def add_muscles(self, muscles: MuscleMeasurement) -> None:
        """Take a muscle state."""
        if self._execution is not None:
            self._execution.add_muscles(muscles)

    def inhibitor_lost(self, reason: str) -> None:
        """Take note that the inhibitor ended before the goal."""
        if self._execution is not None:
            self._execution.inhibitor_lost(reason)

    def step(
        self, now: float, joints: JointMeasurement | None, muscles: MuscleMeasurement | None
    ) -> bool:
        """Do what is due at time `now` [s] with the last states; return whether the swing is over.

        Raises SwingAborted or another PlannerError if the goal cannot be reached; end it then.
        """
        if self._handle.is_cancel_requested:
            raise SwingAborted("CANCELED", "canceled by the client; the arm holds where it is")
        if self._execution is None:
            self._prepare(now, joints, muscles)
            return False
        self._advance(now, self._execution)
        return self._execution.done

    def _prepare(
        self, now: float, joints: JointMeasurement | None, muscles: MuscleMeasurement | None
    ) -> None:
        """Ask the planner, then build the execution."""
        if self._pending is None:
            if self._around.links.planner.service_is_ready():
                goal = self._handle.request
                request = PlanSwing.Request(
                    joint_name=goal.joint_name,
                    start_position=goal.start_position,
                    end_position=goal.end_position,
                    options=goal.options,
                )
                self._pending = self._around.links.planner.call_async(request)
        elif self._pending.done():
            self._plan = self._answer().plan
            self._around.links.plan.publish(self._plan)
            self._execution = self._start(self._plan, now, joints, muscles)
            return
        if now > self._deadline:
            raise SwingAborted("NOT_READY", "plan_swing does not answer: is the planner running?")

    def _answer(self) -> PlanSwing.Response | ArmInhibitor.Response:
        """Take the pending service's answer; raises SwingAborted with its error."""
        assert self._pending is not None
        response = self._pending.result()
        self._pending = None
        if response.error_code != ErrorCode.SUCCESS:
            raise SwingAborted(error_name(response.error_code), response.error_string)
        return response

    def _start(
        self,
        plan: SwingPlanMessage,
        now: float,
        joints: JointMeasurement | None,
        muscles: MuscleMeasurement | None,
    ) -> SwingExecution:
        around, method = self._around, Method(plan.method)
        if joints is None or muscles is None:
            raise SwingAborted("NOT_READY", "no joint and muscle states yet: is the bridge active?")
        age = now - min(joints.time, muscles.time)
        if age > around.settings.state_timeout:
            raise SwingAborted("STALE_STATE", f"the last measurements are {age:.2f} s old")
        if method.inhibits and not around.links.arm.service_is_ready():
            raise SwingAborted("NOT_READY", "arm_inhibitor is missing: is the inhibitor active?")
        swing = PreparedSwing(
            method=method,
            start=frozen(plan.start_position),
            end=frozen(plan.end_position),
            elongation=frozen(plan.elongation),
            holding_tension=frozen(plan.holding_tension),
            final_tension=frozen(plan.final_tension),
        )
        return SwingExecution(
            around.robot.model,
            around.hold,
            around.robot.wire_stiffness,
            swing,
            around.settings,
            joints,
            muscles,
        )

    def _advance(self, now: float, execution: SwingExecution) -> None:
        if self._pending is not None and self._pending.done():
            self._answer()
            execution.inhibitor_armed()
        self._carry_out(execution.step(now))
        if not execution.done:
            self._handle.publish_feedback(
                ExecuteSwing.Feedback(
                    phase=int(execution.phase),
                    joint_position=execution.joint_position.tolist(),
                    distance_to_end=execution.distance_to_end,
                )
            )

    def _carry_out(self, orders: Orders) -> None:
        links = self._around.links
        if orders.lengths is not None:
            links.lengths.publish(
                LengthCommand(
                    header=Header(stamp=links.now()),
                    name=self._around.robot.model.muscle_names,
                    length=orders.lengths.tolist(),
                )
            )
        if orders.arm:
            self._pending = links.arm.call_async(self._arm_request())
        if orders.disarm and links.disarm.service_is_ready():
            links.disarm.call_async(Trigger.Request())

    def _arm_request(self) -> ArmInhibitor.Request:
        options, plan = self._handle.request.options, self._plan
        assert plan is not None
        limit = self._around.settings.swing_limit
        return ArmInhibitor.Request(
            joint_name=plan.joint_name,
            goal_position=plan.end_position,
            threshold=options.threshold,
            kept_muscle=options.kept_muscle,
            time_limit=Duration(sec=int(limit), nanosec=int(limit % 1.0 * 1e9)),
        )

    def end(self, error: PlannerError | None) -> None:
        """Write the result; with an error the arm is told to hold where it is."""
        execution = self._execution
        result = ExecuteSwing.Result(error_code=ErrorCode.SUCCESS)
        if self._plan is not None:
            result.plan = self._plan
            result.predicted = predicted_figures(self._plan)
        if execution is not None and execution.figures is not None:
            result.measured = figures_to_message(execution.figures)
        else:
            result.measured = SwingFigures(time_cost=np.nan)
        if error is None:
            self._handle.succeed()
        else:
            result.error_code = error_code(error)
            result.error_string = str(error)
            if execution is not None:
                self._stop_arm(execution)
            if self._handle.is_cancel_requested:
                self._handle.canceled()
            else:
                self._handle.abort()
        self.finished.set_result(result)

    def _stop_arm(self, execution: SwingExecution) -> None:
        """Hold the arm where it is; the bridge knows that best, our states may be old."""
        links = self._around.links
        if links.hold.service_is_ready():
            links.hold.call_async(Trigger.Request())
            self._carry_out(Orders(disarm=True))
        else:
            self._carry_out(execution.holding_orders())
        if self._pending is not None:
            # An arming that is still on its way must not outlive the swing.
            self._pending.add_done_callback(lambda _: links.disarm.call_async(Trigger.Request()))
