"""What the plant's fit may change, within which range and why, and how it is written down."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fastswing_planner.robot.description import Robot

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Parameter:
    """One physical constant.

    place     `robot`: a key of the YAML file; `plant`: a key of its section `plant`; `joint`: the
              damping of a joint of the MJCF
    initial   where every fit begins, in `unit`
    low, high plausible range, in `unit`
    source    why the range is plausible
    """

    place: str
    name: str
    initial: float
    low: float
    high: float
    unit: str
    source: str

    @property
    def label(self) -> str:
        """Name for tables."""
        prefix = {"robot": "", "plant": "plant.", "joint": "damping of "}[self.place]
        return prefix + self.name


_JOINT = "bearings, cables, and the wires' own friction around the joint"

PARAMETERS: tuple[Parameter, ...] = (
    Parameter(
        "robot",
        "wire_stiffness",
        33000,
        2000,
        40000,
        "N/m",
        "wire and series elasticity: 5 mm to 10 cm of stretch at 200 N",
    ),
    Parameter("plant", "wire_damping", 176, 10, 300, "N s/m", "losses of wire and elastic unit"),
    Parameter(
        "plant",
        "winch_mass",
        2.6,
        0.5,
        8.0,
        "kg",
        "rotor of 0.3 to 5 g cm^2, gear 29:1, pulley of 7 mm radius",
    ),
    Parameter(
        "plant",
        "winch_friction",
        3.3,
        2.0,
        40.0,
        "N",
        "back-drivable gear of 29:1; below the paper's 'almost no tension'",
    ),
    Parameter("plant", "winch_damping", 4, 2.0, 80.0, "N s/m", "grease and bearings; the same"),
    Parameter(
        "plant",
        "stall_force",
        1030,
        300,
        3000,
        "N",
        "the low gain of single-shunt current control (paper); the robot pulled 290 N",
    ),
    Parameter(
        "plant",
        "stall_exponent",
        0.25,
        0.2,
        1.0,
        "",
        "ours: 1 is a straight torque-speed line; below 1 a winch is slow already at small pulls",
    ),
    Parameter(
        "plant",
        "length_gain",
        37.2,
        8.0,
        200.0,
        "1/s",
        "length control slower than five control periods of 1 ms and faster than the swing",
    ),
    Parameter("joint", "S-p", 2.36, 0.2, 8.0, "N m s/rad", _JOINT),
    Parameter("joint", "S-r", 1.91, 0.2, 6.0, "N m s/rad", _JOINT),
    Parameter("joint", "S-y", 2.02, 0.2, 4.0, "N m s/rad", _JOINT),
    Parameter("joint", "E-p", 0.618, 0.05, 4.0, "N m s/rad", _JOINT),
    Parameter("joint", "E-y", 1.58, 0.05, 2.0, "N m s/rad", _JOINT),
)


def values_of(unit: Vector) -> Vector:
    """Return the constants for coordinates from -1 (low) to 1 (high), evenly in logarithms."""
    low = np.array([parameter.low for parameter in PARAMETERS])
    high = np.array([parameter.high for parameter in PARAMETERS])
    values = low * (high / low) ** ((np.clip(unit, -1.0, 1.0) + 1.0) / 2.0)
    return np.array([float(f"{value:.3g}") for value in values])


def candidate_robot(robot: Robot, mjcf_text: str, values: Sequence[float], folder: Path) -> Robot:
    """Return the robot with these constants; its MJCF is written into `folder`."""
    mjcf = folder / robot.mjcf.name
    mjcf.write_text(edited_mjcf(mjcf_text, values))
    each = np.ones(len(robot.model.muscle_names))
    named = {p.name: float(v) for p, v in zip(PARAMETERS, values, strict=True)}
    plant = {p.name: named[p.name] for p in PARAMETERS if p.place == "plant"}
    return replace(
        robot,
        mjcf=mjcf,
        plant={**robot.plant, **plant},
        wire_stiffness=named["wire_stiffness"] * each,
    )


def edited_mjcf(text: str, values: Sequence[float]) -> str:
    """Return the MJCF with these joint dampings, everything else untouched."""
    for parameter, value in zip(PARAMETERS, values, strict=True):
        if parameter.place == "joint":
            pattern = rf'(<joint name="{parameter.name}"[^<>]*\bdamping=")[^"]*(")'
            text = _replaced(text, pattern, parameter, value)
    return text


def edited_yaml(text: str, values: Sequence[float]) -> str:
    """Return the YAML file with these constants, everything else and the comments untouched."""
    for parameter, value in zip(PARAMETERS, values, strict=True):
        if parameter.place != "joint":
            indent = "  " if parameter.place == "plant" else ""
            text = _replaced(text, rf"^({indent}{parameter.name}: )\S+()", parameter, value)
    return text


def _replaced(text: str, pattern: str, parameter: Parameter, value: float) -> str:
    text, count = re.subn(pattern, rf"\g<1>{value:.6g}\g<2>", text, flags=re.MULTILINE)
    if count != 1:
        raise ValueError(f"{parameter.label} was found {count} times, expected once")
    return text
