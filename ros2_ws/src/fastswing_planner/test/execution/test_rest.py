"""When an arm counts as resting."""

import numpy as np

from fastswing_planner.execution.rest import RestWatch


def watch() -> RestWatch:
    return RestWatch(rest_speed=0.15, rest_time=0.2)


def test_an_arm_without_measurements_does_not_rest() -> None:
    assert not watch().resting(100.0)


def test_an_arm_rests_after_its_time() -> None:
    rest = watch()
    rest.add(1.0, np.array([0.15, -0.15]))
    assert not rest.resting(1.19)
    assert rest.resting(1.21)


def test_one_fast_joint_begins_the_rest_anew() -> None:
    rest = watch()
    rest.add(1.0, np.array([0.0, 0.0]))
    rest.add(1.1, np.array([0.0, 0.16]))
    rest.add(1.2, np.array([0.0, 0.0]))
    assert not rest.resting(1.3)


def test_a_speed_that_is_not_a_number_is_no_rest() -> None:
    rest = watch()
    rest.add(1.0, np.array([0.0]))
    rest.add(1.1, np.array([np.nan]))
    assert not rest.resting(2.0)
