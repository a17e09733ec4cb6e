"""What each muscle can do."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fastswing_planner.arrays import Vector, frozen
from fastswing_planner.errors import InvalidLimit, InvalidTensionRange, NotFinite


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

    def checked(self, muscle_names: tuple[str, ...]) -> "MuscleLimits":
        """Return these limits as `muscle_limits` makes them, whatever arrays they were made of.

        Raises InvalidLimit, InvalidTensionRange or NotFinite.
        """
        return muscle_limits(
            muscle_names, self.velocity, self.acceleration, self.tension_min, self.tension_max
        )


# Name, range and unit of each limit; far beyond any muscle, but near enough for the arithmetic.
_RANGES = (
    ("velocity_limit", 1e-4, 1e3, "m/s"),
    ("acceleration_limit", 1e-4, np.inf, "m/s^2"),
    ("tension_min", 0.0, 1e5, "N"),
    ("tension_max", 1e-3, 1e5, "N"),
)


def muscle_limits(
    muscle_names: tuple[str, ...],
    velocity: ArrayLike,
    acceleration: ArrayLike,
    tension_min: ArrayLike,
    tension_max: ArrayLike,
) -> MuscleLimits:
    """Build limits from scalars or vectors; errors name the muscle and the value.

    Raises InvalidLimit, InvalidTensionRange or NotFinite.
    """
    shape = (len(muscle_names),)
    vectors = []
    given = (velocity, acceleration, tension_min, tension_max)
    for (what, *_), values in zip(_RANGES, given, strict=True):
        try:
            vector = frozen(np.broadcast_to(np.asarray(values, dtype=float), shape))
        except (ValueError, TypeError) as error:
            raise InvalidLimit(
                f"{what} is {values!r}, expected one number or {shape[0]} numbers"
            ) from error
        vectors.append(vector)
    for (what, low, high, unit), vector in zip(_RANGES, vectors, strict=True):
        if np.all((vector >= low) & (vector <= high)):
            continue
        for name, value in zip(muscle_names, vector, strict=True):
            _check(f"{what} of {name}", float(value), low, high, unit)
    if np.all(vectors[3] > vectors[2]):
        return MuscleLimits(*vectors)
    for name, least, most in zip(muscle_names, vectors[2], vectors[3], strict=True):
        if not most > least:
            raise InvalidTensionRange(
                f"tension_max of {name} is {most:g} N, must be above its tension_min {least:g} N"
            )
    return MuscleLimits(*vectors)


def _check(what: str, value: float, low: float, high: float, unit: str) -> None:
    if np.isnan(value) or (np.isinf(value) and np.isfinite(high)):
        expected = "a finite number" if np.isfinite(high) else "a number or infinity"
        raise NotFinite(f"{what} is {value:g}, expected {expected}")
    if value < 0 or (value == 0 and low > 0):
        must = "be positive" if low > 0 else "not be negative"
        raise InvalidLimit(f"{what} is {value:g} {unit}, must {must}")
    if not low <= value <= high:
        raise InvalidLimit(f"{what} is {value:g} {unit}, must be {low:g} to {high:g}")
