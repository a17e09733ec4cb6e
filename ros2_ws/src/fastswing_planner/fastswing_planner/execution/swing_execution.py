"""Carries out one planned swing: raise, elongate, settle, swing, recover.

A state machine without clock or I/O: measurements and time come in, commands go out.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

from fastswing_planner.arrays import Vector
from fastswing_planner.errors import (
    Interrupted,
    PhaseTimeout,
    SwingAborted,
    SwingNotReady,
)
from fastswing_planner.execution.approach import Approach
from fastswing_planner.execution.figures import SwingFigures, SwingMeasurement
from fastswing_planner.execution.inhibitor_watch import InhibitorWatch
from fastswing_planner.execution.measurements import (
    InhibitionReport,
    JointMeasurement,
    MuscleMeasurement,
)
from fastswing_planner.execution.posture_path import (
    encoder_lengths,
)
from fastswing_planner.execution.prepared_swing import PreparedSwing
from fastswing_planner.execution.refusals import (
    not_at_start,
    refuse_muscles,
    refuse_stale,
    refuse_stall,
)
from fastswing_planner.execution.rest import RestWatch
from fastswing_planner.execution.settings import ExecutionSettings, Phase
from fastswing_planner.planning.holding import Holding
from fastswing_planner.robot.muscle_model import MuscleModel

_SWING = Phase.SWING  # looking a member up in its enumeration takes half a microsecond


@dataclass(frozen=True)
class SwingCommands:
    """What has to be done now.

    lengths  [m] length command for all muscles, shape (m,); None: nothing new
    arm      arm the inhibitor; report with `SwingExecution.inhibitor_armed`
    disarm   disarm the inhibitor
    """

    lengths: Vector | None = None
    arm: bool = False
    disarm: bool = False


class SwingExecution:
    """One swing. Feed it with `add_joints` and `add_muscles`, call `step` often."""

    def __init__(
        self,
        model: MuscleModel,
        hold: Callable[[Vector], Holding],
        wire_stiffness: Vector,
        swing: PreparedSwing,
        settings: ExecutionSettings,
        joints: JointMeasurement,
        muscles: MuscleMeasurement,
        holds: int | None = None,
    ) -> None:
        """Plan the way to the start posture from where the arm is.

        holds  of the muscle measurement when the swing was asked for; None: those of `muscles`

        Raises HoldingInfeasible if a posture on the way cannot be held, SwingAborted if a muscle
        is faulty, at zero current or driven by somebody else, if the arm was held by somebody
        since, or if a phase would take longer than its limit.
        """
        self._swing = swing
        # Plain numbers: the standard library's norms take a fifth of the time with them.
        self._start, self._end = swing.start.tolist(), swing.end.tolist()
        self._settings = settings
        self._joints = joints
        self._muscles = muscles
        self._phase = Phase.RAISE
        self._phase_start = joints.time
        self._last_step: float | None = None
        self._rest = RestWatch(settings.rest_speed, settings.rest_time)
        self._holds = muscles.holds if holds is None else holds
        self._interruption = ""
        self._inhibitor = InhibitorWatch()
        self._over = False
        self._done = False
        refuse_muscles(muscles, self._holds)
        self._approach = Approach(model, hold, wire_stiffness, swing, settings, joints.position)
        self._end_lengths = encoder_lengths(model, wire_stiffness, swing.end, swing.final_tension)
        self._measurement: SwingMeasurement | None = None
        self._handlers = {
            Phase.RAISE: self._step_raise,
            Phase.ELONGATE: self._step_elongate,
            Phase.SETTLE: self._step_settle,
            Phase.SWING: self._step_swing,
            Phase.RECOVER: self._step_recover,
        }

    @property
    def phase(self) -> Phase:
        """The present phase."""
        return self._phase

    @property
    def done(self) -> bool:
        """Whether the swing is over and the end posture held."""
        return self._done

    @property
    def figures(self) -> SwingFigures | None:
        """What was measured; None before the swing."""
        return None if self._measurement is None else self._measurement.figures()

    @property
    def joint_position(self) -> Vector:
        """The last measured posture [rad], shape (n,)."""
        return self._joints.position

    @property
    def distance_to_end(self) -> float:
        """Norm of the distance to the end posture [rad]."""
        return math.dist(self._end, self._joints.position.tolist())

    def age(self, now: float) -> float:
        """Return how old the older of the last two states is at time `now` [s]."""
        return now - min(self._joints.time, self._muscles.time)

    def inhibitor_armed(self) -> None:
        """Take note that the inhibitor is armed."""
        self._inhibitor.armed = True

    def add_inhibition(self, report: InhibitionReport) -> None:
        """Take a report of the inhibitor; if it ended before the goal, the swing has to stop."""
        self._inhibitor.add(report, not self._arrived and self._phase is not Phase.RECOVER)

    def interrupted(self, reason: str) -> None:
        """Take note that somebody else commands the arm; the swing then has to stop."""
        self._interruption = reason

    def add_joints(self, joints: JointMeasurement) -> None:
        """Take a joint state."""
        self._joints = joints
        if self._phase is _SWING and self._measurement is not None:
            self._measurement.add_joints(
                joints.time, joints.velocity, self.distance_to_end, self._settings.arrival_tolerance
            )
        self._rest.add(joints.time, joints.velocity)

    def add_muscles(self, muscles: MuscleMeasurement) -> None:
        """Take a muscle state."""
        self._muscles = muscles
        if self._phase is _SWING and self._measurement is not None:
            self._measurement.add_muscles(muscles.velocity, muscles.tension)

    def stop(self) -> SwingCommands:
        """End the swing wherever the arm is; return the commands that hold the measured lengths."""
        self._over = True
        return SwingCommands(lengths=self._muscles.length, disarm=True)

    def step(self, now: float) -> SwingCommands:
        """Return what has to be done at time `now` [s]; nothing once the swing has ended.

        Raises SwingAborted when the swing cannot go on; `stop` then holds the arm.
        """
        if self._over:
            return SwingCommands()
        try:
            self._refuse_to_go_on(now)
            return self._handlers[self._phase](now, now - self._phase_start)
        except SwingAborted:
            self._over = True
            raise

    def _refuse_to_go_on(self, now: float) -> None:
        refuse_muscles(self._muscles, self._holds, self._inhibitor.asked)
        if self._interruption:
            raise Interrupted(self._interruption)
        self._inhibitor.refuse_lost()
        refuse_stale(self.age(now), self._settings.state_timeout)
        if self._last_step is None:
            self._phase_start = now
        else:
            refuse_stall(now - self._last_step, self._settings.state_timeout)
        self._last_step = now

    def _enter(self, phase: Phase, now: float) -> None:
        self._phase = phase
        self._phase_start = now

    @property
    def _distance_to_start(self) -> float:
        return math.dist(self._start, self._joints.position.tolist())

    @property
    def _arrived(self) -> bool:
        return self._measurement is not None and self._measurement.arrived

    def _step_raise(self, now: float, elapsed: float) -> SwingCommands:
        if elapsed >= self._approach.raise_time:
            # Paying out is for the start posture: an arm that did not come there stays as it is.
            if self._distance_to_start < self._settings.start_tolerance:
                self._enter(Phase.ELONGATE, now)
            elif elapsed > self._settings.raise_limit:
                raise not_at_start(self._distance_to_start, self._settings, "come")
        return SwingCommands(lengths=self._approach.raising(elapsed))

    def _step_elongate(self, now: float, elapsed: float) -> SwingCommands:
        if elapsed >= self._approach.pay_out_time:
            self._enter(Phase.SETTLE, now)
        return SwingCommands(lengths=self._approach.paying_out(elapsed))

    def _step_settle(self, now: float, elapsed: float) -> SwingCommands:
        near = self._distance_to_start < self._settings.start_tolerance
        ready = near and self._rest.resting(now)
        if ready and (self._inhibitor.armed or not self._swing.method.inhibits):
            return self._start_swing(now)
        if elapsed > self._settings.settle_limit:
            if ready:
                raise SwingNotReady("the inhibitor did not confirm that it is armed")
            raise not_at_start(self._distance_to_start, self._settings, "rest")
        if ready and not self._inhibitor.asked:
            self._inhibitor.ask(now)
            return SwingCommands(arm=True)
        return SwingCommands()

    def _start_swing(self, now: float) -> SwingCommands:
        self._enter(Phase.SWING, now)
        self._measurement = SwingMeasurement(
            self._joints.position.size, self._muscles.length.size, now
        )
        # "Starting from theta_start, we sent the muscle length achieving theta_end for 0 seconds"
        # (section IV-B of the paper).
        return SwingCommands(lengths=self._end_lengths)

    def _step_swing(self, now: float, elapsed: float) -> SwingCommands:
        late = elapsed > self._settings.swing_limit
        self._refuse_silent_inhibitor()
        if late and not self._arrived:
            raise PhaseTimeout(
                f"the arm did not come within {self._settings.arrival_tolerance:g} rad of the end "
                f"posture in {self._settings.swing_limit:g} s; it is {self.distance_to_end:.3f} "
                "rad away",
            )
        if late or (self._arrived and self._rest.resting(now)):
            self._enter(Phase.RECOVER, now)
            return SwingCommands(lengths=self._end_lengths, disarm=True)
        return SwingCommands()

    def _refuse_silent_inhibitor(self) -> None:
        if self._swing.method.inhibits and not self._inhibitor.over and not self._arrived:
            timeout = self._settings.state_timeout
            self._inhibitor.refuse_silent(self._phase_start, self._joints.time, timeout)

    def _step_recover(self, now: float, elapsed: float) -> SwingCommands:
        if elapsed < self._settings.recover_time:
            return SwingCommands()
        near = self.distance_to_end < self._settings.arrival_tolerance
        if near and self._rest.resting(now):
            self._done = self._over = True
        elif elapsed > self._settings.recover_limit:
            raise PhaseTimeout(
                f"the arm does not rest within {self._settings.arrival_tolerance:g} rad of the end "
                f"posture {self._settings.recover_limit:g} s after the swing; it is "
                f"{self.distance_to_end:.3f} rad away",
            )
        return SwingCommands()
