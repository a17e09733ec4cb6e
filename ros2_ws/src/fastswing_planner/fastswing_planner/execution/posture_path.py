"""Encoder lengths that make elastic muscles hold a posture."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fastswing_planner.arrays import Matrix, Vector, frozen
from fastswing_planner.errors import HoldingInfeasible
from fastswing_planner.planning.holding import Holding
from fastswing_planner.robot.muscle_model import MuscleModel


def encoder_lengths(
    model: MuscleModel, wire_stiffness: Vector, joint_position: Vector, tension: Vector
) -> Vector:
    """Return the unstretched lengths [m], shape (m,), that give `tension` [N] at a posture.

    wire_stiffness  k [N/m], shape (m,)
    """
    # The wire between encoder and insertion stretches by f / k: l_encoder = h(theta) - f / k.
    return frozen(model.lengths(joint_position) - tension / wire_stiffness)


def smooth_fraction(elapsed: float, duration: float) -> float:
    """Return how far, 0 to 1, a motion that starts and ends at rest has come."""
    if elapsed >= duration:
        return 1.0
    return 0.5 - 0.5 * math.cos(math.pi * max(elapsed, 0.0) / duration)


@dataclass(frozen=True)
class PosturePath:
    """Encoder lengths along a straight line between two postures.

    duration  [s]
    lengths   [m] shape (k, m), at equal fractions of the way
    """

    duration: float
    lengths: Matrix

    def at(self, elapsed: float) -> Vector:
        """Return the lengths [m], shape (m,), `elapsed` [s] after the start."""
        last = len(self.lengths) - 1
        place = smooth_fraction(elapsed, self.duration) * last
        index = min(int(place), last - 1)
        share = place - index
        return frozen((1.0 - share) * self.lengths[index] + share * self.lengths[index + 1])


def posture_path(
    model: MuscleModel,
    hold: Callable[[Vector], Holding],
    wire_stiffness: Vector,
    begin: Vector,
    end: Vector,
    speed: float,
    count: int = 40,
) -> PosturePath:
    """Plan a slow motion from `begin` to `end` [rad], both shape (n,), held all the way.

    hold   how a posture is held
    speed  [rad/s] largest joint speed
    count  number of postures on the way

    Raises HoldingInfeasible, naming the posture, if one of them cannot be held.
    """
    lengths = []
    for fraction in np.linspace(0.0, 1.0, count):
        position = begin + fraction * (end - begin)
        holding = hold(position)
        # The measured begin may lie a little outside of what can be held.
        if not holding.feasible and fraction > 0.1:
            angles = ", ".join(f"{angle:.3f}" for angle in position)
            raise HoldingInfeasible(
                f"on the way to the start posture, ({angles}) rad cannot be held: "
                f"{holding.residual:.3g} N m are missing"
            )
        lengths.append(encoder_lengths(model, wire_stiffness, position, holding.tension))
    # The cosine profile's top speed is pi/2 of its mean.
    duration = float(np.abs(end - begin).max()) / speed * np.pi / 2.0
    return PosturePath(max(duration, 1e-3), frozen(np.array(lengths)))
