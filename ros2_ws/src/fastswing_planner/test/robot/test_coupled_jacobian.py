"""The Jacobian and gravity of joints that others follow are slopes of length and energy."""

from functools import cache

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fastswing_planner.arrays import Matrix, Vector
from fastswing_planner.robot.mujoco_model import MujocoMuscleModel
from fastswing_planner.robot.muscle_model import Payload

# j2 follows j1, j3 follows j2, j4 is locked by an equality; j5 is left out, at a keyframe.
MJCF = """
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <site name="ground" pos="0.3 0.1 0.4"/>
    <body name="b0" pos="0 0 0.5">
      <joint name="j0" axis="0 1 0"/>
      <geom size="0.03" pos="0.1 0 -0.1" mass="0.8"/>
      <body name="b1" pos="0.1 0 -0.2">
        <joint name="j1" axis="0.6 0.8 0" ref="0.1"/>
        <geom size="0.03" pos="0.05 0 -0.1" mass="0.5"/>
        <body name="b2" pos="0 0.05 -0.2">
          <joint name="j2" axis="0 1 0" ref="-0.2"/>
          <geom size="0.03" pos="0.02 0 -0.1" mass="0.4"/>
          <body name="b3" pos="0.02 0 -0.2">
            <joint name="j3" axis="1 0 0"/>
            <geom size="0.03" pos="0 0.03 -0.05" mass="0.3"/>
            <body name="b4" pos="0 0 -0.1">
              <joint name="j4" axis="0 1 0"/>
              <geom size="0.03" pos="0.03 0 -0.05" mass="0.2"/>
              <body name="hand" pos="0 0 -0.1">
                <joint name="j5" axis="0 1 0"/>
                <geom size="0.03" pos="0.03 0.02 -0.05" mass="0.2"/>
                <site name="tip" pos="0.05 0.03 -0.1"/>
              </body>
            </body>
          </body>
          <site name="side" pos="0.04 0.01 -0.1"/>
        </body>
      </body>
    </body>
  </worldbody>
  <tendon>
    <spatial name="short"><site site="ground"/><site site="side"/></spatial>
    <spatial name="long"><site site="ground"/><site site="side"/><site site="tip"/></spatial>
  </tendon>
  <equality>
    <joint joint1="j3" joint2="j2" polycoef="0.05 -0.4 0.2 0.1 0.3"/>
    <joint joint1="j2" joint2="j1" polycoef="-0.1 0.7 -0.3 0.2 0.1"/>
    <joint joint1="j4" polycoef="0.25"/>
  </equality>
  <keyframe>
    <key name="bent" qpos="0 0 0 0 0 0.6"/>
  </keyframe>
</mujoco>
"""
ANGLES = st.lists(st.floats(-0.8, 0.8), min_size=2, max_size=2).map(np.array)
PAYLOAD = Payload(1.7, "hand", (0.03, -0.02, -0.05))


@cache
def coupled_arm() -> MujocoMuscleModel:
    """Return the arm of j0 and j1 that the other joints follow."""
    plain = mujoco.MjModel.from_xml_string(MJCF)
    return MujocoMuscleModel(plain, ("j1", "j0"), ("long", "short"), "bent")


def plain_positions(at: Vector) -> Vector:
    """Return all joints' angles [rad], by the XML reference's words for equality/joint."""
    j1, j0 = at
    away = j1 - 0.1
    j2 = -0.2 + (-0.1 + 0.7 * away - 0.3 * away**2 + 0.2 * away**3 + 0.1 * away**4)
    away = j2 + 0.2
    j3 = 0.05 - 0.4 * away + 0.2 * away**2 + 0.1 * away**3 + 0.3 * away**4
    return np.array([j0, j1, j2, j3, 0.25, 0.6])


@cache
def plain_model() -> mujoco.MjModel:
    """Return MuJoCo's own model of the whole arm."""
    return mujoco.MjModel.from_xml_string(MJCF)


def plain_data(at: Vector) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Return the model and its state with the followers where they belong."""
    model = plain_model()
    data = mujoco.MjData(model)
    data.qpos[:] = plain_positions(at)
    mujoco.mj_forward(model, data)
    return model, data


def plain_energy(at: Vector) -> float:
    """Return -sum of m g . x of all bodies and the payload [J]."""
    model, data = plain_data(at)
    hand = data.body("hand")
    point = hand.xpos + hand.xmat.reshape(3, 3) @ np.array(PAYLOAD.position)
    weights = [*model.body_mass, PAYLOAD.mass]
    return float(-np.array(weights) @ np.vstack([data.xipos, point]) @ model.opt.gravity)


@given(ANGLES, st.tuples(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0)))
def test_muscles_lengthen_as_the_jacobian_says(at: Vector, speeds: tuple[float, float]) -> None:
    expected = coupled_arm().jacobian(at) @ speeds
    assert coupled_arm().muscle_velocity(at.tolist(), speeds) == pytest.approx(expected, abs=1e-8)


@given(ANGLES)
def test_lengths_are_those_of_the_followed_posture(at: Vector) -> None:
    _, data = plain_data(at)
    expected = [data.tendon(name).length[0] for name in ("long", "short")]
    assert coupled_arm().lengths(at) == pytest.approx(expected, abs=1e-12)


@given(ANGLES)
def test_the_jacobian_is_the_slope_of_the_lengths(at: Vector) -> None:
    arm, step = coupled_arm(), 1e-6
    slopes: Matrix = np.array(
        [
            (arm.lengths(at + step * axis) - arm.lengths(at - step * axis)) / (2 * step)
            for axis in np.eye(2)
        ]
    ).T
    assert arm.jacobian(at) == pytest.approx(slopes, abs=1e-8)


@given(ANGLES)
def test_gravity_is_the_slope_of_the_potential_energy(at: Vector) -> None:
    step = 1e-6
    slopes = [
        (plain_energy(at + step * axis) - plain_energy(at - step * axis)) / (2 * step)
        for axis in np.eye(2)
    ]
    assert coupled_arm().gravity_torque(at, PAYLOAD) == pytest.approx(slopes, abs=1e-6)


def test_the_same_equality_twice_says_nothing_new() -> None:
    line = '<joint joint1="j4" polycoef="0.25"/>'
    twice = mujoco.MjModel.from_xml_string(MJCF.replace(line, line + line))
    arm = MujocoMuscleModel(twice, ("j1", "j0"), ("long", "short"), "bent")
    at = np.array([0.3, -0.2])
    assert arm.lengths(at) == pytest.approx(coupled_arm().lengths(at), abs=1e-12)
