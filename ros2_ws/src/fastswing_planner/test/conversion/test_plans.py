"""Requests, plans and outcomes survive their messages, also as bytes."""

import dataclasses
import math
from array import array
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message

from fastswing_msgs.msg import ErrorCode, SwingOptions, SwingTrajectory
from fastswing_msgs.srv import PlanSwing
from fastswing_planner.conversion.plans import (
    outcome_from_message,
    outcome_to_message,
    plan_from_message,
    plan_to_message,
    predicted_figures,
    request_from_message,
    request_to_message,
)
from fastswing_planner.errors import (
    HoldingInfeasible,
    InvalidLimit,
    NotFinite,
    PlannerError,
    SwingBlocked,
    UnknownMethod,
    WrongLength,
)
from fastswing_planner.planning.mask_search import Verdict
from fastswing_planner.planning.plan import Outcome, SwingPlan
from fastswing_planner.planning.planner import SwingPlanner
from fastswing_planner.planning.request import Method, MuscleConstants, Search, SwingRequest
from fastswing_planner.planning.swing import SETTING_RANGES, SwingSettings
from fastswing_planner.qp.solvers import ProxSuiteSolver
from fastswing_planner.robot.description import Robot
from fastswing_planner.robot.muscle_model import Payload

OWN = SwingSettings(0.02, 0.05, 77)
"""The planner's own settings, where a request gives none."""

NUMBERS = st.lists(st.floats(), max_size=3)
NAMES = st.lists(
    st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0")), max_size=3
)
PAYLOADS = st.builds(
    Payload,
    st.floats().filter(lambda mass: mass != 0.0),
    st.sampled_from(["hand", "forearm"]),
    st.tuples(st.floats(), st.floats(), st.floats()),
)
REQUESTS = st.builds(
    SwingRequest,
    start=NUMBERS,
    end=NUMBERS,
    method=st.sampled_from(Method),
    joint_names=NAMES,
    kept_muscles=NAMES,
    constants=st.builds(MuscleConstants, NAMES, NUMBERS, NUMBERS, NUMBERS, NUMBERS, NUMBERS),
    threshold=st.floats(),
    payload=st.none() | PAYLOADS,
    settings=st.builds(
        SwingSettings,
        st.floats(*SETTING_RANGES["time_step"][:2]),
        st.floats(*SETTING_RANGES["epsilon"][:2]),
        st.integers(1, 100_000),
    ),
    swing_weight=NUMBERS,
    search=st.sampled_from(Search),
    time_limit=st.floats().filter(lambda limit: limit != 0.0),
)


def plain(value: Any) -> Any:
    """Return dataclasses and arrays as what compares with ==, NaN included."""
    if dataclasses.is_dataclass(value):
        fields = dataclasses.fields(value)
        return {field.name: plain(getattr(value, field.name)) for field in fields}
    if isinstance(value, np.ndarray):
        return (str(value.dtype), plain(value.tolist()))
    if isinstance(value, (list, tuple, array)):
        return [plain(item) for item in value]
    if isinstance(value, PlannerError):
        return (type(value), str(value))
    return repr(value)


def through_bytes(message: Any) -> Any:
    return deserialize_message(serialize_message(message), type(message))


def received(request: PlanSwing.Request) -> SwingRequest:
    return request_from_message(request, OWN, math.inf, "forearm")


def plan(robot: Robot, method: Method, **changes: Any) -> SwingPlan:
    request = SwingRequest(robot.postures["start"], robot.postures["end"], method, **changes)
    return SwingPlanner(robot.model, robot.limits, ProxSuiteSolver()).plan(request)


@given(REQUESTS, st.booleans())
def test_a_request_survives_its_message(request: SwingRequest, compare: bool) -> None:
    message = through_bytes(request_to_message(request, compare))
    assert plain(received(message)) == plain(request)
    assert message.compare is compare


def test_a_request_of_defaults_survives_its_message() -> None:
    request = SwingRequest([0.0], [1.0])
    assert plain(received(through_bytes(request_to_message(request, False)))) == plain(request)


def test_a_request_may_hold_arrays() -> None:
    message = request_to_message(SwingRequest(np.zeros(2), np.ones(2)), False)
    assert list(message.end_position) == [1.0, 1.0]


def test_a_matrix_is_sent_row_by_row() -> None:
    request = SwingRequest([0.0], [1.0], swing_weight=[[1.0, 2.0], [3.0, 4.0]])
    message = request_to_message(request, False)
    assert list(message.options.swing_weight) == [1.0, 2.0, 3.0, 4.0]


def test_a_default_message_asks_for_a_basic_swing() -> None:
    asked = received(PlanSwing.Request())
    assert (asked.method, asked.search, asked.payload) == (Method.BASIC, Search.GREEDY, None)


def test_settings_of_zero_are_the_planners_own() -> None:
    assert received(PlanSwing.Request()).settings == OWN


def test_a_setting_of_the_request_replaces_the_planners() -> None:
    asked = received(PlanSwing.Request(options=SwingOptions(max_steps=5)))
    assert asked.settings == SwingSettings(OWN.time_step, OWN.epsilon, 5)


def test_a_time_limit_of_zero_is_the_planners_own() -> None:
    assert request_from_message(PlanSwing.Request(), OWN, 2.5, "hand").time_limit == 2.5


def test_an_infinite_time_limit_is_left_to_the_planner() -> None:
    message = request_to_message(SwingRequest([0.0], [1.0]), False)
    assert message.options.search_time_limit == 0.0


def test_a_payload_without_a_body_is_carried_by_the_robots_own() -> None:
    asked = received(PlanSwing.Request(options=SwingOptions(payload_mass=2.0)))
    assert asked.payload == Payload(2.0, "forearm", (0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"method": 4}, UnknownMethod),
        ({"search": 2}, UnknownMethod),
        ({"time_step": math.nan}, NotFinite),
        ({"epsilon": -1.0}, InvalidLimit),
        ({"max_steps": 2**32 - 1}, InvalidLimit),
    ],
)
def test_options_without_sense_are_refused(
    options: dict[str, Any], error: type[PlannerError]
) -> None:
    with pytest.raises(error):
        received(PlanSwing.Request(options=SwingOptions(**options)))


@pytest.mark.parametrize("method", Method)
def test_a_plan_survives_its_message(musashi: Robot, method: Method) -> None:
    planned = plan(musashi, method, search=Search.EXHAUSTIVE)
    assert plain(plan_from_message(through_bytes(plan_to_message(planned)))) == plain(planned)


def test_a_plan_with_warnings_and_a_blocked_mask_survives_its_message(musashi: Robot) -> None:
    planned = plan(musashi, Method.ELONGATE, constants=MuscleConstants(["#3"], tension_max=[60.0]))
    blocked = dataclasses.replace(planned.trials[-1], verdict=Verdict.SWING_BLOCKED)
    planned = dataclasses.replace(planned, trials=(*planned.trials, blocked))
    assert planned.warnings
    assert plain(plan_from_message(through_bytes(plan_to_message(planned)))) == plain(planned)


def test_arrays_of_a_received_plan_cannot_be_written(musashi: Robot) -> None:
    received_plan = plan_from_message(through_bytes(plan_to_message(plan(musashi, Method.BASIC))))
    found = [*vars(received_plan).values(), *vars(received_plan.trajectory).values()]
    assert not any(value.flags.writeable for value in found if isinstance(value, np.ndarray))


def test_a_message_tells_both_time_costs(musashi: Robot) -> None:
    message = plan_to_message(plan(musashi, Method.ELONGATE))
    assert (message.time_cost, message.time_cost_basic) == pytest.approx((0.78, 0.99))


def test_a_mask_is_one_for_kept_muscles(musashi: Robot) -> None:
    message = plan_to_message(plan(musashi, Method.ELONGATE))
    assert list(message.mask) == [1, 1, 1, 1, 1, 1, 1, 1, 0, 1]


def test_predicted_figures_are_the_trajectorys_peaks(musashi: Robot) -> None:
    planned = plan(musashi, Method.INHIBIT)
    figures = predicted_figures(planned)
    expected = np.abs(planned.trajectory.joint_velocity).max(axis=0)
    assert list(figures.peak_joint_velocity) == expected.tolist()


@pytest.mark.parametrize(
    ("field", "wrong", "text"),
    [
        (
            "joint_velocity",
            [1.0],
            "a table of the plan's trajectory has 1 values, expected 5 for each of 34 steps",
        ),
        ("time_from_start", [], "the plan's trajectory has no step"),
    ],
)
def test_a_trajectory_that_does_not_fit_is_no_plan(
    musashi: Robot, field: str, wrong: list[float], text: str
) -> None:
    message = plan_to_message(plan(musashi, Method.BASIC))
    setattr(message.trajectory, field, wrong)
    with pytest.raises(WrongLength) as caught:
        plan_from_message(message)
    assert str(caught.value) == text


@pytest.mark.parametrize("field", ["end_position", "mask", "elongation", "final_tension"])
def test_a_vector_of_another_length_is_no_plan(musashi: Robot, field: str) -> None:
    message = plan_to_message(plan(musashi, Method.BASIC))
    count = len(getattr(message, field))
    setattr(message, field, getattr(message, field)[:-1])
    with pytest.raises(WrongLength) as caught:
        plan_from_message(message)
    assert str(caught.value) == f"{field} has {count - 1} values for {count} names"


@pytest.mark.parametrize("field", list(SwingTrajectory.get_fields_and_field_types()))
def test_a_plan_with_a_table_of_another_length_is_refused(musashi: Robot, field: str) -> None:
    message = plan_to_message(plan(musashi, Method.BASIC))
    setattr(message.trajectory, field, getattr(message.trajectory, field)[:-1])
    with pytest.raises(WrongLength, match="a table of the plan's trajectory has"):
        plan_from_message(message)


def test_an_outcome_with_a_plan_survives_its_message(musashi: Robot) -> None:
    outcome = Outcome(Method.HYBRID, plan(musashi, Method.HYBRID))
    assert plain(outcome_from_message(through_bytes(outcome_to_message(outcome)))) == plain(outcome)


@pytest.mark.parametrize("error", [HoldingInfeasible("too heavy"), SwingBlocked("\N{CAT FACE}")])
def test_an_outcome_with_an_error_survives_its_message(error: PlannerError) -> None:
    outcome = Outcome(Method.ELONGATE, None, error)
    assert plain(outcome_from_message(through_bytes(outcome_to_message(outcome)))) == plain(outcome)


def test_a_message_of_an_outcome_is_either_plan_or_error(musashi: Robot) -> None:
    good = outcome_to_message(Outcome(Method.BASIC, plan(musashi, Method.BASIC)))
    bad = outcome_to_message(Outcome(Method.BASIC, None, SwingBlocked("stuck")))
    assert (good.error_code, good.error_string) == (ErrorCode.SUCCESS, "")
    assert (bad.error_code, bad.error_string) == (ErrorCode.SWING_BLOCKED, "stuck")
    assert bad.plan.trajectory == SwingTrajectory()
