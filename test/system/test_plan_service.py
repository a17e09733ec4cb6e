"""The planner's service gives the paper's predictions, compares methods, and obeys parameters."""

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter

from fastswing_msgs.msg import ErrorCode, MaskTrial, SwingOptions, SwingPlan, SwingTrajectory
from fastswing_msgs.srv import PlanSwing

if TYPE_CHECKING:
    from test.system.suite import Suite


BASIC, METHOD_1, METHOD_2, HYBRID = (
    SwingOptions.METHOD_BASIC,
    SwingOptions.METHOD_INHIBIT,
    SwingOptions.METHOD_ELONGATE,
    SwingOptions.METHOD_HYBRID,
)
METHODS = [BASIC, METHOD_1, METHOD_2, HYBRID]


def plan(suite: "Suite", method: int, **options: Any) -> SwingPlan:
    answer = suite.plan(options=SwingOptions(method=method, **options))
    assert answer.error_string == ""
    return answer.plan


def compare(suite: "Suite", **options: Any) -> PlanSwing.Response:
    postures = suite.robot.postures
    request = PlanSwing.Request(
        start_position=postures["start"].tolist(),
        end_position=postures["end"].tolist(),
        options=SwingOptions(**options),
        compare=True,
    )
    return suite.ask(PlanSwing, "plan_swing", request)


def is_same_swing(plan: SwingPlan, other: SwingPlan) -> bool:
    """Solvers' results differ in their last bits with the alignment of memory."""
    fields = SwingTrajectory.get_fields_and_field_types()
    pairs = [(getattr(plan.trajectory, f), getattr(other.trajectory, f)) for f in fields]
    return all(
        len(one) == len(beside) and np.allclose(one, beside, rtol=0.0, atol=1e-9)
        for one, beside in pairs
    )


def names_where(plan: SwingPlan, flags: Any) -> list[str]:
    return [name for name, flag in zip(plan.muscle_name, flags, strict=True) if flag]


@pytest.mark.parametrize(
    ("method", "expected"), [(BASIC, 2.4), (METHOD_2, 3.3), (METHOD_1, 4.4), (HYBRID, 4.4)]
)
def test_the_predicted_peak_elbow_speed_is_the_papers(
    lone_planner: "Suite", method: int, expected: float
) -> None:
    answer = plan(lone_planner, method)
    elbow = list(answer.joint_name).index("E-p")
    speed = np.reshape(answer.trajectory.joint_velocity, (-1, len(answer.joint_name)))
    peak = np.abs(speed[:, elbow]).max()
    assert peak == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize(
    ("method", "inhibited", "elongated"),
    [
        (BASIC, [], []),
        (METHOD_1, ["#2", "#3", "#9", "#10"], []),
        (METHOD_2, [], ["#9"]),
        (HYBRID, ["#2", "#3", "#10"], ["#9"]),
    ],
)
def test_the_masked_muscles_are_the_papers(
    lone_planner: "Suite", method: int, inhibited: list[str], elongated: list[str]
) -> None:
    answer = plan(lone_planner, method)
    assert names_where(answer, answer.inhibited) == inhibited
    assert names_where(answer, np.array(answer.elongation) > 0.0) == elongated
    masked = names_where(answer, [not kept for kept in answer.mask])
    assert sorted(masked) == sorted(inhibited + elongated)


def test_a_plan_has_the_time_of_its_answer(lone_planner: "Suite") -> None:
    before = lone_planner.now().stamp
    made = plan(lone_planner, BASIC).header.stamp
    after = lone_planner.now().stamp
    times = [stamp.sec * 1_000_000_000 + stamp.nanosec for stamp in (before, made, after)]
    assert times == sorted(times)


def test_method_2_takes_less_time_than_basic(lone_planner: "Suite") -> None:
    answer = plan(lone_planner, METHOD_2)
    assert (answer.time_cost, answer.time_cost_basic) == pytest.approx((0.78, 0.99))


def test_an_exhaustive_search_tells_that_its_mask_is_proven(lone_planner: "Suite") -> None:
    answer = plan(lone_planner, METHOD_2, search=SwingOptions.SEARCH_EXHAUSTIVE)
    (taken,) = [t for t in answer.trials if t.verdict == MaskTrial.VERDICT_TAKEN]
    assert (answer.proven, list(taken.masked_muscle)) == (True, ["#9"])


def test_a_greedy_search_proves_nothing(lone_planner: "Suite") -> None:
    assert not plan(lone_planner, METHOD_2).proven


def test_a_plan_tells_the_price_of_elongating(lone_planner: "Suite") -> None:
    answer = plan(lone_planner, METHOD_2)
    rise = np.subtract(answer.holding_tension, answer.basic_tension)
    assert answer.muscle_name[int(np.argmin(rise))] == "#9"
    assert 0.0 < answer.holding_margin < plan(lone_planner, BASIC).holding_margin


def test_a_plan_warns_of_high_tension(lone_planner: "Suite") -> None:
    answer = plan(lone_planner, BASIC, muscle_name=["#3"], tension_max=[60.0])
    assert answer.warning[0] == "#3 holds the start posture with 54 N, 91% of its tension_max 60 N"


def test_a_plan_marks_the_muscles_that_hold_the_swing_back(lone_planner: "Suite") -> None:
    answer = plan(lone_planner, BASIC)
    limited = np.reshape(answer.trajectory.at_limit, (-1, len(answer.muscle_name)))
    assert names_where(answer, limited[1:].any(axis=0)) != []
    assert not limited[0].any()


def test_a_kept_muscle_is_not_masked(lone_planner: "Suite") -> None:
    answer = plan(lone_planner, METHOD_1, kept_muscle=["#9"])
    assert answer.mask[list(answer.muscle_name).index("#9")] == 1


def test_the_same_request_with_joints_in_another_order_gives_the_same_swing(
    lone_planner: "Suite",
) -> None:
    postures, names = lone_planner.robot.postures, lone_planner.robot.model.joint_names
    turned = lone_planner.plan(
        joint_name=list(reversed(names)),
        start_position=postures["start"][::-1].tolist(),
        end_position=postures["end"][::-1].tolist(),
    )
    assert is_same_swing(turned.plan, plan(lone_planner, BASIC))


# Comparing.


def test_a_comparison_has_each_method_once(lone_planner: "Suite") -> None:
    comparison = compare(lone_planner).comparison
    assert [outcome.method for outcome in comparison] == METHODS
    costs = [outcome.plan.time_cost for outcome in comparison]
    assert costs == pytest.approx([0.99, 0.60, 0.78, 0.60])


def test_a_comparison_comes_beside_the_plan(lone_planner: "Suite") -> None:
    answer = compare(lone_planner, method=METHOD_2)
    assert is_same_swing(answer.plan, answer.comparison[METHOD_2].plan)
    assert not is_same_swing(answer.plan, answer.comparison[METHOD_1].plan)


def test_nothing_is_compared_unless_asked(lone_planner: "Suite") -> None:
    assert list(lone_planner.plan().comparison) == []


def test_a_comparison_of_what_cannot_be_held_tells_each_error(lone_planner: "Suite") -> None:
    answer = compare(lone_planner, payload_mass=50.0)
    codes = [answer.error_code, *(outcome.error_code for outcome in answer.comparison)]
    assert codes == [ErrorCode.HOLDING_INFEASIBLE] * 5


# Parameters and diagnostics.


def set_parameter(suite: "Suite", name: str, value: Any) -> SetParametersResult:
    message: ParameterMessage = Parameter(name, value=value).to_parameter_msg()
    request = SetParameters.Request(parameters=[message])
    return suite.ask(SetParameters, "planner/set_parameters", request).results[0]


@pytest.mark.parametrize(
    ("name", "value", "usual", "options", "figure", "expected"),
    [
        ("time_step", 0.015, 0.03, {}, lambda plan: plan.trajectory.time_from_start[1], 0.015),
        ("epsilon", 0.2, 0.01, {}, lambda plan: plan.epsilon, 0.2),
        (
            "search_time_limit",
            0.001,
            1.0,
            {"method": METHOD_2, "search": SwingOptions.SEARCH_EXHAUSTIVE},
            lambda plan: plan.proven,
            False,
        ),
    ],
)
def test_a_parameter_takes_effect_with_the_next_request(
    lone_planner: "Suite",
    name: str,
    value: float,
    usual: float,
    options: dict[str, Any],
    figure: Any,
    expected: float,
) -> None:
    before = figure(lone_planner.plan(options=SwingOptions(**options)).plan)
    assert set_parameter(lone_planner, name, value).successful
    changed = lone_planner.plan(options=SwingOptions(**options))
    assert set_parameter(lone_planner, name, usual).successful
    assert figure(changed.plan) == pytest.approx(expected)
    assert before != pytest.approx(expected)


def test_a_cut_search_is_warned_of(lone_planner: "Suite") -> None:
    exhaustive = {"search": SwingOptions.SEARCH_EXHAUSTIVE, "search_time_limit": 1e-6}
    assert list(plan(lone_planner, METHOD_2, **exhaustive).warning) == [
        "the search ended at its time limit: a better mask may exist"
    ]


def test_fewer_steps_than_needed_are_blocked_from_the_next_request_on(
    lone_planner: "Suite",
) -> None:
    assert set_parameter(lone_planner, "max_steps", 20).successful
    blocked = lone_planner.plan()
    assert set_parameter(lone_planner, "max_steps", 400).successful
    assert blocked.error_code == ErrorCode.SWING_BLOCKED
    assert lone_planner.plan().error_code == ErrorCode.SUCCESS


def test_a_request_comes_before_the_parameter(lone_planner: "Suite") -> None:
    assert set_parameter(lone_planner, "max_steps", 20).successful
    asked = lone_planner.plan(options=SwingOptions(max_steps=400))
    assert set_parameter(lone_planner, "max_steps", 400).successful
    assert asked.error_string == ""


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("solver", "daqp", "solver takes effect at configuration: deactivate and clean up first"),
        ("solver", "gurobi", "solver is 'gurobi', choose from: proxsuite, daqp"),
        ("time_step", 0.0, "time_step is 0.0, expected 0.001 to 1 s"),
        ("epsilon", float("nan"), "epsilon is nan, expected 0.0001 to 1 rad"),
        ("max_steps", 0, "max_steps is 0, expected 1 to 100000"),
        ("search_time_limit", -1.0, "search_time_limit is -1.0, expected 0.001 to 3600 s"),
    ],
)
def test_a_wrong_parameter_is_refused_with_the_reason(
    lone_planner: "Suite", name: str, value: Any, reason: str
) -> None:
    result = set_parameter(lone_planner, name, value)
    assert (result.successful, result.reason) == (False, reason)


def test_diagnostics_count_plans_and_refusals(lone_planner: "Suite") -> None:
    def count(key: str) -> int:
        return int(lone_planner.reported("planner", key) or 0)

    lone_planner.until("diagnostics", lambda: lone_planner.reported("planner", "plans") != "")
    plans, refused = count("plans"), count("refused_start_equals_end")
    start = lone_planner.robot.postures["start"].tolist()
    lone_planner.plan()
    lone_planner.plan(end_position=start)
    lone_planner.until("a counted plan", lambda: count("plans") > plans)
    lone_planner.until("a counted refusal", lambda: count("refused_start_equals_end") > refused)
    assert count("callback_errors") == 0
