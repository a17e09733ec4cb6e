"""The swing executor's parameters."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from fastswing_planner.execution.settings import ExecutionSettings
from fastswing_planner.lifecycle.common_parameters import ROBOT_DESCRIPTION
from fastswing_planner.lifecycle.parameters import Parameter
from fastswing_planner.lifecycle.request_age import REQUEST_MAX_AGE

_DEFAULTS = ExecutionSettings()


def _setting(name: str, unit: str, low: float, high: float, description: str) -> Parameter:
    return Parameter(name, getattr(_DEFAULTS, name), description, unit, low, high)


TABLE = (
    ROBOT_DESCRIPTION,
    REQUEST_MAX_AGE,
    Parameter(
        "rate",
        100.0,
        "How often the way of the arm is judged and length commands are sent: on the way to the "
        "start each one is a small step.",
        "Hz",
        10.0,
        1000.0,
    ),
    Parameter(
        "service_timeout",
        2.0,
        "Longest wait for the planner and the inhibitor; then the swing is refused or the arm "
        "held.",
        "s",
        0.1,
        60.0,
    ),
    _setting(
        "raise_speed",
        "rad/s",
        0.05,
        3.0,
        "Largest joint speed on the way to the start; slower is gentler to whatever is in the way.",
    ),
    _setting(
        "elongate_speed",
        "m/s",
        0.005,
        0.3,
        "Speed of paying Method 2's muscles out before the swing.",
    ),
    _setting(
        "start_tolerance",
        "rad",
        0.005,
        0.5,
        "The swing begins only this near to the start posture, by the norm over all joints.",
    ),
    _setting(
        "rest_speed",
        "rad/s",
        0.01,
        1.0,
        "Joints slower than this rest. The arm is raised, and swings, only from rest.",
    ),
    _setting(
        "rest_time",
        "s",
        0.02,
        5.0,
        "How long the arm must rest before the swing; longer lets ringing of the raise die away.",
    ),
    _setting(
        "arrival_tolerance",
        "rad",
        0.005,
        0.5,
        "The swing has arrived this near to the end posture, by the norm over all joints; then it "
        "only has to rest.",
    ),
    _setting(
        "raise_limit",
        "s",
        0.5,
        300.0,
        "Longest way to the start posture; a longer one is refused before anything moves.",
    ),
    _setting(
        "elongate_limit",
        "s",
        0.2,
        60.0,
        "Longest time of paying out; a longer one is refused before anything moves.",
    ),
    _setting(
        "settle_limit",
        "s",
        0.5,
        60.0,
        "Longest wait for the arm to rest before the raise, and for rest at the start posture and "
        "the inhibitor before the swing.",
    ),
    _setting(
        "swing_limit",
        "s",
        0.2,
        10.0,
        "Longest swing; then the arm is held where it is. The inhibitor is armed for 0.5 s more, "
        "so keep this 0.5 s below its max_time_limit.",
    ),
    _setting(
        "recover_time",
        "s",
        0.1,
        10.0,
        "How long the arm is held at the end before the swing is done.",
    ),
    _setting(
        "recover_limit",
        "s",
        0.2,
        60.0,
        "Longest wait for rest at the end posture, recover_time included; then the swing has "
        "failed and the arm is held.",
    ),
    _setting(
        "state_timeout",
        "s",
        0.02,
        2.0,
        "Older measurements, a longer stall of this node or a longer silence of the inhibitor stop "
        "the swing and hold the arm. Longer forgives stalls, and moves an unseen arm for as long.",
    ),
)


def settings_from(parameters: Mapping[str, Any]) -> ExecutionSettings:
    """Return the settings among the node's parameters."""
    return ExecutionSettings(**{field.name: parameters[field.name] for field in fields(_DEFAULTS)})
