"""What is known of one mask's swing is used for another's, and changes nothing of it."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fastswing_planner.arrays import BoolVector
from fastswing_planner.planning.known_swings import KnownSwings
from fastswing_planner.planning.swing import (
    SwingSettings,
    Trajectory,
    shared_step_count,
    simulate_swing,
)
from fastswing_planner.qp.solvers import SOLVERS, solver_from
from fastswing_planner.robot.description import Robot
from fastswing_planner.robot.limits import muscle_limits
from fastswing_planner.robot.muscle_model import MuscleModel

MUSCLES = 7
SEED = st.integers(0, 2**32 - 1)
ORDER = st.lists(st.integers(0, 3), min_size=1, max_size=4, unique=True)
Simulate = Callable[[BoolVector, Trajectory | None], Trajectory]


def without(masked: list[int], count: int = MUSCLES) -> BoolVector:
    return ~np.isin(np.arange(count), masked)


def random_swing(arm: Callable[..., MuscleModel], seed: int, solver: str) -> Simulate:
    """Return the swings of a random arm with two joints, by mask."""
    rng = np.random.default_rng(seed)
    G = rng.uniform(-0.03, 0.06, (MUSCLES, 2))
    model, end = arm(G), rng.uniform(0.3, 0.9, 2)
    limits = muscle_limits(model.muscle_names, rng.uniform(0.1, 0.4, MUSCLES), 0.5, 1.0, 200.0)

    def simulate(kept: BoolVector, like: Trajectory | None) -> Trajectory:
        return simulate_swing(
            model,
            solver_from(solver),
            np.zeros(2),
            end,
            limits,
            kept,
            SwingSettings(),
            like=like,
        )

    return simulate


@given(SEED, ORDER, st.sampled_from(list(SOLVERS)))
def test_a_swing_that_goes_on_from_a_known_one_is_the_one_from_rest(
    linear_arm: Callable[..., MuscleModel], seed: int, order: list[int], solver: str
) -> None:
    simulate = random_swing(linear_arm, seed, solver)
    known = KnownSwings(simulate)
    for count in range(len(order) + 1):
        kept = without(order[:count])
        found, anew = known.swing(kept), simulate(kept, None)
        assert found.joint_position == pytest.approx(anew.joint_position, abs=1e-7)
        assert found.muscle_velocity == pytest.approx(anew.muscle_velocity, abs=1e-5)


def test_a_muscle_that_holds_nothing_back_changes_no_step(
    linear_arm: Callable[..., MuscleModel],
) -> None:
    model = linear_arm([[0.08], [0.02], [-0.04]])
    limits = muscle_limits(model.muscle_names, 0.3, 0.5, 1.0, 200.0)
    asked: list[BoolVector] = []

    def simulate(kept: BoolVector, like: Trajectory | None) -> Trajectory:
        asked.append(kept)
        ends = np.zeros(1), np.ones(1)
        solver = solver_from("daqp")
        return simulate_swing(model, solver, *ends, limits, kept, SwingSettings(), np.eye(1), like)

    known = KnownSwings(simulate)
    everything = known.swing(without([], 3))
    assert shared_step_count(everything, without([1], 3)) == everything.time.size
    assert shared_step_count(everything, without([0], 3)) == 1
    again = known.swing(without([1], 3))
    assert again.joint_position.tolist() == everything.joint_position.tolist()


def test_the_same_mask_is_simulated_once(musashi: Robot) -> None:
    masks: list[int] = []

    def simulate(kept: BoolVector, like: Trajectory | None) -> Trajectory:
        masks.append(int(kept.sum()))
        ends = musashi.postures["start"], musashi.postures["end"]
        solver = solver_from("daqp")
        return simulate_swing(musashi.model, solver, *ends, musashi.limits, kept, SwingSettings())

    known = KnownSwings(simulate)
    for _ in range(3):
        known.swing(without([], 10))
    assert masks == [10]


def test_a_swing_with_more_muscles_is_told_if_it_is_known(
    linear_arm: Callable[..., MuscleModel],
) -> None:
    plain = random_swing(linear_arm, 3, "daqp")
    told: list[Trajectory | None] = []

    def simulate(kept: BoolVector, like: Trajectory | None) -> Trajectory:
        told.append(like)
        return plain(kept, like)

    known = KnownSwings(simulate)
    known.swing(without([0]))
    known.swing(without([1]))
    first = known.swing(without([]))
    known.swing(without([2]))
    assert told[:3] == [None, None, None]
    assert told[3] is first
