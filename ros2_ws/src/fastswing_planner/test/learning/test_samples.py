"""Muscle samples are taken evenly from a bag, and never more than asked for."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from bag_builder import HEADER, START, TIME, Builder, joint_state, stamp
from mcap_ros2._dynamic import serialize_dynamic

from fastswing_planner.bags import open_bag
from fastswing_planner.learning.samples import muscle_samples
from fastswing_planner.robot.muscle_model import MuscleModel

NAME = "fastswing_msgs/msg/MuscleState"
TEXT = f"std_msgs/Header header\nstring[] name\nfloat64[] length\nfloat64[] tension\n{HEADER}{TIME}"
WRITE = serialize_dynamic(NAME, TEXT)[NAME]


def recording(path: Path, count: int) -> Path:
    """Write as many states of one joint and one taut muscle, 10 ms apart."""
    with Builder(path) as bag:
        bag.joints().topic("/muscle_state", NAME, TEXT)
        for index in range(count):
            time_ns = START + index * 10_000_000
            bag.write("/joint_states", joint_state([index], time_ns), time_ns)
            muscle = {"header": stamp(time_ns), "name": ["m0"], "length": [1.0], "tension": [50.0]}
            bag.write("/muscle_state", bytes(WRITE(muscle)), time_ns)
    return path


@pytest.mark.parametrize(("most", "expected"), [(20, 20), (19, 10), (11, 10), (10, 10), (100, 20)])
def test_there_are_at_most_as_many_as_asked_for(
    tmp_path: Path, linear_arm: Callable[..., MuscleModel], most: int, expected: int
) -> None:
    bag = open_bag(recording(tmp_path / "a.mcap", 20))
    arm = linear_arm([[0.03]])
    samples = muscle_samples(bag, arm, np.array([7000.0]), most)
    assert len(samples.joint_position) == expected
