"""What carrying out a swing needs of its plan."""

from dataclasses import dataclass

from fastswing_planner.arrays import Vector
from fastswing_planner.planning.plan import SwingPlan
from fastswing_planner.planning.request import Method


@dataclass(frozen=True)
class PreparedSwing:
    """The part of a plan that is carried out; n joints, m muscles.

    start, end       [rad] shape (n,)
    elongation       [m] shape (m,)
    holding_tension  [N] at the start posture, shape (m,)
    final_tension    [N] at the end posture, shape (m,)
    """

    method: Method
    start: Vector
    end: Vector
    elongation: Vector
    holding_tension: Vector
    final_tension: Vector

    @classmethod
    def of(cls, plan: SwingPlan) -> "PreparedSwing":
        """Return what a plan prepares."""
        return cls(
            plan.method,
            plan.start,
            plan.end,
            plan.elongation,
            plan.holding_tension,
            plan.final_tension,
        )
