"""The speed index says which muscles restrain a motion, and how much."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from fastswing_planner.arrays import Matrix, Vector
from fastswing_planner.errors import StartEqualsEnd
from fastswing_planner.planning.speed_index import (
    greatest_moment_arm,
    moment_arm,
    plain_speed_index,
    speed_index,
    swing_speed_index,
    unit_direction,
)
from fastswing_planner.robot.description import Robot
from fastswing_planner.robot.muscle_model import MuscleModel

ARMS = arrays(float, (4, 2), elements=st.floats(-0.1, 0.1))
DIRECTION = arrays(float, 2, elements=st.floats(-3.0, 3.0)).filter(
    lambda vector: bool(np.linalg.norm(vector) > 1e-3)
)


@given(ARMS, DIRECTION)
def test_the_moment_arm_is_the_lengthening_per_radian(jacobian: Matrix, direction: Vector) -> None:
    way = sum(component**2 for component in direction) ** 0.5
    expected = [sum(g * d for g, d in zip(row, direction, strict=True)) / way for row in jacobian]
    assert moment_arm(jacobian, direction) == pytest.approx(expected, abs=1e-15)


@given(ARMS, DIRECTION, st.floats(0.01, 100.0))
def test_the_moment_arm_does_not_depend_on_the_speed(
    jacobian: Matrix, direction: Vector, factor: float
) -> None:
    faster = moment_arm(jacobian, factor * direction)
    assert faster == pytest.approx(moment_arm(jacobian, direction), abs=1e-14)


@given(ARMS, DIRECTION)
def test_the_way_back_swaps_agonists_and_antagonists(jacobian: Matrix, direction: Vector) -> None:
    assert moment_arm(jacobian, -direction).tolist() == (-moment_arm(jacobian, direction)).tolist()


def test_a_muscle_that_lengthens_is_a_positive_antagonist() -> None:
    assert moment_arm(np.array([[0.05], [-0.04]]), np.array([2.0])).tolist() == [0.05, -0.04]


@given(ARMS, DIRECTION)
def test_an_arm_lengthens_its_muscles_by_the_moment_arm_along_a_unit(
    jacobian: Matrix, velocity: Vector
) -> None:
    unit = unit_direction(velocity.tolist(), float(np.linalg.norm(velocity)))
    assert jacobian @ unit == pytest.approx(moment_arm(jacobian, velocity), abs=1e-15)


@given(arrays(float, 4, elements=st.floats(-0.1, 0.1)))
def test_the_speed_index_of_plain_numbers_is_the_same(arms: Vector) -> None:
    limit = np.array([0.1, 0.2, 0.3, 0.4])
    plain = plain_speed_index(arms.tolist(), limit.tolist())
    assert plain == pytest.approx(speed_index(arms, limit).tolist(), abs=1e-8)


@given(st.floats(-1e-9, 1e-9, exclude_min=True, exclude_max=True))
def test_round_off_is_no_speed_index(round_off: float) -> None:
    assert plain_speed_index([round_off, 1e-9, -1e-9], [0.1] * 3) == (0.0, 1e-8, -1e-8)


THRESHOLD = st.one_of(st.just(0.0), st.floats(1e-12, 1e6))
LIMIT = st.floats(1e-3, 1e3)


@given(THRESHOLD, LIMIT, st.integers(-3, 3))
def test_a_speed_index_is_above_the_threshold_just_above_the_greatest_moment_arm(
    threshold: float, limit: float, numbers_away: int
) -> None:
    arm = greatest = float(greatest_moment_arm(threshold, np.array([limit]))[0])
    for _ in range(abs(numbers_away)):
        arm = math.nextafter(arm, math.copysign(math.inf, numbers_away))
    assert (arm > greatest) is (plain_speed_index([arm], [limit])[0] > threshold)


@given(THRESHOLD, LIMIT, st.floats(-10.0, 10.0))
def test_a_speed_index_is_above_the_threshold_only_there(
    threshold: float, limit: float, arm: float
) -> None:
    greatest = greatest_moment_arm(threshold, np.array([limit]))[0]
    assert (arm > greatest) == (plain_speed_index([arm], [limit])[0] > threshold)


def test_a_standing_arm_has_no_direction() -> None:
    with pytest.raises(StartEqualsEnd, match="the direction of motion is zero"):
        unit_direction([0.0], 0.0)


def test_a_standing_arm_has_no_moment_arm() -> None:
    with pytest.raises(StartEqualsEnd) as caught:
        moment_arm(np.eye(2), np.zeros(2))
    assert str(caught.value) == "the direction of motion is zero, so no moment arm is defined"


def test_the_index_is_the_moment_arm_over_the_speed_limit() -> None:
    index = speed_index(np.array([0.06, -0.03]), np.array([0.3, 0.1]))
    assert index == pytest.approx([0.2, -0.3])


@given(ARMS, DIRECTION, DIRECTION)
def test_the_swings_index_is_taken_from_start_to_end(
    linear_arm: Callable[..., MuscleModel], jacobian: Matrix, start: Vector, end: Vector
) -> None:
    assume(np.linalg.norm(end - start) > 1e-3)
    index = swing_speed_index(linear_arm(jacobian), start, end, np.full(4, 0.3))
    expected = jacobian @ (end - start) / np.linalg.norm(end - start) / 0.3
    assert index == pytest.approx(expected, abs=1e-12)


def test_musashis_index_is_taken_at_the_midpoint(musashi: Robot) -> None:
    start, end = musashi.postures["start"], musashi.postures["end"]
    # Moment arms at the midpoint, by finite differences of the lengths along the way.
    middle, way = (start + end) / 2, (end - start) / np.linalg.norm(end - start)
    ahead, behind = (musashi.model.lengths(middle + side * 1e-6 * way) for side in (1, -1))
    expected = (ahead - behind) / 2e-6 / musashi.limits.velocity
    index = swing_speed_index(musashi.model, start, end, musashi.limits.velocity)
    assert index == pytest.approx(expected, abs=1e-6)


def test_musashis_antagonists_are_ordered_as_in_the_paper(musashi: Robot) -> None:
    start, end = musashi.postures["start"], musashi.postures["end"]
    index = swing_speed_index(musashi.model, start, end, musashi.limits.velocity)
    falling = sorted(zip(index, musashi.model.muscle_names, strict=True), reverse=True)
    assert [name for value, name in falling if value > 0] == ["#9", "#10", "#3", "#2"]
