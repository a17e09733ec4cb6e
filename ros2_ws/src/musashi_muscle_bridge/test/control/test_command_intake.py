"""Every command is checked once, and becomes an order that counts from when it was made."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fastswing_planner.cdr.stamps import from_ns, from_seconds
from musashi_muscle_bridge.buses.protocol import Mode
from musashi_muscle_bridge.control.command_intake import (
    COMMAND_TOPICS,
    COMMANDS,
    OVERRIDE,
    CommandIntake,
    CommandTally,
)
from musashi_muscle_bridge.control.orders import Command, Override
from musashi_muscle_bridge.errors import CommandRejected

MUSCLES = ("#1", "#9", "#10")
CLOCK_NS = 1_700_000_000_000_000_000
NOW = 50.0
INTAKE = CommandIntake(MUSCLES, command_max_age=0.5, command_timeout=0.1, max_lease=0.2)


def stamped(age: float, **fields: Any) -> SimpleNamespace:
    """Return a message that was made `age` [s] ago."""
    sec, nanosec = from_ns(CLOCK_NS - round(age * 1e9))
    header = SimpleNamespace(stamp=SimpleNamespace(sec=sec, nanosec=nanosec))
    return SimpleNamespace(header=header, **fields)


def command(topic: str, age: float = 0.0, **fields: Any) -> SimpleNamespace:
    """Return a command of two muscles."""
    _, values = COMMANDS[topic]
    return stamped(age, **{"name": ["#9", "#1"], values: [0.3, 0.2], **fields})


def override(
    lease: float = 0.05, age: float = 0.0, name: tuple[str, ...] = ("#9",)
) -> SimpleNamespace:
    """Return an override of one muscle."""
    sec, nanosec = from_seconds(lease)
    return stamped(age, name=list(name), lease=SimpleNamespace(sec=sec, nanosec=nanosec))


def order(topic: str, message: SimpleNamespace) -> Any:
    return INTAKE.order(topic, message, NOW, CLOCK_NS)


def rejection(topic: str, message: SimpleNamespace) -> CommandRejected:
    with pytest.raises(CommandRejected) as caught:
        order(topic, message)
    return caught.value


def test_there_are_three_commands_and_the_override() -> None:
    assert COMMAND_TOPICS == (
        "length_command",
        "tension_command",
        "current_command",
        "current_override",
    )


@pytest.mark.parametrize(
    ("topic", "mode"),
    [
        ("length_command", Mode.LENGTH),
        ("tension_command", Mode.TENSION),
        ("current_command", Mode.CURRENT),
    ],
)
def test_a_command_becomes_an_order_in_its_mode(topic: str, mode: Mode) -> None:
    made = order(topic, command(topic))
    assert isinstance(made, Command)
    assert (made.mode, made.index, made.values.tolist()) == (mode, [1, 0], [0.3, 0.2])


@given(st.floats(0.0, 0.099))
def test_a_command_counts_from_when_it_was_made(age: float) -> None:
    for topic in COMMANDS:
        assert order(topic, command(topic, age)).made == pytest.approx(NOW - age, abs=1e-6)


def test_a_command_from_a_clock_slightly_ahead_counts_from_now() -> None:
    assert order("length_command", command("length_command", age=-0.02)).made == NOW


def test_an_override_becomes_a_lease_from_when_it_was_made() -> None:
    made = order(OVERRIDE, override(lease=0.05, age=0.01))
    assert isinstance(made, Override)
    assert made.index == [1]
    assert (made.lease, made.made) == pytest.approx((0.05, NOW - 0.01))


@pytest.mark.parametrize("topic", ["tension_command", "current_command"])
def test_a_stream_that_would_have_ended_is_rejected(topic: str) -> None:
    error = rejection(topic, command(topic, age=0.1))
    assert error.reason == "expired"
    assert str(error) == "the command is 0.100 s old, it would have ended after 0.1 s"


def test_a_length_command_lasts_and_may_be_as_old_as_any_command() -> None:
    order("length_command", command("length_command", age=0.4))


@pytest.mark.parametrize("topic", COMMAND_TOPICS)
@pytest.mark.parametrize(
    ("age", "reason"),
    [(0.6, "old_stamp"), (-0.06, "future_stamp"), (0.0, "zero_stamp")],
)
def test_a_wrong_stamp_is_rejected_on_every_topic(topic: str, age: float, reason: str) -> None:
    message = override(age=age) if topic == OVERRIDE else command(topic, age)
    if reason == "zero_stamp":
        message.header.stamp = SimpleNamespace(sec=0, nanosec=0)
    assert rejection(topic, message).reason == reason


@pytest.mark.parametrize("topic", COMMAND_TOPICS)
@pytest.mark.parametrize(
    ("names", "reason"), [(["#9", "#2"], "unknown_name"), (["#9", "#9"], "duplicate_name")]
)
def test_wrong_names_are_rejected_on_every_topic(topic: str, names: list[str], reason: str) -> None:
    message = override(name=tuple(names)) if topic == OVERRIDE else command(topic, name=names)
    assert rejection(topic, message).reason == reason


@pytest.mark.parametrize("topic", COMMANDS)
@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ([0.3], "wrong_length"),
        ([0.3, np.nan], "not_finite"),
        ([np.inf, 0.2], "not_finite"),
    ],
)
def test_wrong_values_are_rejected(topic: str, values: list[float], reason: str) -> None:
    _, name = COMMANDS[topic]
    message = command(topic)
    setattr(message, name, values)
    assert rejection(topic, message).reason == reason


@pytest.mark.parametrize("lease", [0.0, 0.21, 3600.0])
def test_a_lease_of_no_or_too_long_time_is_rejected(lease: float) -> None:
    assert rejection(OVERRIDE, override(lease)).reason == "lease"


def test_an_override_whose_lease_is_over_is_rejected() -> None:
    error = rejection(OVERRIDE, override(lease=0.05, age=0.05))
    assert (error.reason, str(error)) == (
        "expired",
        "the override is 0.050 s old, its lease of 0.05 s is over",
    )


def test_an_override_that_names_no_muscle_needs_no_lease() -> None:
    assert order(OVERRIDE, override(lease=0.0, name=())).index == []


def test_rejections_are_counted_by_topic_and_reason() -> None:
    tally = CommandTally()
    for _ in range(2):
        tally.reject("length_command", CommandRejected("not_finite", "the value of #1 is nan"))
    tally.contest("length_command")
    assert dict(tally.counts) == {
        "rejected_length_command_not_finite": 2,
        "contested_length_command": 1,
    }
    assert tally.last == "length_command: the value of #1 is nan"
