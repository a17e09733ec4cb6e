"""Which muscles the rule inhibits, and what ends a swing; on two joints and four muscles."""

import dataclasses

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from fastswing_inhibitor.inhibition import (
    Arming,
    Decision,
    Inhibition,
    InhibitionSettings,
    JointNumbers,
    Reason,
)
from fastswing_planner.arrays import frozen
from fastswing_planner.errors import NotReady, OutOfRange, StaleState
from fastswing_planner.testing.arms import LinearArm

# Muscle 0 resists joint 0 going up, 1 helps it; 2 and 3 do so for joint 1.
JACOBIAN = np.array([[0.06, 0.0], [-0.06, 0.0], [0.0, 0.03], [0.0, -0.03]])
LIMIT = frozen([0.3, 0.3, 0.3, 0.3])
START = 10.0
PERIOD = 0.005
SETTINGS = InhibitionSettings()


def arming(
    goal: tuple[float, float] = (2.0, 0.0),
    threshold: float = 0.0,
    protected: tuple[int, ...] = (),
    time_limit: float = 3.0,
) -> Arming:
    mask = np.isin(np.arange(4), protected)
    return Arming(frozen(goal), threshold, mask, time_limit, START)


def joints(
    after: float, position: tuple[float, float], velocity: tuple[float, float] = (1.0, 0.0)
) -> JointNumbers:
    """Return a joint state `after` the start [s]."""
    return JointNumbers(START + after, position, velocity)


def disarmed(settings: InhibitionSettings = SETTINGS) -> Inhibition:
    return Inhibition(LinearArm(JACOBIAN, joint_range=10.0), LIMIT, settings)


def armed(
    goal: tuple[float, float] = (2.0, 0.0),
    threshold: float = 0.0,
    protected: tuple[int, ...] = (),
    time_limit: float = 3.0,
    settings: InhibitionSettings = SETTINGS,
) -> Inhibition:
    inhibition = disarmed(settings)
    inhibition.see(START)
    inhibition.arm(arming(goal, threshold, protected, time_limit))
    return inhibition


def assert_over(inhibition: Inhibition, decision: Decision, reason: Reason) -> None:
    assert decision.reason is reason
    assert not any(decision.inhibited)
    assert np.isnan(inhibition.speed_index(decision)).all()
    assert not inhibition.armed
    assert inhibition.reason is reason


# The rule.


def test_muscles_that_resist_the_motion_are_inhibited() -> None:
    decision = armed().decide(joints(PERIOD, (0.0, 0.0), (2.0, 0.0)))
    assert list(decision.inhibited) == [True, False, False, False]


def test_the_speed_index_is_moment_arm_over_velocity_limit() -> None:
    inhibition = armed()
    decision = inhibition.decide(joints(PERIOD, (0.0, 0.0), (2.0, 0.0)))
    np.testing.assert_allclose(inhibition.speed_index(decision), [0.2, -0.2, 0.0, 0.0])


def test_an_armed_decision_has_no_reason_to_end() -> None:
    inhibition = armed()
    assert inhibition.decide(joints(PERIOD, (0.0, 0.0))).reason is Reason.NONE
    assert inhibition.armed


def test_the_present_motion_counts_not_the_direction_to_the_goal() -> None:
    decision = armed().decide(joints(PERIOD, (0.0, 0.0), (0.0, -1.0)))
    assert list(decision.inhibited) == [False, False, False, True]


def test_a_muscle_exactly_at_the_threshold_is_not_inhibited() -> None:
    index = 0.06 / 0.3
    inhibition = armed(threshold=index)
    decision = inhibition.decide(joints(PERIOD, (0.0, 0.0)))
    assert inhibition.speed_index(decision)[0] == index
    assert not any(decision.inhibited)


def test_a_muscle_just_above_the_threshold_is_inhibited() -> None:
    decision = armed(threshold=np.nextafter(0.06 / 0.3, 0.0)).decide(joints(PERIOD, (0.0, 0.0)))
    assert list(decision.inhibited) == [True, False, False, False]


def test_a_muscle_without_moment_arm_is_not_inhibited_at_threshold_zero() -> None:
    inhibition = armed()
    decision = inhibition.decide(joints(PERIOD, (0.0, 0.0)))
    assert inhibition.speed_index(decision)[2] == 0.0
    assert not decision.inhibited[2]


def test_what_protects_another_number_of_muscles_arms_nothing() -> None:
    inhibition = disarmed()
    inhibition.see(START)
    with pytest.raises(IndexError):
        inhibition.arm(dataclasses.replace(arming(), protected=np.array([True, False, True])))
    assert not inhibition.armed


def test_a_protected_muscle_is_never_inhibited() -> None:
    decision = armed(protected=(0,)).decide(joints(PERIOD, (0.0, 0.0), (1.0, 1.0)))
    assert list(decision.inhibited) == [False, False, True, False]


def test_at_rest_the_direction_to_the_goal_takes_the_motions_place() -> None:
    decision = armed().decide(joints(PERIOD, (0.0, 0.0), (0.0, 0.01)))
    assert decision.direction_from_goal
    assert list(decision.inhibited) == [True, False, False, False]


def test_above_the_velocity_threshold_the_motion_counts() -> None:
    assert not armed().decide(joints(PERIOD, (0.0, 0.0), (0.0, 0.11))).direction_from_goal


def test_the_threshold_is_that_of_the_armed_swing() -> None:
    assert armed(threshold=0.07).threshold == 0.07
    assert np.isnan(disarmed().threshold)


def test_decisions_are_counted_from_the_arming() -> None:
    inhibition = armed()
    for k in range(1, 4):
        inhibition.decide(joints(k * PERIOD, (0.0, 0.0)))
    assert inhibition.decisions == 3
    inhibition.arm(arming())
    assert inhibition.decisions == 0


@given(
    arrays(float, 2, elements=st.floats(-3.0, 3.0)),
    st.floats(-0.3, 0.3),
    st.floats(0.0, 0.2),
    st.floats(1.5, 5.0),
)
def test_a_higher_threshold_and_a_faster_motion_never_inhibit_more(
    velocity: np.ndarray, threshold: float, more: float, faster: float
) -> None:
    assume(np.linalg.norm(velocity) > SETTINGS.velocity_threshold)
    goal = 2.0 * velocity / np.linalg.norm(velocity)

    def inhibited(threshold: float, velocity: np.ndarray) -> np.ndarray:
        inhibition = armed((goal[0], goal[1]), threshold)
        joint_state = joints(PERIOD, (0.0, 0.0), (velocity[0], velocity[1]))
        return np.array(inhibition.decide(joint_state).inhibited)

    usual = inhibited(threshold, velocity)
    assert not (inhibited(threshold + more, velocity) & ~usual).any()
    # q depends on the direction only; 1e-9 spares muscles that are at the threshold.
    assert not (inhibited(threshold + 1e-9, faster * velocity) & ~usual).any()


# Arming.


def test_a_state_that_comes_behind_a_newer_one_does_not_make_it_older() -> None:
    inhibition = disarmed()
    inhibition.see(START)
    inhibition.see(START - 0.04)
    inhibition.arm(dataclasses.replace(arming(), start_time=START + 0.04))
    assert inhibition.armed


def test_before_arming_nothing_is_inhibited() -> None:
    inhibition = disarmed()
    assert_over(inhibition, inhibition.decide(joints(0.0, (0.0, 0.0))), Reason.NEVER_ARMED)


def test_after_disarming_nothing_is_inhibited() -> None:
    inhibition = armed()
    inhibition.decide(joints(PERIOD, (0.0, 0.0)))
    inhibition.disarm(Reason.DISARMED)
    decision = inhibition.decide(joints(2 * PERIOD, (0.0, 0.0)))
    assert_over(inhibition, decision, Reason.DISARMED)


def test_the_first_reason_stays() -> None:
    inhibition = armed()
    inhibition.disarm(Reason.GOAL_REACHED)
    inhibition.disarm(Reason.DEACTIVATED)
    assert inhibition.reason is Reason.GOAL_REACHED


def test_disarming_what_was_never_armed_changes_nothing() -> None:
    inhibition = disarmed()
    inhibition.disarm(Reason.DISARMED)
    assert inhibition.reason is Reason.NEVER_ARMED


def test_arming_again_begins_afresh() -> None:
    inhibition = armed()
    inhibition.decide(joints(PERIOD, (2.0, 0.0)))
    inhibition.arm(dataclasses.replace(arming(goal=(0.0, 0.0)), start_time=START + 0.02))
    decision = inhibition.decide(joints(0.025, (1.0, 0.0), (-1.0, 0.0)))
    assert decision.reason is Reason.NONE
    assert list(decision.inhibited) == [False, True, False, False]


def test_without_any_joint_state_nothing_is_armed() -> None:
    inhibition = disarmed()
    with pytest.raises(
        NotReady, match=r"^no joint state yet: is the bridge active, do its boards answer\?$"
    ):
        inhibition.arm(arming())
    assert not inhibition.armed


def test_without_fresh_joint_states_nothing_is_armed() -> None:
    inhibition = disarmed()
    inhibition.see(START - 0.31)
    with pytest.raises(StaleState) as caught:
        inhibition.arm(arming())
    assert str(caught.value) == (
        "the last joint state is 0.310 s old, at most 0.05 s: is the bridge active?"
    )
    assert not inhibition.armed


# Joint states that cannot be used.


def test_an_old_joint_state_is_not_decided_on() -> None:
    inhibition = armed()
    with pytest.raises(StaleState, match=r"^a joint state is 0\.060 s old, at most 0\.05 s$"):
        inhibition.decide(joints(-0.03, (0.0, 0.0)), START + 0.03)
    assert inhibition.armed
    assert inhibition.decisions == 0


def test_a_joint_state_whose_lease_is_over_is_not_decided_on() -> None:
    patient = dataclasses.replace(SETTINGS, state_timeout=0.5, lease=0.04)
    inhibition = Inhibition(LinearArm(JACOBIAN, joint_range=10.0), LIMIT, patient)
    inhibition.see(START)
    inhibition.arm(arming())
    with pytest.raises(StaleState, match=r"^a joint state is 0\.045 s old, at most 0\.04 s$"):
        inhibition.decide(joints(0.0, (0.0, 0.0)), START + 0.045)


def test_rejected_joint_states_are_counted_from_the_arming() -> None:
    inhibition = armed()
    inhibition.reject(START + PERIOD)
    inhibition.reject(START + 2 * PERIOD)
    assert inhibition.rejected == 2
    inhibition.arm(arming())
    assert inhibition.rejected == 0


def test_rejected_joint_states_do_not_keep_a_swing_alive() -> None:
    inhibition = armed()
    inhibition.reject(START + 0.04)
    assert inhibition.armed
    inhibition.reject(START + 0.06)
    assert inhibition.reason is Reason.STALE_STATE


def test_a_joint_state_lets_the_silence_count_from_when_it_was_measured() -> None:
    inhibition = armed()
    inhibition.decide(joints(0.0, (0.0, 0.0)), START + 0.04)
    inhibition.watch(START + 0.06)
    assert inhibition.reason is Reason.STALE_STATE


# The end.


def test_a_swing_ends_within_the_tolerance_of_the_goal() -> None:
    inhibition = armed()
    decision = inhibition.decide(joints(PERIOD, (1.96, 0.0)))
    assert_over(inhibition, decision, Reason.GOAL_REACHED)


def test_a_swing_goes_on_just_outside_the_tolerance() -> None:
    assert armed().decide(joints(PERIOD, (1.94, 0.0))).reason is Reason.NONE


def test_a_swing_ends_when_the_goal_was_passed_far_off() -> None:
    inhibition = armed()
    inhibition.decide(joints(0.01, (0.0, 0.0), (10.0, 4.0)))
    inhibition.decide(joints(0.05, (0.7, 0.28), (10.0, 4.0)))
    inhibition.decide(joints(0.09, (1.4, 0.56), (10.0, 4.0)))
    decision = inhibition.decide(joints(0.12, (2.01, 0.8), (10.0, 4.0)))
    assert_over(inhibition, decision, Reason.GOAL_REACHED)


def test_a_swing_ends_when_the_arm_turns_back() -> None:
    inhibition = armed()
    inhibition.decide(joints(PERIOD, (1.0, 0.0)))
    decision = inhibition.decide(joints(2 * PERIOD, (1.0, 0.0), (-0.31, 0.0)))
    assert_over(inhibition, decision, Reason.REVERSED)


def test_a_joint_that_overshoots_while_the_arm_swings_on_is_no_reversal() -> None:
    inhibition = armed(goal=(0.4, 1.4))
    inhibition.decide(joints(0.01, (0.0, 0.0)))
    inhibition.decide(joints(0.05, (0.4, 0.7)))
    decision = inhibition.decide(joints(0.09, (0.75, 1.25), (3.0, 1.5)))
    assert decision.reason is Reason.NONE


def test_trembling_below_the_reversal_speed_is_no_reversal() -> None:
    inhibition = armed()
    inhibition.decide(joints(PERIOD, (1.0, 0.0)))
    assert inhibition.decide(joints(2 * PERIOD, (1.0, 0.0), (-0.29, 0.0))).reason is Reason.NONE


def test_a_decision_after_the_lease_tells_for_how_long_muscles_were_back() -> None:
    inhibition = armed(settings=InhibitionSettings(state_timeout=0.5, lease=0.1))
    inhibition.decide(joints(0.01, (0.0, 0.0)))
    inhibition.decide(joints(0.10, (0.1, 0.0)))
    assert inhibition.longest_lapse == 0.0
    inhibition.decide(joints(0.35, (0.2, 0.0)))
    assert inhibition.longest_lapse == pytest.approx(0.15)
    inhibition.decide(joints(0.36, (0.2, 0.0)))
    assert inhibition.longest_lapse == pytest.approx(0.15)


def test_a_swing_ends_at_its_time_limit() -> None:
    inhibition = armed(time_limit=0.0525)
    for k in range(1, 11):
        assert inhibition.decide(joints(k * PERIOD, (0.01 * k, 0.0))).reason is Reason.NONE
    decision = inhibition.decide(joints(0.055, (0.11, 0.0)))
    assert_over(inhibition, decision, Reason.TIME_LIMIT)


def test_a_swing_ends_when_joint_states_stop() -> None:
    inhibition = armed()
    inhibition.decide(joints(PERIOD, (0.0, 0.0)))
    inhibition.watch(START + PERIOD + 0.049)
    assert inhibition.armed
    inhibition.watch(START + PERIOD + 0.051)
    assert inhibition.reason is Reason.STALE_STATE


def test_a_swing_ends_when_joint_states_never_came() -> None:
    inhibition = armed()
    inhibition.watch(START + 0.051)
    assert inhibition.reason is Reason.STALE_STATE


def test_a_joint_state_after_a_gap_does_not_revive_the_swing() -> None:
    inhibition = armed()
    inhibition.decide(joints(PERIOD, (0.0, 0.0)))
    decision = inhibition.decide(joints(0.06, (0.01, 0.0)))
    assert_over(inhibition, decision, Reason.STALE_STATE)


def test_the_time_limit_is_named_before_stale_states() -> None:
    inhibition = armed(time_limit=0.5)
    inhibition.watch(START + 1.0)
    assert inhibition.reason is Reason.TIME_LIMIT


def test_watching_a_disarmed_inhibitor_changes_nothing() -> None:
    inhibition = disarmed()
    inhibition.watch(START + 100.0)
    assert inhibition.reason is Reason.NEVER_ARMED


def test_a_joint_that_jumps_ends_the_swing() -> None:
    inhibition = armed()
    inhibition.decide(joints(PERIOD, (0.0, 0.0)))
    decision = inhibition.decide(joints(2 * PERIOD, (0.21, 0.0)))
    assert_over(inhibition, decision, Reason.STATE_JUMP)


@pytest.mark.parametrize("speed", [20.1, -20.1, 1e308])
def test_a_speed_that_no_joint_has_decides_nothing(speed: float) -> None:
    inhibition = armed()
    with pytest.raises(OutOfRange, match=r"a joint's speed is .* rad/s, at most 20 rad/s"):
        inhibition.decide(joints(PERIOD, (0.0, 0.0), (0.0, speed)))
    assert inhibition.armed


def test_a_speed_that_joints_have_together_is_none_of_a_joint() -> None:
    inhibition = armed()
    assert inhibition.decide(joints(PERIOD, (0.0, 0.0), (19.0, 19.0))).reason is Reason.NONE


def test_a_fast_joint_has_not_jumped() -> None:
    inhibition = armed()
    inhibition.decide(joints(PERIOD, (0.0, 0.0)))
    assert inhibition.decide(joints(2 * PERIOD, (0.19, 0.0))).reason is Reason.NONE


def test_states_that_come_in_the_wrong_order_allow_only_the_tolerance() -> None:
    inhibition = armed()
    inhibition.decide(joints(0.04, (0.2, 0.0)))
    decision = inhibition.decide(joints(PERIOD, (0.09, 0.0)))
    assert_over(inhibition, decision, Reason.STATE_JUMP)


def test_a_jump_to_the_goal_is_a_jump() -> None:
    inhibition = armed()
    inhibition.decide(joints(PERIOD, (0.0, 0.0)))
    decision = inhibition.decide(joints(2 * PERIOD, (2.0, 0.0)))
    assert_over(inhibition, decision, Reason.STATE_JUMP)
