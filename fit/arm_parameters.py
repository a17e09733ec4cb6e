"""What the kinematic fit may change, and how a change is written into the description files."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Parameter:
    """One number of the description: an element's attribute, or a posture's joint.

    element    name of an MJCF site or geom, or of a posture in the YAML file
    attribute  `pos` or `size` [m], or `posture` [rad]
    index      position within the attribute's numbers
    initial    where every fit begins
    span       the fit keeps within initial - span and initial + span
    """

    element: str
    attribute: str
    index: int
    initial: float
    span: float

    @property
    def label(self) -> str:
        """Name for tables, for example `m9_via.pos[0]`."""
        return f"{self.element}.{self.attribute}[{self.index}]"


def _site(name: str, **axes: tuple[float, float]) -> list[Parameter]:
    """Return a site's fitted coordinates, given as axis=(initial, span)."""
    return [Parameter(name, "pos", "xyz".index(axis), *values) for axis, values in axes.items()]


PARAMETERS: tuple[Parameter, ...] = (
    # Shoulder
    *_site("m1_origin", y=(-0.030, 0.020)),
    *_site("m1_insertion", y=(-0.010, 0.015)),
    *_site("m2_origin", x=(0.080, 0.020), y=(-0.100, 0.030), z=(0.040, 0.020)),
    *_site("m2_insertion", x=(0.035, 0.015), y=(-0.005, 0.015), z=(-0.070, 0.030)),
    *_site("m3_origin", x=(0.055, 0.020), z=(0.065, 0.020)),
    *_site("m3_insertion", x=(0.030, 0.010), z=(-0.130, 0.030)),
    *_site("m4_origin", x=(-0.040, 0.020)),
    *_site("m4_insertion", x=(-0.014, 0.010), z=(-0.110, 0.030)),
    *_site("m5_insertion", y=(0.045, 0.010), z=(-0.030, 0.010)),
    *_site("m9_origin", x=(0.045, 0.020), z=(0.070, 0.020)),
    # Elbow
    *_site("m9_via", x=(0.080, 0.020), z=(-0.130, 0.050)),
    *_site("m9_insertion", x=(0.040, 0.020), z=(-0.115, 0.020)),
    *_site("m10_origin", x=(0.070, 0.025), z=(-0.100, 0.060)),
    *_site("m10_insertion", x=(0.035, 0.015), z=(-0.100, 0.020)),
    Parameter("pulley_6", "size", 0, 0.060, 0.004),
    Parameter("pulley_8", "size", 0, 0.054, 0.004),
    # Postures: S-p and E-p
    Parameter("start", "posture", 0, -0.78, 0.10),
    Parameter("start", "posture", 3, -2.00, 0.10),
    Parameter("end", "posture", 0, -0.40, 0.10),
    Parameter("end", "posture", 3, -0.60, 0.10),
)


def values_of(unit: Vector) -> Vector:
    """Return the parameters' values for x in units of their spans, clipped to -1..1."""
    initial = np.array([parameter.initial for parameter in PARAMETERS])
    span = np.array([parameter.span for parameter in PARAMETERS])
    # Rounded to what the files show: 0.01 mm and 0.0001 rad are finer than any workshop.
    return np.round(initial + span * np.clip(unit, -1.0, 1.0), 5)


def edited_mjcf(text: str, values: Sequence[float]) -> str:
    """Return the MJCF with the fitted numbers in their places, everything else untouched."""
    for parameter, value in zip(PARAMETERS, values, strict=True):
        if parameter.attribute != "posture":
            text = _edit_element(text, parameter, value)
    return text


def edited_yaml(text: str, values: Sequence[float]) -> str:
    """Return the YAML file with the fitted postures in their places, comments kept."""
    for parameter, value in zip(PARAMETERS, values, strict=True):
        if parameter.attribute == "posture":
            pattern = rf"^(  {parameter.element}: \[)([^\]]*)(\])"
            text = _edit_numbers(text, pattern, parameter, ", ", f"{value:.4f}")
    return text


def _edit_element(text: str, parameter: Parameter, value: float) -> str:
    pattern = rf'(<[^<>]*\bname="{parameter.element}"[^<>]*\b{parameter.attribute}=")([^"]*)(")'
    return _edit_numbers(text, pattern, parameter, " ", f"{value:.5f}")


def _edit_numbers(text: str, pattern: str, parameter: Parameter, gap: str, value: str) -> str:
    """Replace one number of the list that `pattern`'s second group finds, exactly once."""
    found = re.findall(pattern, text, re.MULTILINE)
    if len(found) != 1:
        raise ValueError(f"{parameter.label} was found {len(found)} times, expected once")

    def with_value(match: re.Match[str]) -> str:
        numbers = match[2].split(gap)
        numbers[parameter.index] = value
        return match[1] + gap.join(numbers) + match[3]

    return re.sub(pattern, with_value, text, flags=re.MULTILINE)
