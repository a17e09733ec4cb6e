"""The bridge's parameters."""

from fastswing_planner.errors import InvalidLimit
from fastswing_planner.lifecycle.common_parameters import ROBOT_DESCRIPTION
from fastswing_planner.lifecycle.parameters import Parameter
from fastswing_planner.lifecycle.real_time import prevent_core_sleep
from musashi_muscle_bridge.nodes.bus_parameters import BUS_URL

_WATCHDOG_PERIODS = 3
TABLE = (
    ROBOT_DESCRIPTION,
    BUS_URL,
    Parameter(
        "read_only",
        False,
        "Publish states and command nothing: no commands are taken, no board is energised, "
        "cleared or kept alive.",
    ),
    Parameter(
        "control_rate",
        500.0,
        "Frames to the boards: how often muscles are commanded and measured. A frame that does not "
        "fit into its period is late.",
        "Hz",
        10.0,
        2000.0,
    ),
    Parameter(
        "watchdog_action",
        "zero_current",
        "What the boards do when frames stop. zero_current: the arm falls, nothing pulls; "
        "hold_length: a raised arm stays up, and so does the force on whatever it presses.",
        choices=("zero_current", "hold_length"),
    ),
    Parameter(
        "watchdog_timeout",
        0.1,
        "Time without frames until the boards do so. Shorter than the machine's stalls, the arm "
        "falls without need; longer, an arm nobody controls goes on for as long. At least three "
        "control periods.",
        "s",
        0.01,
        10.0,
    ),
    Parameter(
        "supervision_timeout",
        0.5,
        "Time without a sign of this node until its control process stops sending frames, as an "
        "emergency stop would not get through; then the boards' watchdog acts.",
        "s",
        0.05,
        10.0,
    ),
    Parameter(
        "command_timeout",
        0.1,
        "Time without a tension or current command until the muscle holds its measured length.",
        "s",
        0.005,
        10.0,
    ),
    Parameter(
        "command_max_age",
        0.5,
        "Commands older than this are rejected: the arm does not obey what a network delivers "
        "late. Tensions and currents must also be younger than command_timeout.",
        "s",
        0.01,
        10.0,
    ),
    Parameter(
        "max_lease",
        0.2,
        "Longest lease of a current override: no muscle is let go for longer without a newer one.",
        "s",
        0.005,
        1.0,
    ),
    Parameter(
        "payout_allowance",
        0.2,
        "How far beyond the longest path a wire may be commanded, for Method 2. More lets more "
        "slack onto the spool, where it can tangle.",
        "m",
        0.0,
        1.0,
    ),
    prevent_core_sleep(False, "While active"),
)


def refuse_short_watchdog(timeout: float, rate: float) -> None:
    """Raise InvalidLimit if one late frame is enough for the boards' watchdog to act."""
    least = _WATCHDOG_PERIODS / rate
    if timeout < least:
        raise InvalidLimit(
            f"watchdog_timeout is {timeout:g} s, expected at least {_WATCHDOG_PERIODS} control "
            f"periods, {least:g} s at {rate:g} Hz: the boards would act between two frames"
        )
