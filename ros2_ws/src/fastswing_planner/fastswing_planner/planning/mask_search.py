"""Which antagonists to elongate (section III-B of the paper)."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from itertools import combinations

import numpy as np

from fastswing_planner.arrays import BoolVector, Vector
from fastswing_planner.errors import HoldingInfeasible, SwingBlocked
from fastswing_planner.planning.holding import Holding
from fastswing_planner.planning.swing import Trajectory


class Verdict(Enum):
    """What a search made of a mask."""

    TAKEN = "taken"
    NOT_FASTER = "not better than the mask taken"
    HOLDING_INFEASIBLE = "start posture cannot be held"
    SWING_BLOCKED = "swing stops short of its end"


@dataclass(frozen=True)
class Trial:
    """One mask that was tried.

    kept              the mask m of the paper as booleans, shape (m,)
    holding_residual  [N m] distance to feasibility of holding the start posture
    time_cost         [s] 0 if the swing was not simulated, or not to its end
    """

    kept: BoolVector
    verdict: Verdict
    holding_residual: float
    time_cost: float = 0.0


@dataclass(frozen=True)
class Candidate:
    """A mask that holds the start posture, and how it swings."""

    kept: BoolVector
    holding: Holding
    trajectory: Trajectory

    @property
    def rank(self) -> tuple[float, int, float]:
        """Less is better: time_cost [s], then masked muscles, then peak holding tension [N]."""
        masked = int(np.count_nonzero(~self.kept))
        return self.trajectory.time_cost, masked, float(self.holding.tension.max())


@dataclass(frozen=True)
class SearchResult:
    """What was found.

    basic   with all muscles kept
    best    the mask taken
    trials  every mask tried, in order
    proven  no other set of antagonists is better
    cut     the time was over before the search was
    """

    basic: Candidate
    best: Candidate
    trials: tuple[Trial, ...]
    proven: bool
    cut: bool


class MaskSearch:
    """Tries masks one by one and remembers what came out."""

    def __init__(
        self,
        muscle_count: int,
        hold: Callable[[BoolVector], Holding],
        simulate: Callable[[BoolVector], Trajectory],
        expired: Callable[[], bool] = lambda: False,
    ) -> None:
        """Try the mask that keeps all muscles.

        hold      how a mask holds the start posture
        simulate  how a mask swings; may raise SwingBlocked
        expired   whether the time for searching is over

        Raises HoldingInfeasible or SwingBlocked if that fails with all muscles kept.
        """
        self._hold = hold
        self._simulate = simulate
        self._expired = expired
        kept = np.ones(muscle_count, dtype=bool)
        holding = hold(kept)
        if not holding.feasible:
            raise HoldingInfeasible(
                f"the start posture cannot be held even with all muscles: {holding.residual:.3g} "
                "N m are missing; choose another start posture, less payload or a wider tension "
                "range"
            )
        self._basic = self._best = Candidate(kept, holding, simulate(kept))
        self._trials = [_feasible_trial(self._basic)]

    def _try(self, masked: Sequence[int]) -> Candidate | Verdict:
        kept = np.ones_like(self._basic.kept)
        kept[list(masked)] = False
        holding = self._hold(kept)
        if not holding.feasible:
            self._trials.append(Trial(kept, Verdict.HOLDING_INFEASIBLE, holding.residual))
            return Verdict.HOLDING_INFEASIBLE
        try:
            candidate = Candidate(kept, holding, self._simulate(kept))
        except SwingBlocked:
            self._trials.append(Trial(kept, Verdict.SWING_BLOCKED, holding.residual))
            return Verdict.SWING_BLOCKED
        self._trials.append(_feasible_trial(candidate))
        self._best = min(self._best, candidate, key=lambda one: one.rank)
        return candidate

    def _result(self, proven: bool, cut: bool = False) -> SearchResult:
        trials = (
            replace(trial, verdict=Verdict.TAKEN) if trial.kept is self._best.kept else trial
            for trial in self._trials
        )
        return SearchResult(self._basic, self._best, tuple(trials), proven, cut)

    def greedy(self, candidates: Sequence[int]) -> SearchResult:
        """Mask the candidates one after the other until the start posture no longer holds.

        candidates  antagonists in decreasing q

        Of the masks on the way, the best is taken.
        """
        for count in range(1, len(candidates) + 1):
            if self._expired():
                return self._result(proven=False, cut=True)
            if self._try(candidates[:count]) is Verdict.HOLDING_INFEASIBLE:
                break
        return self._result(proven=len(self._trials) == 2 ** len(candidates))

    def exhaustive(self, candidates: Sequence[int], tension_min: Vector) -> SearchResult:
        """Find the best of all sets of candidates.

        candidates   antagonists
        tension_min  [N] shape (m,)

        Sets of which a smaller one proves that they cannot be better are left out.
        """
        facts = _Facts(tension_min)
        facts.swung(frozenset(), self._basic.trajectory)
        for masked in _subsets(candidates):
            if self._expired():
                return self._result(proven=False, cut=True)
            if facts.exclude(masked):
                continue
            outcome = self._try(sorted(masked))
            if isinstance(outcome, Candidate):
                facts.swung(masked, outcome.trajectory)
            elif outcome is Verdict.HOLDING_INFEASIBLE:
                facts.unheld(masked)
        return self._result(proven=True)


class _Facts:
    """What is proven about sets of masked muscles from the sets already tried."""

    def __init__(self, tension_min: Vector) -> None:
        self._may_be_slack = frozenset(np.flatnonzero(tension_min == 0.0).tolist())
        self._no_better: list[tuple[frozenset[int], frozenset[int]]] = []

    def unheld(self, masked: frozenset[int]) -> None:
        """Learn that the start is not held.

        A muscle that may pull 0 N gains nothing from being masked: whatever holds with it masked
        too would hold already. With tension_min > 0 that is not so: its least pull goes.
        """
        self._no_better.append((masked, self._may_be_slack))

    def swung(self, masked: frozenset[int], trajectory: Trajectory) -> None:
        """Learn how a set swings.

        A muscle that is at its speed limit in no step restrains no step: QP 2 is strictly convex,
        so without its bounds each step has the same minimum. Masking it too changes nothing.
        """
        idle = frozenset(np.flatnonzero(~trajectory.at_limit.any(axis=0)).tolist())
        self._no_better.append((masked, idle))

    def exclude(self, masked: frozenset[int]) -> bool:
        return any(
            smaller <= masked and masked - smaller <= useless
            for smaller, useless in self._no_better
        )


def antagonists(speed_index: Vector, protected: BoolVector) -> list[int]:
    """Return the muscles with q > 0 that are not protected, in decreasing q.

    speed_index  q [s/rad], shape (m,)
    protected    muscles that are never masked, shape (m,)
    """
    order = np.argsort(-speed_index, kind="stable")
    return [int(i) for i in order if speed_index[i] > 0.0 and not protected[i]]


def _subsets(candidates: Sequence[int]) -> Iterator[frozenset[int]]:
    """Yield all sets but the empty one, small ones first."""
    for size in range(1, len(candidates) + 1):
        yield from map(frozenset, combinations(candidates, size))


def _feasible_trial(candidate: Candidate) -> Trial:
    return Trial(
        candidate.kept,
        Verdict.NOT_FASTER,
        candidate.holding.residual,
        candidate.trajectory.time_cost,
    )
