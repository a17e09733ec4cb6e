"""What a swing asks of planner and inhibitor, and how their answers are judged."""

import numpy as np
from builtin_interfaces.msg import Duration, Time
from rclpy.task import Future

from fastswing_msgs.action import ExecuteSwing
from fastswing_msgs.msg import ErrorCode, SwingOptions
from fastswing_msgs.msg import SwingPlan as SwingPlanMessage
from fastswing_msgs.srv import ArmInhibitor, PlanSwing
from fastswing_planner.cdr.stamps import from_seconds
from fastswing_planner.conversion.error_codes import error_from
from fastswing_planner.conversion.plans import plan_from_message
from fastswing_planner.errors import SwingNotReady
from fastswing_planner.nodes.executor_links import ExecutorLinks
from fastswing_planner.planning.plan import SwingPlan
from fastswing_planner.robot.muscle_model import MuscleModel

_LONGEST_SEARCH_SEC = 3600.0


class PlanQuestion:
    """Asks the planner for the plan of one goal. Call `begin` once and `answer` often."""

    def __init__(self, goal: ExecuteSwing.Goal, links: ExecutorLinks) -> None:
        """Ask nothing yet."""
        self._goal = goal
        self._links = links
        self._deadline = np.nan
        self._call: Future | None = None

    def begin(self, now: float, timeout: float) -> None:
        """Begin at time `now` [s].

        timeout  [s] longest wait, beside the search's own time limit
        """
        search = np.nan_to_num(self._goal.options.search_time_limit)
        self._deadline = now + timeout + float(np.clip(search, 0.0, _LONGEST_SEARCH_SEC))

    def answer(self, now: float) -> SwingPlanMessage | None:
        """Return the plan; None while it is not there.

        Raises SwingNotReady if the planner does not answer in time, else the error that it tells.
        """
        if self._call is None:
            if self._links.planner.service_is_ready():
                self._call = self._links.planner.call_async(
                    PlanSwing.Request(
                        joint_name=self._goal.joint_name,
                        start_position=self._goal.start_position,
                        end_position=self._goal.end_position,
                        options=self._goal.options,
                    )
                )
        elif self._call.done():
            return answer_of(self._call).plan
        if now > self._deadline:
            raise SwingNotReady("plan_swing does not answer: is the planner running?")
        return None


def arm_request(
    stamp: Time, plan: SwingPlanMessage, options: SwingOptions, time_limit: float
) -> ArmInhibitor.Request:
    """Return what arms the inhibitor for a plan for `time_limit` [s]."""
    sec, nanosec = from_seconds(time_limit)
    return ArmInhibitor.Request(
        stamp=stamp,
        joint_name=plan.joint_name,
        goal_position=plan.end_position,
        # The plan's own C, not the inhibitor's parameter: it was predicted with this one.
        threshold=options.threshold,
        kept_muscle=options.kept_muscle,
        time_limit=Duration(sec=sec, nanosec=nanosec),
    )


def answer_of(call: Future) -> PlanSwing.Response | ArmInhibitor.Response:
    """Return a service's answer; raises the PlannerError that it tells of."""
    response = call.result()
    if response.error_code != ErrorCode.SUCCESS:
        raise error_from(response.error_code, response.error_string)
    return response


def plan_of(message: SwingPlanMessage) -> SwingPlan:
    """Return the planner's answer; raises SwingNotReady if it is no plan."""
    try:
        return plan_from_message(message)
    except ValueError as error:
        raise SwingNotReady(f"the planner's answer is no plan: {error}") from error


def refuse_foreign_plan(plan: SwingPlan, model: MuscleModel) -> None:
    """Raise SwingNotReady for a plan of another robot."""
    for what, planned, own in (
        ("joints", plan.joint_names, model.joint_names),
        ("muscles", plan.muscle_names, model.muscle_names),
    ):
        if planned != own:
            raise SwingNotReady(
                f"the planner's robot has the {what} {', '.join(planned)}, this one "
                f"{', '.join(own)}: give both nodes the same robot_description",
            )
