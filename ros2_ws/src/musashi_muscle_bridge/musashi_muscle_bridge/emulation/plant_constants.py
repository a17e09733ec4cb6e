"""The physical constants of the arm that is not here; docs/musashi_model.md says their sources."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from fastswing_planner.errors import RobotDescriptionError

_ZERO_ALLOWED = ("tension_noise", "encoder_step", "angle_noise", "noise_seed")


@dataclass(frozen=True)
class PlantConstants:
    """Physical constants of every winch, and of what measures it.

    wire_damping        [N s/m] of the stretching wire
    winch_mass          [kg] reflected inertia of motor and gear at the wire
    winch_friction      [N] Coulomb friction of the gear at the wire, felt when back-driven
    winch_damping       [N s/m] viscous part of it
    force_per_current   [N/A] pull at the wire for each ampere
    stall_force         [N] at which a winch that is asked to wind in stands still: of the speed
                        asked for, it reaches 1 - (pull / stall_force)^stall_exponent
    stall_exponent      of that law; 1 is a straight torque-speed line
    length_gain         [1/s] of the boards' length control: payout speed for each metre of error
    winding_resistance  [ohm] of a motor, at ambient temperature
    winding_heat_capacity, housing_heat_capacity        [J/K]
    winding_thermal_resistance                          [K/W] from winding to housing
    housing_thermal_resistance                          [K/W] from housing to ambient
    ambient_temperature [degC]
    tension_noise       [N] standard deviation of measured tensions
    encoder_step        [m] resolution of measured lengths
    angle_noise         [rad] standard deviation of measured joint angles
    noise_seed          of both noises
    """

    wire_damping: float = 60.0
    winch_mass: float = 4.0
    winch_friction: float = 10.0
    winch_damping: float = 40.0
    force_per_current: float = 50.0
    stall_force: float = float("inf")
    stall_exponent: float = 1.0
    length_gain: float = 77.0
    winding_resistance: float = 0.4
    winding_heat_capacity: float = 6.0
    housing_heat_capacity: float = 60.0
    winding_thermal_resistance: float = 0.8
    housing_thermal_resistance: float = 10.0
    ambient_temperature: float = 25.0
    tension_noise: float = 0.0
    encoder_step: float = 0.0
    angle_noise: float = 0.0
    noise_seed: int = 0


def plant_constants(content: Mapping[str, Any]) -> PlantConstants:
    """Read a robot's `plant` section; raises RobotDescriptionError naming the key."""
    names = [field.name for field in fields(PlantConstants)]
    for key, value in content.items():
        if key not in names:
            raise RobotDescriptionError(
                f"plant: unknown key '{key}', choose from: {', '.join(names)}"
            )
        number = isinstance(value, (int, float)) and bool(np.isfinite(value))
        if key == "noise_seed":
            if not isinstance(value, int) or value < 0:
                raise RobotDescriptionError(
                    f"plant: {key} is {value!r}, expected a whole number from 0"
                )
        elif key in _ZERO_ALLOWED:
            if not number or value < 0:
                raise RobotDescriptionError(
                    f"plant: {key} is {value!r}, expected a positive number or 0"
                )
        elif not number or value <= 0:
            raise RobotDescriptionError(f"plant: {key} is {value!r}, expected a positive number")
    return PlantConstants(**content)
