"""Reads a recorded plan, of today or as older versions wrote it."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from fastswing_planner.analysis.recording import RecordedPlan, plausible
from fastswing_planner.arrays import Matrix

_METHODS = {0: "basic", 1: "inhibit", 2: "elongate", 3: "hybrid"}


def recorded_plan(received: float, message: Any) -> RecordedPlan:
    """Return a `fastswing_msgs/SwingPlan` as arrays; raises AttributeError or ValueError.

    received  [s]

    Plans recorded before a field existed lack it or have it empty: zero.
    """
    joints, muscles = tuple(message.joint_name), tuple(message.muscle_name)
    time, joint_velocity, muscle_velocity = _predicted(
        message.trajectory, len(joints), len(muscles)
    )
    kept = np.array(message.mask, dtype=bool)
    plan = RecordedPlan(
        received=received,
        method=_METHODS.get(message.method, f"method {message.method}"),
        joint_names=joints,
        start=plausible(message.start_position),
        end=plausible(message.end_position),
        muscle_names=muscles,
        kept=kept,
        inhibited=np.array(_or_zeros(message, "inhibited", muscles), dtype=bool),
        elongation=plausible(message.elongation),
        speed_index=plausible(_or_zeros(message, "speed_index", muscles)),
        time_cost=float(plausible(message.time_cost)),
        time=plausible(time),
        joint_velocity=_table(joint_velocity, len(time), len(joints)),
        muscle_velocity=_table(muscle_velocity, len(time), len(muscles)),
    )
    for what, values, names in (
        ("start_position", plan.start, joints),
        ("end_position", plan.end, joints),
        ("mask", plan.kept, muscles),
        ("inhibited", plan.inhibited, muscles),
        ("elongation", plan.elongation, muscles),
        ("speed_index", plan.speed_index, muscles),
    ):
        if values.shape != (len(names),):
            raise ValueError(f"{what} has {values.size} values for {len(names)} names")
    if not joints:
        raise ValueError("it names no joint")
    if np.array_equal(plan.start, plan.end):
        raise ValueError("it ends where it starts")
    return plan


def _or_zeros(message: Any, name: str, muscles: Sequence[str]) -> Sequence[float]:
    values: Sequence[float] = getattr(message, name, ())
    return values if len(values) else [0.0] * len(muscles)


def _predicted(
    trajectory: Any, joints: int, muscles: int
) -> tuple[Sequence[float], Sequence[float], Sequence[float]]:
    """Return time [s] and the speeds of joints and muscles, row by row.

    Plans recorded before SwingTrajectory have a message for each step.
    """
    if hasattr(trajectory, "time_from_start"):
        return trajectory.time_from_start, trajectory.joint_velocity, trajectory.muscle_velocity
    return (
        [point.time_from_start for point in trajectory],
        _in_a_row([point.joint_velocity for point in trajectory], joints),
        _in_a_row([point.muscle_velocity for point in trajectory], muscles),
    )


def _in_a_row(rows: Sequence[Sequence[float]], width: int) -> list[float]:
    """Return rows one behind the other; those of another length are unknown."""
    unknown = [np.nan] * width
    return [value for row in rows for value in (row if len(row) == width else unknown)]


def _table(numbers: Sequence[float], steps: int, width: int) -> Matrix:
    """Return a table (steps, width); unknown if there are fewer or more numbers."""
    if len(numbers) != steps * width:
        return np.full((steps, width), np.nan)
    return plausible(np.reshape(numbers, (steps, width)))
