"""A swing goes through its phases in order, waits for what it needs and stops when it must."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest

from fastswing_planner.arrays import Vector, frozen
from fastswing_planner.errors import HoldingInfeasible, InvalidLimit, SwingAborted
from fastswing_planner.execution.measurements import (
    InhibitionReport,
    JointMeasurement,
    MuscleMeasurement,
)
from fastswing_planner.execution.posture_path import encoder_lengths
from fastswing_planner.execution.settings import ExecutionSettings, Phase
from fastswing_planner.execution.swing_execution import PreparedSwing, SwingCommands, SwingExecution
from fastswing_planner.planning.holding import Holding
from fastswing_planner.planning.request import Method
from fastswing_planner.robot.muscle_model import MuscleModel

ArmBuilder = Callable[..., MuscleModel]
MOMENT_ARMS = [[0.05], [-0.04]]
STIFFNESS = np.array([7000.0, 5000.0])
TENSION, FINAL_TENSION = np.array([70.0, 25.0]), np.array([35.0, 50.0])
ELONGATION = np.array([0.02, 0.0])
START, END = np.array([-1.0]), np.array([0.5])
PERIOD = 0.01
ORDER = [Phase.RAISE, Phase.ELONGATE, Phase.SETTLE, Phase.SWING, Phase.RECOVER]


@dataclass
class Stage:
    """An arm, its swing and a clock.

    The arm stands where `place` says and moves at `speed`; it obeys nobody by itself.
    """

    model: MuscleModel
    execution: SwingExecution
    place: float
    now: float = 10.0
    speed: float = 0.0
    inhibitor_speaks: bool = True
    phases: list[Phase] = field(default_factory=list)
    commands: list[SwingCommands] = field(default_factory=list)

    def tick(self) -> SwingCommands:
        """Measure, step and note what was ordered."""
        self.now += PERIOD
        self.execution.add_joints(joints_at(self.now, self.place, self.speed))
        self.execution.add_muscles(muscles_at(self.now))
        if self.inhibitor_speaks:
            self.execution.add_inhibition(InhibitionReport(self.now, True))
        commands = self.execution.step(self.now)
        self.commands.append(commands)
        if self.execution.phase not in self.phases:
            self.phases.append(self.execution.phase)
        return commands

    def run_until(self, phase: Phase) -> None:
        """Tick until a phase is entered; the arm follows to the start posture by itself."""
        for _ in range(5000):
            if self.execution.phase is phase:
                return
            self.place = float(START[0])
            self.tick()
        raise AssertionError(f"{phase!r} was not reached")

    def tick_for(self, duration: float) -> list[SwingCommands]:
        """Tick for a time [s] and return what was ordered."""
        return [self.tick() for _ in range(round(duration / PERIOD))]

    def finish(self) -> None:
        """Arrive, rest and recover."""
        self.place, self.speed = float(END[0]), 0.0
        for _ in range(5000):
            if self.execution.done:
                return
            self.tick()
        raise AssertionError("the swing does not end")


def joints_at(now: float, place: float, speed: float = 0.0) -> JointMeasurement:
    return JointMeasurement(now, np.array([place]), np.array([speed]))


def muscles_at(now: float, faulty: tuple[str, ...] = ()) -> MuscleMeasurement:
    return MuscleMeasurement(
        now, np.array([0.1, 0.2]), np.array([-0.35, 0.2]), np.array([60.0, 20.0]), faulty
    )


def holds(position: Vector) -> Holding:
    return Holding(True, 0.0, frozen(TENSION))


def stage(
    arm: ArmBuilder, method: Method = Method.ELONGATE, place: float = 0.0, **settings: Any
) -> Stage:
    """Set up a swing of one joint with two muscles; the arm is at `place` [rad]."""
    model = arm(MOMENT_ARMS)
    swing = PreparedSwing(method, START, END, ELONGATION, TENSION, FINAL_TENSION)
    execution = SwingExecution(
        model,
        holds,
        STIFFNESS,
        swing,
        replace(ExecutionSettings(), **settings),
        joints_at(10.0, place),
        muscles_at(10.0),
    )
    return Stage(model, execution, place)


def reach(case: Stage, phase: Phase) -> None:
    """Tick until a phase is entered."""
    if phase is not Phase.RECOVER:
        case.run_until(phase)
        return
    case.run_until(Phase.SWING)
    case.place = float(END[0])
    case.tick_for(0.3)
    assert case.execution.phase is Phase.RECOVER


def aborted(case: Stage, duration: float = 20.0) -> SwingAborted:
    """Tick until the swing is aborted, at most for `duration` [s]."""
    with pytest.raises(SwingAborted) as caught:
        case.tick_for(duration)
    return caught.value


@pytest.mark.parametrize("method", [Method.BASIC, Method.ELONGATE])
def test_a_swing_goes_through_its_phases_in_order(linear_arm: ArmBuilder, method: Method) -> None:
    case = stage(linear_arm, method)
    case.run_until(Phase.SWING)
    case.finish()
    assert case.phases == ORDER


def test_raising_starts_where_the_arm_is(linear_arm: ArmBuilder) -> None:
    case = stage(linear_arm, place=0.3)
    here = encoder_lengths(case.model, STIFFNESS, np.array([0.3]), TENSION)
    assert case.tick().lengths == pytest.approx(here, abs=1e-4)


def test_raising_is_no_faster_than_asked(linear_arm: ArmBuilder) -> None:
    case = stage(linear_arm, raise_speed=0.5)
    case.run_until(Phase.ELONGATE)
    lengths = np.array([commands.lengths for commands in case.commands])
    # The muscle of 0.05 m moment arm tells the joint's speed.
    assert np.abs(np.diff(lengths[:, 0])).max() / PERIOD / 0.05 <= 0.505


def test_after_elongating_the_lengths_are_the_plans(linear_arm: ArmBuilder) -> None:
    case = stage(linear_arm)
    case.run_until(Phase.SETTLE)
    expected = encoder_lengths(case.model, STIFFNESS, START, TENSION) + ELONGATION
    assert case.commands[-1].lengths == pytest.approx(expected)


def test_elongating_is_about_as_slow_as_asked(linear_arm: ArmBuilder) -> None:
    case = stage(linear_arm, elongate_speed=0.02)
    case.run_until(Phase.ELONGATE)
    begin = case.now
    case.run_until(Phase.SETTLE)
    # 0.02 m at 0.02 m/s
    assert case.now - begin == pytest.approx(1.0, abs=2 * PERIOD)


def test_no_length_command_jumps_before_the_swing(linear_arm: ArmBuilder) -> None:
    case = stage(linear_arm)
    case.run_until(Phase.SETTLE)
    lengths = np.array([commands.lengths for commands in case.commands])
    # 0.8 rad/s at 0.05 m, and pi/2 times 0.08 m/s, are both below 0.13 m/s.
    assert np.abs(np.diff(lengths, axis=0)).max() <= 0.13 * PERIOD


def test_the_swing_is_one_command_of_the_ends_lengths(linear_arm: ArmBuilder) -> None:
    case = stage(linear_arm)
    case.run_until(Phase.SWING)
    expected = encoder_lengths(case.model, STIFFNESS, END, FINAL_TENSION)
    assert case.commands[-1].lengths == pytest.approx(expected)
    assert case.tick() == SwingCommands()


def test_a_moving_arm_does_not_swing(linear_arm: ArmBuilder) -> None:
    case = stage(linear_arm)
    case.run_until(Phase.SETTLE)
    case.speed = -0.2
    case.tick_for(1.0)
    assert case.execution.phase is Phase.SETTLE


def test_the_arm_must_rest_for_a_while_anew(linear_arm: ArmBuilder) -> None:
    case = stage(linear_arm, rest_time=0.5)
    case.run_until(Phase.SETTLE)
    case.speed = 0.2
    case.tick()
    case.speed = 0.0
    case.tick_for(0.48)
    assert case.execution.phase is Phase.SETTLE
    case.tick_for(0.05)
    assert case.execution.phase is Phase.SWING


def test_an_arm_away_from_the_start_is_not_swung(linear_arm: ArmBuilder) -> None:
    case = stage(linear_arm)
    case.run_until(Phase.SETTLE)
    case.place = float(START[0]) + 0.2
    error = aborted(case)
    assert error.code_name == "NOT_AT_START"
    assert str(error) == (
        "the arm is 0.200 rad from the start posture and must rest within 0.08 rad of it"
    )


def test_method_1_asks_once_to_arm_the_inhibitor(linear_arm: ArmBuilder) -> None:
    case = stage(linear_arm, Method.INHIBIT)
    case.run_until(Phase.SETTLE)
    commands = case.tick_for(2.0)
    assert [each.arm for each in commands].count(True) == 1
    assert case.execution.phase is Phase.SETTLE


def test_method_1_swings_once_the_inhibitor_is_armed(linear_arm: ArmBuilder) -> None:
    case = stage(linear_arm, Method.INHIBIT)
    case.run_until(Phase.SETTLE)
    case.tick_for(1.0)
    case.execution.inhibitor_armed()
    case.tick()
    assert case.execution.phase is Phase.SWING


def test_method_1_does_not_swing_without_the_inhibitor(linear_arm: ArmBuilder) -> None:
    case = stage(linear_arm, Method.INHIBIT)
    case.run_until(Phase.SETTLE)
    error = aborted(case)
    assert error.code_name == "NOT_READY"
    assert str(error) == "the inhibitor did not confirm that it is armed"


@pytest.mark.parametrize("method", [Method.BASIC, Method.ELONGATE])
def test_other_methods_arm_nothing(linear_arm: ArmBuilder, method: Method) -> None:
    case = stage(linear_arm, method)
    case.run_until(Phase.SWING)
    assert not any(commands.arm for commands in case.commands)


def test_the_end_of_a_swing_disarms(linear_arm: ArmBuilder) -> None:
    case = stage(linear_arm, Method.INHIBIT)
    case.execution.inhibitor_armed()
    case.run_until(Phase.SWING)
    case.finish()
    assert [commands.disarm for commands in case.commands].count(True) == 1


def test_passing_the_end_is_not_the_end(linear_arm: ArmBuilder) -> None:
    case = stage(linear_arm)
    case.run_until(Phase.SWING)
    case.place, case.speed = float(END[0]), 2.0
    case.tick_for(0.5)
    assert case.execution.phase is Phase.SWING


def test_the_end_posture_is_held_before_the_swing_is_done(linear_arm: ArmBuilder) -> None:
    case = stage(linear_arm, recover_time=1.0)
    case.run_until(Phase.SWING)
    case.place = float(END[0])
    case.tick()
    assert case.execution.phase is Phase.RECOVER
    case.tick_for(0.9)
    assert not case.execution.done
    case.tick_for(0.2)
    assert case.execution.done


def test_a_swing_that_does_not_arrive_is_said(linear_arm: ArmBuilder) -> None:
    case = stage(linear_arm)
    case.run_until(Phase.SWING)
    case.place = 0.2
    error = aborted(case)
    assert error.code_name == "PHASE_TIMEOUT"
    assert str(error) == (
        "the arm did not come within 0.1 rad of the end posture in 3 s; it is 0.300 rad away"
    )


def test_a_swing_that_does_not_arrive_ends_at_its_limit_and_pulls_no_longer(
    linear_arm: ArmBuilder,
) -> None:
    case = stage(linear_arm)
    case.run_until(Phase.SWING)
    begin = case.now
    aborted(case)
    assert case.now - begin == pytest.approx(3.0, abs=2 * PERIOD)


def test_the_inhibitor_stays_armed_for_longer_than_a_swing_may_take() -> None:
    assert ExecutionSettings(swing_limit=2.0).arming_limit == 2.5


def test_an_arm_that_still_rings_at_the_swings_limit_may_come_to_rest_while_it_recovers(
    linear_arm: ArmBuilder,
) -> None:
    case = stage(linear_arm)
    case.run_until(Phase.SWING)
    case.place, case.speed = float(END[0]), 0.5
    case.tick_for(3.1)
    assert case.execution.phase is Phase.RECOVER
    case.finish()


def test_an_arm_that_does_not_rest_at_the_end_is_said(linear_arm: ArmBuilder) -> None:
    case = stage(linear_arm)
    case.run_until(Phase.SWING)
    case.place = float(END[0])
    case.tick()
    case.place = 0.2
    error = aborted(case)
    assert error.code_name == "PHASE_TIMEOUT"
    assert str(error) == (
        "the arm does not rest within 0.1 rad of the end posture 5 s after the swing; it is 0.300 "
        "rad away"
    )


def test_an_arm_that_did_not_come_to_the_start_pays_nothing_out(linear_arm: ArmBuilder) -> None:
    case = stage(linear_arm, place=0.0)
    error = aborted(case)
    assert case.execution.phase is Phase.RAISE
    assert error.code_name == "NOT_AT_START"
    assert str(error) == (
        "the arm is 1.000 rad from the start posture and must come within 0.08 rad of it"
    )


def test_a_way_longer_than_its_limit_is_refused_before_anything_moves(
    linear_arm: ArmBuilder,
) -> None:
    with pytest.raises(SwingAborted) as caught:
        stage(linear_arm, raise_speed=0.1)
    assert caught.value.code_name == "PHASE_TIMEOUT"
    assert str(caught.value) == (
        "the way to the start posture would take 15.7 s at 0.1 rad/s, raise_limit is 15 s"
    )


def test_paying_out_longer_than_its_limit_is_refused_before_anything_moves(
    linear_arm: ArmBuilder,
) -> None:
    with pytest.raises(SwingAborted) as caught:
        stage(linear_arm, elongate_speed=0.005, elongate_limit=2.0)
    assert caught.value.code_name == "PHASE_TIMEOUT"
    assert str(caught.value) == "paying out would take 4.0 s at 0.005 m/s, elongate_limit is 2 s"


@pytest.mark.parametrize(
    ("settings", "text"),
    [
        (
            {"settle_limit": 1.0, "rest_time": 1.0},
            "settle_limit is 1 s, must be above rest_time, 1 s",
        ),
        (
            {"recover_limit": 0.4, "recover_time": 0.5},
            "recover_limit is 0.4 s, must be above recover_time, 0.5 s",
        ),
    ],
)
def test_a_limit_within_which_its_phase_cannot_end_is_refused(
    settings: dict[str, float], text: str
) -> None:
    with pytest.raises(InvalidLimit) as caught:
        ExecutionSettings(**settings)
    assert str(caught.value) == text


def test_before_the_swing_there_are_no_figures(linear_arm: ArmBuilder) -> None:
    case = stage(linear_arm)
    case.run_until(Phase.SETTLE)
    assert case.execution.figures is None


def test_the_figures_are_those_of_the_swing_alone(linear_arm: ArmBuilder) -> None:
    case = stage(linear_arm)
    case.speed = 9.0
    case.tick()
    case.speed = 0.0
    case.run_until(Phase.SWING)
    begin = case.now
    for case.speed in (1.0, -2.5, 0.5):
        case.tick()
    case.finish()
    figures = case.execution.figures
    assert figures is not None
    assert figures.peak_joint_velocity.tolist() == [2.5]
    assert figures.peak_muscle_velocity.tolist() == [0.35, 0.2]
    assert figures.peak_tension.tolist() == [60.0, 20.0]
    # Three moving ticks, then the first at the end.
    assert figures.time_cost == pytest.approx(4 * PERIOD)
    assert begin < case.now


@pytest.mark.parametrize("phase", ORDER[:4])
def test_old_measurements_stop_every_phase(linear_arm: ArmBuilder, phase: Phase) -> None:
    case = stage(linear_arm)
    case.run_until(phase)
    with pytest.raises(SwingAborted) as caught:
        case.execution.step(case.now + 0.25)
    assert caught.value.code_name == "STALE_STATE"
    assert str(caught.value) == "the last measurements are 0.25 s old"


def test_one_silent_source_is_enough_to_stop(linear_arm: ArmBuilder) -> None:
    case = stage(linear_arm)
    case.execution.add_joints(joints_at(10.5, 0.0))
    with pytest.raises(SwingAborted, match=r"^the last measurements are 0\.50 s old$"):
        case.execution.step(10.5)


@pytest.mark.parametrize("phase", ORDER)
def test_an_executor_that_stood_still_does_not_jump_to_where_the_arm_should_be(
    linear_arm: ArmBuilder, phase: Phase
) -> None:
    case = stage(linear_arm)
    reach(case, phase)
    case.tick()
    case.now += 2.0
    with pytest.raises(SwingAborted) as caught:
        case.tick()
    assert caught.value.code_name == "STALE_STATE"
    assert str(caught.value) == "the executor did not run for 2.01 s"


@pytest.mark.parametrize("phase", ORDER)
def test_somebody_who_holds_the_arm_stops_every_phase(linear_arm: ArmBuilder, phase: Phase) -> None:
    case = stage(linear_arm)
    reach(case, phase)
    case.execution.add_muscles(muscles_at(case.now)._replace(holds=1))
    with pytest.raises(SwingAborted) as caught:
        case.execution.step(case.now)
    assert caught.value.code_name == "INTERRUPTED"
    assert str(caught.value) == "somebody held the arm, by hold_posture or clear_faults"


@pytest.mark.parametrize("phase", ORDER)
def test_somebody_who_drives_a_muscle_stops_every_phase(
    linear_arm: ArmBuilder, phase: Phase
) -> None:
    case = stage(linear_arm)
    reach(case, phase)
    case.execution.add_muscles(muscles_at(case.now)._replace(driven=("m1",)))
    with pytest.raises(SwingAborted) as caught:
        case.execution.step(case.now)
    assert caught.value.code_name == "INTERRUPTED"
    assert str(caught.value) == "muscles that follow somebody's tension or current: m1"


@pytest.mark.parametrize("phase", ORDER)
def test_another_writer_of_lengths_stops_every_phase(linear_arm: ArmBuilder, phase: Phase) -> None:
    case = stage(linear_arm)
    reach(case, phase)
    case.execution.interrupted("somebody else publishes length_command")
    with pytest.raises(SwingAborted) as caught:
        case.execution.step(case.now)
    assert caught.value.code_name == "INTERRUPTED"
    assert str(caught.value) == "somebody else publishes length_command"


def test_a_hold_between_request_and_raise_counts(linear_arm: ArmBuilder) -> None:
    swing = PreparedSwing(Method.BASIC, START, END, ELONGATION, TENSION, FINAL_TENSION)
    with pytest.raises(SwingAborted, match=r"^somebody held the arm"):
        SwingExecution(
            linear_arm(MOMENT_ARMS),
            holds,
            STIFFNESS,
            swing,
            ExecutionSettings(),
            joints_at(1.0, 0.0),
            muscles_at(1.0)._replace(holds=4),
            holds=3,
        )


@pytest.mark.parametrize("phase", ORDER[:4])
def test_a_fault_stops_every_phase(linear_arm: ArmBuilder, phase: Phase) -> None:
    case = stage(linear_arm)
    case.run_until(phase)
    case.execution.add_muscles(muscles_at(case.now, ("m1", "m0")))
    with pytest.raises(SwingAborted) as caught:
        case.execution.step(case.now)
    assert caught.value.code_name == "FAULT_LATCHED"
    assert str(caught.value) == "faulty muscles: m1, m0; find the cause, then clear_faults"


@pytest.mark.parametrize("phase", ORDER[:4])
def test_a_muscle_let_go_by_somebody_else_stops_every_phase(
    linear_arm: ArmBuilder, phase: Phase
) -> None:
    case = stage(linear_arm)
    case.run_until(phase)
    case.execution.add_muscles(muscles_at(case.now)._replace(limp=("m1",)))
    with pytest.raises(SwingAborted, match=r"^muscles at zero current: m1; an emergency stop"):
        case.execution.step(case.now)


@pytest.mark.parametrize(("limp", "goes_on"), [(("m1",), True), (("m0", "m1"), False)])
def test_an_armed_swing_allows_some_muscles_at_zero_current_but_not_all(
    linear_arm: ArmBuilder, limp: tuple[str, ...], goes_on: bool
) -> None:
    case = stage(linear_arm, Method.INHIBIT)
    case.run_until(Phase.SETTLE)
    case.tick_for(1.0)
    case.execution.inhibitor_armed()
    case.run_until(Phase.SWING)
    case.execution.add_muscles(muscles_at(case.now)._replace(limp=limp))
    if goes_on:
        assert case.execution.step(case.now).lengths is None
    else:
        with pytest.raises(SwingAborted, match=r"^muscles at zero current: m0, m1;"):
            case.execution.step(case.now)


def swinging_with_method_1(arm: ArmBuilder) -> Stage:
    """Return a swing whose inhibitor has just died."""
    case = stage(arm, Method.INHIBIT)
    case.run_until(Phase.SETTLE)
    case.tick_for(1.0)
    case.execution.inhibitor_armed()
    case.run_until(Phase.SWING)
    case.inhibitor_speaks = False
    return case


def test_a_swing_stops_when_the_inhibitor_ends_before_the_goal(linear_arm: ArmBuilder) -> None:
    case = swinging_with_method_1(linear_arm)
    case.execution.add_inhibition(InhibitionReport(case.now, False, False, "joint states stopped"))
    with pytest.raises(
        SwingAborted, match=r"^the inhibitor disarmed itself: joint states stopped$"
    ):
        case.execution.step(case.now)


def test_a_swing_stops_when_the_inhibitor_falls_silent(linear_arm: ArmBuilder) -> None:
    case = swinging_with_method_1(linear_arm)
    error = aborted(case)
    assert (error.code_name, str(error)) == (
        "NOT_READY",
        "the inhibitor has been silent for 0.21 s",
    )


def test_an_inhibitor_that_ended_at_the_goal_may_be_silent(linear_arm: ArmBuilder) -> None:
    case = swinging_with_method_1(linear_arm)
    case.execution.add_inhibition(InhibitionReport(case.now, False, True, "the goal was reached"))
    case.tick_for(1.0)
    assert case.execution.phase is Phase.SWING


@pytest.mark.parametrize("reached", [True, False])
def test_what_the_inhibitor_told_of_an_earlier_swing_does_not_count(
    linear_arm: ArmBuilder, reached: bool
) -> None:
    # Reliable topics repeat what got lost: the end of an earlier swing arrived a second later.
    case = swinging_with_method_1(linear_arm)
    case.execution.add_inhibition(InhibitionReport(case.now - 2.0, False, reached, "earlier"))
    assert "has been silent" in str(aborted(case))


def test_once_the_arm_has_arrived_the_inhibitor_may_be_silent(linear_arm: ArmBuilder) -> None:
    case = swinging_with_method_1(linear_arm)
    case.place, case.speed = float(END[0]), 1.0
    case.tick_for(1.0)
    assert case.execution.phase is Phase.SWING


def test_a_swing_without_inhibition_needs_no_inhibitor(linear_arm: ArmBuilder) -> None:
    case = stage(linear_arm, Method.BASIC)
    case.inhibitor_speaks = False
    case.run_until(Phase.SWING)
    case.tick_for(1.0)
    assert case.execution.phase is Phase.SWING


def start_with(
    arm: ArmBuilder, hold: Callable[[Vector], Holding], muscles: MuscleMeasurement
) -> SwingExecution:
    swing = PreparedSwing(Method.BASIC, START, END, ELONGATION, TENSION, FINAL_TENSION)
    return SwingExecution(
        arm(MOMENT_ARMS), hold, STIFFNESS, swing, ExecutionSettings(), joints_at(1.0, 0.0), muscles
    )


def test_a_faulty_muscle_is_not_started_with(linear_arm: ArmBuilder) -> None:
    with pytest.raises(SwingAborted) as caught:
        start_with(linear_arm, holds, muscles_at(1.0, ("m0",)))
    assert str(caught.value) == "faulty muscles: m0; find the cause, then clear_faults"


def test_a_muscle_at_zero_current_is_not_started_with(linear_arm: ArmBuilder) -> None:
    with pytest.raises(SwingAborted, match=r"^muscles at zero current: m0; an emergency stop"):
        start_with(linear_arm, holds, muscles_at(1.0)._replace(limp=("m0",)))


def test_a_way_that_cannot_be_held_is_not_started(linear_arm: ArmBuilder) -> None:
    with pytest.raises(HoldingInfeasible, match=r"^on the way to the start posture, \("):
        start_with(linear_arm, lambda _: Holding(False, 3.0, frozen(TENSION)), muscles_at(1.0))


@pytest.mark.parametrize("phase", ORDER)
def test_a_stop_holds_the_measured_lengths_and_disarms(
    linear_arm: ArmBuilder, phase: Phase
) -> None:
    case = stage(linear_arm)
    reach(case, phase)
    commands = case.execution.stop()
    assert commands.disarm
    assert commands.lengths is not None
    assert commands.lengths.tolist() == [0.1, 0.2]


@pytest.mark.parametrize("phase", ORDER)
def test_after_a_stop_nothing_is_ordered(linear_arm: ArmBuilder, phase: Phase) -> None:
    case = stage(linear_arm, Method.INHIBIT)
    case.execution.inhibitor_armed()
    reach(case, phase)
    case.execution.stop()
    assert set(case.tick_for(8.0)) == {SwingCommands()}


def test_the_distance_to_the_end_is_measured(linear_arm: ArmBuilder) -> None:
    case = stage(linear_arm, place=-0.7)
    assert case.execution.distance_to_end == pytest.approx(1.2)
