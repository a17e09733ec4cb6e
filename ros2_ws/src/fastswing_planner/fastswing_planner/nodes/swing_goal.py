"""One goal of the `execute_swing` action, from its plan to its result."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from builtin_interfaces.msg import Duration
from rclpy.action.server import ServerGoalHandle
from rclpy.task import Future
from std_srvs.srv import Trigger

from fastswing_msgs.action import ExecuteSwing
from fastswing_msgs.msg import ErrorCode, SwingFigures
from fastswing_msgs.msg import SwingPlan as SwingPlanMessage
from fastswing_msgs.srv import ArmInhibitor, PlanSwing
from fastswing_planner.arrays import Vector, frozen
from fastswing_planner.cdr.stamps import from_seconds
from fastswing_planner.conversion.error_codes import error_code, error_from
from fastswing_planner.conversion.plans import (
    figures_to_message,
    payload_from_options,
    predicted_figures,
)
from fastswing_planner.errors import (
    Canceled,
    PhaseTimeout,
    PlannerError,
    SwingNotReady,
    SwingStateStale,
    WrongLength,
)
from fastswing_planner.execution.measurements import (
    InhibitionReport,
    JointMeasurement,
    MuscleMeasurement,
)
from fastswing_planner.execution.rest import RestWatch
from fastswing_planner.execution.settings import ExecutionSettings, Phase
from fastswing_planner.execution.swing_execution import (
    Orders,
    PreparedSwing,
    SwingExecution,
    refuse_muscles,
)
from fastswing_planner.nodes.executor_links import ExecutorLinks
from fastswing_planner.planning.holding import Holding
from fastswing_planner.planning.request import Method
from fastswing_planner.robot.description import Robot
from fastswing_planner.robot.muscle_model import MuscleModel, Payload

_LONGEST_SEARCH_SEC = 3600.0
_CONFIRM_SEC = 1.0
"""Longest wait for bridge and inhibitor when a swing is stopped."""
_RELEASE_SEC = 0.25
"""Then as long for muscles that the inhibitor let go: the longest lease, and some way."""
_SETTLED_SEC = 0.05
"""By then every state was made after the goal began."""


@dataclass(frozen=True)
class SwingSurroundings:
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

    def __init__(self, handle: ServerGoalHandle, around: SwingSurroundings) -> None:
        """Wait for `begin`."""
        self._handle = handle
        self._around = around
        self._began = np.nan
        self._deadline = np.nan
        self._states_deadline = np.nan
        self._plan: SwingPlanMessage | None = None
        self._predicted = SwingFigures()
        self._holds: int | None = None
        self._execution: SwingExecution | None = None
        self._planning: Future | None = None
        self._arming: Future | None = None
        self.error: PlannerError | None = None
        """Why the goal was stopped."""
        self._stop_deadline = np.nan
        self._confirmed: float | None = None  # [s] when bridge and inhibitor had confirmed it
        self._muscles: MuscleMeasurement | None = None
        self._holding: Future | None = None
        self._disarming: list[Future] = []
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
        search = np.nan_to_num(self._handle.request.options.search_time_limit)
        patience = self._around.service_timeout + float(np.clip(search, 0.0, _LONGEST_SEARCH_SEC))
        self._began = now
        self._deadline = now + patience
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
        if self._planning is None:
            if self._around.links.planner.service_is_ready():
                goal = self._handle.request
                request = PlanSwing.Request(
                    joint_name=goal.joint_name,
                    start_position=goal.start_position,
                    end_position=goal.end_position,
                    options=goal.options,
                )
                self._planning = self._around.links.planner.call_async(request)
        elif self._planning.done():
            plan = _answer(self._planning).plan
            self._predicted = _figures_of(plan)  # before anything moves
            self._plan = plan
            self._around.links.plan.publish(self._plan)
            # From now on the wait is for the arm.
            self._deadline = now + self._around.settings.settle_limit
            self._states_deadline = now + self._around.service_timeout
            return
        if now > self._deadline:
            raise SwingNotReady("plan_swing does not answer: is the planner running?")

    def _start(
        self,
        plan: SwingPlanMessage,
        now: float,
        joints: JointMeasurement | None,
        muscles: MuscleMeasurement | None,
    ) -> SwingExecution | None:
        """Return the execution of the plan; None while the arm does not rest."""
        around, method = self._around, Method(plan.method)
        _refuse_foreign_plan(plan, around.robot.model)
        if joints is None or muscles is None:
            if now < self._states_deadline:
                return None
            raise SwingNotReady(
                "no joint and muscle states yet: is the bridge active, do its boards answer?",
            )
        age = now - min(joints.time, muscles.time)
        if age > around.settings.state_timeout:
            raise SwingStateStale(f"the last measurements are {age:.2f} s old")
        if method.inhibits and not around.links.arm.service_is_ready():
            raise SwingNotReady("arm_inhibitor is missing: is the inhibitor active?")
        if self._holds is None:
            return None
        refuse_muscles(muscles, self._holds)
        if not around.rest.resting(now):
            if now > self._deadline:
                raise PhaseTimeout(
                    f"the arm did not come to rest in {around.settings.settle_limit:g} s: it is "
                    "raised only from rest",
                )
            return None
        payload = payload_from_options(self._handle.request.options, around.robot.payload_body)
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
            lambda posture: around.hold(posture, payload),
            around.robot.wire_stiffness,
            swing,
            around.settings,
            joints,
            muscles,
            self._holds,
        )

    def _advance(self, now: float, execution: SwingExecution) -> None:
        if self._arming is not None and self._arming.done():
            arming, self._arming = self._arming, None
            _answer(arming)
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
            links.command_lengths(self._around.robot.model.muscle_names, orders.lengths)
        if orders.arm:
            self._arming = links.arm.call_async(self._arm_request())
        if orders.disarm:
            self._disarm()

    def _disarm(self) -> None:
        disarm = self._around.links.disarm
        if disarm.service_is_ready():
            self._disarming.append(disarm.call_async(Trigger.Request()))

    def _arm_request(self) -> ArmInhibitor.Request:
        options, plan = self._handle.request.options, self._plan
        assert plan is not None
        sec, nanosec = from_seconds(self._around.settings.arming_limit)
        return ArmInhibitor.Request(
            stamp=self._around.links.now(),
            joint_name=plan.joint_name,
            goal_position=plan.end_position,
            # The plan's own C, not the inhibitor's parameter: it was predicted with this one.
            threshold=options.threshold,
            kept_muscle=options.kept_muscle,
            time_limit=Duration(sec=sec, nanosec=nanosec),
        )

    # The end.

    def stop(self, error: PlannerError, now: float) -> None:
        """Have the arm held where it is, because of `error`; a plan alone has moved nothing."""
        self.error = error
        self._stop_deadline = now + _CONFIRM_SEC
        execution = self._execution
        if execution is None:
            return
        orders = execution.stop()
        hold = self._around.links.hold
        # The bridge knows best where the arm is, our states may be old.
        if hold.service_is_ready():
            self._holding = hold.call_async(Trigger.Request())
            orders = Orders(disarm=True)
        elif execution.age(now) > self._around.settings.state_timeout:
            orders = Orders(disarm=True)
        self._carry_out(orders)
        if self._arming is not None:
            # An arming that is still on its way must not outlive the swing.
            self._arming.add_done_callback(self._on_late_arming)

    def _on_late_arming(self, _arming: Future) -> None:
        self._arming = None
        self._disarm()

    def stopped(self, now: float) -> bool:
        """Return whether the arm is held: bridge and inhibitor say so, and no muscle is limp.

        Or it is not in time.
        """
        calls = [*self._disarming, *filter(None, (self._holding, self._arming))]
        confirmed = all(call.done() for call in calls)
        if now > self._stop_deadline or self._execution is None:
            return now > self._stop_deadline or confirmed
        if not confirmed:
            self._confirmed = None  # an arming that came late is taken back by one more call
            return False
        self._confirmed = now if self._confirmed is None else self._confirmed
        # The inhibitor's last override may still be on its way to the bridge when both answer.
        muscles = self._muscles
        seen = muscles is not None and muscles.time > self._confirmed and not _not_held(muscles)
        return seen or now > self._confirmed + _RELEASE_SEC

    def finish(self) -> None:
        """Write the result."""
        execution, error = self._execution, self.error
        result = ExecuteSwing.Result(error_code=ErrorCode.SUCCESS)
        if self._plan is not None:
            result.plan = self._plan
            result.predicted = self._predicted
        if execution is not None and execution.figures is not None:
            result.measured = figures_to_message(execution.figures)
        else:
            result.measured = SwingFigures(time_cost=np.nan)
        if error is not None:
            result.error_code = error_code(error)
            result.error_string = f"{error}{self._unconfirmed()}"
        if error is None:
            self._handle.succeed()
        elif self.canceled:
            self._handle.canceled()
        else:
            self._handle.abort()
        self.finished.set_result(result)

    def _unconfirmed(self) -> str:
        if self._execution is None:
            return ""
        if self._holding is None:
            return "; hold_posture is missing: is the bridge active?"
        if not self._holding.done():
            return "; the bridge did not confirm that it holds the arm"
        answer = self._holding.result()
        if not answer.success:
            return f"; the bridge does not hold the arm: {answer.message}"
        if not all(call.done() for call in self._disarming):
            return "; the inhibitor did not confirm that it is disarmed"
        loose = () if self._muscles is None else _not_held(self._muscles)
        if loose and self.error is not None and self.error.code_name != "FAULT_LATCHED":
            return f"; muscles that do not hold a length: {', '.join(loose)}"
        return ""


def _not_held(muscles: MuscleMeasurement) -> tuple[str, ...]:
    """Return the muscles that somebody let go or drives, without those that have a fault."""
    return tuple(name for name in muscles.limp + muscles.driven if name not in muscles.faulty)


def _answer(call: Future) -> PlanSwing.Response | ArmInhibitor.Response:
    """Return a service's answer; raises the PlannerError that it tells of."""
    response = call.result()
    if response.error_code != ErrorCode.SUCCESS:
        raise error_from(response.error_code, response.error_string)
    return response


def _figures_of(plan: SwingPlanMessage) -> SwingFigures:
    try:
        return predicted_figures(plan)
    except WrongLength as error:
        raise SwingNotReady(f"the planner's answer is no plan: {error}") from error


def _refuse_foreign_plan(plan: SwingPlanMessage, model: MuscleModel) -> None:
    for what, planned, own in (
        ("joints", plan.joint_name, model.joint_names),
        ("muscles", plan.muscle_name, model.muscle_names),
    ):
        if tuple(planned) != own:
            raise SwingNotReady(
                f"the planner's robot has the {what} {', '.join(planned)}, this one "
                f"{', '.join(own)}: give both nodes the same robot_description",
            )
