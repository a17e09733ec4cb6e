"""Which antagonists to elongate (section III-B of the paper)."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np

from fastswing_planner.arrays import BoolVector, Vector
from fastswing_planner.errors import HoldingInfeasible, SwingBlocked
from fastswing_planner.holding import Holding
from fastswing_planner.swing import Trajectory


class Verdict(Enum):
    """What a search made of a mask."""

    TAKEN = "taken"
    NOT_FASTER = "not faster"
    HOLDING_INFEASIBLE = "start posture cannot be held"


@dataclass(frozen=True)
class Trial:
    """One mask that was tried.

    kept              the mask m of the paper as booleans, shape (m,)
    holding_residual  [N m] distance to feasibility of holding the start posture
    time_cost         [s] NaN if not simulated or blocked
    """

    kept: BoolVector
    verdict: Verdict
    holding_residual: float
    time_cost: float


@dataclass(frozen=True)
class SearchResult:
    """The best mask, how it holds and swings, and every mask tried, in order."""

    kept: BoolVector
    holding: Holding
    trajectory: Trajectory
    trials: tuple[Trial, ...]


def antagonists(speed_index: Vector, protected: BoolVector) -> list[int]:
    """Return the muscles with q > 0 that are not protected, in decreasing q."""
    order = np.argsort(-speed_index, kind="stable")
    return [int(i) for i in order if speed_index[i] > 0.0 and not protected[i]]


def greedy_search(
    speed_index: Vector,
    protected: BoolVector,
    hold: Callable[[BoolVector], Holding],
    simulate: Callable[[BoolVector], Trajectory],
) -> SearchResult:
    """Mask antagonists in decreasing q until the start posture no longer holds.

    speed_index  q [s/rad], shape (m,)
    protected    muscles that are never masked, shape (m,)
    hold         how a mask holds the start posture
    simulate     how a mask swings; may raise SwingBlocked

    Of the masks on the way, the one with the lowest time_cost is taken; of equals, the one with
    the fewest muscles masked. Raises HoldingInfeasible or SwingBlocked if it fails with all kept.
    """
    kept = np.ones(speed_index.size, dtype=bool)
    holding = hold(kept)
    if not holding.feasible:
        raise HoldingInfeasible(
            f"the start posture cannot be held even with all muscles: {holding.residual:.3g} N m "
            "are missing; choose another start posture, less payload or a wider tension range"
        )
    trajectory = simulate(kept)
    best = (kept, holding, trajectory)
    trials = [Trial(kept, Verdict.TAKEN, holding.residual, trajectory.time_cost)]
    for muscle in antagonists(speed_index, protected):
        kept = kept.copy()
        kept[muscle] = False
        holding = hold(kept)
        if not holding.feasible:
            trials.append(Trial(kept, Verdict.HOLDING_INFEASIBLE, holding.residual, np.nan))
            break
        try:
            trajectory = simulate(kept)
        except SwingBlocked:
            trials.append(Trial(kept, Verdict.NOT_FASTER, holding.residual, np.nan))
            continue
        verdict = Verdict.NOT_FASTER
        if trajectory.time_cost < best[2].time_cost:
            verdict = Verdict.TAKEN
            best = (kept, holding, trajectory)
        trials.append(Trial(kept, verdict, holding.residual, trajectory.time_cost))
    return SearchResult(*best, tuple(trials))
