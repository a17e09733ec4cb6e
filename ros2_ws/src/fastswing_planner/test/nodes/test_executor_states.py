"""The newest states that fit the robot are kept, others are counted."""

from collections.abc import Sequence

import pytest
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

from fastswing_planner.nodes.executor_states import ExecutorStates
from fastswing_planner.robot.description import Robot

MADE = 12.5


@pytest.fixture
def states(musashi: Robot) -> ExecutorStates:
    states = ExecutorStates(lambda _message: MADE)
    states.expect(musashi.model)
    return states


def joint_state(names: Sequence[str], position: float) -> bytes:
    count = len(names)
    message = JointState(name=names, position=[position] * count, velocity=[0.0] * count)
    data: bytes = serialize_message(message)
    return data


def test_a_state_is_kept_with_the_time_at_which_it_was_made(
    states: ExecutorStates, musashi: Robot
) -> None:
    joints = states.read_joints(joint_state(musashi.model.joint_names, 0.1))
    assert joints is not None
    assert states.joints is joints
    assert (joints.time, joints.position[0]) == (MADE, 0.1)


def test_a_state_of_another_robot_is_counted_and_the_last_one_stays(
    states: ExecutorStates, musashi: Robot
) -> None:
    kept = states.read_joints(joint_state(musashi.model.joint_names, 0.1))
    assert states.read_joints(joint_state(["knee"], 0.1)) is None
    assert states.joints is kept
    assert states.rejected.counts == {"rejected_unknown_name": 1}


def test_damaged_bytes_are_counted(states: ExecutorStates) -> None:
    assert states.read_muscles(b"damaged") is None
    assert sum(states.rejected.counts.values()) == 1


def test_ages_are_told_of_states_that_came(states: ExecutorStates, musashi: Robot) -> None:
    assert states.ages(MADE) == {}
    states.read_joints(joint_state(musashi.model.joint_names, 0.1))
    assert states.ages(MADE + 0.02) == {"joint_state_age_ms": "20.0"}


def test_before_the_robot_is_known_there_are_no_ages() -> None:
    assert ExecutorStates(lambda _message: MADE).ages(MADE) == {}


def test_states_of_an_earlier_robot_are_forgotten(states: ExecutorStates, musashi: Robot) -> None:
    states.read_joints(joint_state(musashi.model.joint_names, 0.1))
    states.expect(musashi.model)
    assert states.joints is None
