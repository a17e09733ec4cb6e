"""Limits that make no sense are refused, and the text names muscle, value and unit."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fastswing_planner.errors import InvalidLimit, InvalidTensionRange, NotFinite
from fastswing_planner.robot.limits import MuscleLimits, muscle_limits

MUSCLES = ("a", "b")
FIELDS = ("velocity", "acceleration", "tension_min", "tension_max")


def limits_with(**changes: Any) -> MuscleLimits:
    """Build the paper's limits with some of them replaced."""
    values = {"velocity": 0.3, "acceleration": 0.46, "tension_min": 10.0, "tension_max": 200.0}
    return muscle_limits(MUSCLES, **{**values, **changes})


def test_one_number_counts_for_every_muscle() -> None:
    assert limits_with(velocity=0.2).velocity.tolist() == [0.2, 0.2]


def test_a_list_counts_muscle_by_muscle() -> None:
    assert limits_with(tension_max=[150, 250]).tension_max.tolist() == [150.0, 250.0]


@pytest.mark.parametrize("field", FIELDS)
def test_limits_cannot_be_written(field: str) -> None:
    assert not getattr(limits_with(), field).flags.writeable


def test_no_ramp_is_an_infinite_acceleration() -> None:
    assert np.isposinf(limits_with(acceleration=math.inf).acceleration).all()


def test_a_muscle_may_hold_without_tension() -> None:
    assert limits_with(tension_min=0.0).tension_min.tolist() == [0.0, 0.0]


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"velocity": [0.3, 0.0]}, "velocity_limit of b is 0 m/s, must be positive"),
        ({"velocity": -0.3}, "velocity_limit of a is -0.3 m/s, must be positive"),
        ({"acceleration": 0.0}, "acceleration_limit of a is 0 m/s^2, must be positive"),
        (
            {"acceleration": [0.46, -math.inf]},
            "acceleration_limit of b is -inf m/s^2, must be positive",
        ),
        ({"tension_min": -1.0}, "tension_min of a is -1 N, must not be negative"),
        ({"velocity": 1e-5}, "velocity_limit of a is 1e-05 m/s, must be 0.0001 to 1000"),
        ({"tension_max": 1e6}, "tension_max of a is 1e+06 N, must be 0.001 to 100000"),
    ],
)
def test_a_limit_without_sense_is_refused(change: dict[str, Any], text: str) -> None:
    with pytest.raises(InvalidLimit) as caught:
        limits_with(**change)
    assert str(caught.value) == text


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (
            {"tension_min": [10, 300]},
            "tension_max of b is 200 N, must be above its tension_min 300 N",
        ),
        ({"tension_max": 10.0}, "tension_max of a is 10 N, must be above its tension_min 10 N"),
    ],
)
def test_a_tension_range_without_room_is_refused(change: dict[str, Any], text: str) -> None:
    with pytest.raises(InvalidTensionRange) as caught:
        limits_with(**change)
    assert str(caught.value) == text


@pytest.mark.parametrize(
    ("field", "what"),
    [
        ("velocity", "velocity_limit"),
        ("tension_min", "tension_min"),
        ("tension_max", "tension_max"),
    ],
)
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_limit_must_be_finite(field: str, what: str, bad: float) -> None:
    with pytest.raises(NotFinite) as caught:
        limits_with(**{field: [1.0, bad] if field != "tension_max" else [200.0, bad]})
    assert str(caught.value) == f"{what} of b is {bad}, expected a finite number"


def test_an_acceleration_must_be_a_number() -> None:
    with pytest.raises(NotFinite) as caught:
        limits_with(acceleration=[0.46, math.nan])
    assert str(caught.value) == "acceleration_limit of b is nan, expected a number or infinity"


@pytest.mark.parametrize("values", [[0.3, 0.3, 0.3], "fast", [[0.3], [0.3, 0.3]]])
def test_values_that_fit_no_muscle_are_shown(values: object) -> None:
    with pytest.raises(InvalidLimit) as caught:
        limits_with(velocity=values)
    assert str(caught.value) == f"velocity_limit is {values!r}, expected one number or 2 numbers"


def test_limits_with_one_replaced_are_checked_again() -> None:
    changed = replace(limits_with(), velocity=np.array([0.3, -1.0]))
    with pytest.raises(InvalidLimit, match=r"^velocity_limit of b is -1 m/s, must be positive$"):
        changed.checked(MUSCLES)


def test_checking_makes_one_number_count_for_every_muscle() -> None:
    changed = replace(limits_with(), velocity=np.array(0.2))
    assert changed.checked(MUSCLES).velocity.tolist() == [0.2, 0.2]
