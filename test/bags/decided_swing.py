"""The bag of a swing of a made-up arm on which the inhibitor's rule has decided."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import compress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from fastswing_inhibitor.inhibition import (
    Arming,
    Decision,
    Inhibition,
    InhibitionSettings,
    JointNumbers,
    Reason,
)
from fastswing_inhibitor.replay.replay import replay
from fastswing_inhibitor.replay.result import Replay
from fastswing_msgs.msg import CurrentOverride, InhibitionStatus, SwingPlan
from fastswing_planner.arrays import Vector, frozen
from fastswing_planner.bags import open_bag
from fastswing_planner.bags.metadata import BagTopic
from fastswing_planner.bags.writer import BagWriter
from fastswing_planner.conversion.definitions import definition_text
from fastswing_planner.robot.limits import muscle_limits
from fastswing_planner.testing.arms import BentArm

LIMIT = frozen([0.3, 0.25, 0.2])
LIMITS = muscle_limits(("m0", "m1", "m2"), LIMIT, 1.0, 0.0, 100.0)
START_NS = 1_700_000_000_000_000_000
PERIOD_NS = 5_000_000
TYPES = {
    "/joint_states": "sensor_msgs/msg/JointState",
    "/inhibition_status": "fastswing_msgs/msg/InhibitionStatus",
    "/current_override": "fastswing_msgs/msg/CurrentOverride",
    "/swing_plan": "fastswing_msgs/msg/SwingPlan",
}


def moment_arms(joint_position: Vector) -> ArrayLike:
    """Return G(theta) [m/rad] of two joints and three muscles; it changes with the posture."""
    a, b = joint_position
    return [[np.cos(a), 0.1], [-0.5, np.sin(b)], [0.3 * b, -np.cos(a + b)]]


# Replay needs the Jacobian alone.
ARM = BentArm(lambda _: np.zeros(3), moment_arms, joint_count=2, joint_range=10.0)


def stamp(time_ns: int) -> Header:
    header = Header()
    header.stamp.sec, header.stamp.nanosec = divmod(time_ns, 1_000_000_000)
    return header


@dataclass
class Case:
    """A swing: what is in the bag, and what is done to it before it is written."""

    positions: Sequence[Sequence[float]]
    velocities: Sequence[Sequence[float]]
    goal: Sequence[float] = (2.0, 1.0)
    threshold: float = 0.0
    protected: Sequence[bool] = (False, False, False)
    mask: Sequence[int] = (1, 1, 1)
    prefix: str = ""


Change = Callable[[int, str, Any], Any]
"""Takes the number of a decision, a topic and a message; returns the message, None: left out."""


def write(path: Path, case: Case, change: Change = lambda number, topic, message: message) -> Path:
    """Write the bag of a swing on which the rule has decided."""
    bag = BagWriter(path)
    for name, kind in TYPES.items():
        bag.add_topic(BagTopic(case.prefix + name, kind, definition_text(kind)))
    for number, topic, time_ns, message in messages(case):
        changed = change(number, topic, message)
        if changed is not None:
            data = bytes(serialize_message(changed))
            bag.write(case.prefix + topic, data, time_ns, time_ns)
    bag.close()
    return path


def messages(case: Case) -> Iterator[tuple[int, str, int, Any]]:
    """Yield number of the decision, topic, log time [ns] and message, in the order of recording."""
    yield 0, "/swing_plan", START_NS - 1000, plan(case)
    inhibition = Inhibition(ARM, LIMIT, InhibitionSettings())
    inhibition.see(0.0)
    protected = np.array(case.protected)
    inhibition.arm(Arming(frozen(case.goal), case.threshold, protected, 100.0, 0.0))
    nothing = Decision((False,) * 3, (math.nan,) * 3, False, Reason.NONE)
    yield 0, "/inhibition_status", START_NS, status(START_NS, inhibition, nothing)
    states = zip(case.positions, case.velocities, strict=True)
    for number, (position, velocity) in enumerate(states, 1):
        time_ns = START_NS + number * PERIOD_NS
        yield number, "/joint_states", time_ns, joint_state(time_ns, position, velocity)
        made = inhibition.decide(JointNumbers((time_ns - START_NS) * 1e-9, position, velocity))
        told = status(time_ns, inhibition, made)
        override = CurrentOverride(header=stamp(time_ns), name=told.inhibited)
        yield number, "/inhibition_status", time_ns + 1000, told
        yield number, "/current_override", time_ns + 1000, override
        if not inhibition.armed:
            break


def plan(case: Case) -> SwingPlan:
    return SwingPlan(
        joint_name=ARM.joint_names,
        end_position=list(case.goal),
        muscle_name=ARM.muscle_names,
        mask=case.mask,
    )


def joint_state(time_ns: int, position: Sequence[float], velocity: Sequence[float]) -> JointState:
    """Return a joint state in the bag's own order."""
    return JointState(
        header=stamp(time_ns),
        name=["j1", "other", "j0"],
        position=[position[1], 0.0, position[0]],
        velocity=[velocity[1], 0.0, velocity[0]],
    )


def status(time_ns: int, inhibition: Inhibition, made: Decision) -> InhibitionStatus:
    return InhibitionStatus(
        header=stamp(time_ns),
        armed=inhibition.armed,
        reason=int(made.reason),
        threshold=inhibition.threshold,
        name=ARM.muscle_names,
        speed_index=list(inhibition.speed_index(made)),
        inhibited=list(compress(ARM.muscle_names, made.inhibited)),
        direction_from_goal=made.direction_from_goal,
        decisions=inhibition.decisions,
    )


def straight(count: int = 20) -> Case:
    """Return a swing along the way to the goal, slow at first."""
    way = np.linspace(0.0, 0.8, count)[:, None] * np.array([2.0, 1.0])
    speed = np.linspace(0.0, 4.0, count)[:, None] * np.array([2.0, 1.0])
    return Case(way.tolist(), speed.tolist())


def replayed(path: Path, **options: Any) -> Replay:
    return replay(open_bag(path), ARM, LIMIT, **options)
