"""A plan is carried out only by the executor of the robot that it was made for."""

import pytest

from fastswing_msgs.msg import SwingPlan
from fastswing_planner.errors import SwingAborted
from fastswing_planner.nodes.swing_goal import _figures_of, _refuse_foreign_plan
from fastswing_planner.robot.description import Robot


def test_a_plan_for_other_muscles_is_refused(musashi: Robot) -> None:
    model = musashi.model
    foreign = SwingPlan(joint_name=model.joint_names, muscle_name=model.muscle_names[::-1])
    with pytest.raises(SwingAborted) as caught:
        _refuse_foreign_plan(foreign, model)
    assert caught.value.code_name == "NOT_READY"
    assert str(caught.value) == (
        "the planner's robot has the muscles #10, #9, #8, #7, #6, #5, #4, #3, #2, #1, this one "
        "#1, #2, #3, #4, #5, #6, #7, #8, #9, #10: give both nodes the same robot_description"
    )


def test_a_plan_for_this_robot_is_not_refused(musashi: Robot) -> None:
    model = musashi.model
    _refuse_foreign_plan(
        SwingPlan(joint_name=model.joint_names, muscle_name=model.muscle_names), model
    )


def test_an_answer_without_trajectory_is_refused(musashi: Robot) -> None:
    model = musashi.model
    with pytest.raises(SwingAborted) as caught:
        _figures_of(SwingPlan(joint_name=model.joint_names, muscle_name=model.muscle_names))
    assert caught.value.code_name == "NOT_READY"
    text = "the planner's answer is no plan: the plan's trajectory has no step"
    assert str(caught.value) == text
