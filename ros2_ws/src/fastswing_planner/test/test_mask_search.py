"""The greedy search finds what trying every prefix of the antagonists would find."""

from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fastswing_planner.arrays import BoolVector, frozen
from fastswing_planner.errors import HoldingInfeasible, SwingBlocked
from fastswing_planner.holding import Holding
from fastswing_planner.mask_search import SearchResult, Verdict, antagonists, greedy_search
from fastswing_planner.swing import Trajectory

COUNT = 5
INDEX = np.array([0.3, -0.2, 0.5, 0.0, 0.1])
"""q of the fixed cases: the antagonists are 2, 0, 4 in this order."""
NOBODY = np.zeros(COUNT, dtype=bool)


@dataclass
class FakeArm:
    """Holds and swings as a table says; masks are sets of masked muscles.

    cost       t_cost [s] of a mask; 1 s if it is not there, None: blocked
    unheld     masks that cannot hold the start
    simulated  the masks that were simulated
    """

    cost: dict[frozenset[int], float | None] = field(default_factory=dict)
    unheld: frozenset[frozenset[int]] = frozenset()
    simulated: list[frozenset[int]] = field(default_factory=list)

    def hold(self, kept: BoolVector) -> Holding:
        feasible = masked(kept) not in self.unheld
        return Holding(feasible, 0.0 if feasible else 2.5, frozen(np.where(kept, 50.0, 0.0)))

    def simulate(self, kept: BoolVector) -> Trajectory:
        self.simulated.append(masked(kept))
        cost = self.cost.get(masked(kept), 1.0)
        if cost is None:
            raise SwingBlocked("blocked")
        rows = np.zeros((2, 1))
        return Trajectory(frozen([0.0, cost]), rows, rows, rows, rows)

    def search(
        self, index: BoolVector | np.ndarray = INDEX, protected: BoolVector = NOBODY
    ) -> SearchResult:
        return greedy_search(np.asarray(index), protected, self.hold, self.simulate)


def masked(kept: BoolVector) -> frozenset[int]:
    return frozenset(np.flatnonzero(~kept).tolist())


def random_case(seed: int) -> tuple[np.ndarray, BoolVector, FakeArm, list[frozenset[int]]]:
    """Return q, protected muscles, an arm, and all prefixes of the antagonists, written anew."""
    rng = np.random.default_rng(seed)
    index, protected = rng.normal(size=COUNT), rng.random(COUNT) < 0.2
    falling = sorted((-q, i) for i, q in enumerate(index) if q > 0 and not protected[i])
    prefixes = [frozenset(i for _, i in falling[:count]) for count in range(len(falling) + 1)]
    # Few different costs, so that equals occur; blocked now and then, but never with all kept.
    choices: list[float | None] = [0.6, 0.7, 0.8, None]
    cost = {prefix: choices[int(rng.integers(4))] for prefix in prefixes[1:]} | {prefixes[0]: 0.75}
    unheld = frozenset(prefix for prefix in prefixes[1:] if rng.random() < 0.2)
    return index, protected, FakeArm(cost, unheld), prefixes


def test_antagonists_come_in_decreasing_index() -> None:
    assert antagonists(INDEX, NOBODY) == [2, 0, 4]


def test_a_protected_muscle_is_no_candidate() -> None:
    assert antagonists(INDEX, np.arange(COUNT) == 0) == [2, 4]


def test_equal_antagonists_keep_the_robots_order() -> None:
    assert antagonists(np.full(3, 0.2), np.zeros(3, dtype=bool)) == [0, 1, 2]


@given(st.integers(0, 2**32 - 1))
def test_the_best_prefix_before_the_first_that_does_not_hold_is_taken(seed: int) -> None:
    index, protected, arm, prefixes = random_case(seed)
    reached = []
    for prefix in prefixes:
        if prefix in arm.unheld:
            break
        reached.append(prefix)
    costs = [arm.cost[prefix] for prefix in reached]
    best = min(cost for cost in costs if cost is not None)
    # The first of equals masks the fewest muscles.
    assert masked(arm.search(index, protected).kept) == reached[costs.index(best)]


@given(st.integers(0, 2**32 - 1))
def test_the_search_is_never_slower_than_all_muscles_kept(seed: int) -> None:
    index, protected, arm, _ = random_case(seed)
    assert arm.search(index, protected).trajectory.time_cost <= 0.75


@given(st.integers(0, 2**32 - 1))
def test_what_is_returned_belongs_together(seed: int) -> None:
    index, protected, arm, _ = random_case(seed)
    result = arm.search(index, protected)
    assert result.holding.feasible
    assert result.holding.tension.tolist() == np.where(result.kept, 50.0, 0.0).tolist()
    assert result.trajectory.time_cost == arm.cost[masked(result.kept)]


def test_a_mask_that_does_not_hold_is_not_simulated() -> None:
    arm = FakeArm(unheld=frozenset([frozenset({2})]))
    arm.search()
    assert arm.simulated == [frozenset()]


def test_a_mask_that_is_not_faster_does_not_end_the_search() -> None:
    arm = FakeArm({frozenset({2}): 1.2, frozenset({0, 2}): 0.9})
    assert masked(arm.search().kept) == {0, 2}


def test_a_blocked_mask_does_not_end_the_search() -> None:
    arm = FakeArm({frozenset({2}): None, frozenset({0, 2}): 0.9})
    assert masked(arm.search().kept) == {0, 2}


def test_an_equal_mask_is_not_taken() -> None:
    assert masked(FakeArm().search().kept) == set()


def test_every_trial_is_told_in_order() -> None:
    arm = FakeArm({frozenset({2}): 0.8, frozenset({0, 2}): None}, frozenset([frozenset({0, 2, 4})]))
    told = [(masked(t.kept), t.verdict, t.holding_residual) for t in arm.search().trials]
    assert told == [
        (set(), Verdict.TAKEN, 0.0),
        ({2}, Verdict.TAKEN, 0.0),
        ({0, 2}, Verdict.NOT_FASTER, 0.0),
        ({0, 2, 4}, Verdict.HOLDING_INFEASIBLE, 2.5),
    ]


def test_a_trial_without_simulation_has_no_time_cost() -> None:
    arm = FakeArm({frozenset({2}): None}, frozenset([frozenset({0, 2})]))
    costs = [trial.time_cost for trial in arm.search().trials]
    assert costs[0] == 1.0
    assert np.isnan(costs[1:]).tolist() == [True, True]


def test_an_arm_that_does_not_hold_at_all_says_what_is_missing() -> None:
    with pytest.raises(HoldingInfeasible) as caught:
        FakeArm(unheld=frozenset([frozenset()])).search()
    assert str(caught.value) == (
        "the start posture cannot be held even with all muscles: 2.5 N m are missing; choose "
        "another start posture, less payload or a wider tension range"
    )


def test_an_arm_blocked_with_all_muscles_is_an_error() -> None:
    with pytest.raises(SwingBlocked, match=r"^blocked$"):
        FakeArm({frozenset(): None}).search()
