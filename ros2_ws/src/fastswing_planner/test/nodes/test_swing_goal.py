"""A plan is carried out only by the executor of the robot that it was made for."""

from dataclasses import replace

import pytest

from fastswing_msgs.msg import SwingPlan as SwingPlanMessage
from fastswing_planner.conversion.plans import plan_to_message
from fastswing_planner.errors import SwingNotReady
from fastswing_planner.nodes.swing_goal import _plan_of, _refuse_foreign_plan
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
        _refuse_foreign_plan(foreign, musashi.model)
    assert str(caught.value) == (
        "the planner's robot has the muscles #10, #9, #8, #7, #6, #5, #4, #3, #2, #1, this one "
        "#1, #2, #3, #4, #5, #6, #7, #8, #9, #10: give both nodes the same robot_description"
    )


def test_a_plan_for_this_robot_is_not_refused(musashi: Robot, plan: SwingPlan) -> None:
    _refuse_foreign_plan(plan, musashi.model)


def refusal(message: SwingPlanMessage) -> str:
    with pytest.raises(SwingNotReady) as caught:
        _plan_of(message)
    return str(caught.value)


def test_an_answer_without_trajectory_is_refused() -> None:
    assert refusal(SwingPlanMessage()) == (
        "the planner's answer is no plan: the plan's trajectory has no step"
    )


def test_an_answer_with_a_method_that_is_none_is_refused(plan: SwingPlan) -> None:
    message = plan_to_message(plan)
    message.method = 9
    assert refusal(message) == "the planner's answer is no plan: 9 is not a valid Method"
