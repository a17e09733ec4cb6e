"""Motor temperatures from two thermal resistances; without clock or I/O."""

import numpy as np

from fastswing_planner.arrays import Vector, frozen
from musashi_muscle_bridge.emulation.plant_constants import PlantConstants


class MotorHeat:
    """Windings warm the housings, the housings warm the air; m motors.

    winding, housing  [degC] shape (m,)
    """

    def __init__(self, constants: PlantConstants, count: int) -> None:
        """Start with `count` motors at ambient temperature."""
        self._constants = constants
        self.winding = frozen(np.full(count, constants.ambient_temperature))
        self.housing = self.winding

    def add(self, current: Vector, elapsed: float) -> None:
        """Let `elapsed` [s], much less than the motors' time constants, pass at `current` [A]."""
        constants = self._constants
        heat = constants.winding_resistance * current**2  # [W]
        inner = (self.winding - self.housing) / constants.winding_thermal_resistance
        above_ambient = self.housing - constants.ambient_temperature
        outer = above_ambient / constants.housing_thermal_resistance
        winding_rate = (heat - inner) / constants.winding_heat_capacity  # [K/s]
        housing_rate = (inner - outer) / constants.housing_heat_capacity
        self.winding = frozen(self.winding + winding_rate * elapsed)
        self.housing = frozen(self.housing + housing_rate * elapsed)
