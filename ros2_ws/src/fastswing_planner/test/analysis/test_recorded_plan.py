"""A plan's message as arrays; one that no swing can follow is refused with its reason."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fastswing_planner.analysis.recording_reading import recorded_plan


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
        "trajectory": [],
    }
    return SimpleNamespace(**(fields | changes))


def test_a_plan_is_read_by_its_names() -> None:
    plan = recorded_plan(3.0, message())
    assert (plan.received, plan.method, plan.joint_names) == (3.0, "inhibit", ("a", "b"))
    assert plan.masked == ("n",)


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
