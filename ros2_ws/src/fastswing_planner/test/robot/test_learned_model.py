"""A learned model adds its correction to the MJCF's own model, and leaves the rest to it."""

import numpy as np
import pytest

from fastswing_planner.errors import OutOfRange
from fastswing_planner.robot.description import Robot
from fastswing_planner.robot.learned_model import LearnedMuscleModel
from fastswing_planner.robot.length_correction import LengthCorrection
from fastswing_planner.robot.mujoco_model import MujocoMuscleModel
from fastswing_planner.robot.muscle_model import Payload


@pytest.fixture(scope="module")
def plain(musashi: Robot) -> MujocoMuscleModel:
    assert isinstance(musashi.model, MujocoMuscleModel)
    return musashi.model


@pytest.fixture(scope="module")
def model(plain: MujocoMuscleModel) -> LearnedMuscleModel:
    """Return a model whose muscles differ by an offset and one bell around zero."""
    joints, muscles = len(plain.joint_names), len(plain.muscle_names)
    correction = LengthCorrection(
        joint_names=plain.joint_names,
        muscle_names=plain.muscle_names,
        centers=np.zeros((1, joints)),
        weights=np.linspace(-0.01, 0.02, muscles)[np.newaxis],
        mean=np.linspace(0.0, 0.005, muscles),
        scale=0.5,
        recorded=np.zeros((1, joints)),
        taut=np.ones((1, muscles), dtype=bool),
        held_out_rms=np.zeros(muscles),
        slope=np.zeros(muscles),
    )
    return LearnedMuscleModel(plain, correction)


NEAR = np.array([0.1, -0.05, 0.05, -0.1, 0.0])
FAR = np.array([0.0, 0.0, 0.0, -1.0, 0.0])


def test_lengths_are_the_mjcfs_with_the_correction(model: LearnedMuscleModel) -> None:
    difference = model.lengths(NEAR) - model.plain.lengths(NEAR)
    assert difference == pytest.approx(model.correction.lengths(NEAR), abs=1e-15)


def test_the_jacobian_is_the_slope_of_the_corrected_lengths(model: LearnedMuscleModel) -> None:
    steps = 1e-5 * np.eye(NEAR.size)
    slopes = [(model.lengths(NEAR + step) - model.lengths(NEAR - step)) / 2e-5 for step in steps]
    assert np.transpose(slopes) == pytest.approx(model.jacobian(NEAR), abs=1e-7)


def test_muscles_lengthen_as_the_corrected_jacobian_says(model: LearnedMuscleModel) -> None:
    speed = np.array([0.3, -0.2, 0.1, 1.5, -0.4])
    expected = model.jacobian(NEAR) @ speed
    assert model.muscle_velocity(NEAR.tolist(), speed.tolist()) == pytest.approx(expected)


def test_arrays_of_a_learned_model_cannot_be_written(model: LearnedMuscleModel) -> None:
    assert not model.lengths(NEAR).flags.writeable
    assert not model.jacobian(NEAR).flags.writeable


def test_far_from_the_recorded_postures_it_refuses(model: LearnedMuscleModel) -> None:
    with pytest.raises(OutOfRange):
        model.lengths(FAR)
    with pytest.raises(OutOfRange):
        model.jacobian(FAR)
    with pytest.raises(OutOfRange):
        model.muscle_velocity(FAR.tolist(), [0.0] * FAR.size)


def test_weight_and_payload_are_the_mjcfs_wherever_the_arm_is(
    model: LearnedMuscleModel, musashi: Robot
) -> None:
    payload = Payload(0.5, musashi.payload_body)
    expected = model.plain.gravity_torque(FAR, payload)
    assert model.gravity_torque(FAR, payload).tolist() == expected.tolist()


def test_joints_bodies_and_ranges_are_the_mjcfs(
    model: LearnedMuscleModel, plain: MujocoMuscleModel
) -> None:
    assert (model.joint_names, model.muscle_names) == (plain.joint_names, plain.muscle_names)
    assert model.body_names == plain.body_names
    assert model.joint_lower.tolist() == plain.joint_lower.tolist()
    assert model.joint_upper.tolist() == plain.joint_upper.tolist()
    assert model.full_position(NEAR).tolist() == plain.full_position(NEAR).tolist()
    assert model.held_joints() == plain.held_joints()
