"""A parameter's row accepts what it says, and its text says what would be right."""

import math
from array import array
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fastswing_planner.errors import InvalidParameter
from fastswing_planner.lifecycle.parameters import (
    Parameter,
    check_all,
    check_change,
    unknown_name_text,
)

RATE = Parameter("rate", 100.0, "Control rate.", unit="Hz", low=1.0, high=1000.0)
COUNT = Parameter("count", 3, "Number of tries.", low=1, high=10)
METHOD = Parameter("method", "basic", "How to swing.", choices=("basic", "elongate"))
SWITCH = Parameter("read_only", False, "Whether to send nothing.")
NAMES = Parameter("muscles", ["#1"], "Which muscles.")
CORES = Parameter("cores", [], "Which cores.", low=0, high=7, item=int)
FREE = Parameter("offset", 0.0, "Any number.", unit="m")


@given(st.floats(1.0, 1000.0))
def test_a_number_in_its_range_passes_unchanged(value: float) -> None:
    assert RATE.check(value) == value


@given(st.floats().filter(lambda value: not 1.0 <= value <= 1000.0))
def test_any_other_number_is_refused(value: float) -> None:
    with pytest.raises(InvalidParameter) as caught:
        RATE.check(value)
    assert str(caught.value) == f"rate is {value}, expected 1 to 1000 Hz"


@pytest.mark.parametrize("end", [1, 10])
def test_both_ends_of_a_range_belong_to_it(end: int) -> None:
    assert COUNT.check(end) == end


@pytest.mark.parametrize("value", [[], [0, 7], array("q", [3]), None])
def test_a_list_of_numbers_is_a_list_however_it_comes(value: Any) -> None:
    assert CORES.check(value) == list(value or [])


def test_a_whole_number_becomes_a_float_where_one_is_expected() -> None:
    assert isinstance(RATE.check(50), float)


def test_a_number_without_range_must_still_be_a_number() -> None:
    with pytest.raises(InvalidParameter, match=r"^offset is nan, expected "):
        FREE.check(math.nan)


@pytest.mark.parametrize(
    ("row", "value", "text"),
    [
        (RATE, "fast", "rate is 'fast', expected float"),
        (RATE, True, "rate is True, expected float"),
        (COUNT, 2.0, "count is 2.0, expected int"),
        (COUNT, True, "count is True, expected int"),
        (COUNT, 11, "count is 11, expected 1 to 10"),
        (SWITCH, 1, "read_only is 1, expected bool"),
        (METHOD, None, "method is None, expected str"),
        (METHOD, "fast", "method is 'fast', choose from: basic, elongate"),
        (NAMES, "#1", "muscles is '#1', expected a list of texts"),
        (NAMES, [1], "muscles is [1], expected a list of texts"),
        (CORES, ["1"], "cores is ['1'], expected a list of whole numbers"),
        (CORES, [True], "cores is [True], expected a list of whole numbers"),
        (CORES, [0, 8], "cores has 8, expected 0 to 7"),
    ],
)
def test_a_wrong_value_is_shown_with_what_would_be_right(
    row: Parameter, value: Any, text: str
) -> None:
    with pytest.raises(InvalidParameter) as caught:
        row.check(value)
    assert str(caught.value) == text


@pytest.mark.parametrize(
    ("row", "value"),
    [(METHOD, "elongate"), (SWITCH, True), (NAMES, ["#2", "#3"]), (NAMES, []), (FREE, -1e300)],
)
def test_a_right_value_passes(row: Parameter, value: Any) -> None:
    assert row.check(value) == value


@pytest.mark.parametrize("row", [RATE, COUNT, METHOD, SWITCH, NAMES, FREE])
def test_a_default_is_right_itself(row: Parameter) -> None:
    assert row.check(row.default) == row.default


@pytest.mark.parametrize(
    ("row", "text"),
    [(RATE, "1 to 1000 Hz"), (COUNT, "1 to 10"), (METHOD, "basic, elongate"), (SWITCH, "")],
)
def test_the_range_is_told_for_people(row: Parameter, text: str) -> None:
    assert row.range_text == text


def test_a_whole_table_is_checked() -> None:
    assert check_all([RATE, COUNT], {"rate": 20, "count": 2}) == {"rate": 20.0, "count": 2}


def test_the_first_wrong_value_of_a_table_is_named() -> None:
    with pytest.raises(InvalidParameter) as caught:
        check_all([RATE, COUNT], {"rate": 0.5, "count": 99})
    assert str(caught.value) == "rate is 0.5, expected 1 to 1000 Hz"


def accepted(_name: str, _value: Any) -> None:
    """Judge as a robot that takes every value."""


def refused(name: str, value: Any) -> None:
    raise InvalidParameter(f"{name} {value} does not fit the robot")


LIVE = replace(RATE, read_only=False)


@pytest.mark.parametrize("judge", [None, accepted, refused])
def test_no_invalid_value_is_ever_taken(judge: Callable[[str, Any], None] | None) -> None:
    with pytest.raises(InvalidParameter, match="rate is nan, expected 1 to 1000 Hz"):
        check_change(LIVE, math.nan, judge)


def test_before_configuration_every_valid_value_is_taken() -> None:
    check_change(RATE, 200.0, None)


def test_a_configured_node_changes_what_may_change() -> None:
    check_change(LIVE, 200.0, accepted)


def test_a_configured_node_keeps_what_takes_effect_at_configuration() -> None:
    with pytest.raises(InvalidParameter) as caught:
        check_change(RATE, 200.0, accepted)
    assert str(caught.value) == (
        "rate takes effect at configuration: deactivate and clean up first"
    )


def test_the_robot_is_asked_with_the_checked_value() -> None:
    with pytest.raises(InvalidParameter, match=r"rate 200\.0 does not fit the robot"):
        check_change(LIVE, 200, refused)


def test_a_misspelt_name_is_refused() -> None:
    with pytest.raises(InvalidParameter) as caught:
        unknown_name_text("read_ony", ["rate", "read_only"])
    assert str(caught.value) == "unknown parameter 'read_ony', did you mean 'read_only'?"


def test_another_nodes_parameter_is_ignored() -> None:
    assert unknown_name_text("bus", ["rate", "read_only"]) == (
        "unknown parameter 'bus' is ignored, choose from: rate, read_only"
    )
