"""The phases of a swing, and their limits."""

from dataclasses import dataclass
from enum import IntEnum

from fastswing_planner.errors import InvalidLimit


class Phase(IntEnum):
    """Where a swing is; the values are those of `fastswing_msgs/ExecuteSwing`'s feedback."""

    PLAN = 0
    RAISE = 1
    ELONGATE = 2
    SETTLE = 3
    SWING = 4
    RECOVER = 5


_ARMED_LONGER_SEC = 0.5


@dataclass(frozen=True)
class ExecutionSettings:
    """How carefully a swing is carried out; all positive.

    raise_speed      [rad/s] largest joint speed on the way to the start posture
    elongate_speed   [m/s] of paying out and of moving tension between muscles
    start_tolerance  [rad] norm of the distance to the start posture from which a swing may begin
    rest_speed       [rad/s] the arm rests below it
    rest_time        [s] for which it must rest
    arrival_tolerance [rad] norm of the distance to the end posture that counts as arrived
    raise_limit      [s] longest way to the start posture, with coming near to it
    elongate_limit   [s] longest time of paying out
    settle_limit     [s] longest wait for rest at the start posture and for the inhibitor
    swing_limit      [s] longest swing
    recover_time     [s] the end posture is held before the swing is done
    recover_limit    [s] longest wait for rest at the end posture, recover_time included
    state_timeout    [s] older measurements, a longer stall of the executor or a longer silence of
                     the inhibitor stop the swing
    """

    raise_speed: float = 0.8
    elongate_speed: float = 0.08
    start_tolerance: float = 0.08
    rest_speed: float = 0.15
    rest_time: float = 0.2
    arrival_tolerance: float = 0.1
    raise_limit: float = 15.0
    elongate_limit: float = 5.0
    settle_limit: float = 5.0
    swing_limit: float = 3.0
    recover_time: float = 0.5
    recover_limit: float = 5.0
    state_timeout: float = 0.2

    def __post_init__(self) -> None:
        """Raise InvalidLimit for a limit within which its phase cannot end."""
        for limit, time in (("settle_limit", "rest_time"), ("recover_limit", "recover_time")):
            if getattr(self, limit) <= getattr(self, time):
                raise InvalidLimit(
                    f"{limit} is {getattr(self, limit):g} s, must be above {time}, "
                    f"{getattr(self, time):g} s"
                )

    @property
    def arming_limit(self) -> float:
        """Time [s] for which the inhibitor is armed: longer than the swing may take.

        So a swing that takes too long always ends by its own limit, never by the inhibitor's.
        """
        return self.swing_limit + _ARMED_LONGER_SEC
