"""Plans of the Musashi-like arm are the paper's, and an arm that cannot says why."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

from fastswing_planner.arrays import Vector
from fastswing_planner.errors import (
    HoldingInfeasible,
    InvalidLimit,
    NotFinite,
    SingularJacobian,
    StartEqualsEnd,
    SwingBlocked,
)
from fastswing_planner.planning.mask_search import Verdict
from fastswing_planner.planning.plan import Outcome, SwingPlan
from fastswing_planner.planning.planner import SwingPlanner
from fastswing_planner.planning.request import Method, MuscleConstants, Search, SwingRequest
from fastswing_planner.planning.swing import SwingSettings
from fastswing_planner.qp.solvers import ProxSuiteSolver
from fastswing_planner.robot.description import Robot
from fastswing_planner.robot.limits import MuscleLimits, muscle_limits
from fastswing_planner.robot.muscle_model import MuscleModel, Payload

ELBOW = 3
METHODS = list(Method)
ArmBuilder = Callable[..., MuscleModel]


def plan(musashi: Robot, method: Method = Method.BASIC, **changes: Any) -> SwingPlan:
    """Plan the paper's swing with some of the request replaced."""
    request = SwingRequest(musashi.postures["start"], musashi.postures["end"], method)
    planner = SwingPlanner(musashi.model, musashi.limits, ProxSuiteSolver())
    return planner.plan(replace(request, **changes))


def compare(musashi: Robot, **changes: Any) -> tuple[Outcome, ...]:
    """Compare all methods on the paper's swing with some of the request replaced."""
    request = SwingRequest(musashi.postures["start"], musashi.postures["end"])
    planner = SwingPlanner(musashi.model, musashi.limits, ProxSuiteSolver())
    return planner.compare(replace(request, **changes))


def limits_of(model: MuscleModel) -> MuscleLimits:
    return muscle_limits(model.muscle_names, 0.3, 0.46, 10.0, 200.0)


def hold_residual(musashi: Robot, posture: Vector, payload: Payload) -> float:
    """Return what is missing [N m] to hold a posture."""
    planner = SwingPlanner(musashi.model, musashi.limits, ProxSuiteSolver())
    return planner.hold(posture, payload).residual


def masked_names(musashi: Robot, kept: ArrayLike) -> list[str]:
    return [
        name
        for name, keep in zip(musashi.model.muscle_names, np.asarray(kept), strict=True)
        if not keep
    ]


@pytest.mark.parametrize(
    ("method", "peak"),
    [(Method.BASIC, 2.4), (Method.INHIBIT, 4.4), (Method.ELONGATE, 3.3), (Method.HYBRID, 4.4)],
)
def test_the_elbow_is_as_fast_as_in_the_paper(musashi: Robot, method: Method, peak: float) -> None:
    speed = np.abs(plan(musashi, method).trajectory.joint_velocity[:, ELBOW])
    assert speed.max() == pytest.approx(peak, rel=0.02)


@pytest.mark.parametrize(
    ("method", "steps"),
    [(Method.BASIC, 33), (Method.INHIBIT, 20), (Method.ELONGATE, 26), (Method.HYBRID, 20)],
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
        (Method.HYBRID, ["#2", "#3", "#9", "#10"]),
    ],
)
def test_the_muscles_of_the_paper_are_masked(
    musashi: Robot, method: Method, masked: list[str]
) -> None:
    assert masked_names(musashi, plan(musashi, method).kept) == masked


@pytest.mark.parametrize(
    ("method", "inhibited", "elongated"),
    [
        (Method.BASIC, (), ()),
        (Method.INHIBIT, ("#2", "#3", "#9", "#10"), ()),
        (Method.ELONGATE, (), ("#9",)),
        (Method.HYBRID, ("#2", "#3", "#10"), ("#9",)),
    ],
)
def test_a_masked_muscle_is_either_inhibited_or_elongated(
    musashi: Robot, method: Method, inhibited: tuple[str, ...], elongated: tuple[str, ...]
) -> None:
    found = plan(musashi, method)
    assert found.muscles(found.inhibited) == inhibited
    assert found.muscles(found.elongated) == elongated


def test_the_speed_index_falls_in_the_order_of_the_paper(musashi: Robot) -> None:
    found = plan(musashi)
    order = np.argsort(-found.speed_index)
    assert [found.muscle_names[index] for index in order[:4]] == ["#9", "#10", "#3", "#2"]


def test_the_antagonists_are_those_of_the_paper(musashi: Robot) -> None:
    found = plan(musashi)
    assert found.muscles(found.speed_index > 0.0) == ("#2", "#3", "#9", "#10")


def test_the_greedy_search_ends_where_the_elbow_cannot_be_held(musashi: Robot) -> None:
    trials = plan(musashi, Method.ELONGATE).trials
    assert [(masked_names(musashi, trial.kept), trial.verdict) for trial in trials] == [
        ([], Verdict.NOT_FASTER),
        (["#9"], Verdict.TAKEN),
        (["#9", "#10"], Verdict.HOLDING_INFEASIBLE),
    ]


def test_the_greedy_search_proves_nothing(musashi: Robot) -> None:
    assert not plan(musashi, Method.ELONGATE).proven


def test_the_papers_mask_is_proven_the_best_of_all(musashi: Robot) -> None:
    found = plan(musashi, Method.ELONGATE, search=Search.EXHAUSTIVE)
    assert (masked_names(musashi, found.kept), found.proven) == (["#9"], True)


@pytest.mark.parametrize("method", [Method.BASIC, Method.INHIBIT])
@pytest.mark.parametrize("search", Search)
def test_where_nothing_is_elongated_nothing_is_searched(
    musashi: Robot, method: Method, search: Search
) -> None:
    found = plan(musashi, method, search=search)
    assert (len(found.trials), found.proven) == (1, False)


@pytest.mark.parametrize("method", METHODS)
def test_the_basic_time_cost_is_told_beside_every_method(musashi: Robot, method: Method) -> None:
    assert plan(musashi, method).time_cost_basic == pytest.approx(0.99)


@pytest.mark.parametrize("method", [Method.BASIC, Method.INHIBIT])
def test_other_methods_pay_nothing_out(musashi: Robot, method: Method) -> None:
    assert not plan(musashi, method).elongation.any()


@pytest.mark.parametrize("method", [Method.ELONGATE, Method.HYBRID])
def test_only_the_elongated_muscle_is_paid_out(musashi: Robot, method: Method) -> None:
    found = plan(musashi, method)
    assert found.muscles(found.elongation != 0.0) == ("#9",)


@pytest.mark.parametrize("method", METHODS)
def test_an_elongation_is_never_negative(musashi: Robot, method: Method) -> None:
    assert np.all(plan(musashi, method).elongation >= 0.0)


@pytest.mark.parametrize("method", [Method.ELONGATE, Method.HYBRID])
def test_elongated_muscles_do_not_hold_the_start(musashi: Robot, method: Method) -> None:
    found = plan(musashi, method)
    assert found.muscles(found.holding_tension == 0.0) == ("#9",)


def test_inhibited_muscles_hold_the_start_until_the_swing(musashi: Robot) -> None:
    found = plan(musashi, Method.INHIBIT)
    assert found.holding_tension.tolist() == found.basic_tension.tolist()


def test_a_rise_is_what_elongating_adds_to_the_tension(musashi: Robot) -> None:
    found = plan(musashi, Method.ELONGATE)
    assert found.basic_tension + found.tension_rise == pytest.approx(found.holding_tension)


def test_the_other_flexor_takes_over_from_the_elongated_one(musashi: Robot) -> None:
    found = plan(musashi, Method.ELONGATE)
    rise = dict(zip(found.muscle_names, found.tension_rise, strict=True))
    assert rise["#9"] < 0.0 < rise["#10"]


def test_nothing_rises_where_nothing_is_elongated(musashi: Robot) -> None:
    assert not plan(musashi, Method.INHIBIT).tension_rise.any()


def test_elongating_costs_margin(musashi: Robot) -> None:
    assert 0.0 < plan(musashi, Method.ELONGATE).holding_margin < plan(musashi).holding_margin


def test_a_payload_within_the_margin_is_held(musashi: Robot) -> None:
    # A mass in the hand loads the shoulder and the elbow by less than 1 m of lever each.
    light = plan(musashi).holding_margin / 9.81 / np.sqrt(2.0)
    assert hold_residual(musashi, musashi.postures["start"], Payload(light, "hand")) < 1e-4


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("posture", ["start", "end"])
def test_planned_tensions_balance_gravity(musashi: Robot, method: Method, posture: str) -> None:
    found = plan(musashi, method)
    tension = found.holding_tension if posture == "start" else found.final_tension
    angles = musashi.postures[posture]
    torque = -musashi.model.jacobian(angles).T @ tension
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


@pytest.mark.parametrize("method", [Method.INHIBIT, Method.ELONGATE, Method.HYBRID])
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
    loaded = plan(musashi, payload=Payload(0.2, "hand")).basic_tension
    assert np.linalg.norm(loaded) > np.linalg.norm(plan(musashi).basic_tension)


def test_a_payload_that_cannot_be_carried_says_what_is_missing(musashi: Robot) -> None:
    weight = Payload(50.0, "hand")
    missing = hold_residual(musashi, musashi.postures["start"], weight)
    with pytest.raises(HoldingInfeasible) as caught:
        plan(musashi, payload=weight)
    assert missing > 10.0
    assert str(caught.value) == (
        "the start posture cannot be held even with all muscles: "
        f"{missing:.3g} N m are missing; choose another start posture, less payload or "
        "a wider tension range"
    )


def test_an_end_that_cannot_be_held_says_what_is_missing(musashi: Robot) -> None:
    # 10 kg hang on a hanging arm, but an arm stretched out forward does not carry them.
    load, stretched = Payload(10.0, "hand"), np.array([-1.4, 0.0, 0.0, 0.0, 0.0])
    missing = hold_residual(musashi, stretched, load)
    with pytest.raises(HoldingInfeasible) as caught:
        plan(musashi, start=musashi.postures["home"], end=stretched, payload=load)
    assert str(caught.value) == (
        f"the end posture cannot be held: {missing:.3g} N m are missing; "
        "choose another end posture, less payload or a wider tension range"
    )


def test_postures_closer_than_epsilon_are_nothing_to_swing(musashi: Robot) -> None:
    near = musashi.postures["start"] + np.array([0.002, 0.0, 0.0, 0.0, 0.0])
    with pytest.raises(StartEqualsEnd, match=r"are only 0\.002 rad apart, epsilon is 0\.01 rad"):
        plan(musashi, end=near)


def test_a_swing_that_takes_too_many_steps_is_blocked(musashi: Robot) -> None:
    with pytest.raises(SwingBlocked, match=r"^the swing stops short of its end after 32 steps: "):
        plan(musashi, settings=SwingSettings(max_steps=32))


def test_a_high_tension_is_warned_of(musashi: Robot) -> None:
    found = plan(musashi, constants=MuscleConstants(["#3"], tension_max=[60.0]))
    assert found.warnings == (
        "#3 holds the start posture with 54 N, 91% of its tension_max 60 N",
        "#3 holds the end posture with 52 N, 87% of its tension_max 60 N",
    )


def test_a_tension_up_to_four_fifths_of_the_limit_is_not_warned_of(musashi: Robot) -> None:
    highest = float(plan(musashi).basic_tension.max())
    constants = MuscleConstants(["#3"], tension_max=[highest / 0.799])
    assert plan(musashi, constants=constants).warnings == ()


def test_a_search_out_of_time_is_warned_of(musashi: Robot) -> None:
    ticks = iter(range(100))
    request = SwingRequest(
        musashi.postures["start"], musashi.postures["end"], Method.ELONGATE, time_limit=1.0
    )
    planner = SwingPlanner(musashi.model, musashi.limits, ProxSuiteSolver())
    assert planner.plan(request, lambda: float(next(ticks))).warnings == (
        "the search ended at its time limit: a better mask may exist",
    )


def test_a_planner_takes_no_limits_that_make_no_sense(musashi: Robot) -> None:
    limits = replace(musashi.limits, velocity=np.full(10, np.nan))
    with pytest.raises(NotFinite, match=r"^velocity_limit of #1 is nan, expected a finite number$"):
        SwingPlanner(musashi.model, limits, ProxSuiteSolver())


def test_a_time_limit_needs_a_clock(musashi: Robot) -> None:
    with pytest.raises(InvalidLimit) as caught:
        plan(musashi, Method.ELONGATE, time_limit=1.0)
    assert str(caught.value) == "a search_time_limit needs a clock, such as time.monotonic"


def test_a_comparison_has_one_outcome_for_each_method(musashi: Robot) -> None:
    assert [outcome.method for outcome in compare(musashi)] == METHODS


def test_a_comparison_holds_what_each_method_would_plan_alone(musashi: Robot) -> None:
    costs = [None if one.plan is None else one.plan.time_cost for one in compare(musashi)]
    assert costs == [plan(musashi, method).time_cost for method in METHODS]


def many_muscles(linear_arm: ArmBuilder, antagonist_count: int) -> MuscleModel:
    """Build an arm of one joint with one agonist."""
    return linear_arm([[-0.1], *[[0.05]] * antagonist_count])


def test_an_exhaustive_search_of_many_antagonists_needs_a_time_limit(
    linear_arm: ArmBuilder,
) -> None:
    model = many_muscles(linear_arm, 17)
    planner = SwingPlanner(model, limits_of(model), ProxSuiteSolver())
    request = SwingRequest([0.0], [0.1], Method.ELONGATE, search=Search.EXHAUSTIVE)
    with pytest.raises(InvalidLimit) as caught:
        planner.plan(request)
    assert str(caught.value) == (
        "an exhaustive search of 17 antagonists needs a search_time_limit (up to 16 go without)"
    )


def test_an_error_of_one_method_stays_its_outcome(linear_arm: ArmBuilder) -> None:
    model = many_muscles(linear_arm, 17)
    planner = SwingPlanner(model, limits_of(model), ProxSuiteSolver())
    outcomes = planner.compare(SwingRequest([0.0], [0.1], search=Search.EXHAUSTIVE))
    assert [type(outcome.error) for outcome in outcomes] == [
        type(None),
        type(None),
        InvalidLimit,
        InvalidLimit,
    ]
    assert [outcome.plan is None for outcome in outcomes] == [False, False, True, True]


def test_a_joint_without_muscles_is_named(linear_arm: ArmBuilder) -> None:
    model = linear_arm([[0.1, 0.0], [-0.1, 0.0], [0.05, 0.0]])
    planner = SwingPlanner(model, limits_of(model), ProxSuiteSolver())
    with pytest.raises(SingularJacobian) as caught:
        planner.plan(SwingRequest([0.0, 0.0], [0.5, 0.5]))
    assert str(caught.value) == (
        "the muscle Jacobian is singular at the start of the swing: no muscle restrains some "
        "motion of j1; leave joints out of the robot's description, or add muscles"
    )


def test_joints_that_muscles_only_move_together_are_named(linear_arm: ArmBuilder) -> None:
    model = linear_arm([[0.1, 0.1], [-0.1, -0.1]])
    planner = SwingPlanner(model, limits_of(model), ProxSuiteSolver())
    with pytest.raises(SingularJacobian, match=r"no muscle restrains some motion of j0, j1; "):
        planner.plan(SwingRequest([0.0, 0.0], [0.5, 0.5]))


def test_the_price_of_a_muscle_makes_it_hold_less(musashi: Robot) -> None:
    constants = MuscleConstants(["#9"], holding_weight=[100.0])
    ninth = musashi.model.muscle_names.index("#9")
    assert plan(musashi, constants=constants).basic_tension[ninth] < (
        plan(musashi).basic_tension[ninth] - 5.0
    )


WEIGHT_OF_TWO = np.array([[4.0, 1.0], [1.0, 2.0]])


@pytest.mark.parametrize(
    "same",
    [
        MuscleConstants(["#3", "#9"], holding_weight=[4.0, 1.0, 1.0, 2.0]),
        MuscleConstants(["#9", "#3"], holding_weight=[2.0, 1.0, 1.0, 4.0]),
    ],
)
def test_a_block_of_w1_belongs_to_the_named_muscles(musashi: Robot, same: MuscleConstants) -> None:
    whole = np.eye(10)
    whole[np.ix_([2, 8], [2, 8])] = WEIGHT_OF_TWO
    expected = plan(musashi, constants=MuscleConstants(holding_weight=whole.ravel()))
    found = plan(musashi, constants=same)
    assert found.basic_tension == pytest.approx(expected.basic_tension, abs=1e-6)
    assert not np.allclose(found.basic_tension, plan(musashi).basic_tension, atol=0.1)


def test_a_diagonal_is_short_for_a_whole_weight(musashi: Robot) -> None:
    diagonal = np.arange(1.0, 6.0)
    short = plan(musashi, swing_weight=diagonal).trajectory.joint_position
    whole = plan(musashi, swing_weight=np.diag(diagonal).ravel()).trajectory.joint_position
    np.testing.assert_allclose(short, whole, rtol=0.0, atol=1e-9)


def test_only_the_ratios_of_a_weight_matter(musashi: Robot) -> None:
    diagonal = np.arange(1.0, 6.0)
    usual = plan(musashi, swing_weight=diagonal).trajectory.joint_position
    large = plan(musashi, swing_weight=1e200 * diagonal).trajectory.joint_position
    np.testing.assert_allclose(usual, large, rtol=0.0, atol=1e-9)


def test_w2_is_in_the_order_of_the_named_joints(musashi: Robot) -> None:
    reverse = slice(None, None, -1)
    diagonal = np.array([50.0, 1.0, 1.0, 2.0, 1.0])
    found = plan(
        musashi,
        joint_names=musashi.model.joint_names[reverse],
        start=musashi.postures["start"][reverse],
        end=musashi.postures["end"][reverse],
        swing_weight=diagonal[reverse],
    )
    expected = plan(musashi, swing_weight=diagonal).trajectory.joint_position
    np.testing.assert_allclose(found.trajectory.joint_position, expected, rtol=0.0, atol=1e-9)
    assert not np.allclose(expected[1], plan(musashi).trajectory.joint_position[1], atol=1e-5)


def test_a_swing_of_fine_steps_takes_as_long(musashi: Robot) -> None:
    fine = plan(musashi, settings=SwingSettings(time_step=1e-3, max_steps=2000))
    assert fine.time_cost == pytest.approx(0.99, abs=0.03)
