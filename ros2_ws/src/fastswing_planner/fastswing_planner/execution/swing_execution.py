"""Carries out one planned swing: raise, elongate, settle, swing, recover.

A state machine without clock or I/O: measurements and time come in, orders go out.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fastswing_planner.arrays import Vector, frozen
from fastswing_planner.errors import (
    FaultLatched,
    Interrupted,
    NotAtStart,
    PhaseTimeout,
    SwingAborted,
    SwingNotReady,
    SwingStateStale,
)
from fastswing_planner.execution.figures import SwingFigures, SwingMeasurement
from fastswing_planner.execution.measurements import (
    InhibitionReport,
    JointMeasurement,
    MuscleMeasurement,
)
from fastswing_planner.execution.posture_path import (
    PosturePath,
    encoder_lengths,
    posture_path,
    smooth_fraction,
)
from fastswing_planner.execution.rest import RestWatch
from fastswing_planner.execution.settings import ExecutionSettings, Phase
from fastswing_planner.planning.holding import Holding
from fastswing_planner.planning.request import Method
from fastswing_planner.robot.muscle_model import MuscleModel

_SWING = Phase.SWING  # looking a member up in its enumeration takes half a microsecond


@dataclass(frozen=True)
class PreparedSwing:
    """What the executor needs of a plan; vectors of shape (n,) or (m,)."""

    method: Method
    start: Vector
    end: Vector
    elongation: Vector
    holding_tension: Vector
    final_tension: Vector


@dataclass(frozen=True)
class Orders:
    """What has to be done now.

    lengths  [m] length command for all muscles, shape (m,); None: nothing new
    arm      arm the inhibitor; report with `SwingExecution.inhibitor_armed`
    disarm   disarm the inhibitor
    """

    lengths: Vector | None = None
    arm: bool = False
    disarm: bool = False


def refuse_muscles(muscles: MuscleMeasurement, holds: int, inhibiting: bool = False) -> None:
    """Raise SwingAborted if muscles do not do what length commands tell them.

    holds       of the measurement when the swing was asked for
    inhibiting  some muscles may be at zero current
    """
    if muscles.faulty:
        raise FaultLatched(
            f"faulty muscles: {', '.join(muscles.faulty)}; find the cause, then clear_faults",
        )
    # Only Method 1 lets muscles go, and never all of them.
    if muscles.limp and not (inhibiting and len(muscles.limp) < muscles.length.size):
        raise FaultLatched(
            f"muscles at zero current: {', '.join(muscles.limp)}; an emergency stop or "
            "somebody's current_override holds them",
        )
    if muscles.holds != holds:
        raise Interrupted("somebody held the arm, by hold_posture or clear_faults")
    if muscles.driven:
        raise Interrupted(
            f"muscles that follow somebody's tension or current: {', '.join(muscles.driven)}",
        )


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
        self._inhibition_lost = ""
        self._inhibition_heard = -math.inf
        self._inhibition_over = False  # it reached the goal
        self._armed = False
        self._arm_asked_at = math.inf  # [s]
        self._over = False
        self._done = False
        refuse_muscles(muscles, self._holds)
        self._raise: PosturePath = posture_path(
            model, hold, wire_stiffness, joints.position, swing.start, settings.raise_speed
        )
        self._prepared_lengths = frozen(
            encoder_lengths(model, wire_stiffness, swing.start, swing.holding_tension)
            + swing.elongation
        )
        self._end_lengths = encoder_lengths(model, wire_stiffness, swing.end, swing.final_tension)
        self._change = self._prepared_lengths - self._raise.lengths[-1]
        # For every method: the tensions of the raised arm move to those of the plan.
        self._elongate_time = max(float(np.abs(self._change).max()) / settings.elongate_speed, 0.1)
        self._refuse_long_phases()
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
        self._armed = True

    def add_inhibition(self, report: InhibitionReport) -> None:
        """Take a report of the inhibitor; if it ended before the goal, the swing has to stop."""
        # The middleware repeats what was lost: the end of an earlier swing may arrive in this one.
        if report.time < self._arm_asked_at:
            return
        if report.armed:
            self._inhibition_heard = max(self._inhibition_heard, report.time)
        elif report.reached:
            self._inhibition_over = self._armed
        elif self._armed and not self._arrived and self._phase is not Phase.RECOVER:
            self._inhibition_lost = report.reason

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

    def stop(self) -> Orders:
        """End the swing wherever the arm is; return the orders that hold the measured lengths."""
        self._over = True
        return Orders(lengths=self._muscles.length, disarm=True)

    def step(self, now: float) -> Orders:
        """Return what has to be done at time `now` [s]; nothing once the swing has ended.

        Raises SwingAborted when the swing cannot go on; `stop` then holds the arm.
        """
        if self._over:
            return Orders()
        try:
            self._refuse_to_go_on(now)
            return self._handlers[self._phase](now, now - self._phase_start)
        except SwingAborted:
            self._over = True
            raise

    def _refuse_to_go_on(self, now: float) -> None:
        refuse_muscles(self._muscles, self._holds, self._arm_asked_at < math.inf)
        if self._interruption:
            raise Interrupted(self._interruption)
        if self._inhibition_lost:
            raise SwingNotReady(f"the inhibitor disarmed itself: {self._inhibition_lost}")
        age = self.age(now)
        if age > self._settings.state_timeout:
            raise SwingStateStale(f"the last measurements are {age:.2f} s old")
        if self._last_step is None:
            self._phase_start = now
        elif now - self._last_step > self._settings.state_timeout:
            # Going on would jump to where the arm should be by now.
            stall = now - self._last_step
            raise SwingStateStale(f"the executor did not run for {stall:.2f} s")
        self._last_step = now

    def _refuse_long_phases(self) -> None:
        settings = self._settings
        if self._raise.duration > settings.raise_limit:
            raise PhaseTimeout(
                f"the way to the start posture would take {self._raise.duration:.1f} s at "
                f"{settings.raise_speed:g} rad/s, raise_limit is {settings.raise_limit:g} s",
            )
        if self._elongate_time > settings.elongate_limit:
            raise PhaseTimeout(
                f"paying out would take {self._elongate_time:.1f} s at "
                f"{settings.elongate_speed:g} m/s, elongate_limit is "
                f"{settings.elongate_limit:g} s",
            )

    def _enter(self, phase: Phase, now: float) -> None:
        self._phase = phase
        self._phase_start = now

    @property
    def _distance_to_start(self) -> float:
        return math.dist(self._start, self._joints.position.tolist())

    @property
    def _arrived(self) -> bool:
        return self._measurement is not None and self._measurement.arrived

    def _near_end(self) -> bool:
        return self.distance_to_end < self._settings.arrival_tolerance

    def _step_raise(self, now: float, elapsed: float) -> Orders:
        if elapsed >= self._raise.duration:
            # Paying out is for the start posture: an arm that did not come there stays as it is.
            if self._distance_to_start < self._settings.start_tolerance:
                self._enter(Phase.ELONGATE, now)
            elif elapsed > self._settings.raise_limit:
                raise self._not_at_start("come")
        return Orders(lengths=self._raise.at(elapsed))

    def _step_elongate(self, now: float, elapsed: float) -> Orders:
        if elapsed >= self._elongate_time:
            self._enter(Phase.SETTLE, now)
        share = smooth_fraction(elapsed, self._elongate_time)
        return Orders(lengths=frozen(self._raise.lengths[-1] + share * self._change))

    def _not_at_start(self, verb: str) -> NotAtStart:
        return NotAtStart(
            f"the arm is {self._distance_to_start:.3f} rad from the start posture and must {verb} "
            f"within {self._settings.start_tolerance:g} rad of it",
        )

    def _step_settle(self, now: float, elapsed: float) -> Orders:
        near = self._distance_to_start < self._settings.start_tolerance
        ready = near and self._rest.resting(now)
        if ready and (self._armed or not self._swing.method.inhibits):
            return self._start_swing(now)
        if elapsed > self._settings.settle_limit:
            if ready:
                raise SwingNotReady("the inhibitor did not confirm that it is armed")
            raise self._not_at_start("rest")
        if ready and self._arm_asked_at == math.inf:
            self._arm_asked_at = now
            return Orders(arm=True)
        return Orders()

    def _start_swing(self, now: float) -> Orders:
        self._enter(Phase.SWING, now)
        self._measurement = SwingMeasurement(
            self._joints.position.size, self._muscles.length.size, now
        )
        # "Starting from theta_start, we sent the muscle length achieving theta_end for 0 seconds"
        # (section IV-B of the paper).
        return Orders(lengths=self._end_lengths)

    def _step_swing(self, now: float, elapsed: float) -> Orders:
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
            return Orders(lengths=self._end_lengths, disarm=True)
        return Orders()

    def _refuse_silent_inhibitor(self) -> None:
        if not self._swing.method.inhibits or self._inhibition_over or self._arrived:
            return
        # It decides when a joint state comes, so it may be silent as long as none does.
        silence = self._joints.time - max(self._inhibition_heard, self._phase_start)
        if silence > self._settings.state_timeout:
            raise SwingNotReady(f"the inhibitor has been silent for {silence:.2f} s")

    def _step_recover(self, now: float, elapsed: float) -> Orders:
        if elapsed < self._settings.recover_time:
            return Orders()
        if self._near_end() and self._rest.resting(now):
            self._done = self._over = True
        elif elapsed > self._settings.recover_limit:
            raise PhaseTimeout(
                f"the arm does not rest within {self._settings.arrival_tolerance:g} rad of the end "
                f"posture {self._settings.recover_limit:g} s after the swing; it is "
                f"{self.distance_to_end:.3f} rad away",
            )
        return Orders()
