"""What a bag holds of an inhibitor: joint states, plans, armings, decisions."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import compress
from typing import Any

import numpy as np

from fastswing_inhibitor.inhibition import Reason
from fastswing_inhibitor.replay.result import Told
from fastswing_planner.arrays import BoolVector, Vector, frozen
from fastswing_planner.bags import Bag
from fastswing_planner.bags.robot_topics import robot_topic, robot_topics
from fastswing_planner.cdr.columns import Column
from fastswing_planner.cdr.plan_fields import PlanFields
from fastswing_planner.errors import BagError, UnknownTopic, WrongLength
from fastswing_planner.robot.muscle_model import MuscleModel

STATUS_TYPE = "fastswing_msgs/msg/InhibitionStatus"
OVERRIDE_TYPE = "fastswing_msgs/msg/CurrentOverride"
PLAN_TYPE = "fastswing_msgs/msg/SwingPlan"
JOINT_TYPE = "sensor_msgs/msg/JointState"


class UnusableForReplay(BagError):
    """A bag without what a replay needs."""


@dataclass(frozen=True)
class Status:
    """One published status in the model's order of muscles."""

    stamp_ns: int
    log_ns: int
    armed: bool
    threshold: float
    decision: Told
    decisions: int
    rejected: int


@dataclass(frozen=True)
class Plan:
    """What a plan in the bag says.

    goal  [rad] in the model's order
    kept  muscles that its mask keeps, so that they may be in kept_muscle, shape (m,)
    """

    log_ns: int
    goal: Vector
    kept: BoolVector


def armings(statuses: Sequence[Status]) -> Iterator[list[Status]]:
    """Yield the statuses of each armed time, from the arming to the end."""
    part: list[Status] = []
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
    try:
        return robot_topic(bag, type_name, prefix)
    except UnknownTopic as error:
        why = (
            "; only swings by Method 1 or the hybrid have them" if type_name == STATUS_TYPE else ""
        )
        raise UnusableForReplay(f"nothing to replay: {error}{why}") from error


def _order(what: str, names: Sequence[str], wanted: Sequence[str]) -> list[int]:
    missing = [name for name in wanted if name not in names]
    if missing:
        raise UnusableForReplay(
            f"{what} of the model are not in the bag: {', '.join(missing)}; it has: "
            f"{', '.join(names)}. Choose the robot with --robot"
        )
    return [list(names).index(name) for name in wanted]


def joint_states(
    bag: Bag, model: MuscleModel, prefix: str
) -> dict[int, tuple[list[float], list[float]]]:
    """Return position [rad] and velocity [rad/s] in the model's order, by stamp [ns]."""
    topic = _topic(bag, JOINT_TYPE, prefix)
    found: dict[int, tuple[list[float], list[float]]] = {}
    for part in bag.stream(topic, "header", ["name", "position", "velocity"]):
        names = part.names()
        order = _order("joints", names, model.joint_names)
        for field in ("position", "velocity"):
            _check_width(topic, field, part[field], len(names))
        position, velocity = part["position"][:, order], part["velocity"][:, order]
        rows = zip(part.time_ns.tolist(), position.tolist(), velocity.tolist(), strict=True)
        found |= {stamp: (at, rate) for stamp, at, rate in rows}
    return found


def _check_width(topic: str, field: str, column: Column, count: int) -> None:
    if column.ndim != 2 or column.shape[1] != count:
        raise UnusableForReplay(f"{field} of {topic} has not one value for each name")


def statuses(bag: Bag, model: MuscleModel, prefix: str) -> Iterator[Status]:
    """Read what the inhibitor told of its decisions, its muscles in the order of the model."""
    fields = ["armed", "reason", "threshold", "name", "speed_index", "inhibited"]
    fields += ["direction_from_goal", "decisions", "rejected"]
    topic = _topic(bag, STATUS_TYPE, prefix)
    known = [field for field in fields if field in bag.fields(topic)]
    for part in bag.stream(topic, "header", known):
        names = part.names()
        order = _order("muscles", names, model.muscle_names)
        _check_width(topic, "speed_index", part["speed_index"], len(names))
        rejected = part["rejected"] if "rejected" in part else np.zeros(part.count, dtype=int)
        for row in range(part.count):
            chosen = set(part["inhibited"][row])
            decision = Told(
                tuple(name in chosen for name in model.muscle_names),
                tuple(part["speed_index"][row][order].tolist()),
                bool(part["direction_from_goal"][row]),
                _known_reason(topic, int(part["reason"][row])),
            )
            yield Status(
                stamp_ns=int(part.time_ns[row]),
                log_ns=int(part.log_time_ns[row]),
                armed=bool(part["armed"][row]),
                threshold=float(part["threshold"][row]),
                decision=decision,
                decisions=int(part["decisions"][row]),
                rejected=int(rejected[row]),
            )


def _known_reason(topic: str, value: int) -> Reason:
    try:
        return Reason(value)
    except ValueError:
        raise UnusableForReplay(f"{topic} has the reason {value}, which is not known") from None


def plans(bag: Bag, model: MuscleModel, prefix: str) -> Iterator[Plan]:
    """Yield what each plan says."""
    for topic in robot_topics(bag, PLAN_TYPE, prefix):
        for log_ns, plan in bag.messages(topic):
            yield _plan(topic, log_ns, plan, model)


def _plan(topic: str, log_ns: int, message: Any, model: MuscleModel) -> Plan:
    fields = PlanFields(message)
    order = _order("joints", fields.joint_names, model.joint_names)
    try:
        goal, mask = fields.vector("end_position"), fields.flags("mask")
    except WrongLength as error:
        raise UnusableForReplay(f"a plan of {topic} does not fit: {error}") from error
    kept = set(compress(fields.muscle_names, mask))
    return Plan(
        log_ns, frozen(goal[order]), np.array([name in kept for name in model.muscle_names])
    )


def plan_at(plans: Sequence[Plan], time_ns: int) -> Plan | None:
    """Return the last plan before a time."""
    before = [plan for plan in plans if plan.log_ns <= time_ns]
    return before[-1] if before else None
