"""Why a swing may not begin or go on, judged from what is measured."""

from fastswing_planner.errors import FaultLatched, Interrupted, NotAtStart, SwingStateStale
from fastswing_planner.execution.measurements import MuscleMeasurement
from fastswing_planner.execution.settings import ExecutionSettings


def refuse_muscles(muscles: MuscleMeasurement, holds: int, inhibiting: bool = False) -> None:
    """Raise SwingAborted if muscles do not do what length commands tell them.

    holds       of the measurement when the swing was asked for
    inhibiting  some muscles may be at zero current
    """
    if muscles.faulty:
        raise FaultLatched(
            f"faulty muscles: {', '.join(muscles.faulty)}; find the cause, then clear_faults",
        )
    # Only Method 1 lets muscles go, and never all of them.
    if muscles.limp and not (inhibiting and len(muscles.limp) < muscles.length.size):
        raise FaultLatched(
            f"muscles at zero current: {', '.join(muscles.limp)}; an emergency stop or "
            "somebody's current_override holds them",
        )
    if muscles.holds != holds:
        raise Interrupted("somebody held the arm, by hold_posture or clear_faults")
    if muscles.driven:
        raise Interrupted(
            f"muscles that follow somebody's tension or current: {', '.join(muscles.driven)}",
        )


def refuse_stale(age: float, timeout: float) -> None:
    """Raise SwingStateStale if the older of the last two states has an age [s] above `timeout`."""
    if age > timeout:
        raise SwingStateStale(f"the last measurements are {age:.2f} s old")


def refuse_stall(stall: float, timeout: float) -> None:
    """Raise SwingStateStale if the last step was longer ago than `timeout` [s].

    Going on would jump to where the arm should be by now.
    """
    if stall > timeout:
        raise SwingStateStale(f"the executor did not run for {stall:.2f} s")


def not_at_start(distance: float, settings: ExecutionSettings, verb: str) -> NotAtStart:
    """Return the error of an arm `distance` [rad] from the start; `verb` is what it must do."""
    return NotAtStart(
        f"the arm is {distance:.3f} rad from the start posture and must {verb} within "
        f"{settings.start_tolerance:g} rad of it",
    )
