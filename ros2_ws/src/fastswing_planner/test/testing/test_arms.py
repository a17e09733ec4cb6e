"""The arms to test on are muscle models, and what they say fits together."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from fastswing_planner.arrays import Vector
from fastswing_planner.errors import UnknownName
from fastswing_planner.planning.planner import SwingPlanner
from fastswing_planner.planning.request import SwingRequest
from fastswing_planner.qp.solvers import ProxSuiteSolver
from fastswing_planner.robot.limits import muscle_limits
from fastswing_planner.robot.muscle_model import MuscleModel, Payload
from fastswing_planner.testing.arms import BentArm, LinearArm

G = [[0.05, 0.0], [-0.04, 0.02], [0.0, -0.03]]
ANGLE = st.floats(-1.0, 1.0)


def lengths(joint_position: Vector) -> ArrayLike:
    a, b = joint_position
    return [0.2 + 0.05 * np.sin(a), 0.3 - 0.04 * a * b, 0.1 + 0.03 * np.cos(a - b)]


def jacobian(joint_position: Vector) -> ArrayLike:
    a, b = joint_position
    slope = 0.03 * np.sin(a - b)
    return [[0.05 * np.cos(a), 0.0], [-0.04 * b, -0.04 * a], [-slope, slope]]


ARMS = {"linear": LinearArm(G), "bent": BentArm(lengths, jacobian, 2)}
each_arm = pytest.mark.parametrize("arm", ARMS.values(), ids=ARMS)


@each_arm
@given(st.tuples(ANGLE, ANGLE), st.tuples(ANGLE, ANGLE))
def test_its_jacobian_is_the_slope_of_its_lengths(
    arm: MuscleModel, posture: tuple[float, float], direction: tuple[float, float]
) -> None:
    at, step = np.array(posture), 1e-6 * np.array(direction)
    slope = arm.lengths(at + step) - arm.lengths(at - step)
    assert slope == pytest.approx(2 * arm.jacobian(at) @ step, abs=1e-15)


@each_arm
@given(st.tuples(ANGLE, ANGLE), st.tuples(ANGLE, ANGLE))
def test_its_muscles_lengthen_as_its_jacobian_says(
    arm: MuscleModel, posture: tuple[float, float], speed: tuple[float, float]
) -> None:
    expected = arm.jacobian(np.array(posture)) @ speed
    assert arm.muscle_velocity(posture, speed) == pytest.approx(expected)


@each_arm
def test_joints_and_muscles_are_numbered(arm: MuscleModel) -> None:
    assert arm.joint_names == ("j0", "j1")
    assert arm.muscle_names == ("m0", "m1", "m2")


def test_a_range_counts_to_both_sides_of_zero() -> None:
    arm = LinearArm(G, joint_range=1.5)
    assert (arm.joint_lower.tolist(), arm.joint_upper.tolist()) == ([-1.5, -1.5], [1.5, 1.5])


def test_a_payload_adds_to_the_weight_of_each_joint() -> None:
    arm = LinearArm(G, torque=[1.0, 2.0])
    assert arm.gravity_torque(np.zeros(2), Payload(0.5, "hand")).tolist() == [1.5, 2.5]


def test_only_the_hand_carries_a_payload() -> None:
    with pytest.raises(UnknownName, match=r"^unknown body 'foot', choose from: hand$"):
        LinearArm(G).gravity_torque(np.zeros(2), Payload(0.5, "foot"))


def test_a_swing_is_planned_for_it() -> None:
    arm = LinearArm([[0.05], [-0.05]])
    limits = muscle_limits(arm.muscle_names, 0.3, 0.46, 0.0, 200.0)
    planner = SwingPlanner(arm, limits, ProxSuiteSolver())
    plan = planner.plan(SwingRequest(np.array([-0.5]), np.array([0.5])))
    assert plan.trajectory.joint_position[-1] == pytest.approx([0.5], abs=0.02)
