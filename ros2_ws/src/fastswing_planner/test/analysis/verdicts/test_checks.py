"""Limits in a file, and one line for each that is violated."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fastswing_planner.analysis.figures import FIGURES
from fastswing_planner.analysis.measured_swing import MeasuredSwing
from fastswing_planner.analysis.measuring import measure_swings
from fastswing_planner.analysis.recording import Recording, TopicTimes
from fastswing_planner.analysis.timing import TopicTiming, topic_timing
from fastswing_planner.analysis.verdicts.checks import CheckResult, check
from fastswing_planner.analysis.verdicts.criteria import (
    Bounds,
    CriteriaError,
    parse_criteria,
    read_criteria,
)

LABEL = "run.mcap swing 1 (inhibit, at 3.98 s): "


@pytest.fixture
def swing(recorded: Callable[..., Recording]) -> MeasuredSwing:
    return measure_swings(recorded())[0]


@pytest.fixture
def topics(recorded: Callable[..., Recording]) -> dict[str, list[TopicTiming]]:
    return {"run.mcap": [topic_timing(one) for one in recorded().topics]}


def checked(content: Any, swing: MeasuredSwing) -> CheckResult:
    return check(parse_criteria(content), [swing], {})


def test_limits_that_are_kept_pass(swing: MeasuredSwing) -> None:
    result = checked({"each_swing": {"time": {"max": 1.0}, "joint_speed": {"min": 2.9}}}, swing)
    assert (result.passed, result.checked, result.violations) == (True, 2, ())


@pytest.mark.parametrize(
    ("limits", "line"),
    [
        ({"time": {"max": 0.5}}, "time to the end posture is 0.875 s, at most 0.5 s allowed"),
        (
            {"joint_speed": {"min": 4, "max": 5}},
            "peak speed of any joint is 3 rad/s, 4 to 5 rad/s allowed",
        ),
        ({"rejected": 0}, "joint states rejected is 2, exactly 0 allowed"),
        ({"joints": {"E-p": {"max": 2}}}, "peak speed of E-p is 3 rad/s, at most 2 rad/s allowed"),
        (
            {"muscle_speeds": {"#9": {"max": 0.3}}},
            "peak speed of #9 is 0.5 m/s, at most 0.3 m/s allowed",
        ),
        (
            {"tensions": {"#1": {"max": 100}}},
            "largest tension of #1 is 170 N, at most 100 N allowed",
        ),
        ({"joints": {"knee": {"max": 2}}}, "unknown joint 'knee', the bag holds: S-p, E-p"),
    ],
)
def test_a_violation_is_one_line_with_swing_value_and_bound(
    swing: MeasuredSwing, limits: Any, line: str
) -> None:
    assert checked({"each_swing": limits}, swing).violations == (LABEL + line,)


def test_an_unknown_figure_violates_its_limit(recorded: Callable[..., Recording]) -> None:
    (swing,) = measure_swings(recorded(muscles=None))
    assert checked({"each_swing": {"tension": {"max": 300}}}, swing).violations == (
        LABEL + "largest tension is unknown, at most 300 N allowed",
    )


def test_without_an_inhibition_status_no_limit_of_rejections_is_kept(
    recorded: Callable[..., Recording],
) -> None:
    (swing,) = measure_swings(recorded(status=None))
    assert checked({"each_swing": {"rejected": 0}}, swing).violations == (
        LABEL + "joint states rejected is unknown, exactly 0 allowed",
    )


@pytest.mark.parametrize(("figure", "name"), [("velocity", "muscle_speed"), ("tension", "tension")])
def test_the_largest_of_all_muscles_is_unknown_if_one_is(
    figure: str, name: str, recorded: Callable[..., Recording]
) -> None:
    muscles = recorded().muscles
    assert muscles is not None
    values = getattr(muscles, figure).copy()
    values[:, 2] = np.nan
    (swing,) = measure_swings(recorded(muscles=replace(muscles, **{figure: values})))
    (line,) = checked({"each_swing": {name: {"max": 999}}}, swing).violations
    assert f"is unknown, at most 999 {FIGURES[name].unit} allowed" in line


def test_the_fastest_of_all_joints_is_unknown_if_one_is(
    recorded: Callable[..., Recording],
) -> None:
    joints = recorded().joints
    velocity = joints.velocity.copy()
    velocity[:, 0] = np.nan
    (swing,) = measure_swings(recorded(joints=replace(joints, velocity=velocity)))
    assert not checked({"each_swing": {"joint_speed": {"max": 999}}}, swing).passed


def test_a_methods_limits_are_for_its_swings_only(swing: MeasuredSwing) -> None:
    strict = {"time": {"max": 0.1}}
    result = checked({"methods": {"inhibit": strict, "basic": strict}}, swing)
    assert [line.partition(": ")[0] for line in result.violations] == [
        LABEL[:-2],
        "no swing by method 'basic'",
    ]


def test_the_number_of_swings_is_checked(swing: MeasuredSwing) -> None:
    assert checked({"swings": 3}, swing).violations == ("1 swings, exactly 3 allowed",)


NO_SWING = "no swing: the limits of each_swing could not be tried"


@pytest.mark.parametrize(
    ("swings", "lines"),
    [
        ({}, (NO_SWING,)),
        ({"swings": {"max": 2}}, ()),
        ({"swings": 0}, ()),
        ({"swings": {"min": 1}}, ("0 swings, at least 1 allowed", NO_SWING)),
    ],
)
def test_limits_of_each_swing_are_not_kept_by_none_unless_none_is_allowed(
    swings: Any, lines: tuple[str, ...], topics: dict[str, list[TopicTiming]]
) -> None:
    content = {"each_swing": {"time": {"max": 1}}, "topics": {"joint_states": {"gaps": 0}}}
    assert check(parse_criteria(content | swings), [], topics).violations == lines


def test_without_limits_of_each_swing_there_may_be_none(
    topics: dict[str, list[TopicTiming]],
) -> None:
    assert check(parse_criteria({"topics": {"joint_states": {"gaps": 0}}}), [], topics).passed


@pytest.mark.parametrize(
    ("limits", "line"),
    [
        ({"joints": {"E-q": {"max": 2}}}, "unknown joint 'E-q', the bags hold: S-p, E-p"),
        ({"tensions": {"#8": {"max": 2}}}, "unknown muscle '#8', the bags hold: #1, #9"),
    ],
)
def test_a_misspelt_name_is_noticed_without_any_swing(limits: Any, line: str) -> None:
    wanted = parse_criteria({"swings": 0, "each_swing": limits})
    assert check(wanted, [], {}, ("S-p", "E-p"), ("#1", "#9")).violations == (line,)


def test_a_name_of_the_bags_is_right_without_any_swing() -> None:
    wanted = parse_criteria({"swings": 0, "each_swing": {"joints": {"E-p": {"max": 2}}}})
    assert check(wanted, [], {}, ("S-p", "E-p")).passed


def test_without_any_limit_tried_nothing_passes() -> None:
    result = check(parse_criteria({"topics": {"joint_states": {"gaps": 0}}}), [], {})
    assert (result.checked, result.passed) == (0, False)


@pytest.mark.parametrize("name", ["joint_states", "/joint_states"])
def test_topics_are_checked_with_or_without_their_namespace(
    name: str, topics: dict[str, list[TopicTiming]]
) -> None:
    limits = parse_criteria({"topics": {name: {"rate": {"min": 400}, "gaps": {"max": 0}}}})
    result = check(limits, [], topics)
    assert result.checked == 2
    assert result.violations == ("run.mcap /joint_states: rate is 200 Hz, at least 400 Hz allowed",)


def test_a_topic_that_is_missing_violates_its_limits(topics: dict[str, list[TopicTiming]]) -> None:
    limits = parse_criteria({"topics": {"muscle_state": {"rate": {"min": 1}}}})
    assert check(limits, [], topics).violations == (
        "run.mcap: no topic 'muscle_state', the bag holds: /joint_states",
    )


@pytest.mark.parametrize(("count", "steady"), [(5, True), (50, False)])
def test_gaps_that_were_never_looked_for_violate_their_limit(count: int, steady: bool) -> None:
    times = TopicTimes("/plan", "t/msg/T", np.arange(count) / 10.0, steady=steady)
    limits = parse_criteria({"topics": {"plan": {"gaps": {"max": 9}}}})
    assert check(limits, [], {"run.mcap": [topic_timing(times)]}).violations == (
        "run.mcap /plan: gaps is unknown, at most 9 allowed",
    )


@pytest.mark.parametrize("name", FIGURES)
def test_every_figure_can_be_limited(name: str, swing: MeasuredSwing) -> None:
    value = FIGURES[name].of(swing)
    assert np.isfinite(value)
    assert checked({"each_swing": {name: {"max": value}}}, swing).passed
    assert not checked({"each_swing": {name: {"max": value - 0.001}}}, swing).passed


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (None, "the file is None, expected a mapping"),
        ({}, "no limits; choose from: swings, each_swing, methods, topics"),
        (
            {"swing": 1},
            "the file: unknown key 'swing', choose from: swings, each_swing, methods, topics",
        ),
        ({"swings": "3"}, "swings is '3', expected a number, or min, max or both"),
        ({"swings": {"most": 3}}, "swings: unknown key 'most', choose from: min, max"),
        ({"swings": {"min": True}}, "swings: min is True, expected a number"),
        ({"swings": {"min": 3, "max": 1}}, "swings: min 3 is above max 1"),
        (
            {"each_swing": {"time": {"max": float("nan")}}},
            "each_swing: time: max is nan, expected a number",
        ),
        ({"each_swing": {"joints": 3}}, "each_swing: joints is 3, expected a mapping"),
        (
            {"topics": {"a": {"speed": 3}}},
            "topics: a: unknown key 'speed', choose from: rate, longest_pause, gaps, dropped",
        ),
    ],
)
def test_a_wrong_file_is_refused_with_key_and_choices(content: Any, text: str) -> None:
    with pytest.raises(CriteriaError) as caught:
        parse_criteria(content)
    assert str(caught.value) == text


def test_an_unknown_figure_in_the_file_lists_the_figures() -> None:
    with pytest.raises(CriteriaError, match="unknown key 'speed', choose from: main_joint_speed"):
        parse_criteria({"each_swing": {"speed": 1}})


def test_the_file_is_named(tmp_path: Path) -> None:
    path = tmp_path / "limits.yaml"
    path.write_text("swings: [")
    with pytest.raises(CriteriaError, match=f"^{path}: not YAML: "):
        read_criteria(path)
    with pytest.raises(CriteriaError, match="cannot be read"):
        read_criteria(tmp_path / "none.yaml")


@pytest.mark.parametrize(
    ("text", "line", "key"),
    [
        (
            "each_swing: {time: {max: 1}}\nswings: 1\neach_swing: {tension: {max: 9}}",
            3,
            "each_swing",
        ),
        ("each_swing:\n  time: {max: 1}\n  time: {max: 2}", 3, "time"),
        ("swings: {max: 1, max: 2}", 1, "max"),
    ],
)
def test_a_key_that_stands_twice_is_refused(text: str, line: int, key: str, tmp_path: Path) -> None:
    path = tmp_path / "limits.yaml"
    path.write_text(text)
    with pytest.raises(CriteriaError) as caught:
        read_criteria(path)
    assert str(caught.value) == f"{path}: line {line}: key '{key}' stands there a second time"


def test_bounds_are_inclusive() -> None:
    assert Bounds(1.0, 2.0).allows(1.0)
    assert Bounds(1.0, 2.0).allows(2.0)
    assert not Bounds().allows(np.nan)
