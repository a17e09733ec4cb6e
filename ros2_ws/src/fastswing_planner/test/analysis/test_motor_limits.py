"""Which muscles went beyond what their motors may do, and whether that is known."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from fastswing_planner.analysis.finding import FindingSettings
from fastswing_planner.analysis.findings import examine
from fastswing_planner.analysis.measured_swing import MeasuredSwing
from fastswing_planner.analysis.measuring import measure_swings
from fastswing_planner.analysis.motor_limits import MotorLimit, limits_known
from fastswing_planner.analysis.recording import Recording
from fastswing_planner.analysis.report.record import results_record
from fastswing_planner.analysis.report.results import Results
from fastswing_planner.analysis.report.text import beyond_text

Recorded = Callable[..., Recording]
WIDE = dict.fromkeys(("#1", "#9", "#10"), MotorLimit(9.0, 200.0, 450.0))
NARROW = dict.fromkeys(WIDE, MotorLimit(0.3, 200.0, 450.0))


@pytest.fixture
def without_10(recorded: Recorded) -> Recording:
    """Return the recording without the speed of #10."""
    muscles = recorded().muscles
    assert muscles is not None
    velocity = muscles.velocity.copy()
    velocity[:, 2] = np.nan
    return recorded(muscles=replace(muscles, velocity=velocity))


def only(recording: Recording) -> MeasuredSwing:
    (swing,) = measure_swings(recording)
    return swing


def test_no_muscle_was_beyond_its_limit_if_all_are_known(recorded: Recorded) -> None:
    assert limits_known(only(recorded()), WIDE)
    assert beyond_text(only(recorded()), WIDE) == "none"


def test_a_muscle_without_a_limit_leaves_it_unknown(recorded: Recorded) -> None:
    assert not limits_known(only(recorded()), {"#1": WIDE["#1"]})


def test_a_muscle_of_unknown_speed_leaves_it_unknown(without_10: Recording) -> None:
    assert not limits_known(only(without_10), WIDE)
    assert beyond_text(only(without_10), WIDE) == "–"


def test_a_muscle_beyond_its_limit_is_named_even_if_another_is_unknown(
    without_10: Recording,
) -> None:
    assert beyond_text(only(without_10), NARROW) == "#9"


def test_muscles_of_unknown_speed_are_told(without_10: Recording) -> None:
    assert only(without_10).notes == ("speed or tension is unknown of #10",)


def test_in_json_unknown_is_null_and_not_none_at_all(without_10: Recording) -> None:
    found = examine("run.mcap", [without_10], FindingSettings())
    (bag,) = results_record(Results([found], WIDE))["bags"]
    assert bag["swings"][0]["beyond_velocity_limit"] is None
