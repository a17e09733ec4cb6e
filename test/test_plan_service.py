"""The planner's service gives the paper's predictions for the robot's own swing."""

from typing import TYPE_CHECKING

import numpy as np
import pytest

from fastswing_msgs.msg import SwingOptions, SwingPlan

if TYPE_CHECKING:
    from test.conftest import Suite

pytestmark = pytest.mark.system

BASIC, METHOD_1, METHOD_2 = (
    SwingOptions.METHOD_BASIC,
    SwingOptions.METHOD_INHIBIT,
    SwingOptions.METHOD_ELONGATE,
)


def plan(suite: "Suite", method: int) -> SwingPlan:
    answer = suite.plan(options=SwingOptions(method=method))
    assert answer.error_string == ""
    return answer.plan


@pytest.mark.parametrize(("method", "expected"), [(BASIC, 2.4), (METHOD_2, 3.3), (METHOD_1, 4.4)])
def test_the_predicted_peak_elbow_speed_is_the_papers(
    all_nodes: "Suite", method: int, expected: float
) -> None:
    answer = plan(all_nodes, method)
    elbow = list(answer.joint_name).index("E-p")
    peak = max(abs(point.joint_velocity[elbow]) for point in answer.trajectory)
    assert peak == pytest.approx(expected, rel=0.10)


@pytest.mark.parametrize(
    ("method", "expected"),
    [(BASIC, []), (METHOD_2, ["#9"]), (METHOD_1, ["#2", "#3", "#9", "#10"])],
)
def test_the_masked_muscles_are_the_papers(
    all_nodes: "Suite", method: int, expected: list[str]
) -> None:
    answer = plan(all_nodes, method)
    names = zip(answer.muscle_name, answer.mask, strict=True)
    assert [name for name, kept in names if not kept] == expected


def test_method_2_pays_out_the_masked_muscle_alone(all_nodes: "Suite") -> None:
    answer = plan(all_nodes, METHOD_2)
    paid_out = np.flatnonzero(answer.elongation)
    assert [answer.muscle_name[index] for index in paid_out] == ["#9"]


def test_method_2_takes_less_time_than_basic(all_nodes: "Suite") -> None:
    answer = plan(all_nodes, METHOD_2)
    assert answer.time_cost < answer.time_cost_basic


def test_a_kept_muscle_is_not_masked(all_nodes: "Suite") -> None:
    options = SwingOptions(method=METHOD_1, kept_muscle=["#9"])
    answer = all_nodes.plan(options=options).plan
    assert answer.mask[list(answer.muscle_name).index("#9")] == 1


def test_the_same_request_with_joints_in_another_order_gives_the_same_swing(
    all_nodes: "Suite",
) -> None:
    postures, names = all_nodes.robot.postures, all_nodes.robot.model.joint_names
    turned = all_nodes.plan(
        joint_name=list(reversed(names)),
        start_position=postures["start"][::-1].tolist(),
        end_position=postures["end"][::-1].tolist(),
    )
    assert turned.plan.trajectory == plan(all_nodes, BASIC).trajectory
