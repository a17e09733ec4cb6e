"""A plan's message as arrays; one that no swing can follow is refused with its reason."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fastswing_planner.analysis.recorded_plan import recorded_plan


def trajectory(**changes: Any) -> SimpleNamespace:
    fields: dict[str, Any] = {
        "time_from_start": [0.0, 0.1],
        "joint_velocity": [0.0, 0.0, 1.0, 2.0],
        "muscle_velocity": [0.0, 0.0, 3.0, 4.0],
    }
    return SimpleNamespace(**(fields | changes))


def message(**changes: Any) -> SimpleNamespace:
    """Return a plan of two joints and two muscles with some of its fields exchanged."""
    fields: dict[str, Any] = {
        "method": 1,
        "joint_name": ["a", "b"],
        "start_position": [0.0, 1.0],
        "end_position": [0.0, 2.0],
        "muscle_name": ["m", "n"],
        "mask": [1, 0],
        "inhibited": [0, 1],
        "elongation": [0.0, 0.0],
        "speed_index": [0.1, 0.2],
        "time_cost": 0.5,
        "trajectory": trajectory(),
    }
    return SimpleNamespace(**(fields | changes))


def test_a_plan_is_read_by_its_names() -> None:
    plan = recorded_plan(3.0, message())
    assert (plan.received, plan.method, plan.joint_names) == (3.0, "inhibit", ("a", "b"))
    assert plan.masked == ("n",)


def test_the_predicted_motion_has_a_row_for_each_step() -> None:
    plan = recorded_plan(0.0, message())
    assert plan.time.tolist() == [0.0, 0.1]
    assert plan.joint_velocity.tolist() == [[0.0, 0.0], [1.0, 2.0]]
    assert plan.muscle_velocity.tolist() == [[0.0, 0.0], [3.0, 4.0]]


def test_a_plan_that_was_recorded_with_a_message_for_each_step_is_the_same() -> None:
    steps = [
        SimpleNamespace(time_from_start=time, joint_velocity=joint, muscle_velocity=muscle)
        for time, joint, muscle in ((0.0, [0.0, 0.0], [0.0, 0.0]), (0.1, [1.0, 2.0], [3.0, 4.0]))
    ]
    old, new = (recorded_plan(0.0, message(**part)) for part in ({"trajectory": steps}, {}))
    for name in ("time", "joint_velocity", "muscle_velocity"):
        assert np.array_equal(getattr(old, name), getattr(new, name))


def test_a_step_of_another_length_is_unknown() -> None:
    rows = ([0.0, 0.0], [1.0], [2.0, 3.0, 4.0])
    steps = [
        SimpleNamespace(time_from_start=time, joint_velocity=row, muscle_velocity=[5.0, 6.0])
        for time, row in enumerate(rows)
    ]
    plan = recorded_plan(0.0, message(trajectory=steps))
    expected = [[0.0, 0.0], [np.nan, np.nan], [np.nan, np.nan]]
    assert np.array_equal(plan.joint_velocity, expected, equal_nan=True)
    assert plan.muscle_velocity.tolist() == [[5.0, 6.0]] * 3


def test_a_table_that_is_too_short_is_unknown() -> None:
    plan = recorded_plan(0.0, message(trajectory=trajectory(muscle_velocity=[1.0])))
    assert np.isnan(plan.muscle_velocity).all()
    assert not np.isnan(plan.joint_velocity).any()


@pytest.mark.parametrize("name", ["inhibited", "speed_index"])
def test_what_a_plan_did_not_know_yet_is_zero(name: str) -> None:
    old, empty = message(), message(**{name: []})
    delattr(old, name)
    for plan in (old, empty):
        assert np.array_equal(getattr(recorded_plan(0.0, plan), name), [0, 0])


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"joint_name": [], "start_position": [], "end_position": []}, "it names no joint"),
        ({"end_position": [0.0, 1.0]}, "it ends where it starts"),
        ({"start_position": [0.0]}, "start_position has 1 values for 2 names"),
        ({"mask": []}, "mask has 0 values for 2 names"),
        ({"inhibited": [1]}, "inhibited has 1 values for 2 names"),
        ({"speed_index": [0.1, 0.2, 0.3]}, "speed_index has 3 values for 2 names"),
    ],
)
def test_a_plan_that_makes_no_sense_is_refused(changes: dict[str, Any], reason: str) -> None:
    with pytest.raises(ValueError, match=f"^{reason}$"):
        recorded_plan(0.0, message(**changes))
