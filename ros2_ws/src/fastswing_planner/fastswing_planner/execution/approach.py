"""The way to a swing's start: the arm is raised along held postures, then muscles are paid out."""

from collections.abc import Callable

import numpy as np

from fastswing_planner.arrays import Vector, frozen
from fastswing_planner.errors import PhaseTimeout
from fastswing_planner.execution.posture_path import (
    encoder_lengths,
    posture_path,
    smooth_fraction,
)
from fastswing_planner.execution.prepared_swing import PreparedSwing
from fastswing_planner.execution.settings import ExecutionSettings
from fastswing_planner.planning.holding import Holding
from fastswing_planner.robot.muscle_model import MuscleModel

_SHORTEST_SEC = 0.1
"""For every method: the tensions of the raised arm move to those of the plan."""


class Approach:
    """Length commands on the way; all are known before anything moves.

    raise_time    [s] until the arm should be at the start posture
    pay_out_time  [s] until the muscles have the tensions and the elongation of the plan
    """

    def __init__(
        self,
        model: MuscleModel,
        hold: Callable[[Vector], Holding],
        wire_stiffness: Vector,
        swing: PreparedSwing,
        settings: ExecutionSettings,
        begin: Vector,
    ) -> None:
        """Plan the way from a posture [rad], shape (n,).

        hold            how a posture is held
        wire_stiffness  [N/m] shape (m,)

        Raises HoldingInfeasible if a posture on the way cannot be held, PhaseTimeout if a part of
        it would take longer than its limit.
        """
        self._path = posture_path(
            model, hold, wire_stiffness, begin, swing.start, settings.raise_speed
        )
        held = encoder_lengths(model, wire_stiffness, swing.start, swing.holding_tension)
        self._raised = self._path.lengths[-1]
        self._change = held + swing.elongation - self._raised
        self.raise_time = self._path.duration
        fastest = float(np.abs(self._change).max()) / settings.elongate_speed
        self.pay_out_time = max(fastest, _SHORTEST_SEC)
        self._refuse_long(settings)

    def _refuse_long(self, settings: ExecutionSettings) -> None:
        if self.raise_time > settings.raise_limit:
            raise PhaseTimeout(
                f"the way to the start posture would take {self.raise_time:.1f} s at "
                f"{settings.raise_speed:g} rad/s, raise_limit is {settings.raise_limit:g} s"
            )
        if self.pay_out_time > settings.elongate_limit:
            raise PhaseTimeout(
                f"paying out would take {self.pay_out_time:.1f} s at "
                f"{settings.elongate_speed:g} m/s, elongate_limit is "
                f"{settings.elongate_limit:g} s"
            )

    def raising(self, elapsed: float) -> Vector:
        """Return the lengths [m], shape (m,), `elapsed` [s] after the raise began."""
        return self._path.at(elapsed)

    def paying_out(self, elapsed: float) -> Vector:
        """Return the lengths [m], shape (m,), `elapsed` [s] after paying out began."""
        share = smooth_fraction(elapsed, self.pay_out_time)
        return frozen(self._raised + share * self._change)
