"""Carries out one planned swing: raise, elongate, settle, swing, recover.

A state machine without clock or I/O: measurements and time come in, orders go out.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from fastswing_planner.arrays import Vector, frozen
from fastswing_planner.errors import SwingAborted
from fastswing_planner.figures import SwingFigures, SwingMeasurement
from fastswing_planner.holding import Holding
from fastswing_planner.muscle_model import MuscleModel
from fastswing_planner.posture import PosturePath, encoder_lengths, posture_path, smooth_fraction
from fastswing_planner.request import Method


class Phase(IntEnum):
    """Where a swing is; the values are those of `fastswing_msgs/ExecuteSwing`'s feedback."""

    PLAN = 0
    RAISE = 1
    ELONGATE = 2
    SETTLE = 3
    SWING = 4
    RECOVER = 5


_SWING = Phase.SWING  # looking a member up in its enumeration takes half a microsecond


@dataclass(frozen=True)
class ExecutionSettings:
    """How carefully a swing is carried out; all positive.

    raise_speed      [rad/s] largest joint speed on the way to the start posture
    elongate_speed   [m/s] of paying out and of moving tension between muscles
    start_tolerance  [rad] norm of the distance to the start posture from which a swing may begin
    rest_speed       [rad/s] the arm rests below it
    rest_time        [s] for which it must rest
    arrival_tolerance [rad] norm of the distance to the end posture that counts as arrived
    phase_limit      [s] longest time of a phase beyond its planned duration
    swing_limit      [s] longest swing
    recover_time     [s] the end posture is held before the swing is done
    state_timeout    [s] older measurements stop the swing
    """

    raise_speed: float = 0.8
    elongate_speed: float = 0.08
    start_tolerance: float = 0.08
    rest_speed: float = 0.15
    rest_time: float = 0.2
    arrival_tolerance: float = 0.1
    phase_limit: float = 5.0
    swing_limit: float = 3.0
    recover_time: float = 0.5
    state_timeout: float = 0.2


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


class JointMeasurement(NamedTuple):
    """time [s]; position [rad] and velocity [rad/s], shape (n,)."""

    time: float
    position: Vector
    velocity: Vector


class MuscleMeasurement(NamedTuple):
    """One muscle state; vectors of shape (m,).

    time              [s]
    length, velocity  [m], [m/s]
    tension           [N]
    faulty            names of muscles with a latched fault
    limp              names of muscles at zero current
    """

    time: float
    length: Vector
    velocity: Vector
    tension: Vector
    faulty: tuple[str, ...] = ()
    limp: tuple[str, ...] = ()


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
    ) -> None:
        """Plan the way to the start posture from where the arm is.

        Raises HoldingInfeasible if a posture on the way cannot be held, SwingAborted if a muscle
        is faulty.
        """
        self._swing = swing
        self._settings = settings
        self._joints = joints
        self._muscles = muscles
        self._refuse_faults(muscles)
        self._phase = Phase.RAISE
        self._phase_start = joints.time
        self._rest_since: float | None = None
        self._raise: PosturePath = posture_path(
            model, hold, wire_stiffness, joints.position, swing.start, settings.raise_speed
        )
        self._prepared_lengths = frozen(
            encoder_lengths(model, wire_stiffness, swing.start, swing.holding_tension)
            + swing.elongation
        )
        self._end_lengths = encoder_lengths(model, wire_stiffness, swing.end, swing.final_tension)
        self._measurement: SwingMeasurement | None = None
        self._armed = False
        self._arm_asked = False
        self._inhibition_lost = ""
        self._done = False
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
        return math.dist(self._swing.end, self._joints.position)

    def inhibitor_armed(self) -> None:
        """Take note that the inhibitor is armed."""
        self._armed = True

    def inhibitor_lost(self, reason: str) -> None:
        """Take note that the inhibitor ended before the goal; a swing then has to stop."""
        arrived = self._measurement is not None and self._measurement.arrived
        if self._armed and not arrived and self._phase is not Phase.RECOVER:
            self._inhibition_lost = reason

    def add_joints(self, joints: JointMeasurement) -> None:
        """Take a joint state."""
        self._joints = joints
        if self._phase is _SWING and self._measurement is not None:
            self._measurement.add_joints(
                joints.time, joints.velocity, self.distance_to_end, self._settings.arrival_tolerance
            )
        # Plain numbers: for a few joints they are faster than numpy. NaN does not rest.
        slowest = self._settings.rest_speed
        if not all(abs(speed) <= slowest for speed in joints.velocity.tolist()):
            self._rest_since = None
        elif self._rest_since is None:
            self._rest_since = joints.time

    def add_muscles(self, muscles: MuscleMeasurement) -> None:
        """Take a muscle state."""
        self._muscles = muscles
        if self._phase is _SWING and self._measurement is not None:
            self._measurement.add_muscles(muscles.velocity, muscles.tension)

    def holding_orders(self) -> Orders:
        """Return the orders that end the swing wherever the arm is: hold the measured lengths."""
        return Orders(lengths=self._muscles.length, disarm=True)

    def step(self, now: float) -> Orders:
        """Return what has to be done at time `now` [s].

        Raises SwingAborted when the swing cannot go on; `holding_orders` then stop the arm.
        """
        self._refuse_faults(self._muscles)
        self._refuse_limp(self._muscles)
        if self._inhibition_lost:
            raise SwingAborted(
                "NOT_READY", f"the inhibitor disarmed itself: {self._inhibition_lost}"
            )
        age = now - min(self._joints.time, self._muscles.time)
        if age > self._settings.state_timeout:
            raise SwingAborted("STALE_STATE", f"the last measurements are {age:.2f} s old")
        return self._handlers[self._phase](now, now - self._phase_start)

    def _refuse_faults(self, muscles: MuscleMeasurement) -> None:
        if muscles.faulty:
            raise SwingAborted(
                "FAULT_LATCHED",
                f"faulty muscles: {', '.join(muscles.faulty)}; find the cause, then clear_faults",
            )

    def _refuse_limp(self, muscles: MuscleMeasurement) -> None:
        # Only Method 1 lets muscles go, and never all of them.
        inhibiting = self._arm_asked and len(muscles.limp) < muscles.length.size
        if muscles.limp and not inhibiting:
            raise SwingAborted(
                "FAULT_LATCHED",
                f"muscles at zero current: {', '.join(muscles.limp)}; an emergency stop or "
                "somebody's current_override holds them",
            )

    def _enter(self, phase: Phase, now: float) -> None:
        self._phase = phase
        self._phase_start = now

    def _resting(self, now: float) -> bool:
        return self._rest_since is not None and now - self._rest_since >= self._settings.rest_time

    def _step_raise(self, now: float, elapsed: float) -> Orders:
        if elapsed >= self._raise.duration:
            self._enter(Phase.ELONGATE, now)
        return Orders(lengths=self._raise.at(elapsed))

    def _step_elongate(self, now: float, elapsed: float) -> Orders:
        # For every method: the tensions of the raised arm move to those of the plan.
        raised = self._raise.lengths[-1]
        change = self._prepared_lengths - raised
        duration = max(float(np.abs(change).max()) / self._settings.elongate_speed, 0.1)
        if elapsed >= duration:
            self._enter(Phase.SETTLE, now)
        return Orders(lengths=frozen(raised + smooth_fraction(elapsed, duration) * change))

    def _step_settle(self, now: float, elapsed: float) -> Orders:
        distance = math.dist(self._swing.start, self._joints.position)
        ready = distance < self._settings.start_tolerance and self._resting(now)
        if ready and (self._armed or not self._swing.method.inhibits):
            return self._start_swing(now)
        if elapsed > self._settings.phase_limit:
            if ready:
                raise SwingAborted("NOT_READY", "the inhibitor did not confirm that it is armed")
            raise SwingAborted(
                "NOT_AT_START",
                f"the arm is {distance:.3f} rad from the start posture and must rest within "
                f"{self._settings.start_tolerance:g} rad of it",
            )
        if ready and not self._arm_asked:
            self._arm_asked = True
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
        arrived = self._measurement is not None and self._measurement.arrived
        if (arrived and self._resting(now)) or elapsed > self._settings.swing_limit:
            self._enter(Phase.RECOVER, now)
            return Orders(lengths=self._end_lengths, disarm=True)
        return Orders()

    def _step_recover(self, now: float, elapsed: float) -> Orders:
        if elapsed < self._settings.recover_time:
            return Orders()
        self._done = True
        if self._measurement is None or not self._measurement.arrived:
            raise SwingAborted(
                "PHASE_TIMEOUT",
                f"the arm did not come within {self._settings.arrival_tolerance:g} rad of the end "
                f"posture in {self._settings.swing_limit:g} s; it is {self.distance_to_end:.3f} "
                "rad away",
            )
        return Orders()
