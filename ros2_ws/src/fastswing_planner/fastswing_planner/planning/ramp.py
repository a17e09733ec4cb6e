"""The single-shunt ramp: how fast a driven muscle's speed can change."""

import numpy as np

from fastswing_planner.arrays import Vector, constant

_ZERO = constant(0.0)


def velocity_bounds(
    velocity: Vector, velocity_limit: Vector, acceleration_limit: Vector, time_step: float
) -> tuple[Vector, Vector]:
    """Return the lowest and highest speed [m/s] of the next step, each of shape (m,).

    velocity            l_dot [m/s], shape (m,)
    velocity_limit      l_dot^limit [m/s], shape (m,)
    acceleration_limit  alpha [m/s^2], shape (m,); infinite gives the plain limits of eq. 7
    time_step           dt [s]

    Zero is always allowed, and the bounds never leave +-l_dot^limit.
    """
    return ramp_bounds(velocity, acceleration_limit * time_step, -velocity_limit, velocity_limit)


def ramp_bounds(
    velocity: Vector, gain: Vector, lower_limit: Vector, upper_limit: Vector
) -> tuple[Vector, Vector]:
    """Return the lowest and highest speed [m/s] of the next step, each of shape (m,).

    velocity                  l_dot [m/s], shape (m,)
    gain                      alpha dt [m/s], shape (m,)
    lower_limit, upper_limit  [m/s] what the bounds never leave, shape (m,); zero is within
    """
    # While l_dot > 0 (eqs. 8 and 9 of the paper):
    #   l_dot^max = min(l_dot + alpha dt, l_dot^limit)
    #   l_dot^min = min(l_dot - alpha dt, 0)
    # l_dot < 0 mirrors it, and at rest both directions gain alpha dt.
    upper = np.minimum(np.maximum(velocity + gain, _ZERO), upper_limit)
    lower = np.maximum(np.minimum(velocity - gain, _ZERO), lower_limit)
    return lower, upper
