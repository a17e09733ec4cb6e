"""What each muscle can do."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fastswing_planner.arrays import Vector, frozen
from fastswing_planner.errors import InvalidLimit, NotFinite


@dataclass(frozen=True)
class MuscleLimits:
    """Limits of m muscles, each a read-only vector of shape (m,).

    velocity      [m/s]   largest muscle speed, l_dot^limit of the paper
    acceleration  [m/s^2] alpha of the paper's single-shunt ramp; infinite: no ramp
    tension_min   [N]     f^min of the paper
    tension_max   [N]     f^max of the paper
    """

    velocity: Vector
    acceleration: Vector
    tension_min: Vector
    tension_max: Vector


def _require(holds: bool, text: str) -> None:
    if not holds:
        raise InvalidLimit(text)


def muscle_limits(
    muscle_names: tuple[str, ...],
    velocity: ArrayLike,
    acceleration: ArrayLike,
    tension_min: ArrayLike,
    tension_max: ArrayLike,
) -> MuscleLimits:
    """Build limits from scalars or vectors; raises InvalidLimit naming the muscle and value."""
    shape = (len(muscle_names),)
    vectors = []
    for what, values in (
        ("velocity_limit", velocity),
        ("acceleration_limit", acceleration),
        ("tension_min", tension_min),
        ("tension_max", tension_max),
    ):
        try:
            vector = frozen(np.broadcast_to(np.asarray(values, dtype=float), shape))
        except (ValueError, TypeError) as error:
            raise InvalidLimit(
                f"{what} is {values!r}, expected one number or {shape[0]} numbers"
            ) from error
        vectors.append(vector)
    limits = MuscleLimits(*vectors)
    rows = zip(muscle_names, *vectors, strict=True)
    for name, speed, acceleration_limit, low, high in rows:
        for what, value in (("velocity_limit", speed), ("tension_min", low), ("tension_max", high)):
            if not np.isfinite(value):
                raise NotFinite(f"{what} of {name} is {value}, expected a finite number")
        if np.isnan(acceleration_limit):
            raise NotFinite(f"acceleration_limit of {name} is nan, expected a number or infinity")
        _require(speed > 0, f"velocity_limit of {name} is {speed:g} m/s, must be positive")
        _require(
            acceleration_limit > 0,
            f"acceleration_limit of {name} is {acceleration_limit:g} m/s^2, must be positive",
        )
        _require(low >= 0, f"tension_min of {name} is {low:g} N, must not be negative")
        _require(
            high > low,
            f"tension_max of {name} is {high:g} N, must be above its tension_min {low:g} N",
        )
    return limits
