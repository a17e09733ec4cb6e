"""Plans a swing: from a request to mask, elongation, tensions and predicted trajectory."""

from dataclasses import dataclass

from fastswing_planner.arrays import BoolVector, Vector, frozen
from fastswing_planner.errors import (
    PlannerError,
)
from fastswing_planner.planning.mask_search import (
    Trial,
)
from fastswing_planner.planning.request import Method
from fastswing_planner.planning.swing import Trajectory


@dataclass(frozen=True)
class SwingPlan:
    """A planned swing; m muscles, n joints.

    kept             the mask m of the paper as booleans, shape (m,)
    inhibited        muscles that Method 1 is predicted to inhibit, shape (m,); not kept
    elongation       [m] shape (m,), >= 0, 0 for kept and for inhibited muscles
    basic_tension    [N] that holds the start posture with all muscles, shape (m,)
    holding_tension  [N] that holds it once the elongated muscles are slack, shape (m,)
    holding_margin   [N m] added torque of any direction that the start posture still holds
    final_tension    [N] that holds the end posture with all muscles, shape (m,)
    speed_index      q [s/rad] at the midpoint, shape (m,)
    trajectory       the predicted swing
    time_cost_basic  [s] of the swing with all muscles kept
    trials           the masks tried, in order
    proven           no other set of elongated antagonists is better; False if none was searched
    warnings         what a user should know before executing it
    """

    joint_names: tuple[str, ...]
    muscle_names: tuple[str, ...]
    method: Method
    start: Vector
    end: Vector
    kept: BoolVector
    inhibited: BoolVector
    elongation: Vector
    basic_tension: Vector
    holding_tension: Vector
    holding_margin: float
    final_tension: Vector
    speed_index: Vector
    trajectory: Trajectory
    time_cost_basic: float
    epsilon: float
    trials: tuple[Trial, ...]
    proven: bool
    warnings: tuple[str, ...]

    @property
    def time_cost(self) -> float:
        """t^cost of the paper [s]."""
        return self.trajectory.time_cost

    @property
    def elongated(self) -> BoolVector:
        """Muscles that are paid out before the swing, shape (m,)."""
        return ~self.kept & ~self.inhibited

    @property
    def tension_rise(self) -> Vector:
        """What elongating adds to the tensions that hold the start [N], shape (m,).

        The price the paper names in section III-B; negative for the elongated muscles.
        """
        return frozen(self.holding_tension - self.basic_tension)

    def muscles(self, chosen: BoolVector) -> tuple[str, ...]:
        """Return the names of the chosen muscles; `chosen` has shape (m,)."""
        return tuple(name for name, on in zip(self.muscle_names, chosen, strict=True) if on)


@dataclass(frozen=True)
class Outcome:
    """What became of one method of a comparison: a plan, or why there is none."""

    method: Method
    plan: SwingPlan | None
    error: PlannerError | None = None
