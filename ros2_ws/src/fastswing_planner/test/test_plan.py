"""Plans of the Musashi-like arm are the paper's, and wrong requests say what is wrong."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

from fastswing_planner.errors import (
    DuplicateName,
    HoldingInfeasible,
    InvalidLimit,
    NotFinite,
    OutOfRange,
    PlannerError,
    StartEqualsEnd,
    UnknownMethod,
    UnknownName,
    WrongLength,
)
from fastswing_planner.mask_search import Verdict
from fastswing_planner.muscle_model import Payload
from fastswing_planner.plan import SwingPlan, SwingPlanner
from fastswing_planner.qp_solvers import ProxSuiteSolver
from fastswing_planner.request import Method, MuscleConstants, SwingRequest, method_from
from fastswing_planner.robot import Robot

JOINT_LIST = "S-p, S-r, S-y, E-p, E-y"
MUSCLE_LIST = "#1, #2, #3, #4, #5, #6, #7, #8, #9, #10"
ELBOW = 3
METHODS = list(Method)


def plan(musashi: Robot, method: Method = Method.BASIC, **changes: Any) -> SwingPlan:
    """Plan the paper's swing with some of the request replaced."""
    request = SwingRequest(musashi.postures["start"], musashi.postures["end"], method)
    planner = SwingPlanner(musashi.model, musashi.limits, ProxSuiteSolver())
    return planner.plan(replace(request, **changes))


def masked_names(musashi: Robot, kept: ArrayLike) -> list[str]:
    return [
        name
        for name, keep in zip(musashi.model.muscle_names, np.asarray(kept), strict=True)
        if not keep
    ]


@pytest.mark.parametrize(
    ("method", "peak"), [(Method.BASIC, 2.4), (Method.INHIBIT, 4.4), (Method.ELONGATE, 3.3)]
)
def test_the_elbow_is_as_fast_as_in_the_paper(musashi: Robot, method: Method, peak: float) -> None:
    speed = np.abs(plan(musashi, method).trajectory.joint_velocity[:, ELBOW])
    assert speed.max() == pytest.approx(peak, rel=0.10)


@pytest.mark.parametrize(
    ("method", "steps"), [(Method.BASIC, 33), (Method.INHIBIT, 20), (Method.ELONGATE, 26)]
)
def test_a_swing_takes_as_many_steps_as_in_the_paper(
    musashi: Robot, method: Method, steps: int
) -> None:
    assert len(plan(musashi, method).trajectory.time) - 1 == steps


@pytest.mark.parametrize(
    ("method", "masked"),
    [
        (Method.BASIC, []),
        (Method.INHIBIT, ["#2", "#3", "#9", "#10"]),
        (Method.ELONGATE, ["#9"]),
    ],
)
def test_the_muscles_of_the_paper_are_masked(
    musashi: Robot, method: Method, masked: list[str]
) -> None:
    assert masked_names(musashi, plan(musashi, method).kept) == masked


def test_the_elbow_cannot_be_held_without_both_its_flexors(musashi: Robot) -> None:
    last = plan(musashi, Method.ELONGATE).trials[-1]
    assert masked_names(musashi, last.kept) == ["#9", "#10"]
    assert last.verdict is Verdict.HOLDING_INFEASIBLE


@pytest.mark.parametrize("method", METHODS)
def test_the_basic_time_cost_is_told_beside_every_method(musashi: Robot, method: Method) -> None:
    assert plan(musashi, method).time_cost_basic == pytest.approx(0.99)


@pytest.mark.parametrize("method", [Method.BASIC, Method.INHIBIT])
def test_only_method_2_elongates(musashi: Robot, method: Method) -> None:
    assert not plan(musashi, method).elongation.any()


def test_method_2_elongates_exactly_what_it_masks(musashi: Robot) -> None:
    found = plan(musashi, Method.ELONGATE)
    assert masked_names(musashi, found.elongation == 0.0) == ["#9"]
    assert np.all(found.elongation >= 0.0)


def test_elongated_muscles_do_not_hold_the_start(musashi: Robot) -> None:
    found = plan(musashi, Method.ELONGATE)
    assert masked_names(musashi, found.holding.tension > 0.0) == ["#9"]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("posture", ["start", "end"])
def test_planned_tensions_balance_gravity(musashi: Robot, method: Method, posture: str) -> None:
    found = plan(musashi, method)
    holding = found.holding if posture == "start" else found.final_holding
    angles = musashi.postures[posture]
    torque = -musashi.model.jacobian(angles).T @ holding.tension
    assert torque == pytest.approx(musashi.model.gravity_torque(angles), abs=1e-3)


@pytest.mark.parametrize("method", METHODS)
def test_the_way_leads_from_start_to_end(musashi: Robot, method: Method) -> None:
    found = plan(musashi, method)
    way = found.trajectory.joint_position
    assert way[0].tolist() == musashi.postures["start"].tolist()
    assert np.linalg.norm(way[-1] - musashi.postures["end"]) < found.epsilon


def test_the_order_of_the_named_joints_does_not_matter(musashi: Robot) -> None:
    reverse = slice(None, None, -1)
    found = plan(
        musashi,
        Method.ELONGATE,
        joint_names=musashi.model.joint_names[reverse],
        start=musashi.postures["start"][reverse],
        end=musashi.postures["end"][reverse],
    )
    expected = plan(musashi, Method.ELONGATE).trajectory.joint_position
    # Not bit for bit: the solver's sums depend on how its memory is aligned.
    np.testing.assert_allclose(found.trajectory.joint_position, expected, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("method", [Method.INHIBIT, Method.ELONGATE])
def test_a_protected_muscle_is_never_masked(musashi: Robot, method: Method) -> None:
    found = plan(musashi, method, kept_muscles=["#9"])
    assert "#9" not in masked_names(musashi, found.kept)


def test_method_1_masks_only_above_the_threshold(musashi: Robot) -> None:
    assert masked_names(musashi, plan(musashi, Method.INHIBIT, threshold=0.1).kept) == ["#9", "#10"]


def test_a_muscle_at_the_threshold_is_not_masked(musashi: Robot) -> None:
    index = plan(musashi).speed_index
    brachialis = float(index[musashi.model.muscle_names.index("#10")])
    found = plan(musashi, Method.INHIBIT, threshold=brachialis)
    assert masked_names(musashi, found.kept) == ["#9"]


def test_requested_constants_replace_those_of_the_named_muscles(musashi: Robot) -> None:
    constants = MuscleConstants(["#9"], velocity=[0.6], acceleration=[np.inf])
    changed, usual = plan(musashi, constants=constants).speed_index, plan(musashi).speed_index
    ninth = musashi.model.muscle_names.index("#9")
    assert changed[ninth] == pytest.approx(usual[ninth] / 2.0)
    assert np.delete(changed, ninth).tolist() == np.delete(usual, ninth).tolist()


def test_a_faster_muscle_makes_a_faster_swing(musashi: Robot) -> None:
    constants = MuscleConstants(["#9"], velocity=[0.6], acceleration=[np.inf])
    found = plan(musashi, constants=constants)
    assert found.trajectory.time_cost < found.time_cost_basic + 1e-9 < 0.99


def test_a_payload_needs_more_tension(musashi: Robot) -> None:
    loaded = plan(musashi, payload=Payload(0.2, "hand")).holding.tension
    assert np.linalg.norm(loaded) > np.linalg.norm(plan(musashi).holding.tension)


def test_a_payload_that_cannot_be_carried_says_what_is_missing(musashi: Robot) -> None:
    angles, weight = musashi.postures["start"], Payload(50.0, "hand")
    residual = SwingPlanner(musashi.model, musashi.limits, ProxSuiteSolver()).hold(angles, weight)
    with pytest.raises(HoldingInfeasible) as caught:
        plan(musashi, payload=weight)
    assert residual.residual > 10.0
    assert str(caught.value) == (
        "the start posture cannot be held even with all muscles: "
        f"{residual.residual:.3g} N m are missing; choose another start posture, less payload or "
        "a wider tension range"
    )


def test_an_end_that_cannot_be_held_says_what_is_missing(musashi: Robot) -> None:
    # 10 kg hang on a hanging arm, but an arm stretched out forward does not carry them.
    load, stretched = Payload(10.0, "hand"), np.array([-1.4, 0.0, 0.0, 0.0, 0.0])
    held = SwingPlanner(musashi.model, musashi.limits, ProxSuiteSolver()).hold(stretched, load)
    with pytest.raises(HoldingInfeasible) as caught:
        plan(musashi, start=musashi.postures["home"], end=stretched, payload=load)
    assert str(caught.value) == (
        f"the end posture cannot be held: {held.residual:.3g} N m are missing; "
        "choose another end posture, less payload or a wider tension range"
    )


@pytest.mark.parametrize(
    ("change", "error", "text"),
    [
        (
            {"start": [0.0, 0.0, 0.0, np.nan, 0.0]},
            NotFinite,
            "start_position of E-p is nan, expected a finite number",
        ),
        (
            {"end": [np.inf, 0.0, 0.0, 0.0, 0.0]},
            NotFinite,
            "end_position of S-p is inf, expected a finite number",
        ),
        (
            {"end": [0.0, 0.0, 0.0, 0.0]},
            WrongLength,
            f"end_position has 4 values, expected 5: {JOINT_LIST}",
        ),
        (
            {"joint_names": ["S-p", "S-r", "S-y", "E-p", "W-p"]},
            UnknownName,
            f"unknown joint 'W-p', choose from: {JOINT_LIST}",
        ),
        (
            {"joint_names": ["S-p", "S-r", "S-y", "E-p", "E-p"]},
            DuplicateName,
            "joint 'E-p' is named more than once",
        ),
        (
            {"joint_names": ["S-p", "S-r", "S-y", "E-p"]},
            WrongLength,
            "start_position lacks joint E-y",
        ),
        (
            {"start": [0.0] * 5, "end": [0.0] * 5},
            StartEqualsEnd,
            "start_position and end_position are the same (0, 0, 0, 0, 0 rad): nothing to swing",
        ),
        (
            {"start": [0.0, 0.0, 0.0, -2.5, 0.0]},
            OutOfRange,
            "start_position of E-p is -2.5000 rad, its range is -2.2000 to 0.1000 rad",
        ),
        (
            {"end": [0.7, 0.0, 0.0, 0.0, 0.0]},
            OutOfRange,
            "end_position of S-p is 0.7000 rad, its range is -1.4000 to 0.6000 rad",
        ),
        (
            {"kept_muscles": ["#11"]},
            UnknownName,
            f"unknown muscle '#11', choose from: {MUSCLE_LIST}",
        ),
        (
            {"kept_muscles": ["#9", "#9"]},
            DuplicateName,
            "muscle '#9' is named more than once",
        ),
        (
            {"constants": MuscleConstants(["#0"], velocity=[0.3])},
            UnknownName,
            f"unknown muscle '#0', choose from: {MUSCLE_LIST}",
        ),
        (
            {"constants": MuscleConstants(["#1", "#2"], tension_max=[100.0])},
            WrongLength,
            "tension_max has 1 values, expected none or one for each of the 2 muscles in "
            "muscle_name",
        ),
        (
            {"constants": MuscleConstants(["#9"], tension_min=[250.0])},
            InvalidLimit,
            "tension_max of #9 is 200 N, must be above its tension_min 250 N",
        ),
        (
            {"constants": MuscleConstants(["#9"], velocity=[np.nan])},
            NotFinite,
            "velocity_limit of #9 is nan, expected a finite number",
        ),
        (
            {"threshold": -0.1},
            InvalidLimit,
            "threshold is -0.1, must be finite and not negative: below 0 agonists would be "
            "inhibited",
        ),
        (
            {"threshold": np.nan},
            InvalidLimit,
            "threshold is nan, must be finite and not negative: below 0 agonists would be "
            "inhibited",
        ),
        (
            {"payload": Payload(-1.0, "hand")},
            InvalidLimit,
            "payload_mass is -1.0 kg, must be finite and not negative",
        ),
        (
            {"payload": Payload(np.nan, "hand")},
            InvalidLimit,
            "payload_mass is nan kg, must be finite and not negative",
        ),
        (
            {"payload": Payload(1.0, "hand", (0.0, np.inf, 0.0))},
            NotFinite,
            "payload_position of y is inf, expected a finite number",
        ),
        (
            {"payload": Payload(1.0, "foot")},
            UnknownName,
            "unknown body 'foot', choose from: world, torso, scapula, upper_arm, forearm, radius, "
            "hand",
        ),
    ],
)
def test_a_wrong_request_says_what_is_wrong(
    musashi: Robot, change: dict[str, Any], error: type[PlannerError], text: str
) -> None:
    with pytest.raises(error) as caught:
        plan(musashi, **change)
    assert str(caught.value) == text


@pytest.mark.parametrize("method", METHODS)
def test_a_methods_number_names_it(method: Method) -> None:
    assert method_from(int(method)) is method


@pytest.mark.parametrize("number", [-1, 3, 255])
def test_an_unknown_method_lists_the_choices(number: int) -> None:
    with pytest.raises(UnknownMethod) as caught:
        method_from(number)
    assert str(caught.value) == (
        f"unknown method {number}, choose from: 0 (basic), 1 (inhibit), 2 (elongate)"
    )


def test_postures_closer_than_epsilon_are_nothing_to_swing(musashi: Robot) -> None:
    near = musashi.postures["start"] + np.array([0.002, 0.0, 0.0, 0.0, 0.0])
    with pytest.raises(StartEqualsEnd, match=r"are only 0\.002 rad apart, epsilon is 0\.01 rad"):
        plan(musashi, end=near)
