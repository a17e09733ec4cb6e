"""Links and muscle paths in space; MuJoCo says how long a muscle is."""

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fastswing_planner.robot.description import Robot
from fastswing_planner.robot.mujoco_model import load_mjcf
from musashi_muscle_bridge.arm_view.muscle_lines import path_length
from musashi_muscle_bridge.arm_view.shapes import ArmShapes, Form
from musashi_muscle_bridge.arm_view.wrapped_path import wrapped_arc

SHARES = st.lists(st.floats(0.0, 1.0), min_size=5, max_size=5)


@pytest.fixture(scope="module")
def shapes(musashi: Robot) -> ArmShapes:
    return ArmShapes(musashi)


def posture(robot: Robot, shares: list[float]) -> np.ndarray:
    low, high = robot.model.joint_lower, robot.model.joint_upper
    return np.asarray(low + np.array(shares) * (high - low))


@given(SHARES)
def test_a_muscles_path_is_as_long_as_mujocos_tendon(
    musashi: Robot, shapes: ArmShapes, shares: list[float]
) -> None:
    angles = posture(musashi, shares)
    shapes.move(angles)
    drawn = [path_length(path) for path in shapes.paths()]
    # An arc of chords is a little shorter than the arc.
    assert drawn == pytest.approx(musashi.model.lengths(angles), abs=1e-4)


@given(SHARES)
def test_a_muscles_path_is_one_piece_between_its_ends(
    musashi: Robot, shapes: ArmShapes, shares: list[float]
) -> None:
    shapes.move(posture(musashi, shares))
    assert [len(path) for path in shapes.paths()] == [1] * 10


def test_some_muscle_is_wrapped_in_the_start_posture(musashi: Robot, shapes: ArmShapes) -> None:
    shapes.move(musashi.postures["start"])
    assert max(len(path[0]) for path in shapes.paths()) > 6


def test_every_link_has_a_solid(shapes: ArmShapes) -> None:
    named = {solid.name for solid in shapes.solids}
    assert {"trunk", "head", "humerus", "ulna", "radius_bone", "palm"} <= named


def test_what_mujocos_viewer_hides_is_not_drawn(shapes: ArmShapes) -> None:
    assert not any(solid.name.startswith("pulley") for solid in shapes.solids)


def test_a_capsule_is_a_cylinder_with_two_balls(shapes: ArmShapes) -> None:
    forms = [solid.form for solid in shapes.solids if solid.name == "humerus"]
    assert forms == [Form.CYLINDER, Form.BALL, Form.BALL]


@given(SHARES)
def test_a_capsules_balls_are_at_its_ends(
    musashi: Robot, shapes: ArmShapes, shares: list[float]
) -> None:
    angles = posture(musashi, shares)
    shapes.move(angles)
    tube, *balls = (solid for solid in shapes.solids if solid.name == "humerus")
    model = load_mjcf(musashi.mjcf)
    data = mujoco.MjData(model)
    data.qpos[:] = musashi.model.full_position(angles)
    mujoco.mj_forward(model, data)
    axis = data.geom("humerus").xmat.reshape(3, 3)[:, 2] * model.geom("humerus").size[1]
    middle = data.geom("humerus").xpos
    assert shapes.pose(tube).position == pytest.approx(middle)
    assert [shapes.pose(ball).position for ball in balls] == [
        pytest.approx(middle + axis),
        pytest.approx(middle - axis),
    ]


# Wrapping.


@given(st.floats(0.05, 5.5), st.floats(-0.1, 0.1), st.floats(0.01, 0.1))
def test_around_a_cylinder_the_path_is_a_helix(angle: float, climb: float, radius: float) -> None:
    begin = np.array([radius, 0.0, 0.0])
    end = np.array([radius * np.cos(angle), radius * np.sin(angle), climb])
    arc = wrapped_arc(begin - [0.0, 0.1, 0.0], begin, end, cylinder=True)
    line = np.array([begin, *arc, end])
    assert np.hypot(line[:, 0], line[:, 1]) == pytest.approx(np.full(len(line), radius))
    assert path_length((line,)) == pytest.approx(np.hypot(radius * angle, climb), rel=1e-3)


@given(st.floats(0.05, 5.5), st.floats(0.01, 0.1))
def test_around_a_ball_the_path_is_a_great_circle(angle: float, radius: float) -> None:
    begin = np.array([0.0, radius, 0.0])
    end = np.array([0.0, radius * np.cos(angle), radius * np.sin(angle)])
    arc = wrapped_arc(begin - [0.0, 0.0, 0.1], begin, end, cylinder=False)
    line = np.array([begin, *arc, end])
    assert np.linalg.norm(line, axis=1) == pytest.approx(np.full(len(line), radius))
    assert path_length((line,)) == pytest.approx(radius * angle, rel=1e-3)


def test_a_wire_that_just_touches_makes_no_turn() -> None:
    begin = np.array([0.05, 0.0, 0.0])
    end = np.array([0.05, -1e-12, 0.0])
    assert len(wrapped_arc(begin - [0.0, 0.1, 0.0], begin, end, cylinder=True)) == 0
