"""A wrong request gets a code and a text that names the value, and moves nothing."""

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from fastswing_msgs.msg import ErrorCode, SwingOptions, SwingTrajectory

if TYPE_CHECKING:
    from test.system.suite import Suite


START = [-0.7475, 0.0, 0.0, -1.9422, 0.0]
WRONG = {
    "a NaN angle": (
        {"start_position": [*START[:3], float("nan"), 0.0]},
        ErrorCode.NOT_FINITE,
        ["start_position", "E-p", "nan"],
    ),
    "four angles for five joints": (
        {"end_position": [-0.4, 0.0, 0.0, -0.6]},
        ErrorCode.WRONG_LENGTH,
        ["end_position", "4", "5"],
    ),
    "an unknown muscle": (
        {"options": SwingOptions(method=SwingOptions.METHOD_ELONGATE, kept_muscle=["#11"])},
        ErrorCode.UNKNOWN_NAME,
        ["muscle", "#11", "#10"],
    ),
    "start equal to end": (
        {"end_position": START, "start_position": START},
        ErrorCode.START_EQUALS_END,
        ["start_position", "end_position", "-1.9422"],
    ),
    "an end out of joint range": (
        {"end_position": [-0.4, 0.0, 0.0, 2.5, 0.0]},
        ErrorCode.OUT_OF_RANGE,
        ["end_position", "E-p", "2.5"],
    ),
}


@pytest.fixture(params=WRONG)
def wrong(request: pytest.FixtureRequest) -> tuple[dict[str, Any], int, list[str]]:
    return WRONG[request.param]


def test_the_service_says_what_is_wrong(
    all_nodes: "Suite", wrong: tuple[dict[str, Any], int, list[str]]
) -> None:
    changes, code, words = wrong
    answer = all_nodes.plan(**changes)
    assert answer.error_code == code
    assert all(word in answer.error_string for word in words), answer.error_string


def test_the_service_gives_no_plan_for_a_wrong_request(
    all_nodes: "Suite", wrong: tuple[dict[str, Any], int, list[str]]
) -> None:
    assert all_nodes.plan(**wrong[0]).plan.trajectory == SwingTrajectory()


def test_the_action_says_what_is_wrong(
    all_nodes: "Suite", wrong: tuple[dict[str, Any], int, list[str]]
) -> None:
    changes, code, words = wrong
    result = all_nodes.execute(all_nodes.goal(**changes))
    assert result.error_code == code
    assert all(word in result.error_string for word in words), result.error_string


def test_a_wrong_goal_commands_nothing(
    all_nodes: "Suite", wrong: tuple[dict[str, Any], int, list[str]]
) -> None:
    before = len(all_nodes.length_commands)
    all_nodes.execute(all_nodes.goal(**wrong[0]))
    all_nodes.let_states_pass()
    assert len(all_nodes.length_commands) == before


def test_a_wrong_goal_does_not_move_the_arm(
    all_nodes: "Suite", wrong: tuple[dict[str, Any], int, list[str]]
) -> None:
    before = all_nodes.fresh_posture()
    all_nodes.execute(all_nodes.goal(**wrong[0]))
    all_nodes.let_states_pass()
    assert np.abs(all_nodes.fresh_posture() - before).max() < 1e-2


def test_the_planner_still_answers_after_wrong_requests(all_nodes: "Suite") -> None:
    for changes, _, _ in WRONG.values():
        all_nodes.plan(**changes)
    assert all_nodes.plan().error_code == ErrorCode.SUCCESS
