"""Encoder lengths hold a posture against stretching wires, and a path to it is smooth."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fastswing_planner.arrays import Vector, frozen
from fastswing_planner.errors import HoldingInfeasible
from fastswing_planner.execution.posture_path import (
    PosturePath,
    encoder_lengths,
    posture_path,
    smooth_fraction,
)
from fastswing_planner.planning.holding import Holding
from fastswing_planner.robot.muscle_model import MuscleModel

ArmBuilder = Callable[..., MuscleModel]
STIFFNESS = np.array([7000.0, 5000.0])
TENSION = np.array([70.0, 25.0])
TIME = st.floats(-1.0, 5.0)


def hold_up_to(limit: float) -> Callable[[Vector], Holding]:
    """Return how an arm holds whose first joint must not be above `limit` [rad]."""
    return lambda position: Holding(bool(position[0] <= limit), 1.25, frozen(TENSION))


def path_to(arm: ArmBuilder, end: float, limit: float = np.inf, speed: float = 0.8) -> PosturePath:
    """Plan from 0 to `end` [rad] with a one-joint arm of two muscles."""
    model = arm([[0.05], [-0.04]])
    begin, there = np.zeros(1), np.array([end])
    return posture_path(model, hold_up_to(limit), STIFFNESS, begin, there, speed)


def test_the_encoder_is_short_by_the_wires_stretch(linear_arm: ArmBuilder) -> None:
    lengths = encoder_lengths(linear_arm([[0.05], [-0.04]]), STIFFNESS, np.array([2.0]), TENSION)
    assert lengths == pytest.approx([0.1 - 0.01, -0.08 - 0.005])


@given(st.floats(0.0, 200.0), st.floats(-2.0, 2.0))
def test_wires_pull_with_the_planned_tension(
    linear_arm: ArmBuilder, tension: float, angle: float
) -> None:
    model, position = linear_arm([[0.05], [-0.04]]), np.array([angle])
    lengths = encoder_lengths(model, STIFFNESS, position, np.full(2, tension))
    pull = STIFFNESS * (model.lengths(position) - lengths)
    assert pull == pytest.approx([tension] * 2, abs=1e-9)


@given(TIME, TIME)
def test_a_motion_never_goes_back(one: float, other: float) -> None:
    earlier, later = sorted((one, other))
    assert smooth_fraction(earlier, 2.0) <= smooth_fraction(later, 2.0)


@given(TIME)
def test_a_motion_stays_between_its_ends(elapsed: float) -> None:
    assert 0.0 <= smooth_fraction(elapsed, 2.0) <= 1.0


@given(st.floats(0.0, 2.0))
def test_the_second_half_mirrors_the_first(elapsed: float) -> None:
    mirrored = 1.0 - smooth_fraction(2.0 - elapsed, 2.0)
    assert smooth_fraction(elapsed, 2.0) == pytest.approx(mirrored, abs=1e-12)


@pytest.mark.parametrize(("elapsed", "fraction"), [(-1.0, 0.0), (0.0, 0.0), (2.0, 1.0), (9.0, 1.0)])
def test_outside_of_its_time_a_motion_stands(elapsed: float, fraction: float) -> None:
    assert smooth_fraction(elapsed, 2.0) == fraction


@pytest.mark.parametrize("moment", [0.0, 2.0])
def test_a_motion_starts_and_ends_at_rest(moment: float) -> None:
    change = smooth_fraction(moment + 1e-4, 2.0) - smooth_fraction(moment - 1e-4, 2.0)
    assert abs(change) / 2e-4 < 1e-3


def test_a_motion_of_no_duration_is_over() -> None:
    assert smooth_fraction(0.0, 0.0) == 1.0


@pytest.mark.parametrize(("elapsed", "angle"), [(0.0, 0.0), (99.0, 0.6)])
def test_a_path_begins_and_ends_held(linear_arm: ArmBuilder, elapsed: float, angle: float) -> None:
    expected = encoder_lengths(linear_arm([[0.05], [-0.04]]), STIFFNESS, np.array([angle]), TENSION)
    assert path_to(linear_arm, 0.6).at(elapsed) == pytest.approx(expected)


@given(st.floats(-2.0, 2.0).filter(lambda end: abs(end) > 0.01), st.floats(0.1, 2.0))
def test_no_joint_is_faster_than_asked(linear_arm: ArmBuilder, end: float, speed: float) -> None:
    path = path_to(linear_arm, end, speed=speed)
    times = np.linspace(0.0, path.duration, 500)
    angles = np.array([path.at(time)[0] for time in times]) / 0.05
    fastest = float(np.abs(np.diff(angles)).max() / times[1])
    assert fastest == pytest.approx(speed, rel=0.05)
    assert fastest <= speed * 1.01


@given(TIME)
def test_lengths_between_two_postures_are_interpolated(elapsed: float) -> None:
    path = PosturePath(2.0, np.array([[0.0, 1.0], [0.5, 2.0], [1.0, 3.0]]))
    fraction = smooth_fraction(elapsed, 2.0)
    assert path.at(elapsed) == pytest.approx([fraction, 1.0 + 2.0 * fraction])


def test_a_path_to_where_the_arm_is_has_a_duration(linear_arm: ArmBuilder) -> None:
    assert path_to(linear_arm, 0.0).duration > 0.0


def test_a_posture_on_the_way_that_cannot_be_held_is_named(linear_arm: ArmBuilder) -> None:
    # The 40 postures are 2 / 39 rad apart; the first above 0.9 rad is the 18th step.
    with pytest.raises(HoldingInfeasible) as caught:
        path_to(linear_arm, 2.0, limit=0.9)
    assert str(caught.value) == (
        "on the way to the start posture, (0.923) rad cannot be held: 1.25 N m are missing"
    )


def test_the_measured_begin_need_not_hold(linear_arm: ArmBuilder) -> None:
    # Going down from 0 rad, postures above -0.05 rad do not hold: the first tenth of the way.
    assert path_to(linear_arm, -1.0, limit=-0.05).lengths.shape == (40, 2)
