"""Reads a recorded plan, of today or as older versions wrote it."""

from typing import Any

import numpy as np

from fastswing_planner.analysis.recording import RecordedPlan, plausible
from fastswing_planner.arrays import Matrix
from fastswing_planner.cdr.plan_fields import PlanFields
from fastswing_planner.errors import WrongLength

_METHODS = {0: "basic", 1: "inhibit", 2: "elongate", 3: "hybrid"}


def recorded_plan(received: float, message: Any) -> RecordedPlan:
    """Return a `fastswing_msgs/SwingPlan` as arrays; raises AttributeError or ValueError.

    received  [s]

    Plans recorded before a field existed lack it or have it empty: zero.
    """
    fields = PlanFields(message)
    plan = RecordedPlan(
        received=received,
        method=_METHODS.get(message.method, f"method {message.method}"),
        joint_names=fields.joint_names,
        start=plausible(fields.vector("start_position")),
        end=plausible(fields.vector("end_position")),
        muscle_names=fields.muscle_names,
        kept=fields.flags("mask"),
        inhibited=fields.flags("inhibited"),
        elongation=plausible(fields.vector("elongation")),
        speed_index=plausible(fields.vector("speed_index")),
        time_cost=float(plausible(message.time_cost)),
        time=plausible(fields.time),
        joint_velocity=_table(fields, "joint_velocity", len(fields.joint_names)),
        muscle_velocity=_table(fields, "muscle_velocity", len(fields.muscle_names)),
    )
    if not plan.joint_names:
        raise ValueError("it names no joint")
    if np.array_equal(plan.start, plan.end):
        raise ValueError("it ends where it starts")
    return plan


def _table(fields: PlanFields, name: str, width: int) -> Matrix:
    """Return a table (steps, width); unknown if there are fewer or more numbers."""
    try:
        return plausible(fields.table(name))
    except WrongLength:
        return np.full((fields.time.size, width), np.nan)
