"""The figures of a measured swing."""

import math
from dataclasses import dataclass

import numpy as np

from fastswing_planner.arrays import Vector, frozen


@dataclass(frozen=True)
class SwingFigures:
    """What is compared between plan and robot.

    peak_joint_velocity   [rad/s] largest magnitudes, shape (n,)
    time_cost             [s] from the swing command to the end posture; NaN: not reached
    peak_muscle_velocity  [m/s] largest magnitudes, shape (m,)
    peak_tension          [N] largest values, shape (m,)
    """

    peak_joint_velocity: Vector
    time_cost: float
    peak_muscle_velocity: Vector
    peak_tension: Vector


class SwingMeasurement:
    """Collects the figures of one swing from measurements in any order of arrival."""

    def __init__(self, joint_count: int, muscle_count: int, start_time: float) -> None:
        """Start at the swing command, at `start_time` [s]."""
        self._start_time = start_time
        self._time_cost = math.nan
        self._joint_velocity = np.zeros(joint_count)
        self._muscle_velocity = np.zeros(muscle_count)
        self._tension = np.zeros(muscle_count)

    @property
    def arrived(self) -> bool:
        """Whether the end posture was reached."""
        return not math.isnan(self._time_cost)

    def add_joints(
        self, time: float, joint_velocity: Vector, distance: float, epsilon: float
    ) -> None:
        """Add a joint state: velocities [rad/s] and distance [rad] to the end posture."""
        np.maximum(self._joint_velocity, np.abs(joint_velocity), out=self._joint_velocity)
        if not self.arrived and distance < epsilon:
            self._time_cost = time - self._start_time

    def add_muscles(self, muscle_velocity: Vector, tension: Vector) -> None:
        """Add a muscle state: speeds [m/s] and tensions [N], each of shape (m,)."""
        np.maximum(self._muscle_velocity, np.abs(muscle_velocity), out=self._muscle_velocity)
        np.maximum(self._tension, tension, out=self._tension)

    def figures(self) -> SwingFigures:
        """Return what was collected so far."""
        return SwingFigures(
            frozen(self._joint_velocity),
            self._time_cost,
            frozen(self._muscle_velocity),
            frozen(self._tension),
        )
