"""The searches find what trying every mask would find, and tell what they tried."""

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fastswing_planner.arrays import BoolVector, Vector, frozen
from fastswing_planner.errors import HoldingInfeasible, SwingBlocked
from fastswing_planner.planning.holding import Holding
from fastswing_planner.planning.mask_search import MaskSearch, SearchResult, Verdict, antagonists
from fastswing_planner.planning.swing import Trajectory

COUNT = 5
INDEX = np.array([0.3, -0.2, 0.5, 0.0, 0.1])
"""q of the fixed cases: the antagonists are 2, 0, 4 in this order."""
FALLING = [2, 0, 4]
NOBODY = np.zeros(COUNT, dtype=bool)
PULLING = np.full(COUNT, 10.0)
"""tension_min [N] with which no failed mask excludes a larger one."""
SEED = st.integers(0, 2**32 - 1)


@dataclass
class FakeArm:
    """Holds and swings as a table says; masks are sets of masked muscles.

    cost       t_cost [s] of a mask; 1 s if it is not there, None: blocked
    unheld     masks that cannot hold the start
    peak       largest tension [N] of a mask; 50 N if it is not there
    idle       muscles that are at their speed limit in no step, whatever is masked
    simulated  the masks that were simulated
    held       the masks whose holding was asked for
    """

    cost: dict[frozenset[int], float | None] = field(default_factory=dict)
    unheld: frozenset[frozenset[int]] = frozenset()
    peak: dict[frozenset[int], float] = field(default_factory=dict)
    idle: frozenset[int] = frozenset()
    simulated: list[frozenset[int]] = field(default_factory=list)
    held: list[frozenset[int]] = field(default_factory=list)

    def hold(self, kept: BoolVector) -> Holding:
        self.held.append(masked(kept))
        feasible = masked(kept) not in self.unheld
        tension = np.where(kept, self.peak.get(masked(kept), 50.0), 0.0)
        return Holding(feasible, 0.0 if feasible else 2.5, frozen(tension))

    def simulate(self, kept: BoolVector) -> Trajectory:
        self.simulated.append(masked(kept))
        cost = self.cost.get(masked(kept), 1.0)
        if cost is None:
            raise SwingBlocked("blocked")
        rows = np.zeros((2, 1))
        busy = kept & ~np.isin(np.arange(COUNT), list(self.idle))
        return Trajectory(frozen([0.0, cost]), rows, rows, rows, rows, np.array([NOBODY, busy]))

    def search(self, expired: Callable[[], bool] = lambda: False) -> MaskSearch:
        return MaskSearch(COUNT, self.hold, self.simulate, expired)

    def greedy(self, candidates: list[int] = FALLING) -> SearchResult:
        return self.search().greedy(candidates)

    def exhaustive(
        self, candidates: list[int] = FALLING, tension_min: Vector = PULLING
    ) -> SearchResult:
        return self.search().exhaustive(candidates, tension_min)


def masked(kept: BoolVector) -> frozenset[int]:
    return frozenset(np.flatnonzero(~kept).tolist())


def taken(result: SearchResult) -> set[int]:
    return set(masked(result.best.kept))


def subsets(candidates: list[int]) -> list[frozenset[int]]:
    return [
        frozenset(chosen)
        for size in range(len(candidates) + 1)
        for chosen in combinations(candidates, size)
    ]


def expires_after(count: int) -> Callable[[], bool]:
    """Return a clock's end that comes after `count` questions."""
    left = iter([False] * count)
    return lambda: next(left, True)


def random_arm(seed: int, masks: list[frozenset[int]]) -> FakeArm:
    """Return an arm with few different costs and peaks, so that equals occur."""
    rng = np.random.default_rng(seed)
    choices: list[float | None] = [0.6, 0.7, 0.8, None]
    cost = {mask: choices[int(rng.integers(4))] for mask in masks} | {frozenset(): 0.75}
    peak = {mask: float(rng.choice([50.0, 60.0])) for mask in masks}
    unheld = frozenset(mask for mask in masks if mask and rng.random() < 0.2)
    return FakeArm(cost, unheld, peak)


def ranks(arm: FakeArm, masks: list[frozenset[int]]) -> dict[frozenset[int], tuple[float, ...]]:
    """Return cost, size and peak tension of every mask that holds and arrives."""
    return {
        mask: (cost, float(len(mask)), arm.peak[mask])
        for mask in masks
        if mask not in arm.unheld and (cost := arm.cost[mask]) is not None
    }


def test_antagonists_come_in_decreasing_index() -> None:
    assert antagonists(INDEX, NOBODY) == FALLING


def test_a_protected_muscle_is_no_candidate() -> None:
    assert antagonists(INDEX, np.arange(COUNT) == 0) == [2, 4]


def test_equal_antagonists_keep_the_robots_order() -> None:
    assert antagonists(np.full(3, 0.2), np.zeros(3, dtype=bool)) == [0, 1, 2]


@given(SEED)
def test_greedy_takes_the_best_prefix_before_the_first_that_does_not_hold(seed: int) -> None:
    prefixes = [frozenset(FALLING[:count]) for count in range(4)]
    arm = random_arm(seed, prefixes)
    ends = [count for count, prefix in enumerate(prefixes) if prefix in arm.unheld]
    reached = ranks(arm, prefixes[: min(ends, default=4)])
    assert taken(arm.greedy()) == min(reached, key=lambda mask: reached[mask])


@given(SEED)
def test_exhaustive_takes_the_best_of_all_subsets(seed: int) -> None:
    arm = random_arm(seed, subsets(FALLING))
    best = min(ranks(arm, subsets(FALLING)).values())
    assert arm.exhaustive().best.rank == best


@given(SEED)
def test_neither_search_is_slower_than_all_muscles_kept(seed: int) -> None:
    arm = random_arm(seed, subsets(FALLING))
    for result in (arm.greedy(), arm.exhaustive()):
        assert result.best.trajectory.time_cost <= 0.75


@given(SEED)
def test_what_is_returned_belongs_together(seed: int) -> None:
    arm = random_arm(seed, subsets(FALLING))
    for result in (arm.greedy(), arm.exhaustive()):
        mask = masked(result.best.kept)
        assert result.best.holding.feasible
        assert result.best.holding.tension.max() == arm.peak[mask]
        assert result.best.trajectory.time_cost == arm.cost[mask]


@given(SEED)
def test_exactly_one_trial_is_taken_and_it_is_the_best(seed: int) -> None:
    arm = random_arm(seed, subsets(FALLING))
    for result in (arm.greedy(), arm.exhaustive()):
        found = [trial.kept for trial in result.trials if trial.verdict is Verdict.TAKEN]
        assert [masked(kept) for kept in found] == [taken(result)]


def test_a_mask_that_does_not_hold_is_not_simulated() -> None:
    arm = FakeArm(unheld=frozenset([frozenset({2})]))
    arm.greedy()
    assert arm.simulated == [frozenset()]


def test_a_mask_that_is_not_faster_does_not_end_the_greedy_search() -> None:
    arm = FakeArm({frozenset({2}): 1.2, frozenset({0, 2}): 0.9})
    assert taken(arm.greedy()) == {0, 2}


def test_a_blocked_mask_does_not_end_the_greedy_search() -> None:
    arm = FakeArm({frozenset({2}): None, frozenset({0, 2}): 0.9})
    assert taken(arm.greedy()) == {0, 2}


def test_greedy_misses_what_only_exhaustive_finds() -> None:
    arm = FakeArm({frozenset({4}): 0.7, frozenset({2}): 0.8})
    assert (taken(arm.greedy()), taken(arm.exhaustive())) == ({2}, {4})


def test_of_equally_fast_masks_the_one_with_fewer_muscles_is_taken() -> None:
    arm = FakeArm({frozenset({4}): 0.7, frozenset({0, 2}): 0.7})
    assert taken(arm.exhaustive()) == {4}


def test_of_equally_large_masks_the_one_with_the_lower_peak_tension_is_taken() -> None:
    costs: dict[frozenset[int], float | None] = {frozenset({2}): 0.7, frozenset({4}): 0.7}
    arm = FakeArm(costs, peak={frozenset({2}): 60.0})
    assert taken(arm.exhaustive()) == {4}


def test_a_mask_that_is_only_as_fast_is_not_taken() -> None:
    assert taken(FakeArm().greedy()) == set()


def test_every_trial_is_told_in_order() -> None:
    arm = FakeArm({frozenset({2}): 0.8, frozenset({0, 2}): None}, frozenset([frozenset({0, 2, 4})]))
    told = [
        (masked(t.kept), t.verdict, t.holding_residual, t.time_cost) for t in arm.greedy().trials
    ]
    assert told == [
        (set(), Verdict.NOT_FASTER, 0.0, 1.0),
        ({2}, Verdict.TAKEN, 0.0, 0.8),
        ({0, 2}, Verdict.SWING_BLOCKED, 0.0, 0.0),
        ({0, 2, 4}, Verdict.HOLDING_INFEASIBLE, 2.5, 0.0),
    ]


def test_without_candidates_the_swing_with_all_muscles_is_proven_the_best() -> None:
    for result in (FakeArm().greedy([]), FakeArm().exhaustive([])):
        assert (result.proven, len(result.trials)) == (True, 1)


def test_greedy_proves_nothing_about_masks_it_did_not_try() -> None:
    assert not FakeArm().greedy().proven


def test_greedy_with_one_candidate_has_tried_everything() -> None:
    assert FakeArm().greedy([2]).proven


def test_an_exhaustive_search_proves_its_mask() -> None:
    assert FakeArm().exhaustive().proven


def test_a_search_without_a_time_limit_is_not_cut() -> None:
    assert not any(result.cut for result in (FakeArm().greedy(), FakeArm().exhaustive()))


@pytest.mark.parametrize("method", ["greedy", "exhaustive"])
def test_a_search_out_of_time_takes_the_best_so_far(method: str) -> None:
    # In both searches {2} is the first mask and the only one before the time is over.
    search = FakeArm({frozenset({2}): 0.9}).search(expires_after(1))
    found = search.greedy(FALLING) if method == "greedy" else search.exhaustive(FALLING, PULLING)
    assert (taken(found), found.cut, found.proven) == ({2}, True, False)


def test_a_search_out_of_time_at_once_keeps_all_muscles() -> None:
    found = FakeArm({frozenset({2}): 0.9}).search(lambda: True).exhaustive(FALLING, PULLING)
    assert (taken(found), len(found.trials)) == (set(), 1)


def test_every_subset_is_tried_where_nothing_can_be_excluded() -> None:
    arm = FakeArm(unheld=frozenset([frozenset({2})]))
    arm.exhaustive()
    assert arm.held == subsets(FALLING)


def test_a_muscle_that_may_be_slack_does_not_help_a_mask_that_does_not_hold() -> None:
    arm = FakeArm(unheld=frozenset([frozenset({2})]))
    arm.exhaustive(tension_min=np.zeros(COUNT))
    assert arm.held == [mask for mask in subsets(FALLING) if not mask > {2}]


def test_a_muscle_that_must_pull_may_help_a_mask_that_does_not_hold() -> None:
    costs: dict[frozenset[int], float | None] = {frozenset({0, 2}): 0.6}
    arm = FakeArm(costs, frozenset([frozenset({2})]))
    assert taken(arm.exhaustive()) == {0, 2}


def test_masking_a_muscle_that_holds_nothing_back_is_not_tried() -> None:
    arm = FakeArm(idle=frozenset({4}))
    arm.exhaustive()
    assert arm.simulated == subsets([2, 0])


def test_leaving_masks_out_is_still_a_proof() -> None:
    assert FakeArm(idle=frozenset({4})).exhaustive().proven


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
