"""What may be commanded of a muscle, from the robot's description."""

from dataclasses import dataclass

from fastswing_planner.arrays import Vector


@dataclass(frozen=True)
class CommandLimits:
    """What commands are clamped to; vectors of shape (m,).

    length_min, length_max  [m]
    tension_max             [N] of a tension command
    tension_limit           [N] above it the boards pay out
    current_max             [A] of a current command; less than 0 would wind the wire off its drum
    velocity                [m/s] of re-engaging, and of winding in by a current
    stream_timeout          [s] without a tension or current command until the muscle holds
    max_lease               [s]
    """

    length_min: Vector
    length_max: Vector
    tension_max: Vector
    tension_limit: Vector
    current_max: Vector
    velocity: Vector
    stream_timeout: float
    max_lease: float
