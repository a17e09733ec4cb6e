"""A swing's figures against the formulas that the made-up recording follows."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from made_up_recording import searched

from fastswing_planner.analysis.measured_swing import MeasuredSwing
from fastswing_planner.analysis.measuring import measure_swings
from fastswing_planner.analysis.recording import CommandSeries, JointSpeed, Recording

Recorded = Callable[..., Recording]
PERIOD = 1.0 / 200.0
COMMAND = 3.98
"""[s] 0.02 s before the motion."""


def only(recording: Recording) -> MeasuredSwing:
    (swing,) = measure_swings(searched(recording))
    return swing


def piece(recording: Recording, rows: slice) -> Recording:
    """Return a recording of fewer joint states."""
    joints, speed = recording.joints, recording.speed
    count = len(range(*rows.indices(joints.time.size)))
    return replace(
        recording,
        joints=replace(
            joints,
            row=np.arange(count),
            time=joints.time[rows],
            position=joints.position[rows],
            velocity=joints.velocity[rows],
        ),
        speed=JointSpeed(speed.time[rows], speed.speed[rows], speed.fastest),
    )


def test_a_swing_begins_with_its_command(recorded: Recorded) -> None:
    swing = only(recorded())
    assert (swing.commanded, swing.start) == (True, COMMAND)


def test_without_a_command_it_begins_with_the_motion(recorded: Recorded) -> None:
    swing = only(recorded(commands=None))
    # The elbow's speed rises as 3 sin(pi t).
    exceeded = 4.0 + np.arcsin(0.15 / 3.0) / np.pi
    assert not swing.commanded
    assert swing.start == pytest.approx(exceeded, abs=PERIOD)
    assert "no length command before it: time counts from the first motion" in swing.notes


def test_its_time_ends_within_the_tolerance_of_the_end(recorded: Recorded) -> None:
    # What is left is 3 / pi (1 + cos(pi t)).
    near = 4.0 + np.arccos(0.1 * np.pi / 3.0 - 1.0) / np.pi
    assert only(recorded()).arrival == pytest.approx(near - COMMAND, abs=PERIOD)


def test_without_a_plan_the_end_is_where_the_arm_rested(recorded: Recorded) -> None:
    near = 4.0 + np.arccos(0.1 * np.pi / 3.0 - 1.0) / np.pi
    swing = only(recorded(plans=()))
    assert swing.arrival == pytest.approx(near - COMMAND, abs=2 * PERIOD)
    assert swing.method == "unplanned"
    assert (
        "no plan in the bag: nothing is predicted, the end is where the arm rested" in swing.notes
    )


def test_an_end_that_is_never_reached_has_no_time(recorded: Recorded) -> None:
    plan = recorded().plans[0]
    swing = only(recorded(plans=(replace(plan, end=plan.end + 1.0),)))
    assert np.isnan(swing.arrival)
    assert swing.notes == ("the arm did not come within 0.1 rad of the end posture",)


def test_peaks_stand_beside_the_plans(recorded: Recorded) -> None:
    joint = only(recorded()).main_joint
    assert (joint.name, joint.predicted_peak_speed) == ("E-p", 3.5)
    assert joint.peak_speed == pytest.approx(3.0, rel=1e-3)


def test_the_main_joint_is_the_one_that_the_plan_moves_even_if_another_is_faster(
    recorded: Recorded,
) -> None:
    recording = recorded()
    velocity = recording.joints.velocity.copy()
    velocity[:, 0] = 2.0 * velocity[:, 1]
    swing = only(replace(recording, joints=replace(recording.joints, velocity=velocity)))
    assert (swing.main_joint.name, swing.fastest_joint.name) == ("E-p", "S-p")


def test_muscles_have_speed_tension_mask_and_time_under_override(recorded: Recorded) -> None:
    muscles = {muscle.name: muscle for muscle in only(recorded()).muscles}
    assert muscles["#9"].peak_speed == pytest.approx(0.5, rel=1e-3)
    assert muscles["#9"].predicted_peak_speed == 0.5
    assert muscles["#1"].peak_tension == pytest.approx(170.0, rel=1e-3)
    assert [muscles[name].masked for name in ("#1", "#9", "#10")] == [False, True, True]
    # 60 overrides, 0.01 s apart, the last one to the end of its lease of 0.05 s.
    assert muscles["#9"].inhibited == pytest.approx(0.59 + 0.05)
    assert muscles["#1"].inhibited == 0.0


@pytest.mark.parametrize("beyond_end", [0.0, 1.0, -3.0], ids=["end", "beyond end", "before start"])
def test_raising_the_arm_faster_than_a_swing_is_no_swing(
    recorded: Recorded, beyond_end: float
) -> None:
    recording = recorded()
    velocity, speed = recording.joints.velocity.copy(), recording.speed.speed.copy()
    raising = recording.joints.time < 2.0
    velocity[raising], speed[raising] = -1.5, 1.5
    plan = recording.plans[0]
    # From the plan's end to its start, as before a second swing, or from where the arm hung.
    position = recording.joints.position.copy()
    hanging = plan.end[1] + beyond_end
    position[raising, 1] = np.linspace(hanging, plan.start[1], int(raising.sum()))
    again = replace(
        recording,
        joints=replace(recording.joints, velocity=velocity, position=position),
        speed=JointSpeed(recording.speed.time, speed, "E-p"),
    )
    assert [swing.start for swing in measure_swings(searched(again))] == [COMMAND]


def test_a_plan_for_another_start_predicts_nothing(recorded: Recorded) -> None:
    plan = recorded().plans[0]
    other = replace(plan, start=plan.start + 2.0, end=plan.end + 5.0)
    swing = only(recorded(plans=(other,)))
    assert swing.plan is None
    assert "the plan in the bag is another swing's: nothing is predicted" in swing.notes


def test_a_plan_of_other_joints_predicts_nothing(recorded: Recorded) -> None:
    plan = replace(recorded().plans[0], joint_names=("S-p", "wrist"))
    assert only(recorded(plans=(plan,))).plan is None


def test_the_last_plan_before_the_swing_counts(recorded: Recorded) -> None:
    plan = recorded().plans[0]
    plans = (
        replace(plan, time_cost=9.0),
        replace(plan, received=3.0),
        replace(plan, received=5.5, time_cost=8.0),
    )
    assert only(recorded(plans=plans)).predicted_time == 0.75


def test_half_a_swing_says_so_and_has_no_time(recorded: Recorded) -> None:
    middle = round(4.5 / PERIOD)
    begun = only(piece(recorded(), slice(middle, None)))
    ended = only(piece(recorded(), slice(0, middle)))
    assert begun.notes[0] == (
        "half a swing: the recording begins, or has a gap, in the middle of it"
    )
    assert ended.notes[0] == (
        "half a swing: the recording ends, or has a gap, before the arm rested"
    )
    assert np.isnan([begun.arrival, ended.arrival]).all()


def test_a_pause_of_joint_states_in_a_swing_is_told(recorded: Recorded) -> None:
    whole = recorded()
    time = whole.joints.time
    kept = np.flatnonzero((time <= 4.5) | (time >= 4.75))
    joints = replace(
        whole.joints,
        row=np.arange(kept.size),
        time=time[kept],
        position=whole.joints.position[kept],
        velocity=whole.joints.velocity[kept],
    )
    swing = only(
        recorded(joints=joints, speed=JointSpeed(time[kept], whole.speed.speed[kept], "E-p"))
    )
    assert swing.notes == (
        "no joint speed is known for 0.25 s of it: peaks and a rest may be missed, "
        "its time may be too long",
    )
    assert swing.arrival == pytest.approx(only(whole).arrival)


def test_two_motions_after_one_command_are_not_both_commanded(recorded: Recorded) -> None:
    whole = recorded()
    time = whole.joints.time
    # The arm rests 0.25 s halfway.
    still = (time > 4.4) & (time < 4.65)
    velocity, speed = whole.joints.velocity.copy(), whole.speed.speed.copy()
    velocity[still], speed[still] = 0.0, 0.0
    recording = recorded(
        joints=replace(whole.joints, velocity=velocity),
        speed=JointSpeed(time, speed, "E-p"),
        commands=CommandSeries(np.array([4.35]), np.array([0.2])),
    )
    swings = measure_swings(searched(recording))
    assert [swing.commanded for swing in swings] == [True, False]


def test_without_muscle_states_the_joints_are_still_measured(recorded: Recorded) -> None:
    swing = only(recorded(muscles=None))
    assert swing.main_joint.peak_speed == pytest.approx(3.0, rel=1e-3)
    assert swing.tightest_muscle is None
    assert "no muscle states in the bag: muscle speed and tension are unknown" in swing.notes


def test_only_the_states_around_a_swing_are_needed(recorded: Recorded) -> None:
    whole = recorded()
    kept = (whole.joints.time > 3.0) & (whole.joints.time < 6.0)
    part = replace(
        whole,
        joints=replace(
            whole.joints,
            row=np.flatnonzero(kept),
            time=whole.joints.time[kept],
            position=whole.joints.position[kept],
            velocity=whole.joints.velocity[kept],
        ),
    )
    one, other = only(whole), only(part)
    assert (one.start, one.arrival, one.joints) == (other.start, other.arrival, other.joints)


def test_what_the_inhibitor_rejected_and_why_it_ended(recorded: Recorded) -> None:
    swing = only(recorded())
    assert (swing.rejected, swing.ended) == (2, "the goal was reached")


def test_what_the_inhibitor_rejected_is_unknown_without_its_status(recorded: Recorded) -> None:
    assert np.isnan(only(recorded(status=None)).rejected)


def test_what_the_inhibitor_rejected_is_unknown_if_it_was_not_armed(recorded: Recorded) -> None:
    status = recorded().status
    assert status is not None
    unarmed = replace(status, armed=np.zeros_like(status.armed))
    assert np.isnan(only(recorded(status=unarmed)).rejected)


def test_faulty_muscles_are_named(recorded: Recorded) -> None:
    muscles = recorded().muscles
    assert muscles is not None
    fault = muscles.fault.copy()
    fault[round(4.2 / PERIOD), 2] = 1
    assert only(recorded(muscles=replace(muscles, fault=fault))).faulty == ("#10",)


def test_of_muscle_states_that_came_twice_the_longer_piece_counts(recorded: Recorded) -> None:
    muscles = recorded().muscles
    assert muscles is not None
    # The clock ran backwards for the last few states.
    time = muscles.time.copy()
    time[-20:] = np.linspace(4.2, 4.3, 20)
    velocity = muscles.velocity.copy()
    velocity[-20:] = 9.0
    swing = only(recorded(muscles=replace(muscles, time=time, velocity=velocity)))
    assert swing.fastest_muscle is not None
    assert swing.fastest_muscle.peak_speed == pytest.approx(0.5, rel=1e-3)
