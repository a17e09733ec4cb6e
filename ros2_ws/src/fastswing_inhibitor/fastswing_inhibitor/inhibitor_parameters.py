"""The inhibitor's parameters."""

from collections.abc import Mapping
from typing import Any

from fastswing_inhibitor.inhibition import InhibitionSettings
from fastswing_planner.lifecycle.common_parameters import ROBOT_DESCRIPTION
from fastswing_planner.lifecycle.parameters import Parameter
from fastswing_planner.lifecycle.real_time import prevent_core_sleep
from fastswing_planner.lifecycle.request_age import REQUEST_MAX_AGE

_DEFAULTS = InhibitionSettings()

TABLE = (
    ROBOT_DESCRIPTION,
    REQUEST_MAX_AGE,
    Parameter(
        "threshold",
        0.0,
        "C of arming requests whose threshold is NaN: muscles with q above it lose their current. "
        "Larger lets fewer muscles go. The swing executor never asks so: it arms with the C that "
        "its plan was made with.",
        "s/rad",
        0.0,
        1e6,
    ),
    Parameter(
        "lease",
        0.05,
        "How long an override lasts without a newer one, from the stamp of its joint state; older "
        "joint states decide nothing. Longer rides over late messages, shorter brings the muscles "
        "back sooner when this node dies.",
        "s",
        0.002,
        0.2,
    ),
    prevent_core_sleep(True, "While armed"),
    Parameter(
        "max_time_limit",
        5.0,
        "Longest time limit of an arming request: no muscle is let go for longer.",
        "s",
        0.1,
        60.0,
    ),
    Parameter(
        "velocity_threshold",
        _DEFAULTS.velocity_threshold,
        "Below this joint speed the direction to the goal chooses the muscles to let go, above it "
        "the arm's own motion. Too low, noise of a resting arm chooses them.",
        "rad/s",
        1e-3,
        10.0,
    ),
    Parameter(
        "reversal_speed",
        _DEFAULTS.reversal_speed,
        "An arm that moves faster than this away from the goal disarms: all muscles are driven "
        "again. Keep it above the executor's rest_speed.",
        "rad/s",
        1e-3,
        10.0,
    ),
    Parameter(
        "state_timeout",
        _DEFAULTS.state_timeout,
        "Joint states older than this disarm: the muscles are driven again. Longer forgives "
        "stalls, and lets an unseen arm fall for as long.",
        "s",
        0.002,
        1.0,
    ),
    Parameter(
        "goal_tolerance",
        _DEFAULTS.goal_tolerance,
        "This near to the goal all muscles are driven again and brake the arm. Larger brakes "
        "earlier.",
        "rad",
        1e-3,
        1.0,
    ),
    Parameter(
        "max_joint_speed",
        _DEFAULTS.max_joint_speed,
        "A joint that moved faster between two states has jumped: a sensor is wrong. That disarms, "
        "and all muscles are driven again. A state that tells a higher speed is rejected. Above "
        "any speed of the arm.",
        "rad/s",
        0.1,
        1000.0,
    ),
)


def settings_from(parameters: Mapping[str, Any]) -> InhibitionSettings:
    """Return the settings among the node's parameters."""
    return InhibitionSettings(
        velocity_threshold=parameters["velocity_threshold"],
        reversal_speed=parameters["reversal_speed"],
        state_timeout=parameters["state_timeout"],
        lease=parameters["lease"],
        goal_tolerance=parameters["goal_tolerance"],
        max_joint_speed=parameters["max_joint_speed"],
    )
