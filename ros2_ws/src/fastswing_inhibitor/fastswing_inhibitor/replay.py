"""Makes the inhibitor's decisions again from a bag, with the very rule that the node runs.

The rule is fed the joint states that the inhibitor decided on, which their stamps tell. What ended
a swing from outside, such as the service or the clock, ends it here as it was published.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fastswing_inhibitor.inhibition import Arming, Decision, Inhibition, InhibitionSettings, Reason
from fastswing_planner.arrays import BoolVector, Vector, frozen
from fastswing_planner.bag import Bag
from fastswing_planner.bag_errors import BagError
from fastswing_planner.errors import PlannerError
from fastswing_planner.muscle_model import MuscleModel
from fastswing_planner.swing_execution import JointMeasurement

STATUS_TYPE = "fastswing_msgs/msg/InhibitionStatus"
OVERRIDE_TYPE = "fastswing_msgs/msg/CurrentOverride"
PLAN_TYPE = "fastswing_msgs/msg/SwingPlan"
JOINT_TYPE = "sensor_msgs/msg/JointState"

_BY_RULE = (Reason.GOAL_REACHED, Reason.STATE_JUMP, Reason.REVERSED, Reason.STALE_STATE)
"""Ends that follow from the joint states themselves."""


class UnusableForReplay(BagError):
    """A bag without what a replay needs."""


@dataclass(frozen=True)
class WhatIf:
    """What to change; None: as published.

    threshold       C [s/rad]
    velocity_limit  [m/s] of every muscle
    """

    threshold: float | None = None
    velocity_limit: float | None = None


@dataclass(frozen=True)
class Compared:
    """One decision, published and replayed.

    stamp_ns       of the joint state
    published      q [s/rad] (NaN: not evaluated) and what was inhibited, in the model's order
    replayed       by the rule; None if its joint state is not in the bag
    difference     in words; empty if both are equal, q bit for bit
    """

    stamp_ns: int
    published: Decision
    replayed: Decision | None
    difference: str


@dataclass(frozen=True)
class ReplayedSwing:
    """One armed time.

    start_ns   [ns] stamp of the arming, or of the first decision if that is not in the bag
    threshold  C [s/rad] as published
    protected  muscles that were above C and never inhibited: the request's kept_muscle
    decisions  in the order of publishing
    end        why it was over as published; None if the bag ends before
    rejected   joint states that the inhibitor could not use
    complaint  why it could not be replayed; empty if it was
    """

    start_ns: int
    threshold: float
    protected: tuple[str, ...]
    decisions: tuple[Compared, ...]
    end: Reason | None
    rejected: int
    complaint: str = ""

    @property
    def agreed(self) -> int:
        """Decisions that were replayed as published."""
        return sum(not one.difference for one in self.decisions)

    @property
    def first_difference(self) -> Compared | None:
        """The first decision that differs."""
        return next((one for one in self.decisions if one.difference), None)


@dataclass(frozen=True)
class Replay:
    """All armed times of a bag.

    muscle_names         of the model
    override_differences lines about overrides that are not what the status of their stamp says
    """

    muscle_names: tuple[str, ...]
    swings: tuple[ReplayedSwing, ...]
    override_differences: tuple[str, ...]

    @property
    def agrees(self) -> bool:
        """Whether every decision was replayed as it was published."""
        return not self.override_differences and all(
            not swing.complaint and swing.agreed == len(swing.decisions) for swing in self.swings
        )


@dataclass(frozen=True)
class _Status:
    """One published status in the model's order of muscles."""

    stamp_ns: int
    log_ns: int
    armed: bool
    threshold: float
    decision: Decision
    decisions: int
    rejected: int


def replay(
    bag: Bag,
    model: MuscleModel,
    velocity_limit: Vector,
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
    joints = _joint_states(bag, model, prefix)
    statuses = list(_statuses(bag, model, prefix))
    goals = list(_goals(bag, model, prefix))
    rule = _Rule(model, velocity_limit, settings or InhibitionSettings(), what_if)
    swings = [
        rule.replayed(part, joints, _goal_at(goals, part[0].log_ns)) for part in _armings(statuses)
    ]
    return Replay(
        tuple(model.muscle_names),
        tuple(swings),
        tuple(_override_differences(bag, model, statuses, prefix)),
    )


class _Rule:
    """The inhibitor's rule with one robot."""

    def __init__(
        self,
        model: MuscleModel,
        velocity_limit: Vector,
        settings: InhibitionSettings,
        what_if: WhatIf,
    ) -> None:
        self._model = model
        self._velocity_limit = velocity_limit
        self._settings = settings
        self._what_if = what_if

    def replayed(
        self,
        statuses: Sequence[_Status],
        joints: Mapping[int, tuple[Vector, Vector]],
        goal: Vector | None,
    ) -> ReplayedSwing:
        """Return one armed time decided again."""
        first = statuses[0]
        decided = [status for status in statuses if status.decisions or not status.armed]
        protected = _protected(statuses)
        swing = ReplayedSwing(
            first.stamp_ns,
            first.threshold,
            tuple(np.array(self._model.muscle_names)[protected]),
            (),
            None if statuses[-1].armed else statuses[-1].decision.reason,
            statuses[-1].rejected,
        )
        if goal is None:
            return replace(swing, complaint="no plan before it, so its goal is not known")
        threshold = self._what_if.threshold
        inhibition = Inhibition(self._model, self._velocity_limit, self._settings)
        inhibition.see(0.0)
        inhibition.arm(
            Arming(
                goal, first.threshold if threshold is None else threshold, protected, np.inf, 0.0
            )
        )
        return replace(
            swing, decisions=tuple(self._compared(inhibition, decided, joints, first.stamp_ns))
        )

    def _compared(
        self,
        inhibition: Inhibition,
        statuses: Sequence[_Status],
        joints: Mapping[int, tuple[Vector, Vector]],
        start_ns: int,
    ) -> Iterator[Compared]:
        for status in statuses:
            state = joints.get(status.stamp_ns)
            published = status.decision
            if not status.armed and (published.reason not in _BY_RULE or state is None):
                return  # ended from outside: by the service, or by a clock
            if state is None:
                text = "its joint state is not in the bag"
                yield Compared(status.stamp_ns, published, None, text)
                continue
            time = (status.stamp_ns - start_ns) * 1e-9
            try:
                made = inhibition.decide(JointMeasurement(time, *state))
            except PlannerError as error:
                yield Compared(status.stamp_ns, published, None, str(error))
                continue
            yield Compared(
                status.stamp_ns,
                published,
                made,
                _difference(self._model.muscle_names, published, made),
            )


def _difference(names: Sequence[str], published: Decision, made: Decision) -> str:
    """Say in words what differs between two decisions; empty if nothing does."""
    if published.reason is not made.reason:
        stale = made.reason is Reason.STALE_STATE
        hint = ": is state_timeout the node's?" if stale else ""
        return f"published {_reason(published.reason)}, replayed {_reason(made.reason)}{hint}"
    if published.direction_from_goal != made.direction_from_goal:
        which = {True: "to the goal", False: "of motion"}
        return (
            f"published q along the direction {which[published.direction_from_goal]}, replayed "
            f"along that {which[made.direction_from_goal]}: is velocity_threshold the node's?"
        )
    other = np.flatnonzero(published.inhibited != made.inhibited)
    unequal = published.speed_index.view(np.int64) != made.speed_index.view(np.int64)
    unequal &= ~(np.isnan(published.speed_index) & np.isnan(made.speed_index))
    if unequal.any():
        gap = np.abs(published.speed_index - made.speed_index)
        at = int(np.nanargmax(np.where(unequal, gap, -1.0)))
        text = (
            f"q of {names[at]} published {float(published.speed_index[at])!r} s/rad, replayed "
            f"{float(made.speed_index[at])!r}"
        )
        return text + (f"; inhibited differ: {_listed(names, other)}" if other.size else "")
    if other.size:
        return f"same q, but inhibited differ: {_listed(names, other)}"
    return ""


def _listed(names: Sequence[str], places: Any) -> str:
    return ", ".join(names[place] for place in places)


def _reason(reason: Reason) -> str:
    return "a decision" if reason is Reason.NONE else f"the end {reason.name}"


def _protected(statuses: Sequence[_Status]) -> BoolVector:
    """Return the muscles that were above C in some decision and inhibited in none."""
    above = np.array([s.decision.speed_index > s.threshold for s in statuses if s.armed])
    inhibited = np.array([s.decision.inhibited for s in statuses if s.armed])
    return np.asarray(above.any(axis=0) & ~inhibited.any(axis=0))


def _armings(statuses: Sequence[_Status]) -> Iterator[list[_Status]]:
    """Yield the statuses of each armed time, from the arming to the end."""
    part: list[_Status] = []
    for status in statuses:
        if status.armed and part and status.decisions == 0:
            yield part
            part = []
        if status.armed or part:
            part.append(status)
        if part and not status.armed:
            yield part
            part = []
    if part:
        yield part


def _topic(bag: Bag, type_name: str, prefix: str) -> str:
    names = [name for name in bag.topics_of_type(type_name) if name.startswith(prefix)]
    if not names:
        where = f" below {prefix}" if prefix else ""
        raise UnusableForReplay(f"nothing to replay: no messages of type {type_name}{where}")
    if len(names) > 1:
        raise UnusableForReplay(
            f"more than one topic of type {type_name}: {', '.join(names)}; choose with --prefix"
        )
    return names[0]


def _order(what: str, names: Sequence[str], wanted: Sequence[str]) -> list[int]:
    missing = [name for name in wanted if name not in names]
    if missing:
        raise UnusableForReplay(
            f"{what} of the model are not in the bag: {', '.join(missing)}; it has: "
            f"{', '.join(names)}. Choose the robot with --model"
        )
    return [list(names).index(name) for name in wanted]


def _joint_states(bag: Bag, model: MuscleModel, prefix: str) -> dict[int, tuple[Vector, Vector]]:
    """Return position [rad] and velocity [rad/s] in the model's order, by stamp [ns]."""
    topic = _topic(bag, JOINT_TYPE, prefix)
    found: dict[int, tuple[Vector, Vector]] = {}
    for part in bag.stream(topic, "header", ["name", "position", "velocity"]):
        order = _order("joints", part.names(), model.joint_names)
        if part["velocity"].shape != part["position"].shape:
            raise UnusableForReplay(f"{topic} has no velocities")
        position, velocity = part["position"][:, order], part["velocity"][:, order]
        for stamp, at, rate in zip(part.time_ns.tolist(), position, velocity, strict=True):
            found[stamp] = (frozen(at), frozen(rate))
    return found


def _statuses(bag: Bag, model: MuscleModel, prefix: str) -> Iterator[_Status]:
    fields = ["armed", "reason", "threshold", "name", "speed_index", "inhibited"]
    fields += ["direction_from_goal", "decisions", "rejected"]
    topic = _topic(bag, STATUS_TYPE, prefix)
    known = [field for field in fields if field in bag.fields(topic)]
    for part in bag.stream(topic, "header", known):
        order = _order("muscles", part.names(), model.muscle_names)
        rejected = part["rejected"] if "rejected" in part else np.zeros(part.count, dtype=int)
        for row in range(part.count):
            chosen = set(part["inhibited"][row])
            decision = Decision(
                np.array([name in chosen for name in model.muscle_names]),
                frozen(part["speed_index"][row][order]),
                bool(part["direction_from_goal"][row]),
                Reason(int(part["reason"][row])),
            )
            yield _Status(
                int(part.time_ns[row]),
                int(part.log_time_ns[row]),
                bool(part["armed"][row]),
                float(part["threshold"][row]),
                decision,
                int(part["decisions"][row]),
                int(rejected[row]),
            )


def _goals(bag: Bag, model: MuscleModel, prefix: str) -> Iterator[tuple[int, Vector]]:
    """Yield log time [ns] and goal [rad] of each plan."""
    for topic in bag.topics_of_type(PLAN_TYPE):
        if topic.startswith(prefix):
            for log_ns, plan in bag.messages(topic):
                order = _order("joints", plan.joint_name, model.joint_names)
                yield log_ns, frozen([plan.end_position[index] for index in order])


def _goal_at(goals: Sequence[tuple[int, Vector]], time_ns: int) -> Vector | None:
    """Return the goal of the last plan before a time."""
    before = [goal for when, goal in goals if when <= time_ns]
    return before[-1] if before else None


def _override_differences(
    bag: Bag, model: MuscleModel, statuses: Sequence[_Status], prefix: str
) -> Iterator[str]:
    """Yield a line for each override that is not what the status of its stamp says."""
    said = {status.stamp_ns: status.decision.inhibited for status in statuses}
    names = np.array(model.muscle_names)
    for topic in bag.topics_of_type(OVERRIDE_TYPE):
        if not topic.startswith(prefix):
            continue
        for part in bag.stream(topic, "header", ["name"]):
            for stamp, chosen in zip(part.time_ns.tolist(), part["name"], strict=True):
                if stamp in said and set(chosen) != set(names[said[stamp]]):
                    yield (
                        f"the override of stamp {stamp} ns names {', '.join(chosen) or 'nothing'}, "
                        f"its status {', '.join(names[said[stamp]]) or 'nothing'}"
                    )
