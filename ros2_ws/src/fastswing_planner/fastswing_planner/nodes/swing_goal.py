"""One goal of the `execute_swing` action, from its plan to its result."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from rclpy.action.server import ServerGoalHandle
from rclpy.task import Future

from fastswing_msgs.action import ExecuteSwing
from fastswing_msgs.msg import ErrorCode, SwingFigures
from fastswing_msgs.msg import SwingPlan as SwingPlanMessage
from fastswing_planner.arrays import Vector
from fastswing_planner.conversion.error_codes import error_code
from fastswing_planner.conversion.plans import (
    figures_to_message,
    payload_from_options,
    predicted_figures,
)
from fastswing_planner.errors import (
    Canceled,
    FaultLatched,
    PhaseTimeout,
    PlannerError,
    SwingNotReady,
)
from fastswing_planner.execution.measurements import (
    InhibitionReport,
    JointMeasurement,
    MuscleMeasurement,
)
from fastswing_planner.execution.prepared_swing import PreparedSwing
from fastswing_planner.execution.refusals import refuse_muscles, refuse_stale
from fastswing_planner.execution.rest import RestWatch
from fastswing_planner.execution.settings import ExecutionSettings, Phase
from fastswing_planner.execution.swing_execution import SwingCommands, SwingExecution
from fastswing_planner.nodes.executor_links import ExecutorLinks
from fastswing_planner.nodes.plan_question import (
    PlanQuestion,
    answer_of,
    arm_request,
    plan_of,
    refuse_foreign_plan,
)
from fastswing_planner.nodes.stopping import Stopping
from fastswing_planner.planning.holding import Holding
from fastswing_planner.planning.plan import SwingPlan
from fastswing_planner.robot.description import Robot
from fastswing_planner.robot.muscle_model import Payload

_SETTLED_SEC = 0.05
"""By then every state was made after the goal began."""


@dataclass(frozen=True)
class SwingContext:
    """What every goal of an executor shares.

    hold             how a posture [rad], shape (n,), is held with a payload
    rest             whether the arm rests
    service_timeout  [s] longest wait for the planner, beside its search's time limit
    """

    robot: Robot
    hold: Callable[[Vector, Payload | None], Holding]
    rest: RestWatch
    settings: ExecutionSettings
    service_timeout: float
    links: ExecutorLinks


class SwingGoal:
    """Asks for the plan, carries it out, and writes the result.

    Call `begin` once and `step` often. However it ends, call `stop` and then `stopped` until the
    arm is held, unless it ended well; then `finish`.
    """

    def __init__(self, handle: ServerGoalHandle, context: SwingContext) -> None:
        """Wait for `begin`."""
        self._handle = handle
        self._context = context
        self._began = np.nan
        self._deadline = np.nan
        self._states_deadline = np.nan
        self._message: SwingPlanMessage | None = None
        self._plan: SwingPlan | None = None
        self._holds: int | None = None
        self._execution: SwingExecution | None = None
        self._planning = PlanQuestion(handle.request, context.links)
        self._arming: Future | None = None
        self.error: PlannerError | None = None
        """Why the goal was stopped."""
        self._stopping = Stopping(context.links)
        self._muscles: MuscleMeasurement | None = None
        self.finished = Future()
        """Done with the result when the goal has ended."""

    @property
    def phase(self) -> Phase:
        """The present phase."""
        return Phase.PLAN if self._execution is None else self._execution.phase

    @property
    def stopping(self) -> bool:
        """Whether the swing is over and the arm is being stopped."""
        return self.error is not None

    @property
    def canceled(self) -> bool:
        """Whether the client wants the goal to end."""
        return bool(self._handle.is_cancel_requested)

    def begin(self, now: float) -> None:
        """Begin to plan at time `now` [s]."""
        self._began = now
        self._planning.begin(now, self._context.service_timeout)
        self._handle.publish_feedback(
            ExecuteSwing.Feedback(phase=int(Phase.PLAN), distance_to_end=np.nan)
        )

    def add_joints(self, joints: JointMeasurement) -> None:
        """Take a joint state."""
        if self._execution is not None:
            self._execution.add_joints(joints)

    def add_muscles(self, muscles: MuscleMeasurement) -> None:
        """Take a muscle state."""
        if self._holds is None and muscles.time > self._began + _SETTLED_SEC:
            self._holds = muscles.holds
        self._muscles = muscles
        if self._execution is not None:
            self._execution.add_muscles(muscles)

    def add_inhibition(self, report: InhibitionReport) -> None:
        """Take a report of the inhibitor."""
        if self._execution is not None:
            self._execution.add_inhibition(report)

    def interrupted(self, reason: str) -> None:
        """Take note that somebody else commands the arm."""
        if self._execution is not None:
            self._execution.interrupted(reason)

    def step(
        self, now: float, joints: JointMeasurement | None, muscles: MuscleMeasurement | None
    ) -> bool:
        """Do what is due at time `now` [s] with the last states; return whether the swing is over.

        Raises SwingAborted or another PlannerError if the goal cannot be reached; stop it then.
        """
        if self.canceled:
            raise Canceled("canceled by the client; the arm holds where it is")
        if self._execution is not None:
            self._advance(now, self._execution)
            return self._execution.done
        if self._plan is None:
            self._ask_planner(now)
        if self._plan is not None:
            self._execution = self._start(self._plan, now, joints, muscles)
        return False

    def _ask_planner(self, now: float) -> None:
        message = self._planning.answer(now)
        if message is None:
            return
        self._plan = plan_of(message)  # before anything moves
        self._message = message
        self._context.links.plan.publish(message)
        # From now on the wait is for the arm.
        self._deadline = now + self._context.settings.settle_limit
        self._states_deadline = now + self._context.service_timeout

    def _start(
        self,
        plan: SwingPlan,
        now: float,
        joints: JointMeasurement | None,
        muscles: MuscleMeasurement | None,
    ) -> SwingExecution | None:
        """Return the execution of the plan; None while the arm does not rest."""
        context = self._context
        refuse_foreign_plan(plan, context.robot.model)
        if joints is None or muscles is None:
            if now < self._states_deadline:
                return None
            raise SwingNotReady(
                "no joint and muscle states yet: is the bridge active, do its boards answer?"
            )
        refuse_stale(now - min(joints.time, muscles.time), context.settings.state_timeout)
        if plan.method.inhibits and not context.links.arm.service_is_ready():
            raise SwingNotReady("arm_inhibitor is missing: is the inhibitor active?")
        if self._holds is None:
            return None
        refuse_muscles(muscles, self._holds)
        if not self._rests(now):
            return None
        payload = payload_from_options(self._handle.request.options, context.robot.payload_body)
        return SwingExecution(
            context.robot.model,
            lambda posture: context.hold(posture, payload),
            context.robot.wire_stiffness,
            PreparedSwing.of(plan),
            context.settings,
            joints,
            muscles,
            self._holds,
        )

    def _rests(self, now: float) -> bool:
        resting = self._context.rest.resting(now)
        if not resting and now > self._deadline:
            raise PhaseTimeout(
                f"the arm did not come to rest in {self._context.settings.settle_limit:g} s: it is "
                "raised only from rest"
            )
        return resting

    def _advance(self, now: float, execution: SwingExecution) -> None:
        if self._arming is not None and self._arming.done():
            arming, self._arming = self._arming, None
            answer_of(arming)
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

    def _carry_out(self, commands: SwingCommands) -> None:
        links = self._context.links
        if commands.lengths is not None:
            links.command_lengths(self._context.robot.model.muscle_names, commands.lengths)
        if commands.arm:
            assert self._message is not None
            self._arming = links.arm.call_async(
                arm_request(
                    links.now(),
                    self._message,
                    self._handle.request.options,
                    self._context.settings.arming_limit,
                )
            )
        if commands.disarm:
            self._stopping.disarm()

    # The end.

    def stop(self, error: PlannerError, now: float) -> None:
        """Have the arm held where it is, because of `error`; a plan alone has moved nothing."""
        self.error = error
        execution = self._execution
        # First: whatever fails below, the arm is waited for, and a late arming is taken back.
        self._stopping.begin(now, execution is not None, self._arming)
        if execution is None:
            return
        commands = execution.stop()
        if self._stopping.hold() or execution.age(now) > self._context.settings.state_timeout:
            commands = SwingCommands(disarm=True)
        self._carry_out(commands)

    def stopped(self, now: float) -> bool:
        """Return whether the arm is held and the inhibitor disarmed, or it is too late for that."""
        return self._stopping.done(now, self._muscles)

    def finish(self) -> None:
        """Write the result."""
        execution, error = self._execution, self.error
        result = ExecuteSwing.Result(error_code=ErrorCode.SUCCESS)
        if self._message is not None and self._plan is not None:
            result.plan = self._message
            result.predicted = predicted_figures(self._plan)
        if execution is not None and execution.figures is not None:
            result.measured = figures_to_message(execution.figures)
        else:
            result.measured = SwingFigures(time_cost=np.nan)
        if error is not None:
            result.error_code = error_code(error)
            told = isinstance(error, FaultLatched)
            result.error_string = f"{error}{self._stopping.unconfirmed(self._muscles, told)}"
        if error is None:
            self._handle.succeed()
        elif self.canceled:
            self._handle.canceled()
        else:
            self._handle.abort()
        self.finished.set_result(result)
