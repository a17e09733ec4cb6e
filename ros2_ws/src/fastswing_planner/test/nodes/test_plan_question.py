"""The planner is asked once, and its plan is carried out only on the robot it was made for."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import pytest
from builtin_interfaces.msg import Time

from fastswing_msgs.action import ExecuteSwing
from fastswing_msgs.msg import ErrorCode, SwingOptions
from fastswing_msgs.msg import SwingPlan as SwingPlanMessage
from fastswing_msgs.srv import PlanSwing
from fastswing_planner.conversion.plans import plan_to_message
from fastswing_planner.errors import HoldingInfeasible, SwingNotReady
from fastswing_planner.nodes.executor_links import ExecutorLinks
from fastswing_planner.nodes.plan_question import (
    PlanQuestion,
    arm_request,
    plan_of,
    refuse_foreign_plan,
)
from fastswing_planner.planning.plan import SwingPlan
from fastswing_planner.planning.planner import SwingPlanner
from fastswing_planner.planning.request import SwingRequest
from fastswing_planner.qp.solvers import solver_from
from fastswing_planner.robot.description import Robot


@pytest.fixture(scope="module")
def plan(musashi: Robot) -> SwingPlan:
    planner = SwingPlanner(musashi.model, musashi.limits, solver_from())
    return planner.plan(SwingRequest(musashi.postures["start"], musashi.postures["end"]))


def test_a_plan_for_other_muscles_is_refused(musashi: Robot, plan: SwingPlan) -> None:
    foreign = replace(plan, muscle_names=plan.muscle_names[::-1])
    with pytest.raises(SwingNotReady) as caught:
        refuse_foreign_plan(foreign, musashi.model)
    assert str(caught.value) == (
        "the planner's robot has the muscles #10, #9, #8, #7, #6, #5, #4, #3, #2, #1, this one "
        "#1, #2, #3, #4, #5, #6, #7, #8, #9, #10: give both nodes the same robot_description"
    )


def test_a_plan_for_this_robot_is_not_refused(musashi: Robot, plan: SwingPlan) -> None:
    refuse_foreign_plan(plan, musashi.model)


def refusal(message: SwingPlanMessage) -> str:
    with pytest.raises(SwingNotReady) as caught:
        plan_of(message)
    return str(caught.value)


def test_an_answer_without_trajectory_is_refused() -> None:
    assert refusal(SwingPlanMessage()) == (
        "the planner's answer is no plan: the plan's trajectory has no step"
    )


def test_an_answer_with_a_method_that_is_none_is_refused(plan: SwingPlan) -> None:
    message = plan_to_message(plan)
    message.method = 9
    assert refusal(message) == "the planner's answer is no plan: 9 is not a valid Method"


class Planner:
    """The client of `plan_swing`, and its only call."""

    def __init__(self) -> None:
        self.there = True
        self.asked: list[PlanSwing.Request] = []
        self.answered: PlanSwing.Response | None = None

    def service_is_ready(self) -> bool:
        return self.there

    def call_async(self, request: PlanSwing.Request) -> "Planner":
        self.asked.append(request)
        return self

    def done(self) -> bool:
        return self.answered is not None

    def result(self) -> PlanSwing.Response | None:
        return self.answered


def question(planner: Planner, search_time_limit: float = math.nan) -> PlanQuestion:
    goal = ExecuteSwing.Goal(options=SwingOptions(search_time_limit=search_time_limit))
    asked = PlanQuestion(goal, cast(ExecutorLinks, SimpleNamespace(planner=planner)))
    asked.begin(10.0, 2.0)
    return asked


def test_the_planner_is_asked_once() -> None:
    planner = Planner()
    asked = question(planner)
    assert [asked.answer(10.0), asked.answer(10.1)] == [None, None]
    assert len(planner.asked) == 1


def test_the_plan_is_the_planners_answer() -> None:
    planner = Planner()
    asked = question(planner)
    asked.answer(10.0)
    planner.answered = PlanSwing.Response(error_code=ErrorCode.SUCCESS)
    assert asked.answer(10.1) is planner.answered.plan


def test_the_planners_refusal_is_raised() -> None:
    planner = Planner()
    asked = question(planner)
    asked.answer(10.0)
    planner.answered = PlanSwing.Response(
        error_code=ErrorCode.HOLDING_INFEASIBLE, error_string="too heavy"
    )
    with pytest.raises(HoldingInfeasible, match="too heavy"):
        asked.answer(10.1)


@pytest.mark.parametrize("there", [False, True])
@pytest.mark.parametrize(("limit", "longest"), [(math.nan, 2.0), (-1.0, 2.0), (5.0, 7.0)])
def test_it_waits_as_long_as_the_search_may_take_and_no_longer(
    there: bool, limit: float, longest: float
) -> None:
    planner = Planner()
    planner.there = there
    asked = question(planner, limit)
    assert asked.answer(10.0 + longest) is None
    with pytest.raises(SwingNotReady, match="plan_swing does not answer"):
        asked.answer(10.001 + longest)


def test_the_inhibitor_is_armed_with_the_threshold_of_the_plan() -> None:
    plan = SwingPlanMessage(joint_name=["E-p"], end_position=[1.5])
    options = SwingOptions(threshold=0.25, kept_muscle=["#2"])
    request = arm_request(Time(sec=7), plan, options, 3.5)
    assert (request.threshold, request.goal_position[0]) == (0.25, 1.5)
    assert (request.stamp.sec, request.time_limit.sec, request.time_limit.nanosec) == (
        7,
        3,
        500_000_000,
    )
