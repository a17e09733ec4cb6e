"""Every wrong request has an error of its own that names the value and what would be right."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fastswing_planner.errors import (
    DuplicateName,
    InvalidLimit,
    InvalidTensionRange,
    InvalidWeight,
    NotFinite,
    OutOfRange,
    PlannerError,
    StartEqualsEnd,
    UnknownMethod,
    UnknownName,
    WrongLength,
)
from fastswing_planner.planning.plan import SwingPlan
from fastswing_planner.planning.planner import SwingPlanner
from fastswing_planner.planning.request import (
    Method,
    MuscleConstants,
    Search,
    SwingRequest,
    choice_from,
)
from fastswing_planner.planning.task import checked_task, requested_limits
from fastswing_planner.qp.solvers import ProxSuiteSolver
from fastswing_planner.robot.description import Robot
from fastswing_planner.robot.muscle_model import Payload

NAN, INF = float("nan"), float("inf")
JOINT_LIST = "S-p, S-r, S-y, E-p, E-y"
MUSCLE_LIST = "#1, #2, #3, #4, #5, #6, #7, #8, #9, #10"
BODY_LIST = "world, torso, scapula, upper_arm, forearm, radius, hand"
ZERO = [0.0] * 5


def plan(musashi: Robot, **changes: Any) -> SwingPlan:
    """Plan the paper's swing with some of the request replaced."""
    request = SwingRequest(musashi.postures["start"], musashi.postures["end"])
    planner = SwingPlanner(musashi.model, musashi.limits, ProxSuiteSolver())
    return planner.plan(replace(request, **changes))


def muscle(name: str = "#9", **values: float) -> MuscleConstants:
    """Build constants of one muscle."""
    return MuscleConstants([name], **{what: [value] for what, value in values.items()})


def diagonal(first: float, others: float = 1.0) -> list[float]:
    return [first, *[others] * 4]


def block(*values: float) -> MuscleConstants:
    """Build a block of W1 of two muscles."""
    return MuscleConstants(["#1", "#2"], holding_weight=values)


WRONG: dict[str, tuple[dict[str, Any], type[PlannerError], str]] = {
    "a NaN in the start": (
        {"start": [0.0, 0.0, 0.0, NAN, 0.0]},
        NotFinite,
        "start_position of E-p is nan, expected a finite number",
    ),
    "an infinity in the end": (
        {"end": [INF, 0.0, 0.0, 0.0, 0.0]},
        NotFinite,
        "end_position of S-p is inf, expected a finite number",
    ),
    "four angles": (
        {"end": ZERO[:4]},
        WrongLength,
        f"end_position has 4 values, expected 5: {JOINT_LIST}",
    ),
    "no angles": (
        {"start": []},
        WrongLength,
        f"start_position has 0 values, expected 5: {JOINT_LIST}",
    ),
    "an unknown joint": (
        {"joint_names": ["S-p", "S-r", "S-y", "E-p", "W-p"]},
        UnknownName,
        f"unknown joint 'W-p', choose from: {JOINT_LIST}",
    ),
    "a joint twice": (
        {"joint_names": ["S-p", "S-r", "S-y", "E-p", "E-p"]},
        DuplicateName,
        "joint 'E-p' is named more than once",
    ),
    "a joint missing": (
        {"joint_names": ["S-p", "S-r", "S-y", "E-p"]},
        WrongLength,
        "start_position lacks joint E-y",
    ),
    "start = end": (
        {"start": ZERO, "end": ZERO},
        StartEqualsEnd,
        "start_position and end_position are the same (0, 0, 0, 0, 0 rad): nothing to swing",
    ),
    "start nearly = end": (
        {"start": ZERO, "end": [0.002, 0.0, 0.0, 0.0, 0.0]},
        StartEqualsEnd,
        "start_position and end_position are only 0.002 rad apart, epsilon is 0.01 rad: nothing "
        "to swing",
    ),
    "a start out of range": (
        {"start": [0.0, 0.0, 0.0, -2.5, 0.0]},
        OutOfRange,
        "start_position of E-p is -2.5000 rad, its range is -2.2000 to 0.1000 rad",
    ),
    "an end out of range": (
        {"end": [0.7, 0.0, 0.0, 0.0, 0.0]},
        OutOfRange,
        "end_position of S-p is 0.7000 rad, its range is -1.4000 to 0.6000 rad",
    ),
    "an unknown kept muscle": (
        {"kept_muscles": ["#11"]},
        UnknownName,
        f"unknown muscle '#11', choose from: {MUSCLE_LIST}",
    ),
    "a kept muscle twice": (
        {"kept_muscles": ["#9", "#9"]},
        DuplicateName,
        "muscle '#9' is named more than once",
    ),
    "constants of an unknown muscle": (
        {"constants": muscle("#0", velocity=0.3)},
        UnknownName,
        f"unknown muscle '#0', choose from: {MUSCLE_LIST}",
    ),
    "constants of a muscle twice": (
        {"constants": MuscleConstants(["#1", "#1"])},
        DuplicateName,
        "muscle '#1' is named more than once",
    ),
    "a constant too few for the named muscles": (
        {"constants": MuscleConstants(["#1", "#2"], tension_max=[100.0])},
        WrongLength,
        "tension_max has 1 values, expected none or one for each of the 2 muscles in muscle_name",
    ),
    "a constant too few for all muscles": (
        {"constants": MuscleConstants(velocity=[0.3] * 9)},
        WrongLength,
        "velocity_limit has 9 values, expected none or one for each of the 10 muscles",
    ),
    "tension_min above tension_max": (
        {"constants": muscle(tension_min=250.0)},
        InvalidTensionRange,
        "tension_max of #9 is 200 N, must be above its tension_min 250 N",
    ),
    "a negative tension_min": (
        {"constants": muscle(tension_min=-1.0)},
        InvalidLimit,
        "tension_min of #9 is -1 N, must not be negative",
    ),
    "a NaN velocity": (
        {"constants": muscle(velocity=NAN)},
        NotFinite,
        "velocity_limit of #9 is nan, expected a finite number",
    ),
    "an infinite velocity": (
        {"constants": muscle(velocity=INF)},
        NotFinite,
        "velocity_limit of #9 is inf, expected a finite number",
    ),
    "no velocity": (
        {"constants": muscle(velocity=0.0)},
        InvalidLimit,
        "velocity_limit of #9 is 0 m/s, must be positive",
    ),
    "a negative velocity": (
        {"constants": muscle(velocity=-0.3)},
        InvalidLimit,
        "velocity_limit of #9 is -0.3 m/s, must be positive",
    ),
    "an absurd velocity": (
        {"constants": muscle(velocity=1e300)},
        InvalidLimit,
        "velocity_limit of #9 is 1e+300 m/s, must be 0.0001 to 1000",
    ),
    "no acceleration": (
        {"constants": muscle(acceleration=0.0)},
        InvalidLimit,
        "acceleration_limit of #9 is 0 m/s^2, must be positive",
    ),
    "a NaN acceleration": (
        {"constants": muscle(acceleration=NAN)},
        NotFinite,
        "acceleration_limit of #9 is nan, expected a number or infinity",
    ),
    "a negative threshold": (
        {"threshold": -0.1},
        InvalidLimit,
        "threshold is -0.1 s/rad, must be 0 to 1e+06: below 0 agonists would be inhibited",
    ),
    "a NaN threshold": (
        {"threshold": NAN},
        NotFinite,
        "threshold is nan, expected a finite number",
    ),
    "a negative payload": (
        {"payload": Payload(-1.0, "hand")},
        InvalidLimit,
        "payload_mass is -1 kg, must be 0 to 10000",
    ),
    "a NaN payload": (
        {"payload": Payload(NAN, "hand")},
        NotFinite,
        "payload_mass is nan, expected a finite number",
    ),
    "an infinite payload position": (
        {"payload": Payload(1.0, "hand", (0.0, INF, 0.0))},
        NotFinite,
        "payload_position of y is inf, expected a finite number",
    ),
    "a payload far away": (
        {"payload": Payload(1.0, "hand", (0.0, 0.0, -1e9))},
        InvalidLimit,
        "payload_position is [0.0, 0.0, -1000000000.0] m, must be within 100 m",
    ),
    "an unknown payload body": (
        {"payload": Payload(1.0, "foot")},
        UnknownName,
        f"unknown body 'foot', choose from: {BODY_LIST}",
    ),
    "no time to search": (
        {"time_limit": 0.0},
        InvalidLimit,
        "search_time_limit is 0 s, must be positive",
    ),
    "a NaN time to search": (
        {"time_limit": NAN},
        NotFinite,
        "search_time_limit is nan, expected a number of seconds",
    ),
    "W2 of a wrong size": (
        {"swing_weight": [1.0] * 6},
        WrongLength,
        "swing_weight has 6 values, expected none, 5 (the diagonal) or 25 (all of it, row by row)",
    ),
    "W1 of a wrong size": (
        {"constants": block(1.0, 1.0, 1.0)},
        WrongLength,
        "holding_weight has 3 values, expected none, 2 (the diagonal) or 4 (all of it, row by row)",
    ),
    "a NaN in W2": (
        {"swing_weight": diagonal(NAN)},
        NotFinite,
        "swing_weight holds nan, expected finite numbers",
    ),
    "an infinity in W1": (
        {"constants": block(1.0, -INF)},
        NotFinite,
        "holding_weight holds -inf, expected finite numbers",
    ),
    "W1 not symmetric": (
        {"constants": block(4.0, 1.0, 0.5, 4.0)},
        InvalidWeight,
        "holding_weight is not symmetric: 1 for #1 with #2, but 0.5 for #2 with #1",
    ),
    "W1 not positive definite": (
        {"constants": block(1.0, 2.0, 2.0, 1.0)},
        InvalidWeight,
        "holding_weight is not positive definite: its eigenvalues reach from -1 to 3, the smallest "
        "must be above 1e-06 of the largest",
    ),
    "W2 negative": (
        {"swing_weight": diagonal(-1.0, -1.0)},
        InvalidWeight,
        "swing_weight is not positive definite: its eigenvalues reach from -1 to -1, the smallest "
        "must be above 1e-06 of the largest",
    ),
    "W2 without one joint": (
        {"swing_weight": diagonal(0.0)},
        InvalidWeight,
        "swing_weight is not positive definite: its eigenvalues reach from 0 to 1, the smallest "
        "must be above 1e-06 of the largest",
    ),
    "W2 zero": (
        {"swing_weight": diagonal(0.0, 0.0)},
        InvalidWeight,
        "swing_weight is not positive definite: its eigenvalues reach from 0 to 0, the smallest "
        "must be above 1e-06 of the largest",
    ),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_request_says_what_is_wrong(musashi: Robot, what: str) -> None:
    change, error, text = WRONG[what]
    with pytest.raises(error) as caught:
        plan(musashi, **change)
    assert (type(caught.value), str(caught.value)) == (error, text)


@pytest.mark.parametrize("method", Method)
def test_a_methods_number_names_it(method: Method) -> None:
    assert choice_from(Method, "method", int(method)) is method


@pytest.mark.parametrize("number", [-1, 4, 255])
def test_an_unknown_method_lists_the_choices(number: int) -> None:
    with pytest.raises(UnknownMethod) as caught:
        choice_from(Method, "method", number)
    assert str(caught.value) == (
        f"unknown method {number}, choose from: 0 (basic), 1 (inhibit), 2 (elongate), 3 (hybrid)"
    )


@pytest.mark.parametrize("number", [-1, 2, 255])
def test_an_unknown_search_lists_the_choices(number: int) -> None:
    with pytest.raises(UnknownMethod) as caught:
        choice_from(Search, "search", number)
    assert str(caught.value) == (
        f"unknown search {number}, choose from: 0 (greedy), 1 (exhaustive)"
    )


def test_a_weight_is_scaled_to_a_largest_eigenvalue_of_one(musashi: Robot) -> None:
    request = SwingRequest(
        musashi.postures["start"], musashi.postures["end"], swing_weight=diagonal(4.0)
    )
    task = checked_task(musashi.model, musashi.limits, request)
    assert task.swing_weight.tolist() == np.diag(diagonal(1.0, 0.25)).tolist()


# Errors and their codes.


def test_every_wrong_request_names_its_own_code() -> None:
    for _, error, _ in WRONG.values():
        assert error.code_name not in ("INTERNAL", "INVALID_REQUEST")


def test_a_request_without_limits_keeps_the_robots(musashi: Robot) -> None:
    constants = MuscleConstants(["#9"], holding_weight=[2.0])
    assert requested_limits(musashi.model, musashi.limits, constants) is musashi.limits
