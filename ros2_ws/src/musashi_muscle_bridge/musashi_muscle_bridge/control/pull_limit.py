"""Keeps a muscle that follows a current from pulling too hard or winding too fast.

A current is a force: a slack wire runs away under it, a taut one swings to twice its pull. The
boards' own limit pays out only when the tension is too high already.
"""

import numpy as np

from fastswing_planner.arrays import BoolVector, Vector, frozen
from musashi_muscle_bridge.buses.protocol import Mode
from musashi_muscle_bridge.control.arbiter import Setpoints
from musashi_muscle_bridge.control.command_limits import CommandLimits

_CURRENT = int(Mode.CURRENT)


def pulls(setpoints: Setpoints) -> bool:
    """Return whether any muscle follows a current."""
    return _CURRENT in setpoints.mode.tobytes()


def limited_pull(
    setpoints: Setpoints,
    tension: Vector,
    velocity: Vector,
    stale: BoolVector,
    limits: CommandLimits,
) -> Setpoints:
    """Return `setpoints` with their currents reduced by what was measured.

    tension   [N] shape (m,); full current up to `tension_max`, none from `tension_limit` on
    velocity  [m/s] shape (m,), winding in is negative; full current up to half the speed limit,
              none from the limit on
    stale     muscles that were not measured lately, shape (m,); no current
    """
    pulling = setpoints.mode == _CURRENT
    # The two limits of a robot may be the same.
    reach = np.maximum(limits.tension_limit - limits.tension_max, 1e-9)
    below_tension = (limits.tension_limit - tension) / reach
    below_speed = 2.0 * (1.0 + velocity / limits.velocity)
    share = np.clip(np.minimum(below_tension, below_speed), 0.0, 1.0)
    # What is not a number is no measurement either.
    share[stale | ~np.isfinite(share)] = 0.0
    reduced = setpoints.value * share
    return Setpoints(setpoints.mode, frozen(np.where(pulling, reduced, setpoints.value)))
