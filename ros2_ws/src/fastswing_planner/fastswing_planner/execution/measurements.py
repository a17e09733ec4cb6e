"""What is measured while an arm swings."""

from typing import NamedTuple

from fastswing_planner.arrays import Vector


class JointMeasurement(NamedTuple):
    """time [s]; position [rad] and velocity [rad/s], shape (n,)."""

    time: float
    position: Vector
    velocity: Vector


class MuscleMeasurement(NamedTuple):
    """One muscle state; vectors of shape (m,).

    time              [s]
    length, velocity  [m], [m/s]
    tension           [N]
    faulty            names of muscles with a latched fault
    limp              names of muscles at zero current
    driven            names of muscles that follow a tension or a current
    holds             how often the bridge was told to hold the arm
    """

    time: float
    length: Vector
    velocity: Vector
    tension: Vector
    faulty: tuple[str, ...] = ()
    limp: tuple[str, ...] = ()
    driven: tuple[str, ...] = ()
    holds: int = 0


class InhibitionReport(NamedTuple):
    """What the inhibitor tells of itself.

    time     [s] at which it was made
    armed    whether it goes on deciding
    reached  whether it ended because the goal was reached or passed
    reason   why it is not armed
    """

    time: float
    armed: bool
    reached: bool = False
    reason: str = ""
