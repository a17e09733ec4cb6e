"""A command that is wrong is not taken, and its text says what was wrong."""

import numpy as np
import pytest

from musashi_muscle_bridge.control.command_checks import (
    check_lease,
    check_stream,
    checked_age,
    checked_index,
    checked_values,
)
from musashi_muscle_bridge.errors import CommandRejected

MUSCLES = ("#1", "#2", "#3")
NOW_NS = 1_700_000_000_000_000_000


def test_names_become_indices_in_the_order_of_the_command() -> None:
    assert checked_index(["#3", "#1"], MUSCLES) == [2, 0]


def test_a_command_may_address_no_muscle_at_all() -> None:
    assert checked_index([], MUSCLES) == []


def test_an_unknown_name_is_rejected_with_the_choices() -> None:
    with pytest.raises(CommandRejected) as caught:
        checked_index(["#1", "biceps"], MUSCLES)
    assert str(caught.value) == "unknown muscle 'biceps', choose from: #1, #2, #3"
    assert caught.value.reason == "unknown_name"


def test_a_repeated_name_is_rejected() -> None:
    with pytest.raises(CommandRejected) as caught:
        checked_index(["#2", "#1", "#2"], MUSCLES)
    assert str(caught.value) == "a muscle is named twice: #2, #1, #2"
    assert caught.value.reason == "duplicate_name"


def test_values_come_back_as_they_are() -> None:
    assert checked_values(["#1", "#2"], [0.25, -3.0]).tolist() == [0.25, -3.0]


def test_checked_values_cannot_be_changed() -> None:
    with pytest.raises(ValueError, match="read-only"):
        checked_values(["#1"], [0.25])[0] = 1.0


@pytest.mark.parametrize("values", [[], [0.1], [0.1, 0.2, 0.3]])
def test_a_wrong_number_of_values_is_rejected(values: list[float]) -> None:
    with pytest.raises(CommandRejected) as caught:
        checked_values(["#1", "#2"], values)
    assert str(caught.value) == f"{len(values)} values for 2 muscles"
    assert caught.value.reason == "wrong_length"


@pytest.mark.parametrize(("value", "text"), [(np.nan, "nan"), (np.inf, "inf"), (-np.inf, "-inf")])
def test_a_value_that_is_not_finite_is_rejected_naming_the_muscle(value: float, text: str) -> None:
    with pytest.raises(CommandRejected) as caught:
        checked_values(["#1", "#3"], [0.1, value])
    assert str(caught.value) == f"the value of #3 is {text}"
    assert caught.value.reason == "not_finite"


@pytest.mark.parametrize("age_ns", [0, 199_000_000, -49_000_000])
def test_a_stamp_of_about_now_is_taken(age_ns: int) -> None:
    checked_age(NOW_NS - age_ns, NOW_NS, max_age=0.2)


def test_a_zero_stamp_is_rejected() -> None:
    with pytest.raises(CommandRejected) as caught:
        checked_age(0, NOW_NS, max_age=0.2)
    assert str(caught.value) == "the stamp is zero: fill in when the command was made"
    assert caught.value.reason == "zero_stamp"


def test_an_old_stamp_is_rejected_with_its_age() -> None:
    with pytest.raises(CommandRejected) as caught:
        checked_age(NOW_NS - 250_000_000, NOW_NS, max_age=0.2)
    assert str(caught.value) == "the stamp is 0.250 s old, at most 0.2 s"
    assert caught.value.reason == "old_stamp"


def test_a_future_stamp_is_rejected_with_its_lead() -> None:
    with pytest.raises(CommandRejected) as caught:
        checked_age(NOW_NS + 75_000_000, NOW_NS, max_age=0.2)
    assert str(caught.value) == "the stamp is 0.075 s in the future"
    assert caught.value.reason == "future_stamp"


def test_an_age_is_returned() -> None:
    assert checked_age(NOW_NS - 50_000_000, NOW_NS, max_age=0.2) == pytest.approx(0.05)


def test_a_command_from_a_clock_slightly_ahead_has_no_age() -> None:
    assert checked_age(NOW_NS + 25_000_000, NOW_NS, max_age=0.2) == 0.0


def test_a_lease_that_was_over_before_it_arrived_is_rejected() -> None:
    with pytest.raises(
        CommandRejected, match=r"^the override is 0\.060 s old, its lease of 0\.05 s is over$"
    ):
        check_lease(0.05, 0.2, age=0.06)


def test_a_stream_command_that_would_have_ended_is_rejected() -> None:
    with pytest.raises(
        CommandRejected, match=r"^the command is 0\.200 s old, it would have ended after 0\.1 s$"
    ):
        check_stream(0.2, 0.1)
