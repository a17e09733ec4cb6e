"""Makes the inhibitor's decisions again from a bag, with the very rule that the node runs.

The rule is fed the joint states that the inhibitor decided on, which their stamps tell. What ended
a swing from outside, such as the service or the clock, ends it here as it was published.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from fastswing_inhibitor.inhibition import (
    Arming,
    Inhibition,
    InhibitionSettings,
    JointNumbers,
    Reason,
)
from fastswing_inhibitor.replay.difference import difference, override_differences
from fastswing_inhibitor.replay.recorded import (
    Plan,
    Status,
    armings,
    joint_states,
    plan_at,
    plans,
    statuses,
)
from fastswing_inhibitor.replay.result import Compared, Replay, ReplayedSwing, Told, WhatIf
from fastswing_planner.arrays import BoolVector, Vector, frozen
from fastswing_planner.bags import Bag
from fastswing_planner.errors import PlannerError
from fastswing_planner.robot.muscle_model import MuscleModel

_BY_RULE = (Reason.GOAL_REACHED, Reason.STATE_JUMP, Reason.REVERSED, Reason.STALE_STATE)
"""Ends that follow from the joint states themselves."""


def replay(
    bag: Bag,
    model: MuscleModel,
    velocity_limit: Vector,
    *,
    settings: InhibitionSettings | None = None,
    what_if: WhatIf | None = None,
    prefix: str = "",
) -> Replay:
    """Decide again on every joint state that the inhibitor decided on.

    velocity_limit  [m/s] shape (m,)
    prefix          namespace of the robot's topics if the bag holds more than one, '/left'

    Raises BagError if the bag lacks joint states or statuses of this robot.
    """
    what_if = what_if or WhatIf()
    if what_if.velocity_limit is not None:
        velocity_limit = frozen(np.full(velocity_limit.shape, what_if.velocity_limit))
    joints = joint_states(bag, model, prefix)
    told = list(statuses(bag, model, prefix))
    planned = list(plans(bag, model, prefix))
    rule = _Rule(model, velocity_limit, settings or InhibitionSettings(), what_if, joints)
    swings = [rule.replayed(part, plan_at(planned, part[0].log_ns)) for part in armings(told)]
    return Replay(
        tuple(model.muscle_names),
        tuple(swings),
        tuple(override_differences(bag, model, told, prefix)),
    )


class _Rule:
    """The inhibitor's rule with one robot, on the joint states of one bag."""

    def __init__(
        self,
        model: MuscleModel,
        velocity_limit: Vector,
        settings: InhibitionSettings,
        what_if: WhatIf,
        joints: Mapping[int, tuple[list[float], list[float]]],
    ) -> None:
        self._model = model
        self._velocity_limit = velocity_limit
        self._settings = settings
        self._what_if = what_if
        self._joints = joints
        self._stamps = sorted(joints)

    def replayed(self, statuses: Sequence[Status], plan: Plan | None) -> ReplayedSwing:
        """Return one armed time decided again."""
        first = statuses[0]
        swing = ReplayedSwing(
            start_ns=first.stamp_ns,
            threshold=first.threshold,
            protected=(),
            decisions=(),
            end=None if statuses[-1].armed else statuses[-1].decision.reason,
            rejected=statuses[-1].rejected,
            missing=tuple(self._missing(statuses)),
        )
        if plan is None:
            return replace(swing, complaint="no plan before it, so its goal is not known")
        protected = _never_inhibited(statuses) & plan.kept
        threshold = self._what_if.threshold
        inhibition = Inhibition(self._model, self._velocity_limit, self._settings)
        inhibition.see(0.0)
        inhibition.arm(
            Arming(
                plan.goal,
                first.threshold if threshold is None else threshold,
                protected,
                np.inf,
                0.0,
            )
        )
        return replace(
            swing,
            protected=tuple(np.array(self._model.muscle_names)[protected]),
            decisions=tuple(self._compared(inhibition, statuses)),
        )

    def _missing(self, statuses: Sequence[Status]) -> Iterator[str]:
        """Yield a line for each gap in the count of decisions, and for an end without status."""
        for before, status in pairwise(statuses):
            count = _lost_between(before, status)
            if count:
                yield f"{count} decisions after stamp {before.stamp_ns} ns are not in the bag"
        last = statuses[-1]
        silence = (self._stamps[-1] - last.stamp_ns) * 1e-9 if self._stamps else 0.0
        if last.armed and silence > self._settings.state_timeout:
            yield (
                f"no status after stamp {last.stamp_ns} ns is in the bag, though joint states go "
                f"on for {silence:.3f} s"
            )

    def _compared(self, inhibition: Inhibition, statuses: Sequence[Status]) -> Iterator[Compared]:
        start_ns = statuses[0].stamp_ns
        before: Status | None = None
        for status in statuses:
            between = self._between(before, status)
            if before is not None and _lost_between(before, status):
                for stamp_ns in between:
                    self._decided(inhibition, stamp_ns, start_ns)
            before = status
            if status.armed and not status.decisions:
                continue  # the arming
            state = self._joints.get(status.stamp_ns)
            published = status.decision
            if not status.armed and (published.reason not in _BY_RULE or state is None):
                return  # ended from outside: by the service, or by a clock
            if state is None:
                text = "its joint state is not in the bag"
                yield Compared(status.stamp_ns, published, None, text)
                continue
            made = self._decided(inhibition, status.stamp_ns, start_ns)
            if isinstance(made, str):
                yield Compared(status.stamp_ns, published, None, made)
                continue
            text = difference(self._model.muscle_names, published, made, bool(between))
            yield Compared(status.stamp_ns, published, made, text)

    def _between(self, before: Status | None, status: Status) -> list[int]:
        """Return the stamps [ns] of the joint states between those of two statuses."""
        if before is None:
            return []
        low = bisect_right(self._stamps, before.stamp_ns)
        return self._stamps[low : bisect_left(self._stamps, status.stamp_ns)]

    def _decided(self, inhibition: Inhibition, stamp_ns: int, start_ns: int) -> Told | str:
        """Return what the rule decides on a joint state, or why it cannot."""
        time = (stamp_ns - start_ns) * 1e-9
        try:
            made = inhibition.decide(JointNumbers(time, *self._joints[stamp_ns]))
        except PlannerError as error:
            return str(error)
        index = inhibition.speed_index(made)
        return Told(made.inhibited, index, made.direction_from_goal, made.reason)


def _lost_between(before: Status, status: Status) -> int:
    """Return how many decisions were counted between two statuses and are not in the bag."""
    return max(status.decisions - before.decisions - status.armed, 0)


def _never_inhibited(statuses: Sequence[Status]) -> BoolVector:
    """Return the muscles that were above C in some decision and inhibited in none."""
    above = np.array([np.greater(s.decision.speed_index, s.threshold) for s in statuses if s.armed])
    inhibited = np.array([s.decision.inhibited for s in statuses if s.armed])
    return np.asarray(above.any(axis=0) & ~inhibited.any(axis=0))
