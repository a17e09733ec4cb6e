"""The planner does what a plain one does that was written anew from the paper.

The plain planner knows constant moment arms only, solves its programs with scipy (Lawson and
Hanson's least distance programming by NNLS, and bounded least squares), shares no code with the
planner and leaves nothing out of its exhaustive search.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from itertools import combinations, count
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import lsq_linear, nnls

from fastswing_planner.arrays import BoolVector, Matrix, Vector
from fastswing_planner.errors import InvalidLimit
from fastswing_planner.planning.mask_search import Verdict
from fastswing_planner.planning.plan import SwingPlan
from fastswing_planner.planning.planner import SwingPlanner
from fastswing_planner.planning.request import Method, Search, SwingRequest
from fastswing_planner.qp.solvers import SOLVERS, solver_from
from fastswing_planner.robot.limits import MuscleLimits, muscle_limits
from fastswing_planner.robot.muscle_model import MuscleModel

DT, EPSILON = 0.03, 0.01
SEED = st.integers(0, 2**32 - 1)
SOLVER = st.sampled_from(list(SOLVERS))
ArmBuilder = Callable[..., MuscleModel]
Mask = frozenset[int]
Rank = tuple[float, int, float]


@dataclass(frozen=True)
class Case:
    """A swing of an arm whose muscle lengths are l = G theta; m muscles, n joints.

    G       [m/rad] shape (m, n)
    torque  tau^nec [N m] in every posture, shape (n,)
    end     [rad] shape (n,); the start is zero
    limits  each of shape (m,)
    """

    G: Matrix
    torque: Vector
    end: Vector
    limits: MuscleLimits


# ---- the plain planner ---------------------------------------------------------------------------


def least_norm(A: Matrix, low: Vector, high: Vector) -> Vector:
    """Return the x of least |x| with low <= A x <= high."""
    stacked = np.vstack([np.hstack([A.T, -A.T]), np.concatenate([low, -high])])
    target = np.append(np.zeros(A.shape[1]), 1.0)
    residual = stacked @ nnls(stacked, target)[0] - target
    return np.asarray(-residual[:-1] / residual[-1])


def plain_peak_tension(case: Case, masked: Mask) -> float | None:
    """Return the largest of the least tensions [N] that hold the start, None if none do."""
    kept = [i for i in range(len(case.G)) if i not in masked]
    pull = -case.G[kept].T  # tau = -G^T f
    low, high = case.limits.tension_min[kept], case.limits.tension_max[kept]
    nearest = lsq_linear(pull, case.torque, (low, high), method="bvls", tol=1e-14).x
    if np.linalg.norm(pull @ nearest - case.torque) > 1e-4:
        return None
    rows = np.vstack([pull / 0.04, np.eye(len(kept))])
    reached = pull @ nearest / 0.04
    ends = (np.concatenate([reached, low]), np.concatenate([reached, high]))
    return float(least_norm(rows, *(np.asarray(end) / 100.0 for end in ends)).max()) * 100.0


def plain_swing(case: Case, masked: Mask) -> Matrix:
    """Return theta [rad] after each step, shape (k + 1, n)."""
    kept = [i for i in range(len(case.G)) if i not in masked]
    arms, fastest = case.G[kept], case.limits.velocity[kept]
    gain = case.limits.acceleration[kept] * DT
    theta, speed = np.zeros_like(case.end), np.zeros(len(kept))
    path = [theta]
    while np.linalg.norm(case.end - theta) >= EPSILON:
        # Speeding up takes time, slowing down to zero does not; at rest both ways speed up.
        highest = np.where(speed >= 0, speed + gain, np.maximum(speed + gain, 0)).clip(max=fastest)
        lowest = np.where(speed <= 0, speed - gain, np.minimum(speed - gain, 0)).clip(min=-fastest)
        left = case.end - theta
        straight = arms @ left
        short = least_norm(arms * 25, (lowest * DT - straight) * 25, (highest * DT - straight) * 25)
        theta = theta + left + short
        speed = arms @ (left + short) / DT
        path.append(theta)
    return np.array(path)


def plain_antagonists(case: Case) -> list[int]:
    """Return the muscles that the straight way to the end lengthens, the largest q first."""
    q = (case.G @ case.end) / case.limits.velocity
    return sorted((i for i in range(len(q)) if q[i] > 0), key=lambda i: -q[i])


def plain_rank(case: Case, masked: Mask) -> Rank | None:
    """Return steps, masked muscles and peak tension [N]: less is better. None: not held."""
    peak = plain_peak_tension(case, masked)
    return None if peak is None else (len(plain_swing(case, masked)) - 1, len(masked), peak)


def plain_greedy(case: Case) -> Mask:
    """Return the best set on the way, up to the first that does not hold."""
    order, ranks = plain_antagonists(case), {}
    for size in range(len(order) + 1):
        rank = plain_rank(case, frozenset(order[:size]))
        if rank is None:
            break
        ranks[rank] = frozenset(order[:size])
    return ranks[min(ranks)]


def all_sets(members: list[int]) -> Iterator[Mask]:
    for size in range(len(members) + 1):
        yield from map(frozenset, combinations(members, size))


def plain_elongation(case: Case, path: Matrix, muscle: int) -> float:
    """Return how far [m] a muscle's path runs ahead of its fastest payout."""
    speed = paid_out = largest = 0.0
    for theta in path[1:]:
        gain = float(case.limits.acceleration[muscle]) * DT
        speed = min(speed + gain, float(case.limits.velocity[muscle]))
        paid_out += speed * DT
        largest = max(largest, float(case.G[muscle] @ theta) - paid_out)
    return largest


# ---- the real planner ----------------------------------------------------------------------------


def plan(arm: ArmBuilder, case: Case, solver: str = "daqp", **request: Any) -> SwingPlan:
    """Plan the case's swing by Method 2, unless the request says otherwise."""
    asked = SwingRequest(np.zeros_like(case.end), case.end, Method.ELONGATE)
    clock = request.pop("clock", None)
    planner = SwingPlanner(arm(case.G, torque=case.torque), case.limits, solver_from(solver))
    return planner.plan(replace(asked, **request), clock)


def search(arm: ArmBuilder, case: Case, solver: str = "daqp", **request: Any) -> SwingPlan:
    """Plan with the exhaustive search."""
    return plan(arm, case, solver, search=Search.EXHAUSTIVE, **request)


def masked(kept: BoolVector) -> Mask:
    return frozenset(np.flatnonzero(~kept).tolist())


def tried(plan: SwingPlan) -> list[Mask]:
    return [masked(trial.kept) for trial in plan.trials]


def random_case(seed: int, joints: int = 2, antagonists: int = 4, least: float = 10.0) -> Case:
    """Return a case whose start all muscles hold, with as many agonists as joints and one more.

    least  tension_min [N]
    """
    rng = np.random.default_rng(seed)
    end = rng.choice([-1.0, 1.0], joints) * rng.uniform(0.4, 1.2, joints)
    count = antagonists + joints + 1
    G = rng.uniform(-0.03, 0.03, (count, joints))
    arm = np.concatenate(
        [rng.uniform(0.02, 0.1, antagonists), -rng.uniform(0.02, 0.06, joints + 1)]
    )
    direction = end / np.linalg.norm(end)
    G += np.outer(arm - G @ direction, direction)
    tension = rng.uniform(max(least, 0.2), rng.uniform(30.0, 190.0), count)
    limits = MuscleLimits(
        velocity=rng.uniform(0.2, 0.4, count),
        acceleration=rng.uniform(0.3, 3.0, count),
        tension_min=np.full(count, least),
        tension_max=np.full(count, 200.0),
    )
    return Case(G, -G.T @ tension, end, limits)


Sizes = tuple[int, int, int, float]
SIZES = st.tuples(SEED, st.integers(1, 3), st.integers(1, 6), st.sampled_from([0.0, 10.0]))
EXHAUSTED = [
    pytest.param(
        (seed, joints, antagonists, least),
        id=f"{antagonists} antagonists, {joints} joints, from {least:g} N",
    )
    for least in (0.0, 10.0)
    for seed, joints, antagonists in (
        (1, 1, 2),
        (2, 2, 3),
        (3, 3, 4),
        (4, 2, 5),
        (5, 3, 6),
        (6, 2, 7),
        (7, 3, 8),
        (8, 1, 9),
        (34, 2, 10),
    )
]


@cache
def all_ranks(sizes: Sizes) -> dict[Mask, Rank | None]:
    """Return the plain ranks of all sets of the random case's antagonists."""
    case = random_case(*sizes)
    return {one: plain_rank(case, one) for one in all_sets(plain_antagonists(case))}


@given(SIZES, SOLVER)
def test_the_greedy_search_takes_the_plain_ones_mask(
    linear_arm: ArmBuilder, sizes: Sizes, solver: str
) -> None:
    case = random_case(*sizes)
    assert masked(plan(linear_arm, case, solver).kept) == plain_greedy(case)


@given(SIZES, SOLVER)
def test_every_mask_on_the_greedy_way_costs_what_the_plain_one_says(
    linear_arm: ArmBuilder, sizes: Sizes, solver: str
) -> None:
    case = random_case(*sizes)
    for trial in plan(linear_arm, case, solver).trials:
        rank = plain_rank(case, masked(trial.kept))
        held = trial.verdict is not Verdict.HOLDING_INFEASIBLE
        told = (held, trial.time_cost)
        assert told == ((True, pytest.approx(rank[0] * DT)) if rank else (False, 0.0))


@given(SIZES, SOLVER, st.sampled_from([Method.BASIC, Method.INHIBIT, Method.ELONGATE]))
def test_every_step_of_a_swing_is_the_plain_ones(
    linear_arm: ArmBuilder, sizes: Sizes, solver: str, method: Method
) -> None:
    case = random_case(*sizes)
    masks = {
        Method.BASIC: frozenset(),
        Method.INHIBIT: frozenset(plain_antagonists(case)),
        Method.ELONGATE: plain_greedy(case),
    }
    planned = plan(linear_arm, case, solver, method=method).trajectory.joint_position
    assert planned == pytest.approx(plain_swing(case, masks[method]), abs=1e-6)


@given(SIZES, SOLVER)
def test_what_is_elongated_is_what_the_plain_one_elongates(
    linear_arm: ArmBuilder, sizes: Sizes, solver: str
) -> None:
    case = random_case(*sizes)
    mask = plain_greedy(case)
    path = plain_swing(case, mask)
    expected = [
        plain_elongation(case, path, muscle) if muscle in mask else 0.0
        for muscle in range(len(case.G))
    ]
    assert plan(linear_arm, case, solver).elongation == pytest.approx(expected, abs=1e-6)


@given(SIZES, SOLVER)
def test_the_peak_tension_is_the_plain_ones(
    linear_arm: ArmBuilder, sizes: Sizes, solver: str
) -> None:
    case = random_case(*sizes)
    found = plan(linear_arm, case, solver)
    peak = plain_peak_tension(case, masked(found.kept))
    assert found.holding_tension.max() == pytest.approx(peak, abs=1e-3)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("sizes", EXHAUSTED)
def test_the_exhaustive_search_finds_the_best_of_all_sets(
    linear_arm: ArmBuilder, sizes: Sizes, solver: str
) -> None:
    ranks = all_ranks(sizes)
    found = search(linear_arm, random_case(*sizes), solver)
    best = min(rank for rank in ranks.values() if rank)
    # Steps and masked muscles are the same as the best's; the peak tensions may be a tie.
    assert ranks[masked(found.kept)] == pytest.approx(best, abs=1e-3)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("sizes", EXHAUSTED)
def test_what_the_exhaustive_search_leaves_out_is_no_better(
    linear_arm: ArmBuilder, sizes: Sizes, solver: str
) -> None:
    ranks = all_ranks(sizes)
    found = search(linear_arm, random_case(*sizes), solver)
    left_out = ranks.keys() - set(tried(found))
    assert left_out
    taken, others = ranks[masked(found.kept)], [ranks[one] for one in left_out]
    better = [rank for rank in others if rank and taken and rank < taken]
    assert better == []


@pytest.mark.parametrize("sizes", [(130, 2, 5, 0.0), (153, 3, 5, 0.0), (185, 3, 5, 10.0)])
def test_of_equally_fast_sets_of_a_size_the_one_with_the_lowest_peak_tension_is_taken(
    linear_arm: ArmBuilder, sizes: Sizes
) -> None:
    ranks = [rank for rank in all_ranks(sizes).values() if rank]
    best = min(ranks)
    assert any(rank[:2] == best[:2] and rank[2] > best[2] + 1.0 for rank in ranks)
    found = search(linear_arm, random_case(*sizes))
    assert found.holding_tension.max() == pytest.approx(best[2], abs=1e-3)


def test_sets_that_hold_no_better_are_left_out_if_muscles_may_be_slack(
    linear_arm: ArmBuilder,
) -> None:
    case = random_case(20, 3, 6, 0.0)
    found = search(linear_arm, case)
    unheld = [one.kept for one in found.trials if one.verdict is Verdict.HOLDING_INFEASIBLE]
    supersets = [
        one
        for one in all_sets(plain_antagonists(case))
        if any(masked(kept) < one for kept in unheld)
    ]
    assert supersets
    assert not set(supersets) & set(tried(found))


def test_sets_that_do_not_hold_leave_nothing_out_if_muscles_pull_at_least_10_newtons(
    linear_arm: ArmBuilder,
) -> None:
    # Each of the antagonists m0 and m1 balances the least pull of the other on joint j1. Only
    # without both, or with both, the start is held.
    case = Case(
        G=np.array([[0.04, 0.04], [0.04, -0.04], [-0.02, 0.0]]),
        torque=np.array([1.0, 0.0]),
        end=np.array([1.0, 0.0]),
        limits=muscle_limits(("m0", "m1", "m2"), 0.3, 0.46, 10.0, 200.0),
    )
    found = search(linear_arm, case)
    assert [(masked(one.kept), one.verdict) for one in found.trials] == [
        (frozenset(), Verdict.NOT_FASTER),
        (frozenset({0}), Verdict.HOLDING_INFEASIBLE),
        (frozenset({1}), Verdict.HOLDING_INFEASIBLE),
        (frozenset({0, 1}), Verdict.TAKEN),
    ]


def test_masking_muscles_that_restrain_nothing_is_left_out(linear_arm: ArmBuilder) -> None:
    # m0 alone is at its limit; m1 with half its arm never is, until m0 is masked.
    case = Case(
        G=np.array([[0.08], [0.04], [-0.02]]),
        torque=np.zeros(1),
        end=np.array([1.0]),
        limits=muscle_limits(("m0", "m1", "m2"), 0.3, 0.46, 0.0, 200.0),
    )
    assert tried(search(linear_arm, case)) == [
        frozenset(),
        frozenset({0}),
        frozenset({0, 1}),
    ]


def ticking(seconds: float) -> Callable[[], float]:
    """Return a clock that goes on by so many seconds each time it is read."""
    readings = count()
    return lambda: next(readings) * seconds


@pytest.mark.parametrize("kind", Search)
def test_a_search_out_of_time_is_the_begin_of_the_whole_one(
    linear_arm: ArmBuilder, kind: Search
) -> None:
    case = random_case(34, 2, 10)
    whole = plan(linear_arm, case, search=kind)
    cut = plan(linear_arm, case, search=kind, time_limit=2.5, clock=ticking(1.0))
    assert 1 < len(cut.trials) < len(whole.trials)
    assert tried(cut) == tried(whole)[: len(cut.trials)]


@pytest.mark.parametrize("kind", Search)
@pytest.mark.parametrize("seconds", [1.5, 6.5, 20.5])
def test_a_search_out_of_time_takes_the_best_so_far(
    linear_arm: ArmBuilder, kind: Search, seconds: float
) -> None:
    case = random_case(34, 2, 10)
    cut = plan(linear_arm, case, search=kind, time_limit=seconds, clock=ticking(1.0))
    ranks = {one: plain_rank(case, one) for one in tried(cut)}
    best = min(rank for rank in ranks.values() if rank)
    assert ranks[masked(cut.kept)] == pytest.approx(best, abs=1e-3)


@pytest.mark.parametrize("kind", Search)
def test_a_search_out_of_time_proves_nothing_and_says_so(
    linear_arm: ArmBuilder, kind: Search
) -> None:
    case = random_case(34, 2, 10)
    cut = plan(linear_arm, case, search=kind, time_limit=2.5, clock=ticking(1.0))
    assert not cut.proven
    assert cut.warnings[-1:] == ("the search ended at its time limit: a better mask may exist",)


def test_a_search_within_its_time_is_the_one_without_limit(linear_arm: ArmBuilder) -> None:
    case = random_case(34, 2, 10)
    timely = search(linear_arm, case, time_limit=1e4, clock=ticking(1.0))
    assert timely.proven
    assert tried(timely) == tried(search(linear_arm, case))


def test_a_time_limit_without_a_clock_is_refused(linear_arm: ArmBuilder) -> None:
    with pytest.raises(InvalidLimit) as caught:
        search(linear_arm, random_case(34), time_limit=2.5)
    assert str(caught.value) == "a search_time_limit needs a clock, such as time.monotonic"


def test_more_than_16_antagonists_need_a_time_limit(linear_arm: ArmBuilder) -> None:
    with pytest.raises(InvalidLimit) as caught:
        search(linear_arm, random_case(1, antagonists=17))
    assert str(caught.value) == (
        "an exhaustive search of 17 antagonists needs a search_time_limit (up to 16 go without)"
    )


def test_16_antagonists_are_searched_without_a_time_limit(linear_arm: ArmBuilder) -> None:
    assert search(linear_arm, random_case(1, joints=1, antagonists=16)).proven
