"""The inhibition rule and the conditions that end it; without clock or I/O.

It runs a thousand times a second on a core that has just woken, where each function of numpy
costs several times what plain numbers do: there are none here but those of the arming.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from operator import gt, mul
from typing import NamedTuple

import numpy as np

from fastswing_planner.arrays import BoolVector, Vector
from fastswing_planner.errors import NotReady, OutOfRange, StaleState
from fastswing_planner.planning.speed_index import (
    greatest_moment_arm,
    plain_speed_index,
    unit_direction,
)
from fastswing_planner.robot.muscle_model import MuscleModel


class Reason(IntEnum):
    """Why the inhibitor is not armed; the values are those of InhibitionStatus."""

    NONE = 0
    NEVER_ARMED = 1
    DISARMED = 2
    GOAL_REACHED = 3
    TIME_LIMIT = 4
    STALE_STATE = 5
    STATE_JUMP = 6
    REVERSED = 7
    DEACTIVATED = 8


@dataclass(frozen=True)
class InhibitionSettings:
    """When a swing is over; all positive.

    velocity_threshold  [rad/s] norm of theta_dot below which the direction to the goal is used
    reversal_speed      [rad/s] speed against the way from start to goal that ends it
    state_timeout       [s] age of the joint state that ends it
    lease               [s] of an override, from the joint state's stamp; older ones decide nothing
    goal_tolerance      [rad] norm of the distance to the goal that counts as reached
    max_joint_speed     [rad/s] a joint that moved faster between two states has jumped, a state
                        that tells a higher speed decides nothing
    jump_tolerance      [rad] allowance for late messages in that comparison
    """

    velocity_threshold: float = 0.1
    reversal_speed: float = 0.3
    state_timeout: float = 0.05
    lease: float = 0.05
    goal_tolerance: float = 0.05
    max_joint_speed: float = 20.0
    jump_tolerance: float = 0.1


class JointNumbers(NamedTuple):
    """A joint state as plain numbers: time [s]; position [rad], velocity [rad/s] of n joints."""

    time: float
    position: Sequence[float]
    velocity: Sequence[float]


class Decision(NamedTuple):
    """What to inhibit now.

    inhibited            of m muscles; none once the swing is over
    moment_arm           r [m/rad] of m muscles; NaN if not evaluated
    direction_from_goal  the arm was too slow for its own direction
    reason               NONE while armed
    """

    inhibited: tuple[bool, ...]
    moment_arm: Sequence[float]
    direction_from_goal: bool
    reason: Reason


@dataclass(frozen=True)
class Arming:
    """One armed swing.

    goal        [rad] shape (n,)
    threshold   C [s/rad]
    protected   muscles that are never inhibited, shape (m,)
    time_limit  [s]
    start_time  [s]
    """

    goal: Vector
    threshold: float
    protected: BoolVector
    time_limit: float
    start_time: float


class Inhibition:
    """One decision for each joint state, while armed.

    longest_lapse  [s] for which a lease was over before the next decision: muscles came back
    """

    def __init__(
        self, model: MuscleModel, velocity_limit: Vector, settings: InhibitionSettings
    ) -> None:
        """Start disarmed."""
        self._model = model
        self._velocity_limit = velocity_limit
        self._plain_limit: list[float] = velocity_limit.tolist()
        self._settings = settings
        self._oldest = min(settings.state_timeout, settings.lease)
        self._arming: Arming | None = None
        self._greatest_arms: list[float] = []
        self._goal: list[float] = []
        self._last: JointNumbers | None = None
        self._way: list[float] = []
        self._goal_on_way = 0.0
        self._reversal = 0.0
        self._seen = -math.inf
        self.reason = Reason.NEVER_ARMED
        self.decisions = 0
        self.rejected = 0
        self.longest_lapse = 0.0

    @property
    def armed(self) -> bool:
        """Whether a swing is armed."""
        return self._arming is not None

    @property
    def threshold(self) -> float:
        """C [s/rad] of the armed swing; NaN if not armed."""
        return math.nan if self._arming is None else self._arming.threshold

    def see(self, time: float) -> None:
        """Take note of a joint state of that time [s]: they come."""
        # One that was long on its way may come behind a newer one.
        self._seen = max(time, self._seen)

    def arm(self, arming: Arming) -> None:
        """Begin a swing with the next joint state; raises NotReady or StaleState if none come."""
        if self._seen == -math.inf:
            raise NotReady("no joint state yet: is the bridge active, do its boards answer?")
        age, allowed = arming.start_time - self._seen, self._settings.state_timeout
        if age > allowed:
            raise StaleState(
                f"the last joint state is {age:.3f} s old, at most {allowed:g} s: is the bridge "
                "active?"
            )
        # First, so that what is not one value per muscle raises here and arms nothing.
        greatest = greatest_moment_arm(arming.threshold, self._velocity_limit)
        greatest[arming.protected] = np.inf
        self._greatest_arms = greatest.tolist()
        self._arming = arming
        self._goal = arming.goal.tolist()
        self._last = None
        self.reason = Reason.NONE
        self.decisions = 0
        self.rejected = 0
        self.longest_lapse = 0.0

    def disarm(self, reason: Reason) -> None:
        """End the swing; the first reason stays."""
        if self._arming is not None:
            self._arming = None
            self.reason = reason

    def watch(self, now: float) -> None:
        """End the swing at its time limit or when joint states stopped; call it often."""
        if self._arming is None:
            return
        newest = self._arming.start_time if self._last is None else self._last.time
        if now - self._arming.start_time > self._arming.time_limit:
            self.disarm(Reason.TIME_LIMIT)
        elif now - newest > self._settings.state_timeout:
            self.disarm(Reason.STALE_STATE)

    def reject(self, now: float) -> None:
        """Take note of a joint state that cannot be used; too many of them are a silence."""
        if self._arming is not None:
            self.rejected += 1
        self.watch(now)

    def decide(self, joints: JointNumbers, now: float | None = None) -> Decision:
        """Return what to inhibit at this joint state; ends the swing where it has to end.

        now  [s] on the clock of `joints.time`; None: the state was measured just now

        Raises StaleState for a state that is too old to decide on, OutOfRange for one with a speed
        that no joint has; `reject` it then.
        """
        time, position, velocity = joints
        now = time if now is None else now
        self.watch(now)
        arming, settings = self._arming, self._settings
        if arming is None:
            return self.nothing()
        age = now - time
        if age > self._oldest:
            raise StaleState(f"a joint state is {age:.3f} s old, at most {self._oldest:g} s")
        speed = math.hypot(*velocity)
        # No joint is faster than all together are.
        if speed > settings.max_joint_speed:
            self._refuse_absurd_speed(velocity)
        if self._last is None:
            self._set_out(position)
        end = self._end_reason(joints)
        if self._last is not None:
            lapse = now - self._last.time - settings.lease
            self.longest_lapse = max(self.longest_lapse, lapse)
        self._last = joints
        self.see(time)
        if end is not Reason.NONE:
            self.disarm(end)
            return self.nothing()
        self.decisions += 1
        slow = speed < settings.velocity_threshold
        # At rest theta_dot / |theta_dot| is noise: the direction to the goal takes its place.
        direction = _difference(self._goal, position) if slow else velocity
        norm = math.hypot(*direction) if slow else speed
        # r = G(theta) theta_dot / |theta_dot|_2  (eq. 3 of the paper)
        moment_arm = self._model.muscle_velocity(position, unit_direction(direction, norm))
        # o[i] = 0 if q[i] > C  (eq. 5 of the paper): where r[i] is above the greatest one that
        # q[i] allows. So q itself is worked out when the override is on its way.
        inhibited = tuple(map(gt, moment_arm, self._greatest_arms))
        return Decision(inhibited, moment_arm, slow, Reason.NONE)

    def speed_index(self, decision: Decision) -> tuple[float, ...]:
        """Return q [s/rad] of the m muscles at a decision; NaN if not evaluated."""
        return plain_speed_index(decision.moment_arm, self._plain_limit)

    def _refuse_absurd_speed(self, velocity: Sequence[float]) -> None:
        fastest, allowed = max(map(abs, velocity)), self._settings.max_joint_speed
        if fastest > allowed:
            raise OutOfRange(f"a joint's speed is {fastest:g} rad/s, at most {allowed:g} rad/s")

    def nothing(self) -> Decision:
        """Return the decision that inhibits nothing, with the reason of the last end."""
        count = len(self._plain_limit)
        return Decision((False,) * count, (math.nan,) * count, False, self.reason)

    def _set_out(self, start: Sequence[float]) -> None:
        """Take the way to the goal from where the arm is first seen."""
        self._way = _difference(self._goal, start)
        self._goal_on_way = _dot(self._goal, self._way)
        self._reversal = self._settings.reversal_speed * math.hypot(*self._way)

    def _end_reason(self, joints: JointNumbers) -> Reason:
        settings, here = self._settings, joints.position
        if self._last is not None:
            elapsed = max(joints.time - self._last.time, 0.0)
            allowed = settings.max_joint_speed * elapsed + settings.jump_tolerance
            before = self._last.position
            # No joint moved farther than all together did.
            if math.dist(here, before) > allowed and _farthest(here, before) > allowed:
                return Reason.STATE_JUMP
        if math.dist(here, self._goal) < settings.goal_tolerance:
            return Reason.GOAL_REACHED
        # Passed: the projection on the way from start to goal lies beyond the goal.
        if _dot(here, self._way) >= self._goal_on_way:
            return Reason.GOAL_REACHED
        # Along the way from start to goal: on it, single joints may overshoot or turn back.
        if _dot(joints.velocity, self._way) < -self._reversal:
            return Reason.REVERSED
        return Reason.NONE


def _dot(one: Sequence[float], other: Sequence[float]) -> float:
    return sum(map(mul, one, other))


def _difference(one: Sequence[float], other: Sequence[float]) -> list[float]:
    return [a - b for a, b in zip(one, other, strict=True)]


def _farthest(here: Sequence[float], before: Sequence[float]) -> float:
    return max(map(abs, _difference(here, before)))
